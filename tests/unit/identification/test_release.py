"""When a free run was released: interpolation against closed forms, and an instant that the fit finds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import DAMPING, MASS_KG, OMEGA, RATE_HZ, rig, run_of

from sloshlab.identification.free_run_fit import fitted_baseline
from sloshlab.identification.free_run_problem import FreeRunProblem
from sloshlab.identification.observations import observations
from sloshlab.identification.release import INSTANT, late_by, samples_disturbed
from sloshlab.identification.rig_model import RigModel

START_M, DURATION_S = 0.02, 4.0
NOISE = {"acceleration_tip": 0.01, "displacement_tank": 5e-6}


@pytest.mark.parametrize("samples", [0.0, 1.0, 0.3, 2.7, 11.5, -0.4, -3.0])
@pytest.mark.parametrize(("rad_per_sample", "error"), [(0.2, 1e-8), (0.5, 1e-5), (1.4, 0.02)])
def test_a_harmonic_comes_later_by_parts_of_a_sample(samples: float, rad_per_sample: float, error: float) -> None:
    at = np.arange(300)
    late = late_by(np.cos(rad_per_sample * at), samples)
    np.testing.assert_allclose(late[20:-20], np.cos(rad_per_sample * (at - samples))[20:-20], atol=error)


@pytest.mark.parametrize("rad_per_sample", [0.1, 0.5, 1.4])
def test_a_recorder_that_averages_passes_less_of_fast_oscillations(rad_per_sample: float) -> None:
    """The gain of a mean over a sample, whose variance is 1/12, is a sinc; alike to the fourth power."""
    at = np.arange(400)
    passed = late_by(np.cos(rad_per_sample * at), 0.0, 1 / 12)
    inside = np.cos(rad_per_sample * at)[20:-20]
    gain = np.mean(passed[20:-20] * inside) / np.mean(inside**2)
    assert gain == pytest.approx(np.sinc(rad_per_sample / (2 * np.pi)), abs=0.015 * rad_per_sample**4 + 1e-6)


def test_what_is_not_known_is_held() -> None:
    np.testing.assert_array_equal(late_by(np.arange(12.0), 3.0)[:4], [0.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(late_by(np.arange(12.0), -3.0)[-4:], [11.0, 11.0, 11.0, 11.0])


def decay(at_s: np.ndarray) -> dict[str, np.ndarray]:
    """Released at time zero, held before: the free decay in closed form."""
    rate = DAMPING / (2 * MASS_KG)
    damped = np.sqrt(OMEGA**2 - rate**2)
    complex_rate = -rate + 1j * damped
    # x = Re(c e^{st}) with x(0) = START_M and no velocity.
    amplitude = START_M * (1 - 1j * rate / damped)
    x = np.real(amplitude * np.exp(complex_rate * at_s))
    a = np.real(amplitude * complex_rate**2 * np.exp(complex_rate * at_s))
    before = at_s < 0
    return {"displacement_tank": np.where(before, START_M, x), "acceleration_tip": np.where(before, 0.0, a)}


@pytest.mark.parametrize("lead_samples", [0.0, 0.6, 7.3])
def test_the_instant_of_a_release_is_found_to_a_hundredth_of_a_sample(lead_samples: float, tmp_path: Path) -> None:
    at_s = (np.arange(round(DURATION_S * RATE_HZ)) - lead_samples) / RATE_HZ
    run = run_of("decay", decay(at_s), NOISE, 3, configuration="frozen", initial_displacement_m=START_M)
    model = RigModel(rig(tmp_path), tmp_path, [run])
    observed = observations(run, model.compared(run))
    fit, _ = fitted_baseline(FreeRunProblem(model, [observed]))
    assert fit.values[f"{INSTANT}decay"] * RATE_HZ == pytest.approx(lead_samples, abs=0.02)
    assert fit.misfit / observed[0].spectra.size < 2.3


def test_samples_in_which_a_release_may_be_are_not_compared(tmp_path: Path) -> None:
    n = samples_disturbed(RATE_HZ)
    assert n >= 12
    run = run_of("decay", decay(np.arange(500) / RATE_HZ), NOISE, 3, initial_displacement_m=START_M)
    for observation in observations(run, ["acceleration_tip", "displacement_tank"]):
        assert not observation.known[:n].any()
        assert observation.known[n:].all()
