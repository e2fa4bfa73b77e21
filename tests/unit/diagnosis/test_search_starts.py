"""Where a fit starts from: sizes of an effect that its author did not think of."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest
from recorded_oscillators import decays, effect, rig, surroundings

from sloshlab.diagnosis import effects
from sloshlab.diagnosis.candidate import Candidate, Surroundings
from sloshlab.diagnosis.rig_model import RigModel
from sloshlab.diagnosis.search import start_values

assert effects.__all__


@pytest.fixture(scope="module")
def at(tmp_path_factory: pytest.TempPathFactory) -> Surroundings:
    folder = tmp_path_factory.mktemp("rig")
    return surroundings(RigModel(rig(folder), folder, decays()))


def numbers(start: dict[str, float]) -> dict[str, float]:
    return {name.rpartition(".")[2]: value for name, value in start.items()}


@pytest.mark.parametrize(
    ("key", "grown"),
    [
        ("structure.coulomb_friction", {"force_n"}),
        ("structure.asymmetric_friction", {"force_up_n", "force_down_n"}),
        ("structure.stribeck_friction", {"coulomb_n", "static_n"}),
        ("structure.clearance", {"stiffness_n_per_m"}),
        ("structure.missing_mode", {"participation"}),
        ("tank.fading_mass", {"beta"}),
        ("tank.liquid_sloshing", {"peak_w_bar"}),
        ("tank.ceiling_impact", {"stiffness_n_per_m", "damping_kg_per_s", "share"}),
        ("tank.faraday_wave", {"force_n"}),
        ("tank.air_cushion", {"stiffness_n_per_m", "mass_kg"}),
    ],
)
def test_an_effect_grows_by_the_numbers_without_which_it_is_nothing(
    at: Surroundings, key: str, grown: set[str]
) -> None:
    candidate = Candidate(effect(key), at)
    for start in candidate.starts():
        larger = numbers(candidate.sized(start, 3.0))
        for name, value in numbers(start).items():
            assert larger[name] == pytest.approx(value * (3.0 if name in grown else 1.0))


def test_an_effect_is_looked_at_a_tenth_of_its_size_too(at: Surroundings) -> None:
    candidate = Candidate(effect("tank.fading_mass"), at)
    found = start_values.starts_with_smaller_sizes(candidate)
    assert found[:2] == candidate.starts()
    assert [numbers(start)["beta"] for start in found] == pytest.approx([0.1, -0.1, 0.01, -0.01])
    assert len({numbers(start)["fade_g"] for start in found}) == 1


def test_a_look_alike_starts_from_a_thirtieth_to_three_times_its_size(at: Surroundings) -> None:
    candidate = Candidate(effect("structure.coulomb_friction"), at)
    sizes = [numbers(start)["force_n"] for start in candidate.starts()]
    found = [numbers(start)["force_n"] for start in start_values.starts_of_many_sizes(candidate)]
    assert found == pytest.approx([size * factor for size in sizes for factor in (0.03, 0.1, 0.3, 1.0, 3.0)])


@pytest.mark.parametrize(("predicted", "factor"), [(2.0, 2.0), (0.001, 0.1), (300.0, 10.0)])
def test_a_start_is_as_large_as_a_first_step_says_within_a_decade(
    at: Surroundings, predicted: float, factor: float
) -> None:
    candidate = Candidate(effect("tank.fading_mass"), at)
    start = candidate.starts()[0]
    found = numbers(start_values.resized(candidate, start, predicted))
    assert found["beta"] == pytest.approx(0.1 * factor)
    assert found["fade_g"] == numbers(start)["fade_g"]


def test_a_mass_that_moves_by_itself_is_one_that_the_tank_may_lack(at: Surroundings) -> None:
    mass, cushion = Candidate(effect("tank.mass_error"), at), Candidate(effect("tank.air_cushion"), at)
    fit = SimpleNamespace(values={**cushion.starts()[0], "tank.air_cushion.mass_kg": 0.18})
    found = start_values.starts_from_nesting(mass, cushion, cast(Any, fit))
    assert [numbers(start)["mass_kg"] for start in found[len(mass.starts()) :]] == [0.18, -0.18]
