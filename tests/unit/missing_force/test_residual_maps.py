"""Residuals that were put at a known order, phase, level and cell are found there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import NOISE, RATE_HZ, rig, run_of

from sloshlab.identification.mismatch import mismatches, summary
from sloshlab.identification.observations import Observation, observations
from sloshlab.missing_force.residual_maps import ResidualMaps, profile, residual_maps

N = 2500
TIME = np.arange(N) / RATE_HZ
MAIN_HZ, AMPLITUDE = 7.0, 12.0
PHASE = 2 * np.pi * MAIN_HZ * TIME
TONE = AMPLITUDE * np.cos(PHASE)


Readings = dict[str, dict[str, np.ndarray]]


def observed(extra: np.ndarray, simulated: np.ndarray = TONE) -> tuple[list[list[Observation]], Readings]:
    """A harmonic run with something that the simulation lacks."""
    run = run_of("run", {"acceleration_tip": simulated + extra}, NOISE, 4, experiment="other")
    return [observations(run, ["acceleration_tip"])], {"run": {"acceleration_tip": simulated}}


def maps_of(extra: np.ndarray, folder: Path, simulated: np.ndarray = TONE) -> ResidualMaps:
    runs, readings = observed(extra, simulated)
    [found] = residual_maps(runs, readings, rig(folder))
    return found


@pytest.mark.parametrize("order", [0.5, 2.0, 3.0])
def test_a_tone_lies_at_its_order(tmp_path: Path, order: float) -> None:
    at = maps_of(0.5 * np.cos(order * PHASE), tmp_path).at_orders()
    assert max(at, key=lambda order: at[order]) == order
    assert at[order] > 20 * max(size for other, size in at.items() if other != order)


def test_what_is_followed_to_its_noise_has_no_excess(tmp_path: Path) -> None:
    found = maps_of(np.zeros(N), tmp_path)
    assert all(abs(size) < 0.5 for size in found.at_orders().values())


@pytest.mark.parametrize("where", [0.0, 0.5 * np.pi, -0.5 * np.pi])
def test_blows_lie_at_their_phase(tmp_path: Path, where: float) -> None:
    """a = a₀ cos φ: φ = 0 is the lowest point, where the velocity turns."""
    distance = np.angle(np.exp(1j * (PHASE - where)))
    phase = maps_of(np.where(np.abs(distance) < 0.15, 1.0, 0.0), tmp_path).phase
    assert phase is not None
    assert phase.middles[np.nanargmax(phase.excess)] == pytest.approx(where, abs=0.3)


def test_an_error_of_the_largest_levels_lies_there(tmp_path: Path) -> None:
    growing = TONE * (0.2 + 0.8 * TIME / TIME[-1])
    level = maps_of(np.where(TIME > 8.0, 0.5 * np.sin(2 * PHASE), 0.0), tmp_path, growing).level
    assert level is not None
    known = np.isfinite(level.excess)
    assert level.middles[known][np.argmax(level.excess[known])] > 0.75 * AMPLITUDE / 9.81
    assert level.edges[-1] == pytest.approx(AMPLITUDE / 9.81, rel=0.08)


def test_the_cell_is_that_of_frequency_and_amplitude(tmp_path: Path) -> None:
    """ω̄ = Ω √(h/g), ū = a/(Ω² h)."""
    found = maps_of(0.3 * np.cos(2 * PHASE), tmp_path)
    assert found.cells is not None
    assert found.omega_bar is not None
    assert found.u_bar is not None
    i, j = np.unravel_index(np.nanargmax(np.where(np.isfinite(found.cells), found.cells, -1)), found.cells.shape)
    omega = 2 * np.pi * MAIN_HZ
    middle = 0.5 * (found.omega_bar[i] + found.omega_bar[i + 1]), 0.5 * (found.u_bar[j] + found.u_bar[j + 1])
    assert middle[0] == pytest.approx(omega * np.sqrt(0.0272 / 9.81), rel=0.08)
    assert middle[1] == pytest.approx(AMPLITUDE / omega**2 / 0.0272, rel=0.25)


def test_means_per_class() -> None:
    found = profile(
        np.array([0.1, 0.2, 1.4, np.nan]), np.array([1.0, 3.0, 5.0, 7.0]), np.array([0.0, 1.0, 2.0, 3.0])
    )
    np.testing.assert_allclose(found.excess, [2.0, 5.0, np.nan])


def test_the_summary_names_time_frequency_and_level() -> None:
    """A tone of 20 Hz between 4 and 6 s; the level of a sine is its amplitude over g."""
    inside = (TIME > 4.0) & (TIME < 6.0)
    runs, readings = observed(np.where(inside, 0.8 * np.sin(2 * np.pi * 20.0 * TIME), 0.0))
    [found] = mismatches(runs, readings)
    assert np.median(found.acceleration_g[2:-2]) == pytest.approx(AMPLITUDE / 9.81, rel=0.03)
    place = summary([found])
    assert place["channels"] == ["acceleration_tip"]
    assert 3.4 <= place["time_s"][0] <= place["time_s"][1] <= 6.6
    assert 18.0 <= place["frequency_hz"][0] <= place["frequency_hz"][1] <= 22.0
