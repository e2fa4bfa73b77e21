"""Two extensions together: forces side by side, changes one after the other."""

from __future__ import annotations

from dataclasses import replace

from sloshlab.missing_physics.extension import NOTHING, Extension, SensorFault
from sloshlab.twin.structure import Structure, single_degree_of_freedom
from sloshlab.twin.structure_forces import COULOMB_FRICTION, VISCOUS_DAMPING
from sloshlab.twin.terms import Term

DAMPER = VISCOUS_DAMPING(place="tank", damping_n_s_per_m=2.0)
FRICTION = COULOMB_FRICTION(force_n=0.3)


def doubled(terms: tuple[Term, ...]) -> tuple[Term, ...]:
    return tuple(term.changed(damping_n_s_per_m=2 * term.values["damping_n_s_per_m"]) for term in terms)


def one_more(terms: tuple[Term, ...]) -> tuple[Term, ...]:
    return tuple(term.changed(damping_n_s_per_m=1 + term.values["damping_n_s_per_m"]) for term in terms)


def heavier(structure: Structure) -> Structure:
    return replace(structure, masses_kg=structure.masses_kg + 1.0)


def three_times(structure: Structure) -> Structure:
    return replace(structure, masses_kg=3.0 * structure.masses_kg)


def test_forces_faults_and_keys_are_put_side_by_side() -> None:
    fault = SensorFault("force_interface", lambda values, rate, others, recorded: values, None, ("gain",))
    both = Extension(terms=(FRICTION,), key=(("a", 1.0),)) + Extension(
        terms=(DAMPER,), faults=(fault,), key=(("b",),)
    )
    assert both.terms == (FRICTION, DAMPER)
    assert both.faults == (fault,)
    assert both.key == (("a", 1.0), ("b",))


def test_changes_of_the_liquid_follow_each_other() -> None:
    """(2 · 2) + 1 and 2 · (2 + 1)."""
    for first, second, expected in ((doubled, one_more, 5.0), (one_more, doubled, 6.0)):
        both = Extension(liquid=first) + Extension(liquid=second)
        assert both.liquid is not None
        assert both.liquid((DAMPER,))[0].values["damping_n_s_per_m"] == expected


def test_changes_of_the_structure_follow_each_other() -> None:
    """3 · (2 + 1) and 3 · 2 + 1."""
    structure = single_degree_of_freedom(2.0, 100.0)
    for first, second, expected in ((heavier, three_times, 9.0), (three_times, heavier, 7.0)):
        both = Extension(structure=first) + Extension(structure=second)
        assert both.structure is not None
        assert both.structure(structure).masses_kg[0] == expected


def test_nothing_more_is_the_same() -> None:
    for both in (
        NOTHING + Extension(liquid=doubled, structure=heavier),
        Extension(liquid=doubled, structure=heavier) + NOTHING,
    ):
        assert both.liquid is doubled
        assert both.structure is heavier
    assert (NOTHING + NOTHING).liquid is None
    assert (NOTHING + NOTHING).structure is None
