"""ü/F, its largest values and the energy identity of windows whose structure is a known oscillator."""

import math

import numpy as np
import pytest
import xarray as xr

from sloshlab.sweep.crossing_level import crossing_level
from sloshlab.sweep.energy_identity import harmonic_mass_kg, harmonic_work_share
from sloshlab.sweep.frequency_response import force_amplitude_n, frequency_response_of, vertex
from sloshlab.sweep.passivity import gives_energy

MASS_KG, DAMPING_KG_PER_S, STIFFNESS_N_PER_M, FORCE_N = 20.0, 60.0, 80_000.0, 5.0
NATURAL_HZ = math.sqrt(STIFFNESS_N_PER_M / MASS_KG) / (2 * math.pi)


def oscillator_windows() -> xr.Dataset:
    """M ü + c u̇ + k u = F with a force of constant amplitude, u₀ = F/|k − MΩ² + jcΩ|."""
    frequency = np.linspace(8.0, 12.0, 161)
    omega = 2 * np.pi * frequency
    amplitude = FORCE_N / np.abs(STIFFNESS_N_PER_M - MASS_KG * omega**2 + 1j * DAMPING_KG_PER_S * omega)
    columns = {
        "time_s": frequency[::-1],  # downwards
        "frequency_hz": frequency,
        "amplitude_m": amplitude,
        "acceleration_g": omega**2 * amplitude / 9.81,
        "apparent_mass_kg": MASS_KG - STIFFNESS_N_PER_M / omega**2,
        "gamma_kg_per_s": np.full(frequency.size, DAMPING_KG_PER_S),
        "work_j": np.pi * DAMPING_KG_PER_S * omega * amplitude**2,
    }
    return xr.Dataset({name: ("window", values) for name, values in columns.items()})


def test_largest_acceleration_and_accelerance_lie_at_omega0_over_sqrt_1_minus_2_zeta2():
    response = frequency_response_of(oscillator_windows())
    zeta = DAMPING_KG_PER_S / (2 * math.sqrt(MASS_KG * STIFFNESS_N_PER_M))
    # the parabola over windows 0.025 Hz apart, half the width of the resonance being 0.24 Hz
    assert response.strongest_hz == pytest.approx(NATURAL_HZ / math.sqrt(1 - 2 * zeta**2), abs=5e-4)
    assert response.peak_hz == pytest.approx(response.strongest_hz, abs=1e-9)
    assert response.strongest_g * 9.81 == pytest.approx(FORCE_N * response.peak_per_kg, rel=1e-9)
    # πcΩu₀² = (πc F²/Ω)/|Z|², largest a little below ω₀
    assert response.work_peak_hz == pytest.approx(NATURAL_HZ, rel=1e-3)
    assert (np.diff(response.frequency_hz) < 0).all()  # in order of time


def test_force_of_every_window_is_the_one_applied():
    assert force_amplitude_n(oscillator_windows()) == pytest.approx(FORCE_N, rel=1e-12)


def test_nothing_is_read_from_windows_without_motion():
    windows = oscillator_windows()
    assert frequency_response_of(windows.assign(gamma_kg_per_s=windows["gamma_kg_per_s"] * np.nan)) is None
    assert frequency_response_of(windows.isel(window=[])) is None


@pytest.mark.parametrize("place", [1.9, 2.0, 2.3, 2.6])
def test_vertex_of_a_parabola_through_uneven_points_is_exact(place):
    """5 − 3 (x − p)² has its vertex (p, 5), wherever three points about it lie."""
    x = np.array([0.5, 1.0, 2.2, 3.7, 4.0])
    assert vertex(x, 5 - 3 * (x - place) ** 2) == pytest.approx((place, 5.0), rel=1e-12)


def test_response_leads_or_lags_as_e_plus_j_omega_t_says():
    """ü/F = 1/(m − jγ/Ω): with damping the acceleration leads the force by arctan(γ/(Ωm))."""
    windows = xr.Dataset(
        {
            "time_s": ("window", [0.0, 1.0, 2.0]),
            "frequency_hz": ("window", [9.0, 10.0, 11.0]),
            "acceleration_g": ("window", [1.0, 2.0, 1.0]),
            "apparent_mass_kg": ("window", [2.0, 2.0, 2.0]),
            "gamma_kg_per_s": ("window", [30.0, 30.0, 30.0]),
            "work_j": ("window", [1.0, 2.0, 1.0]),
        }
    )
    response = frequency_response_of(windows)
    expected = np.arctan2(30.0, 2 * np.pi * np.array([9.0, 10.0, 11.0]) * 2.0)
    np.testing.assert_allclose(np.angle(response.accelerance_per_kg), expected, rtol=1e-12)


def test_vertex_falls_back_to_the_largest_value_where_no_parabola_fits():
    assert vertex(np.array([1.0, 2.0, 1.5]), np.array([1.0, 3.0, 2.0])) == (2.0, 3.0)
    assert vertex(np.array([1.0, 2.0]), np.array([1.0, 3.0])) == (2.0, 3.0)


def test_harmonics_do_what_the_fundamental_does_not():
    """2 % of the work by harmonics; a liquid of 0.2 kg with W̄ = πη."""
    windows = oscillator_windows()
    speed2 = (2 * np.pi * windows.frequency_hz * windows.amplitude_m) ** 2
    windows["work_harmonic_j"] = 0.98 * windows.work_j
    assert harmonic_mass_kg(windows) == pytest.approx((0.02 * windows.work_j / speed2).values, rel=1e-12)
    windows["dissipated_mass_kg"] = windows.work_j / speed2
    windows["w_bar"] = windows.dissipated_mass_kg / 0.2
    assert harmonic_work_share(windows) == pytest.approx(0.02 * windows.w_bar.values, rel=1e-12)
    windows["amplitude_m"][3] = 0.0
    assert np.flatnonzero(np.isnan(harmonic_mass_kg(windows))).tolist() == [3]


@pytest.mark.parametrize(("sign", "gives"), [(1.0, False), (-1.0, True)])
def test_work_that_is_negative_throughout_is_told(sign, gives):
    work = sign * np.linspace(0.5, 1.0, 30)
    work[0] *= -1  # while a resonance is passed, energy comes back
    columns = {"dissipated_mass_kg": work, "dissipated_mass_kg_std": np.full(30, 0.05)}
    windows = xr.Dataset({name: ("window", values) for name, values in columns.items()})
    assert gives_energy(windows) is gives
    windows["dissipated_mass_kg_std"] = 10 * windows["dissipated_mass_kg_std"]  # within its errors
    assert not gives_energy(windows)


def test_a_threshold_is_crossed_between_levels_by_their_logarithm():
    assert crossing_level([0.5, 1.0, 4.0], [0.0, 0.1, 0.5], 0.3) == pytest.approx(2.0, rel=1e-12)
    assert crossing_level([2.0, 8.0], [0.0, 1.0], 0.5) == pytest.approx(4.0, rel=1e-12)
    assert math.isnan(crossing_level([0.5, 1.0], [0.4, 0.5], 0.3))
    assert math.isnan(crossing_level([], [], 0.3))
