"""Twins of the benchmarks against computations by SciPy, and fits of what these computed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from synthetic_files import (
    CIRCUIT_RATE_HZ,
    DIODE_KNEE_V,
    DIODE_LOSS,
    DIODE_ONSET_V,
    TANKS,
    circuit_voltages,
    write_circuit,
    write_tanks,
)

from pipelines.field_benchmarks.bouc_wen_equations import N_STEPS, displacement_m, multisine
from pipelines.field_benchmarks.cascaded_tanks import CASCADED_TANKS
from pipelines.field_benchmarks.definition import NamedModel, Record
from pipelines.field_benchmarks.fitting import FittedModel, fitted_model
from pipelines.field_benchmarks.run import scored
from pipelines.field_benchmarks.scoring import free_run
from pipelines.field_benchmarks.twins import wiener_hammerstein as circuit
from pipelines.field_benchmarks.wiener_hammerstein import WIENER_HAMMERSTEIN
from sloshlab.missing_physics.extension import NOTHING

# poles of the designs, from scipy.signal.cheby1(3, 0.5, 4400) and cheby2(3, 40, 5000), in Hz, rounded
DESIGNED = {
    "pole_1": 2756.4085,
    "frequency_1": 4702.9552,
    "damping_1": 0.2930507,
    "pole_2": 1761.4976,
    "frequency_2": 1684.8252,
    "damping_2": 0.4782366,
    "zero_2": 5773.5027,
}


def numbers(fitted: FittedModel) -> dict[str, float]:
    return {number.name: number.value for number in fitted.numbers}


@pytest.mark.slow
def test_the_circuit_with_its_diode_agrees_with_scipys_filters() -> None:
    voltage, output = circuit_voltages(4096, 200)
    record = Record("test", {"voltage_input": voltage, "voltage_output": output}, CIRCUIT_RATE_HZ)
    values = DESIGNED | {"gain": 1.0, "onset": DIODE_ONSET_V, "loss": DIODE_LOSS, "knee": DIODE_KNEE_V}
    simulated = free_run(NamedModel("circuit", circuit.WITH_DIODE), record, values, NOTHING)["voltage_output"]
    # Away from where the noise begins and ends, which no band-limited interpolation can follow. lsim takes the
    # input for linear between samples an eighth as far apart: (π/8 · 10/25.6)²/12 = 0.2 % at 10 kHz.
    inner = slice(600, 3500)
    assert np.abs(simulated - output)[inner].max() < 2e-3 * output.std()
    linear = {name: value for name, value in values.items() if name not in ("onset", "loss", "knee")}
    without = free_run(NamedModel("filters", circuit.TWIN), record, linear, NOTHING)["voltage_output"]
    assert (without - output).std() > 0.1 * output.std()


@pytest.mark.slow
def test_numbers_of_tanks_are_recovered(tmp_path: Path) -> None:
    """Published equations by SciPy's integrator, without overflow; noise of 1 mV."""
    write_tanks(tmp_path, overflows=False, noise_v=1e-3)
    data = CASCADED_TANKS.read(tmp_path)
    model = CASCADED_TANKS.models(data)[1]
    assert model.name == "square-root outlets"
    fitted = fitted_model(model, data.training)
    result = scored(CASCADED_TANKS, data, fitted)
    assert result.errors["validation"] < 2e-3
    found = numbers(fitted)
    # Of the upper tank nothing is read: its level has no scale, s h₁ with k₄ s, k₁ √s and k₂/√s is the same.
    scale = (found["upper_outlet"] / TANKS["upper_outlet"]) ** 2
    assert found["pump"] / scale == pytest.approx(TANKS["pump"], rel=0.01)
    assert found["upper_to_lower"] * scale**0.5 == pytest.approx(TANKS["upper_to_lower"], rel=0.01)
    assert found["lower_outlet"] == pytest.approx(TANKS["lower_outlet"], rel=0.01)


def test_the_hysteretic_oscillator_agrees_with_another_integrator() -> None:
    force = multisine(750.0, 256, 1, band_hz=(5.0, 150.0), rms_n=50.0, seed=3)
    instants = np.arange(force.half_steps_n.size) / (2 * N_STEPS * 750.0)

    def rates(time: float, state: np.ndarray) -> list[float]:
        y, v, z = state
        u = np.interp(time, instants, force.half_steps_n)
        return [v, (u - 10 * v - 5e4 * y - z) / 2, 5e4 * v - 1e3 * (0.8 * abs(v) * z - 1.1 * v * abs(z))]

    times = np.arange(256) / 750.0
    other = solve_ivp(rates, (0, times[-1]), [0, 0, 0], t_eval=times, rtol=1e-9, atol=1e-12, max_step=1 / 15_000)
    own = displacement_m(force)
    assert np.abs(own).max() > 5e-4
    # |ẏ| has kinks, where a fixed step is of the second order: a hundredth of the documented noise of 8 µm.
    np.testing.assert_allclose(own, other.y[0], rtol=0, atol=8e-8)


@pytest.mark.slow
def test_numbers_of_the_circuit_are_recovered(tmp_path: Path) -> None:
    """Of 0.1 mV of noise nothing is left on the test beside the noise."""
    write_circuit(tmp_path, noise_v=1e-4)
    data = WIENER_HAMMERSTEIN.read(tmp_path)
    linear, with_diode = (fitted_model(model, data.training) for model in WIENER_HAMMERSTEIN.models(data))
    errors = [scored(WIENER_HAMMERSTEIN, data, fitted).errors["test"] for fitted in (linear, with_diode)]
    assert errors[0] > 20.0
    assert errors[1] == pytest.approx(0.1, rel=0.05)
    found = numbers(with_diode)
    expected = DESIGNED | {"onset": DIODE_ONSET_V, "loss": DIODE_LOSS, "knee": DIODE_KNEE_V, "gain": 1.0}
    assert found == pytest.approx(expected, rel=0.005)
