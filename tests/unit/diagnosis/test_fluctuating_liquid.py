"""Noise of a liquid whose damping fluctuates: recordings in which it does, made by scipy and a random walk."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import DAMPING, MASS_KG, OMEGA, RATE_HZ, STIFFNESS, rig, run_of
from scipy.integrate import solve_ivp

from sloshlab.diagnosis.inference.fluctuating_liquid import with_fluctuation
from sloshlab.identification.case import CaseRun
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.identification.observations import observations, with_scatter
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics.extension import NOTHING

LIQUID_N_S_PER_M, STRENGTH, DURATION_S = 2.0, 0.3, 16.0
PERIOD_S = 2 * np.pi / OMEGA
NOISE = {"acceleration_tip": 1e-3}


def recorded(name: str, size: float, seed: int) -> CaseRun:
    """A mass on a moving base with a damper that is another one in every cycle, about its mean."""
    time = np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ
    generator = np.random.default_rng(seed)
    # Ornstein–Uhlenbeck process of unit variance that forgets in one cycle.
    decay, state, walk = np.exp(-1 / (RATE_HZ * PERIOD_S)), 0.0, np.zeros(time.size)
    for i in range(time.size):
        state = decay * state + np.sqrt(1 - decay**2) * generator.normal()
        walk[i] = state

    def base(t: float) -> float:
        return float(size * np.sin(np.pi * t / DURATION_S) ** 2 * np.sin(1.02 * OMEGA * t))

    def rates(t: float, y: np.ndarray) -> list[float]:
        liquid = LIQUID_N_S_PER_M * (1 + STRENGTH * float(np.interp(t, time, walk)))
        return [y[1], -(STIFFNESS * y[0] + (DAMPING + liquid) * y[1]) / MASS_KG - base(t)]

    found = solve_ivp(rates, (0, time[-1]), [0.0, 0.0], t_eval=time, rtol=1e-9, atol=1e-12, max_step=0.004)
    root = np.array([base(t) for t in time])
    tip = np.array([rates(t, y)[1] for t, y in zip(time, found.y.T, strict=True)]) + root
    channels = {"acceleration_tip": tip, "acceleration_root": root}
    return run_of(name, channels, NOISE, seed, experiment="other")


@pytest.mark.slow
def test_a_run_alone_has_the_side_bands_that_repeats_scatter_by(tmp_path: Path) -> None:
    runs = [recorded("one_1", 1.0, 1), recorded("one_2", 1.0, 2), recorded("two", 2.0, 3)]
    model = RigModel(rig(tmp_path, LIQUID_N_S_PER_M), tmp_path, runs)
    fit = FreeRunFit((), dict(model.believed), 0.0, 0.0)
    observed = [observations(run, ["acceleration_tip"], model.driving(run)) for run in runs]
    left = []
    for run, [each] in zip(runs, observed, strict=True):
        readings = model.simulate(run, fit.values, NOTHING)["acceleration_tip"]
        left.append(each.residual(readings) * np.sqrt(each.variance))
    repeats = with_scatter(observed[:2], [{"acceleration_tip": residual} for residual in left[:2]])
    *same, [alone] = with_fluctuation(model, [*repeats, observed[2]], {"one_1", "one_2"}, fit)
    assert all(new is old for new, [old] in zip([each for [each] in same], repeats, strict=True))
    frequencies = alone.frequencies_hz
    at_hz = 1.02 * OMEGA / (2 * np.pi)
    side = np.abs(frequencies - at_hz)
    middle = slice(8, 24)
    # Nearer than that the window of the transform leaks what changes within a block.
    for low, high in ((2.5, 4.0), (4.0, 7.0)):
        chosen = (side > low) & (side < high)
        power = float(np.mean(left[2][middle][:, chosen] ** 2))
        # Of sensors alone the noise is a hundredth of it.
        assert power > 100 * float(np.mean(observed[2][0].variance[middle][:, chosen]))
        assert 0.5 < float(np.mean(alone.variance[middle][:, chosen])) / power < 2.0


def test_without_repeats_the_mean_of_a_run_is_as_uncertain_as_it_is_believed(tmp_path: Path) -> None:
    """5 % of the mean of 16 s of a cycle of 0.15 s is 37 % of one cycle."""
    run = recorded("two", 2.0, 3)
    model = RigModel(rig(tmp_path, LIQUID_N_S_PER_M), tmp_path, [run])
    fit = FreeRunFit((), dict(model.believed), 0.0, 0.0)
    observed = observations(run, ["acceleration_tip"], model.driving(run))
    [[alone]] = with_fluctuation(model, [observed], frozenset(), fit)
    [told] = observed
    side = np.abs(alone.frequencies_hz - 1.02 * OMEGA / (2 * np.pi))
    chosen = (side > 2.5) & (side < 7.0)
    readings = model.simulate(run, fit.values, NOTHING)["acceleration_tip"]
    left = told.residual(readings) * np.sqrt(told.variance)
    expected = 0.05**2 * DURATION_S / PERIOD_S / 2 / STRENGTH**2
    ratio = np.mean(alone.variance[8:24][:, chosen]) / np.mean(left[8:24][:, chosen] ** 2)
    assert 0.4 < ratio / expected < 2.5
