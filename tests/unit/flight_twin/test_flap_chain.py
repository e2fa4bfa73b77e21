"""The flap behind its linkage, against closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sloshlab.flight_twin.described_wing import FlapTable, read_flight_wing
from sloshlab.flight_twin.flap_chain import flap_angles
from sloshlab.flight_twin.numbers import NOTHING

FLAP = read_flight_wing(Path(__file__).parents[3] / "docs/examples/flight_wing.toml").flap
STEP_S = 1 / 1024


def flown(flap: FlapTable, play_rad: float, command_rad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    numbers = {**NOTHING, "actuator frequency": 1.0, "play_rad": play_rad}
    return flap_angles(flap, numbers, command_rad, STEP_S)


@pytest.mark.parametrize("lag_s", [0.0, 0.008])
def test_a_ramp_is_followed_half_the_play_and_a_lag_behind(lag_s: float) -> None:
    """τβ̇ = δ − p/2 − β of a ramp δ = rt: β = δ − p/2 − rτ in the end."""
    time, soft = np.arange(4096) * STEP_S, FLAP.model_copy(update={"linkage_time_s": lag_s})
    angle, behind = flown(soft, 0.04, 0.1 * time)
    assert (angle - behind)[-1] == pytest.approx(0.02 + 0.1 * lag_s, rel=1e-9)


@pytest.mark.parametrize("play_rad", [0.037, 0.0411, 0.0523])
def test_a_play_that_ends_within_a_step_is_taken_up_there(play_rad: float) -> None:
    """Against steps sixty-four times as short; taken up at the end of the step it is off by hundreds of ppm."""
    command = np.minimum(0.4 * np.arange(2049) / 1024, 0.3)
    numbers = {**NOTHING, "actuator frequency": 1.0, "play_rad": play_rad}
    finer = np.interp(np.arange(2048 * 64 + 1) / 64, np.arange(2049), command)
    _, expected = flap_angles(FLAP, numbers, finer, STEP_S / 64)
    np.testing.assert_allclose(flown(FLAP, play_rad, command)[1], expected[::64], atol=2e-6)


def test_it_rests_in_its_play() -> None:
    """A motion within the play moves nothing, and what has moved stays where the actuator turns."""
    time = np.arange(2048) * STEP_S
    _, behind = flown(FLAP, 0.05, 0.02 * np.sin(2 * np.pi * time))
    assert not behind.any()
    rigid = FLAP.model_copy(update={"linkage_time_s": 0.0})
    angle, behind = flown(rigid, 0.05, 0.1 * np.sin(2 * np.pi * np.minimum(time, 0.25)))
    assert behind[-1] == pytest.approx(angle.max() - 0.025, abs=1e-6)
