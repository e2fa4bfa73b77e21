"""Many simulations at once: each is what it is alone, whatever runs beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sloshlab.errors import AnalysisError, InputError
from sloshlab.twin.excitation import Excitation, free, harmonic, recorded
from sloshlab.twin.lane_preparation import Lane, done, motions
from sloshlab.twin.liquid_effects import FARADAY_WAVE, LATERAL_MODE, LIQUID_LOSS
from sloshlab.twin.motion import Motion
from sloshlab.twin.rate_independent_forces import FRICTION_BEHIND_PLAY
from sloshlab.twin.status import Status
from sloshlab.twin.structure import Structure, modal_structure, single_degree_of_freedom
from sloshlab.twin.structure_forces import (
    ASYMMETRIC_FRICTION,
    CLEARANCE,
    CONSTANT_FORCE,
    COULOMB_FRICTION,
    CUBIC_STIFFNESS,
    MASS_ERROR,
    MISSING_MODE,
    QUADRATIC_DRAG,
    STIFFNESS_CHANGE,
    STRIBECK_FRICTION,
    VISCOUS_DAMPING,
)
from sloshlab.twin.tank_forces import BOUNCING_BALL, FADING_MASS, LINEAR_RESPONSE
from sloshlab.twin.terms import Term
from sloshlab.twin.twin import Twin

RATE_HZ = 400.0
RELEASE_M = 0.012
OSCILLATOR = single_degree_of_freedom(2.0, 3200.0, 0.8)
BEAM = modal_structure(
    [6.0, 38.0, 105.0], [0.004, 0.009, 0.02], [0.9, 1.1, 1.0],
    mode_shape=[1.0, -0.9, 0.8], base_participation_kg=[1.2, -1.0, 0.8],
)  # fmt: skip
BALL = {"radius_m": 0.009, "stiffness_n_per_m": 3000.0, "damping_kg_per_s": 9.0, "liquid_mass_kg": 0.12}
TERMS: dict[str, Callable[[float], tuple[Term, ...]]] = {
    "nothing": lambda size: (),
    "together": lambda size: (
        VISCOUS_DAMPING(place="tank", damping_n_s_per_m=0.5 * size),
        QUADRATIC_DRAG(drag_n_s2_per_m2=3.0 * size),
        STIFFNESS_CHANGE(stiffness_n_per_m=-90.0 * size),
        CONSTANT_FORCE(force_n=0.1 * size),
    ),
    "together and alone": lambda size: (
        VISCOUS_DAMPING(damping_n_s_per_m=0.5 * size),
        CUBIC_STIFFNESS(stiffness_n_per_m3=2e6 * size),
        MASS_ERROR(place="tank", mass_kg=0.1 * size),
    ),
    "memory": lambda size: (MISSING_MODE(frequency_hz=9.0 * size, damping_ratio=0.05, participation=0.2),),
    "friction": lambda size: (COULOMB_FRICTION(force_n=0.6 * size), VISCOUS_DAMPING(damping_n_s_per_m=0.4)),
    "friction of the tank": lambda size: (COULOMB_FRICTION(place="tank", force_n=0.6 * size),),
    "two frictions": lambda size: (
        ASYMMETRIC_FRICTION(force_up_n=0.3 * size, force_down_n=0.5),
        STRIBECK_FRICTION(coulomb_n=0.2, static_n=0.4 * size, stribeck_velocity_m_per_s=0.02),
    ),
    "friction behind play": lambda size: (
        FRICTION_BEHIND_PLAY(force_n=0.5 * size, play_m=0.001, stiffness_n_per_m=4e3),
    ),
    "clearance": lambda size: (CLEARANCE(gap_m=0.004 * size, stiffness_n_per_m=2e4),),
    "contacts": lambda size: (BOUNCING_BALL(**BALL, hardening_per_m=500.0, beta=0.002 * size, height_m=0.0272),),
    "acceleration": lambda size: (FADING_MASS(beta=0.5 * size, liquid_mass_kg=0.2, fade_g=1.5, averaging_s=0.8),),
    "acceleration and friction": lambda size: (
        LATERAL_MODE(frequency_hz=8.0 * size, mass_kg=0.15, damping_ratio=0.02),
        COULOMB_FRICTION(place="tank", force_n=0.5 * size),
        LIQUID_LOSS(rate_kg_per_s=0.01 * size),
        QUADRATIC_DRAG(place="tank", drag_n_s2_per_m2=2.0),
    ),
    "acceleration and contacts": lambda size: (
        FARADAY_WAVE(frequency_hz=3.0, force_n=0.2 * size),
        FADING_MASS(beta=0.5 * size, liquid_mass_kg=0.2, fade_g=1.5, averaging_s=0.8),
        BOUNCING_BALL(**BALL, hardening_per_m=500.0, beta=0.002 * size, height_m=0.0272),
    ),
    "discrete time": lambda size: (LINEAR_RESPONSE(n_delays=3, table=[1.0 * size, -2.0, 0.5]),),
}


def shaken(seed: int, duration_s: float = 2.0) -> Excitation:
    """Noise of some hertz at the base, and a force on the tank."""
    rng = np.random.default_rng(seed)
    a, force = (
        np.convolve(rng.normal(size=round(duration_s * RATE_HZ)), np.hanning(60), "same") for _ in range(2)
    )
    velocity = np.cumsum(a) / RATE_HZ
    return recorded(
        RATE_HZ, acceleration=a, velocity=velocity, displacement=np.cumsum(velocity) / RATE_HZ, force_n=0.3 * force
    )


def beams(n: int, structure: Structure = BEAM) -> list[Structure]:
    """The same with frequencies that differ by half a per cent from lane to lane."""
    return [
        replace(structure, stiffnesses_n_per_m=structure.stiffnesses_n_per_m * (1.0 + 0.01 * i)) for i in range(n)
    ]


def alone(lane: Lane) -> Any:
    """The simulation of a lane by the engine for one twin."""
    assert isinstance(lane.twin, Twin)
    return lane.twin.simulate(
        lane.excitation,
        initial_displacement_m=lane.start[0],
        initial_velocity_m_per_s=lane.start[1],
        n_substeps=lane.n_substeps,
    )


def assert_as_alone(lanes: Sequence[Lane], found: Sequence[Motion | InputError]) -> None:
    for lane, motion in zip(lanes, found, strict=True):
        assert isinstance(motion, Motion)
        expected = alone(lane)
        assert str(motion.ending) == str(expected.ending)
        np.testing.assert_array_equal(motion.modes, expected.modes)
        np.testing.assert_array_equal(motion.base_motion, expected.base_motion)
        np.testing.assert_array_equal(motion.external_force_n, expected.external_force_n)
        np.testing.assert_allclose(motion.tank_force_n, expected.tank_force_n, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("structure", [OSCILLATOR, BEAM], ids=["one mode", "three modes"])
@pytest.mark.parametrize("terms", TERMS)
def test_every_lane_is_what_it_is_alone(terms: str, structure: Structure) -> None:
    """Packs that are full and not, of one excitation and of several; gains, releases, and steps that differ."""
    drives = [shaken(1), shaken(2), free(2.0, RATE_HZ)]
    lanes = [
        Lane(
            Twin(own, TERMS[terms](1.0 + 0.05 * i), (), 0.4),
            drives[i % 5 // 2].scaled(1.0 + 0.02 * i),
            (RELEASE_M * (1.0 + 0.1 * i), 0.02 * (i % 2)),
            2 + (i == 4),
        )
        for i, own in enumerate(beams(22, structure))
    ]
    found = motions(lanes)
    assert_as_alone(lanes, found)
    # they do differ, and something happens in them
    ends = {float(motion.modes[-1, 0, 0]) for motion in found if isinstance(motion, Motion)}
    assert len(ends) > len(lanes) // 2


def test_runs_of_other_lengths_rates_and_structures_are_put_together_as_they_fit() -> None:
    ball = TERMS["contacts"](1.0)
    lanes = [
        Lane(Twin(BEAM), shaken(3, 2.0), n_substeps=2),
        Lane(Twin(BEAM), shaken(4, 3.0), n_substeps=2),
        Lane(Twin(None, (VISCOUS_DAMPING(place="tank", damping_n_s_per_m=2.0),)), shaken(5, 2.0)),
        Lane(Twin(BEAM), harmonic(0.001, 6.0, 2.0, RATE_HZ), n_substeps=2),
        Lane(Twin(OSCILLATOR, ball), free(2.0, RATE_HZ), (RELEASE_M, 0.0), 3),
        Lane(Twin(None, ball), shaken(6, 2.0), n_substeps=4),
    ]
    lanes += [replace(lane, excitation=lane.excitation.scaled(0.5)) for lane in reversed(lanes)]
    assert_as_alone(lanes, motions(lanes))


def test_a_long_run_is_cut_into_stretches_alike() -> None:
    """More half steps than one stretch holds (2¹⁷): 1700 samples of 40 steps are 136 000."""
    terms = TERMS["friction"](1.0)
    lanes = [Lane(Twin(own, terms), shaken(7, 4.25), n_substeps=40) for own in beams(2, OSCILLATOR)]
    assert_as_alone(lanes, motions(lanes))


@pytest.mark.parametrize("terms", ["nothing", "together", "memory", "friction", "contacts", "acceleration"])
def test_a_lane_that_diverges_or_leaves_its_range_disturbs_no_other(terms: str) -> None:
    grows = replace(OSCILLATOR, stiffnesses_n_per_m=np.array([-1e5]))
    lanes = [
        Lane(Twin(own, TERMS[terms](1.0)), free(2.0, RATE_HZ), (RELEASE_M, 0.0), 2)
        for own in [*beams(3, OSCILLATOR), grows, *beams(3, OSCILLATOR)]
    ]
    found = motions(lanes)
    assert_as_alone(lanes, found)
    endings = [motion.ending.status for motion in found if isinstance(motion, Motion)]
    assert endings[3] is not Status.DONE
    assert [*endings[:3], *endings[4:]] == [Status.DONE] * 6
    with pytest.raises(AnalysisError, match="at t = "):
        done(found[3])


def test_a_lane_that_contradicts_itself_is_refused_alone() -> None:
    lanes = [
        Lane(Twin(own, (MASS_ERROR(place="tank", mass_kg=mass_kg),)), free(1.0, RATE_HZ), (RELEASE_M, 0.0))
        for own, mass_kg in zip(beams(3, OSCILLATOR), (0.1, -5.0, 0.2), strict=True)
    ]
    found = motions(lanes)
    assert_as_alone([lanes[0], lanes[2]], [found[0], found[2]])
    with pytest.raises(InputError, match="negative modal mass"):
        done(found[1])


def test_motions_do_not_depend_on_who_works_in_which_order() -> None:
    class LastFirst:
        def map(self, function: Callable[[Any], Any], items: Iterable[Any], /) -> list[Any]:
            return [function(item) for item in reversed(list(items))][::-1]

        map_apart = map

    lanes = [
        Lane(Twin(own, TERMS["friction"](1.0 + 0.1 * i)), shaken(i // 9), (0.0, 0.0), 2)
        for i, own in enumerate(beams(27, OSCILLATOR))
    ]
    for motion, expected in zip(motions(lanes, LastFirst()), motions(lanes), strict=True):
        np.testing.assert_array_equal(done(motion).modes, done(expected).modes)
