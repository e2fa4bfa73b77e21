"""Integration of acceleration against closed forms and against fine quadrature."""

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import cumulative_simpson

from sloshlab.conditioning import integration
from sloshlab.conditioning.integration import (
    displacement,
    displacement_of_part,
    integrated,
    integration_error,
    is_away_from_ends,
    velocity,
)

RATE_HZ = 2000.0


def acceleration_of(values, rate_hz=RATE_HZ):
    time = np.arange(len(values)) / rate_hz
    attributes = {"quantity": "acceleration", "units": "m s-2"}
    return xr.DataArray(values, dims="time", coords={"time": time}, name="acceleration_roof_1", attrs=attributes)


def fitted(values, frequency_hz, rate_hz=RATE_HZ):
    """Complex amplitude A of Re(A e^{jωt}) by least squares."""
    phase = 2 * np.pi * frequency_hz * np.arange(len(values)) / rate_hz
    basis = np.stack([np.cos(phase), -np.sin(phase)], axis=1)
    real, imaginary = np.linalg.lstsq(basis, values, rcond=None)[0]
    return complex(real, imaginary)


def test_sine_with_offset_and_slow_drift():
    """ü = A cos ωt + b + slow drift: u̇ = (A/ω) sin ωt, nothing of the offset and the drift."""
    amplitude, omega = 20.0, 2 * np.pi * 8.0
    time = np.arange(0, 60, 1 / RATE_HZ)
    drift = 0.4 + 0.05 * np.sin(2 * np.pi * 0.005 * time)
    result = velocity(acceleration_of(amplitude * np.cos(omega * time) + drift)).values
    inside = slice(int(4 * RATE_HZ), -int(4 * RATE_HZ))
    expected = amplitude / omega * np.sin(omega * time)
    # high-pass at 0.5 Hz: (0.5/8)⁴ = 1.5e-5 in amplitude; drift: 0.05/(2π 0.005) (0.005/0.5)⁴ = 1.6e-8 m/s
    assert np.abs(result - expected)[inside].max() < 3e-5 * amplitude / omega
    # without drift removal the offset alone would have grown to 0.4 · 60 = 24 m/s
    assert np.abs(result - expected).max() < 0.15 * amplitude / omega


def test_displacement_of_a_sine():
    amplitude, omega = 0.0125, 2 * np.pi * 5.0
    time = np.arange(0, 40, 1 / RATE_HZ)
    speed = velocity(acceleration_of(-amplitude * omega**2 * np.sin(omega * time) + 0.3))
    result = displacement(speed)
    assert (speed.attrs["units"], speed.attrs["quantity"]) == ("m s-1", "velocity")
    assert (result.attrs["units"], result.attrs["quantity"]) == ("m", "displacement")
    inside = slice(int(5 * RATE_HZ), -int(5 * RATE_HZ))
    # twice (0.5/5)⁴ = 2e-4
    assert np.abs(result.values - amplitude * np.sin(omega * time))[inside].max() < 2.5e-4 * amplitude


def test_displacement_of_a_part_is_that_of_the_sine_up_to_its_ends():
    """Also where the padding ends at the ends of the record."""
    amplitude, omega = 0.0125, 2 * np.pi * 5.0
    time = np.arange(0, 20, 1 / RATE_HZ)
    acceleration = (-amplitude * omega**2 * np.sin(omega * time) + 0.3).astype(np.float32)
    for start, stop, tolerance in ((8.0, 10.5, 2e-3), (1.0, 2.0, 2e-2), (18.0, 19.0, 2e-2)):
        part = slice(round(start * RATE_HZ), round(stop * RATE_HZ))
        found = displacement_of_part(acceleration, RATE_HZ, part, corner_hz=1.0, padding_s=2.0)
        assert found.size == part.stop - part.start
        # high-pass at 1 Hz, twice: 2 (1/5)⁴ = 3.2e-3 of the amplitude are lost
        expected = amplitude * np.sin(omega * time[part]) * (1 - 3.2e-3)
        assert np.abs(found - expected).max() < tolerance * amplitude


