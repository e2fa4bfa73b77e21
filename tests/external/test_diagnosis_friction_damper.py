"""A public friction damper on an actuator: friction with memory behind a play, by the vocabulary alone.

Its authors write of "hysteretic and backlash effects" and of about 0.16 in of travel at low force. The tension of
36 lb was looked at when the form was fixed, and chose nothing; that of 30 lb is the one it was developed with.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

pytestmark = [pytest.mark.external, pytest.mark.slow]
UNEXPLAINED = pytest.mark.xfail(
    reason="how exact a law is on real recordings is not modelled yet: what is left beyond the noise has no name"
)

PLAY_M = 0.16 * 0.0254


@UNEXPLAINED
@pytest.mark.parametrize(
    ("tension", "amplitudes"), [("30lb", ("0.5", "1", "1.5")), ("36lb", ("1", "1.5"))], ids=["30 lb", "36 lb"]
)
def test_friction_with_memory_and_play_is_named(
    external_data: Path,
    load_example: Callable[[str], ModuleType],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    tension: str,
    amplitudes: tuple[str, ...],
) -> None:
    example = load_example("friction_damper")
    if not (external_data / "friction_backlash" / example.NAME.format("1")).is_file():
        pytest.skip("no friction damper among the recordings of other laboratories")
    monkeypatch.setattr(example, "NAME", example.NAME.replace("30lb", tension))
    monkeypatch.setattr(example, "AMPLITUDES", amplitudes)
    found = example.diagnosed(example.write_case(external_data, tmp_path / "case"), report=False)
    assert found["verdict"] == "named"
    [friction] = [effect for effect in found["effects"] if effect["name"] == "friction_behind_play"]
    assert friction["block"] == "structure"
    play = friction["parameters"]["play_m"]
    assert play["low"] < PLAY_M < play["high"]
    assert play["high"] - play["low"] < 0.5 * PLAY_M
    assert found["fit"]["heldout_after"] < 0.6 * found["fit"]["heldout_retuned"]
