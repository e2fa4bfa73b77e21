"""Theory that the tank of liquid and gas is compared with, and the table of what was computed."""

import json
from pathlib import Path

import pytest

import studies.two_phase_verification as room
from acquisition.two_phase_tank.setup import Fluids
from studies.two_phase_verification import cases, shaken

KEPT = Path(room.__file__).with_name("shaken.json")


def test_growth_of_a_mathieu_wave_is_that_of_first_order() -> None:
    """At Ω = 2ω₀ a wave grows with s ω₀/4 − γ to first order; without shaking it decays with γ."""
    assert cases.growth_rate(100.0, 0.3, 0.0, 20.0) == pytest.approx(-0.3, rel=1e-6)
    assert cases.growth_rate(100.0, 0.0, 0.02, 20.0) == pytest.approx(0.02 * 10 / 4, rel=1e-3)
    assert cases.growth_rate(100.0, 0.05, 0.02, 20.0) == pytest.approx(0.0, abs=1e-4)


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
        "w_bar_scatter": 0.4,
        "beta": -0.1,
        "shares": shares,
        "residual_share": 0.0,
        "computing_s_per_s": 5.2,
    }
    other = shaken.Shaking(1.0, 11.4)
    (line,) = shaken.rows({case.name: found}, [case, other])[2:]
    assert "| 4 g, 11.4 Hz | 16 | σ = 0, seed 2 | 0.90 ± 0.10 | −0.100 |" in line


def test_what_is_kept_belongs_to_cases_that_can_be_computed_again() -> None:
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    assert kept
    for name, found in kept.items():
        assert shaken.Shaking(**found["case"]).name == name
        assert abs(found["volume_change"]) < 1e-9