def test_octave_sweep_against_fine_quadrature():
    """No closed form: Simpson's rule on a twenty times finer grid gives the velocity."""
    rate_octave_per_s, start_hz, duration_s, finer = 1 / 20, 5.0, 40.0, 20

    def phase(t):
        return 2 * np.pi * start_hz * 2 ** (rate_octave_per_s * t) / (rate_octave_per_s * np.log(2))

    fine_time = np.arange(int(duration_s * RATE_HZ) * finer) / (RATE_HZ * finer)
    fine = cumulative_simpson(10 * np.cos(phase(fine_time)), dx=1 / (RATE_HZ * finer), initial=0.0)[::finer]
    time = fine_time[::finer]
    result = velocity(acceleration_of(10 * np.cos(phase(time)))).values
    inside = slice(int(4 * RATE_HZ), -int(4 * RATE_HZ))
    constant = fine[inside].mean()  # of integration: the true velocity oscillates about it
    difference = (result - fine)[inside]
    assert np.abs(difference - difference.mean()).max() < 2e-4 * 10 / (2 * np.pi * 5)
    assert difference.mean() == pytest.approx(-constant, abs=2e-4)


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("frequency_hz", [1.0, 3.0, 7.3, 40.0, 250.0, 600.0])
def test_stated_error_is_the_measured_one(frequency_hz, order):
    time = np.arange(0, 40, 1 / RATE_HZ)
    omega = 2 * np.pi * frequency_hz
    speed = integrated(np.cos(omega * time + 0.4), 1 / RATE_HZ, order=order)
    inside = is_away_from_ends(np.ones(time.size, bool), 1 / RATE_HZ, corner_hz=0.08)
    start = int(np.flatnonzero(inside)[0])
    measured = fitted(speed[inside], frequency_hz) * np.exp(-1j * omega * start / RATE_HZ)
    exact = np.exp(0.4j) / (1j * omega)
    stated = integration_error(frequency_hz, RATE_HZ, 0.5, order)
    assert abs(measured / exact) - 1 == pytest.approx(stated.gain_error, abs=2e-7)
    assert np.angle(measured / exact) == pytest.approx(stated.phase_error_rad, abs=2e-7)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_stated_error_follows_the_butterworth_form_and_the_rule(order):
    """High-pass 1/(1 + (f_c/f)^{2p}); rule −(191/60480)(ωΔt)⁶: both by hand."""
    low = integration_error(2.0, 10_000.0, 0.5, order).gain_error
    assert low == pytest.approx(1 / (1 + 0.25 ** (2 * order)) - 1, rel=2e-3)
    high = integration_error(1000.0, 10_000.0, 0.5, 3).gain_error
    assert high == pytest.approx(-191 / 60480 * (2 * np.pi * 0.1) ** 6, rel=0.1)
    twice = integration_error(2.0, 10_000.0, 0.5, order, n_integrations=2).gain_error
    assert 1 + twice == pytest.approx((1 + low) ** 2, rel=1e-12)


def test_measured_order_of_convergence_is_six():
    """∫ sin³t dt = cos³t/3 − cos t + 2/3, ends included, before the trend is taken off: error ∝ Δt⁶."""
    errors = []
    for step in (0.1, 0.05, 0.025):
        time = np.arange(0, 30 + step / 2, step)
        result = np.empty(time.size)
        integration._cumulative(np.sin(time) ** 3, step, 1, result, np.zeros(time.size + 1))
        errors.append(np.abs(result - (np.cos(time) ** 3 / 3 - np.cos(time) + 2 / 3)).max())
    assert -np.diff(np.log2(errors)) == pytest.approx([6.0, 6.0], abs=0.35)


@pytest.mark.parametrize("degree", range(6))
def test_the_rule_is_exact_up_to_degree_five_ends_included(degree):
    x = np.arange(12.0)
    result = np.empty(12)
    integration._cumulative(x**degree, 1.0, 1, result, np.zeros(13))
    assert result == pytest.approx(x ** (degree + 1) / (degree + 1), rel=1e-11, abs=1e-9)


@pytest.mark.parametrize(("order", "degree"), [(1, 0), (2, 0), (2, 1), (3, 1), (3, 2)])
def test_polynomial_drift_leaves_nothing_behind(order, degree):
    """A drift of degree p − 1 in the velocity is removed whole, at the ends too."""
    time = np.arange(0, 30, 1 / RATE_HZ)
    drift_acceleration = np.zeros(time.size) if degree == 0 else degree * (time / 30) ** (degree - 1)
    wave = np.cos(2 * np.pi * 9 * time)
    with_drift = integrated(wave + drift_acceleration, 1 / RATE_HZ, order=order)
    without = integrated(wave, 1 / RATE_HZ, order=order)
    # 30 m/s of drift at the end; a chain of straight lines follows a parabola to (D Δt)²/8 · 2/30²
    assert np.abs(with_drift - without).max() < (1e-7 if degree < 2 else 1e-5)
