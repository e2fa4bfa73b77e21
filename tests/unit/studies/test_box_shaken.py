"""The box on the shaker: a run that was stopped gives what it would have given, and the map of its runs."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.two_phase_box import checkpoint
from studies.two_phase_verification import box_map, box_shaken
from studies.two_phase_verification.shaken import Shaking

CASE = Shaking(3.0, 11.4, 4, 6)


def test_a_run_that_was_stopped_goes_on_to_the_same_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = box_shaken.shaken_box(CASE)
    kept, saved, save = box_shaken.beside(tmp_path / "box.json", CASE), list[int](), checkpoint.save

    def stops(tank: Any, path: Path, extra: Any) -> None:
        save(tank, path, extra)
        saved.append(tank.n_steps)
        if len(saved) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(checkpoint, "save", stops)
    with pytest.raises(KeyboardInterrupt):
        box_shaken.shaken_box(CASE, kept)
    again = box_shaken.shaken_box(CASE, kept)
    assert len(saved) > 3
    assert not kept.exists()
    assert replace(again, computing_s_per_s=0.0) == replace(whole, computing_s_per_s=0.0)
    assert len(again.w_bar_of_cycles) == 2


def test_every_case_has_a_file_of_its_own() -> None:
    cases = [case for group in box_shaken.POINTS.values() for case in group]
    assert len({box_shaken.beside(Path("box.json"), case) for case in cases}) == len(cases) == 81


@pytest.mark.parametrize("filling_level", [0.25, 0.75])
def test_a_tank_has_the_liquid_of_its_fill(filling_level: float) -> None:
    half, other = (box_shaken.box_of(replace(CASE, filling_level=level)) for level in (0.5, filling_level))
    assert other.setup.liquid_mass_kg / half.setup.liquid_mass_kg == pytest.approx(2 * filling_level)
    assert other.liquid_fraction.sum() / half.liquid_fraction.sum() == pytest.approx(2 * filling_level, rel=1e-3)
    assert "α" not in CASE.differs
    assert replace(CASE, filling_level=filling_level).differs == f"α = {filling_level:g}"


def test_kept_results_account_for_all_energy_and_liquid() -> None:
    kept = json.loads(Path(box_shaken.__file__).with_name("box_shaken.json").read_text(encoding="utf-8"))
    assert len(kept) >= 6
    for name, found in kept.items():
        assert Shaking(**found["case"]).name == name
        assert abs(found["residual_share"]) < 1e-3
        assert abs(found["volume_change"]) < 1e-5
        # the same work by the force and by the account
        assert abs(found["account_w_bar"] - found["w_bar"]) < 0.05


def test_a_map_has_its_levels_over_the_stroke() -> None:
    """ū = a₀/(Ω² h); a level of two points is no row."""
    cases = [Shaking(2.0, frequency, 24, 12) for frequency in (11.0, 8.0, 18.0)]
    cases += [Shaking(1.0, frequency, 24, 12) for frequency in (8.0, 11.0)]
    results = {case.name: {"w_bar": case.frequency_hz} for case in cases}
    found = box_map.rows(results, [*cases, Shaking(3.0, 8.0, 24, 12)])
    assert list(found) == [2.0]
    strokes = [2.0 * 9.80665 / (2 * np.pi * frequency) ** 2 / 0.0272 for frequency in (18.0, 11.0, 8.0)]
    np.testing.assert_allclose(found[2.0], np.column_stack([strokes, [18.0, 11.0, 8.0]]), rtol=1e-3)
