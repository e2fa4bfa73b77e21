"""Tables 3.2 and 3.4: sloshing frequencies in the tanks of the flying wing."""

import pytest

from sloshlab.lateral_sloshing.box_tank import BoxTank, equivalent_model

# table, length, width, axis, then the printed frequencies in rad/s
PRINTED = [
    ("3.2, x", 0.18, 0.18, "x", ("11.80", "22.64", "29.26")),
    ("3.2, y", 0.18, 0.18, "y", ("11.80", "22.64", "29.26")),
    ("3.4, x", 0.18, 0.09, "x", ("11.80", "22.64", "29.26")),
    ("3.4, y", 0.18, 0.09, "y", ("18.31", "32.05", "41.38")),
]


@pytest.mark.parametrize(("length", "width", "axis", "printed"), [row[1:] for row in PRINTED], ids=str)
def test_sloshing_frequencies_to_every_printed_digit(length, width, axis, printed):
    tank = BoxTank(length, width, 0.13, fill_level=0.5, density_kg_per_m3=650.0)
    frequencies = equivalent_model(tank, axis, n_modes=3).frequencies_rad_per_s
    # 11.7949 is printed as 11.80, rounded twice; half a unit of the last digit and 1e-4 for that
    assert tuple(f"{frequency + 1e-4:.2f}" for frequency in frequencies) == printed


def test_masses_of_case_1():
    """To the digits of NASA SP-106 (L2) as settled from it, which the source leaves to its reference."""
    tank = BoxTank(0.18, 0.18, 0.13, fill_level=0.5, density_kg_per_m3=650.0)
    model = equivalent_model(tank, "x", n_modes=3)
    assert model.masses_kg == pytest.approx([0.79472, 0.03614, 0.00782], abs=6e-6)
    assert model.heights_m == pytest.approx([-0.02632, -0.00324, 0.00974], abs=6e-6)
    assert model.inertia_kg_m2 == pytest.approx(2.68875e-3, abs=6e-9)
