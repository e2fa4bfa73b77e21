"""The beam in closed form, by elements, and updated."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from sloshlab.errors import AnalysisError
from sloshlab.modal.beam_elements import element_modes
from sloshlab.modal.cantilever import Cantilever, cantilever_modes
from sloshlab.modal.structural_update import update_beam

BEAM = Cantilever(0.74, 0.10, 0.01, 70e9, 2700.0, tip_mass_kg=0.44)
BARE = Cantilever(0.74, 0.10, 0.01, 70e9, 2700.0)


def test_wave_numbers_without_tip_mass_are_those_of_the_tables() -> None:
    speed = np.sqrt(70e9 * 0.01**2 / 12 / 2700.0)
    roots = 0.74 * np.sqrt(2 * np.pi * cantilever_modes(BARE, n_modes=4).frequency_hz / speed)
    assert roots == pytest.approx([1.875104, 4.694091, 7.854757, 10.995541], abs=1e-6)
    # ∫ψ²/ψ(L)² = L/4 for every mode of a bare cantilever
    assert cantilever_modes(BARE, n_modes=4).modal_mass_kg == pytest.approx(0.74 * 0.1 * 0.01 * 2700 / 4)


def test_a_heavy_tip_on_a_light_beam_is_a_spring_and_a_mass() -> None:
    heavy = Cantilever(0.74, 0.10, 0.01, 70e9, 1.0, tip_mass_kg=50.0)
    stiffness = 3 * heavy.bending_stiffness_n_m2 / 0.74**3
    # Rayleigh: 33/140 of the beam's mass of 0.74 g moves with the tip
    expected = np.sqrt(stiffness / (50 + 33 / 140 * 0.74e-3)) / (2 * np.pi)
    assert cantilever_modes(heavy, n_modes=1).frequency_hz[0] == pytest.approx(expected, rel=1e-8)


def test_shapes_meet_root_and_tip_conditions_and_are_orthogonal() -> None:
    modes = cantilever_modes(BEAM, n_modes=4)
    assert modes.mode_shape[0] == pytest.approx(0, abs=1e-12)
    assert modes.mode_shape[-1] == pytest.approx(1)
    step = 1e-3
    at = cantilever_modes(BEAM, n_modes=4, x_m=0.74 - step * np.arange(5)).mode_shape
    # EI ψ''' = −ω² M ψ and ψ'' = 0 at the tip, by one-sided differences (error about step²)
    third = (5 * at[0] - 18 * at[1] + 24 * at[2] - 14 * at[3] + 3 * at[4]) / (2 * step**3)
    second = (35 * at[0] - 104 * at[1] + 114 * at[2] - 56 * at[3] + 11 * at[4]) / (12 * step**2)
    force = -((2 * np.pi * modes.frequency_hz) ** 2) * 0.44
    assert BEAM.bending_stiffness_n_m2 * third == pytest.approx(force, rel=2e-3)
    assert second == pytest.approx(0, abs=1e-3 * (2 * np.pi * modes.frequency_hz).max())

    def product(x: float, m: int, n: int) -> float:
        shapes = cantilever_modes(BEAM, n_modes=4, x_m=np.array([x])).mode_shape[0]
        return float(shapes[m] * shapes[n])

    for m, n in ((0, 1), (1, 2)):
        inner = quad(product, 0, 0.74, args=(m, n), epsabs=1e-10)[0]
        assert BEAM.mass_per_length_kg_per_m * inner + 0.44 == pytest.approx(0, abs=1e-8)


def test_shapes_of_high_modes_do_not_overflow() -> None:
    modes = cantilever_modes(BEAM, n_modes=50)
    assert np.isfinite(modes.mode_shape).all()
    assert modes.mode_shape[0] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("beam", [BARE, BEAM])
def test_elements_converge_to_the_closed_form_with_the_fourth_order(beam: Cantilever) -> None:
    exact = cantilever_modes(beam, n_modes=3)
    errors = [
        element_modes(beam, n_modes=3, n_elements=n).frequency_hz / exact.frequency_hz - 1 for n in (8, 16, 32)
    ]
    assert (errors[2] > 0).all()
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert orders[-1, 1:] == pytest.approx(4.0, abs=0.1)
    fine = element_modes(beam, n_modes=3, n_elements=40)
    assert fine.modal_mass_kg == pytest.approx(exact.modal_mass_kg, rel=1e-5)
    assert fine.base_factor_kg == pytest.approx(exact.base_factor_kg, rel=1e-5)
    at_nodes = cantilever_modes(beam, n_modes=3, x_m=fine.x_m).mode_shape
    np.testing.assert_allclose(fine.mode_shape, at_nodes, atol=1e-4)


def test_base_factors_of_all_modes_add_up_to_the_moving_mass() -> None:
    modes = element_modes(BEAM, n_modes=80, n_elements=40)
    effective = (modes.base_factor_kg**2 / modes.modal_mass_kg).sum()
    # but for half of the root element, which does not move: 4 thousandths of the beam's mass
    assert effective == pytest.approx(0.44 + 0.74 * 2.7, rel=0.01)


def test_update_recovers_tip_mass_and_stiffness() -> None:
    start = Cantilever(0.74, 0.10, 0.01, 60e9, 2700.0, tip_mass_kg=0.2)
    measured = cantilever_modes(BEAM, n_modes=3).frequency_hz
    updated = update_beam(start, measured, n_elements=40)
    assert updated.beam.tip_mass_kg == pytest.approx(0.44, rel=1e-4)
    assert updated.beam.youngs_modulus_pa == pytest.approx(70e9, rel=1e-5)


@pytest.mark.parametrize("errors_known", [True, False])
def test_update_intervals_hold_in_nine_of_ten_repeats(errors_known: bool) -> None:
    """Errors of 0.2 %, known or estimated from what two parameters leave of three frequencies (Student)."""
    generator = np.random.default_rng(3)
    true = element_modes(BEAM, n_modes=3, n_elements=6).frequency_hz
    held = []
    for _ in range(100):
        noisy = true * (1 + generator.normal(0, 0.002, 3))
        update = update_beam(BEAM, noisy, measured_std_hz=0.002 * true if errors_known else None, n_elements=6)
        k = update.coverage_factor
        held.append(
            (
                abs(update.beam.tip_mass_kg - 0.44) <= k * update.tip_mass_kg_std,
                abs(update.beam.youngs_modulus_pa - 70e9) <= k * update.youngs_modulus_pa_std,
            )
        )
    # 100 repeats: 90 % within twice the standard deviation of 3 %
    assert np.mean(held, axis=0) == pytest.approx(0.90, abs=0.06)


def test_claimed_errors_of_the_update_are_the_scatter_over_repeats() -> None:
    generator = np.random.default_rng(4)
    true = element_modes(BEAM, n_modes=3, n_elements=6).frequency_hz
    found = [
        update_beam(BEAM, true * (1 + generator.normal(0, 0.002, 3)), measured_std_hz=0.002 * true, n_elements=6)
        for _ in range(100)
    ]
    for name in ("tip_mass_kg", "youngs_modulus_pa"):
        scatter = np.std([getattr(update.beam, name) for update in found])
        claimed = np.sqrt(np.mean([getattr(update, f"{name}_std") ** 2 for update in found]))
        # 100 repeats give a standard deviation within 7 %; three of those
        assert claimed == pytest.approx(scatter, rel=0.21)


def test_impossible_beams_and_frequencies_are_refused() -> None:
    with pytest.raises(AnalysisError, match=r"beam\.length_m"):
        Cantilever(0.0, 0.1, 0.01, 70e9, 2700.0)
    with pytest.raises(AnalysisError, match="position along the beam"):
        cantilever_modes(BEAM, n_modes=1, x_m=np.array([0.8]))
    with pytest.raises(AnalysisError, match="number of beam modes"):
        cantilever_modes(BEAM, n_modes=0)
    with pytest.raises(AnalysisError, match="beam elements"):
        element_modes(BEAM, n_modes=9, n_elements=4)
    with pytest.raises(AnalysisError, match="two rising frequencies"):
        update_beam(BEAM, np.array([79.0, 10.9]))


def test_data_sets() -> None:
    dataset = cantilever_modes(BEAM, n_modes=2).to_dataset()
    assert dataset.modal_mass_kg.attrs["units"] == "kg"
    assert (
        update_beam(BEAM, np.array([10.87, 79.06, 223.15])).to_dataset().youngs_modulus_pa_std.attrs["units"]
        == "Pa"
    )
