"""Table 1.1: the first ten symmetric free-surface modes at three fill levels."""

import pytest

from sloshlab.errors import AnalysisError, RigError
from sloshlab.free_surface_modes import mode_table, natural_frequency_hz
from sloshlab.rig import Liquid, Tank

TANK = Tank(height_m=0.0272, length_m=0.1172, width_m=0.0780, dry_mass_kg=0.61)
# (l, m), then the printed frequencies in hertz at fill levels 0.50, 0.25 and 0.75
PRINTED = [
    ((2, 0), 2.909, 2.179, 3.295),
    ((0, 2), 4.093, 3.234, 4.411),
    ((2, 2), 4.716, 3.850, 4.972),
    ((4, 0), 5.091, 4.240, 5.307),
    ((4, 2), 5.984, 5.219, 6.116),
    ((6, 0), 6.809, 6.160, 6.886),
    ((0, 4), 6.817, 6.170, 6.893),
    ((2, 4), 7.079, 6.471, 7.142),
    ((6, 2), 7.381, 6.818, 7.432),
    ((4, 4), 7.789, 7.285, 7.827),
]
CASES = [
    (orders, fill_level, row[column])
    for orders, *row in PRINTED
    for column, fill_level in enumerate((0.50, 0.25, 0.75))
]


def water(fill_level, surface_tension_n_per_m=0.0728):
    return Liquid(density_kg_per_m3=1000.0, surface_tension_n_per_m=surface_tension_n_per_m, fill_level=fill_level)


@pytest.mark.parametrize(("orders", "fill_level", "printed_hz"), CASES)
def test_all_thirty_frequencies_of_table_1_1(orders, fill_level, printed_hz):
    computed_hz = natural_frequency_hz(*orders, tank=TANK, liquid=water(fill_level))
    # printed to 3 decimals with unstated σ, ρ and g: they are met within 0.13 %
    assert computed_hz == pytest.approx(printed_hz, rel=1.3e-3)


def test_without_surface_tension_table_1_1_is_missed_by_up_to_eleven_percent():
    errors = [
        natural_frequency_hz(*orders, tank=TANK, liquid=water(fill_level, 0.0)) / printed_hz - 1
        for orders, fill_level, printed_hz in CASES
    ]
    assert min(errors) == pytest.approx(-0.11, abs=0.005)
    assert max(errors) < 0


@pytest.mark.parametrize("fill_level", [0.50, 0.25, 0.75])
def test_the_table_lists_the_modes_of_table_1_1_in_its_order(fill_level):
    table = mode_table(TANK, water(fill_level), n_modes=10)
    assert [(mode.order_l, mode.order_m) for mode in table] == [orders for orders, *_ in PRINTED]
    assert all(mode.is_symmetric for mode in table)


def test_without_symmetry_the_first_mode_is_one_half_wave_along_the_length():
    table = mode_table(TANK, water(0.5), n_modes=4, symmetric=False)
    assert [(mode.order_l, mode.order_m) for mode in table] == [(1, 0), (0, 1), (1, 1), (2, 0)]


def test_deep_gravity_wave_limit():
    deep = Tank(height_m=100.0, length_m=1.0, width_m=1.0, dry_mass_kg=1.0)
    # ω² = g k with k = 2π: f = √(9.81 · 2π)/2π = √(9.81/2π)
    expected_hz = (9.81 / 6.283185307179586) ** 0.5
    assert natural_frequency_hz(2, 0, tank=deep, liquid=water(0.5, 0.0)) == pytest.approx(expected_hz, rel=1e-12)


def test_missing_surface_tension_is_not_guessed():
    with pytest.raises(RigError, match=r"surface_tension.*remedy"):
        natural_frequency_hz(2, 0, tank=TANK, liquid=Liquid(density_kg_per_m3=1000.0, fill_level=0.5))


@pytest.mark.parametrize("orders", [(0, 0), (-2, 0), (2, -1)])
def test_impossible_orders_are_refused(orders):
    with pytest.raises(AnalysisError, match="orders"):
        natural_frequency_hz(*orders, tank=TANK, liquid=water(0.5))


@pytest.mark.parametrize("n_modes", [0, -1, 10**9])
def test_impossible_numbers_of_modes_are_refused(n_modes):
    with pytest.raises(AnalysisError, match="number of free-surface modes"):
        mode_table(TANK, water(0.5), n_modes=n_modes)
