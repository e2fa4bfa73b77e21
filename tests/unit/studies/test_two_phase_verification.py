"""Theory that the tank of liquid and gas is compared with, and the table of what was computed."""

import json
from pathlib import Path

import pytest

import studies.two_phase_verification as room
from acquisition.two_phase_tank.setup import Fluids
from studies.two_phase_verification import cases, shaken
from studies.two_phase_verification.linear_theory import Layers

KEPT = Path(room.__file__).with_name("shaken.json")


def test_viscous_wave_of_deep_water_is_lamb_s_with_the_next_term() -> None:
    """Lamb art. 349, expanded: γ = 2νk² (1 − √(θ/2)), ω = ω₀ (1 − √2 θ^1.5) with θ = νk²/ω₀."""
    k, nu = 50.0, 1e-5
    fluids = Fluids(
        viscosity_m2_per_s=nu, gas_density_kg_per_m3=1e-4, gas_viscosity_m2_per_s=1e-9, surface_tension_n_per_m=0.0
    )
    omega, decay = Layers(fluids, k, 1.0, 1.0).free_wave()
    plain = (9.81 * k) ** 0.5
    theta = nu * k**2 / plain
    assert decay / (2 * nu * k**2) - 1 == pytest.approx(-((theta / 2) ** 0.5), rel=0.03)
    assert omega / plain - 1 == pytest.approx(-(2**0.5) * theta**1.5, rel=0.03)


def test_threshold_is_that_of_a_damped_mathieu_equation() -> None:
    """ζ̈ + 2γ ζ̇ + ω² (1 + (a/g) cos 2ωt) ζ = 0 grows from a = 4γ g/ω on, to first order."""
    fluids = Fluids(viscosity_m2_per_s=1e-5, gas_density_kg_per_m3=1e-4, surface_tension_n_per_m=0.0)
    layers = Layers(fluids, 50.0, 1.0, 1.0)
    omega, decay = layers.free_wave()
    assert layers.subharmonic_threshold(2 * omega) == pytest.approx(4 * decay * 9.81 / omega, rel=0.01)


def test_wave_frequency_without_gas_and_tension_is_that_of_deep_water() -> None:
    fluids = Fluids(gas_density_kg_per_m3=1e-4, surface_tension_n_per_m=0.0)
    assert cases.wave_frequency(fluids, 50.0, 1.0, 1.0) == pytest.approx((9.81 * 50.0) ** 0.5, rel=1e-6)


def test_table_names_what_differs() -> None:
    case = shaken.Shaking(4.0, 11.4, 32, 16, surface_tension_n_per_m=0.0, seed=2)
    shares = {
        "advection": 0.8,
        "viscosity": 0.05,
        "pressure": 0.1,
        "interface": 0.0,
        "place": -0.04,
        "height": 0.0,
    }
    found = {
        "w_bar": 0.9,
        "w_bar_error": 0.1,
        "beta": -0.1,
        "shares": shares,
        "residual_share": 0.0,
        "computing_s_per_s": 5.2,
    }
    other = shaken.Shaking(1.0, 11.4)
    (line,) = shaken.rows({case.name: found}, [case, other])[2:]
    assert "| 4 g, 11.4 Hz | 16 | σ = 0, seed 2 | 0.90 ± 0.10 | −0.100 |" in line
    # what was kept without an error is printed without one
    del found["w_bar_error"]
    assert "| 0.90 | −0.100 |" in shaken.rows({case.name: found}, [case])[-1]


def test_what_is_kept_belongs_to_cases_that_can_be_computed_again() -> None:
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    assert kept
    for name, found in kept.items():
        assert shaken.Shaking(**found["case"]).name == name
        assert abs(found["volume_change"]) < 1e-9
