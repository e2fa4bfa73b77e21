"""The picture of what the program is for shows what a verdict says, where the simulation misses most."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr

from studies.purpose_figure import missed_most, purpose_figure

RATE_HZ = 100.0


def history(missed_at_s: float, held_out: int) -> xr.Dataset:
    """A decay of 6 s whose simulation is 1 mm off for half a second."""
    time = np.arange(600) / RATE_HZ
    recorded = 0.01 * np.exp(-0.3 * time) * np.cos(40 * time)
    retuned = recorded + 1e-3 * ((time >= missed_at_s) & (time < missed_at_s + 0.5))
    values = np.stack([recorded, retuned, recorded])
    return xr.Dataset(
        {"displacement_tank": (("model", "time"), values, {"units": "m"})},
        {"model": ["recorded", "retuned", "extended"], "time": time},
        {"held_out": held_out},
    )


@pytest.mark.parametrize("missed_at_s", [0.0, 2.3, 5.5])
def test_the_stretch_that_is_shown_holds_what_is_missed(missed_at_s: float) -> None:
    shown = missed_most(history(missed_at_s, 1))
    assert shown.stop - shown.start == 160
    assert shown.start <= round(missed_at_s * RATE_HZ)
    assert shown.stop >= round((missed_at_s + 0.5) * RATE_HZ)


def test_the_picture_has_the_unseen_run_the_errors_and_the_sentence() -> None:
    parts = {"fitted": history(0.0, 0), "unseen": history(4.0, 1)}
    verdict: Any = SimpleNamespace(
        histories=lambda: xr.DataTree.from_dict(parts),
        headline="Left out: a force. Error: 4 to 1.",
        fit={"heldout_before": 8.0, "heldout_retuned": 4.0, "heldout_after": 1.0},
    )
    before, after, errors, sentence = purpose_figure(verdict).axes
    recorded, simulated = (line.get_ydata() for line in before.lines)
    assert np.abs(np.asarray(simulated) - recorded).max() == pytest.approx(1.0)  # mm
    assert before.get_xlim()[0] > 2.0
    np.testing.assert_array_equal(*(line.get_ydata() for line in after.lines))
    assert [bar.get_height() for bar in errors.patches] == [8.0, 4.0, 1.0]
    assert sentence.texts[0].get_text() == "Left out: a force.\nError: 4 to 1."
