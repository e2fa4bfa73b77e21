"""Units at the border."""

from __future__ import annotations

import pytest

from sloshlab.errors import UnitsError
from sloshlab.quantities import QUANTITIES
from sloshlab.units import SI_UNITS, factor_to_si


@pytest.mark.parametrize(
    ("units", "quantity", "factor"),
    [
        ("N", "force", 1.0),
        ("kN", "force", 1000.0),
        ("mN", "force", 1e-3),
        ("gf", "force", 9.80665e-3),
        ("lbf", "force", 4.4482216152605),
        ("kg m s-2", "force", 1.0),
        ("mm s-2", "acceleration", 1e-3),
        ("m/s2", "acceleration", 1.0),
        ("gravity", "acceleration", 9.80665),
        ("cm/s", "velocity", 0.01),
        ("km h-1", "velocity", 1 / 3.6),
        ("um", "displacement", 1e-6),
        ("inch", "displacement", 0.0254),
        ("mV", "voltage", 1e-3),
    ],
)
def test_factors_from_the_definitions_of_the_units(units, quantity, factor):
    assert factor_to_si(units, quantity) == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize(
    ("units", "quantity"),
    [
        ("g", "force"),
        ("g", "acceleration"),
        ("", "force"),
        ("  ", "force"),
        ("1", "force"),
        ("N m", "force"),
        ("m", "velocity"),
        ("s since 2000-01-01", "displacement"),
        ("newtonne", "force"),
        ("N" * 100, "force"),
        ("N\n", "force"),
        ("m @ 3", "displacement"),
        ("V", "unknown"),
    ],
)
def test_wrong_units_are_refused_in_one_line(units, quantity):
    with pytest.raises(UnitsError) as refused:
        factor_to_si(units, quantity)
    assert "\n" not in str(refused.value)
    assert "allowed" in str(refused.value)


def test_si_units_of_the_format():
    assert SI_UNITS == {
        "force": "N",
        "acceleration": "m s-2",
        "velocity": "m s-1",
        "displacement": "m",
        "voltage": "V",
    }


def test_every_result_has_convertible_units():
    import cf_units

    for name, quantity in QUANTITIES.items():
        assert not cf_units.Unit(quantity.units).is_unknown(), name
        assert quantity.long_name
