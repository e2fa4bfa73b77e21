"""The numerical tank against potential flow and hydrostatics; formulas written here in the books' symbols."""

import itertools
import math

import numpy as np
import pytest

from acquisition.numerical_tank.simulation import NumericalTank
from acquisition.numerical_tank.tank import Box, Liquid, Numerics, filled_tank
from studies.numerical_tank_verification.verification_cases import hydrostatic_rest, modal_history

g = 9.81


def frequency_and_decay(
    n_layers: int, mode: int, numerics: Numerics | None = None, nu: float = 1e-6
) -> tuple[float, ...]:
    """Zero crossings and peaks of the modal velocity, without any fit."""
    liquid = Liquid(speed_of_sound_m_per_s=10.0, viscosity_m2_per_s=nu)
    tank = NumericalTank(filled_tank(Box(0.1, 0.1), 0.5, 2 * n_layers, liquid=liquid, numerics=numerics))
    k, h = mode * math.pi / 0.1, 0.05
    omega = math.sqrt(g * k * math.tanh(k * h))
    times = np.arange(0, 5.2 * 2 * math.pi / omega, 2 * math.pi / omega / 60)
    v = modal_history(tank, mode, 0.02 * omega / k, 0.0, times)
    falls = np.flatnonzero((v[:-1] > 0) & (v[1:] <= 0))
    crossings = times[falls] + (times[1] - times[0]) * v[falls] / (v[falls] - v[falls + 1])
    peaks = np.array([np.abs(v[a:b]).max() for a, b in itertools.pairwise(falls)])
    period = np.diff(crossings).mean()
    decay = -np.polyfit(np.arange(peaks.size) * period, np.log(peaks), 1)[0]
    return 2 * math.pi / period, omega, decay, 2 * tank.setup.effective_viscosity_m2_per_s * k**2


@pytest.mark.parametrize(("n_layers", "mode"), [(12, 1), (12, 2), (16, 1)])
def test_standing_wave_has_the_frequency_of_potential_flow(n_layers: int, mode: int) -> None:
    """ω² = g k tanh kh, within 2 %."""
    measured, omega, _, _ = frequency_and_decay(n_layers, mode)
    assert measured == pytest.approx(omega, rel=0.02)


@pytest.mark.parametrize("nu", [1e-4, 4e-4])
def test_standing_wave_decays_as_viscosity_says(nu: float) -> None:
    """Amplitude ∝ exp(−2νk²t) where walls slip; 15 %: amplitudes are read off peaks."""
    _, _, decay, expected = frequency_and_decay(16, 1, nu=nu)
    assert decay == pytest.approx(expected, rel=0.15)


def test_liquid_at_rest_stays_at_rest() -> None:
    missed = [finding for finding in hydrostatic_rest(8, 1.0) if not finding.met]
    assert missed == []
