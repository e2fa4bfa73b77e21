"""Answers to the physical questions against closed forms on harmonic motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from recorded_oscillators import run_of

from sloshlab.missing_force.force_character import Answer, ForceCharacter, force_character
from sloshlab.missing_force.force_regression import stretches
from sloshlab.missing_force.latent_force import STRUCTURE, LatentForce
from sloshlab.missing_physics import evidence

RATE_HZ = 250.0
DURATION_S = 8.0
NOISE_N = 0.004
G = 9.81
AMPLITUDES_M = (0.002, 0.004, 0.008)
OMEGAS = (25.0, 40.0)
Law = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""(time, x, v, a) → force."""


def latent(law: Law, amplitude: float, omega: float, seed: int) -> LatentForce:
    """A harmonic motion whose amplitude grows by a tenth, with a force by formula."""
    time = np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ
    size = amplitude * (1 + 0.1 * time / DURATION_S)
    x, v = size * np.sin(omega * time), size * omega * np.cos(omega * time)
    a = -(omega**2) * x
    noise = NOISE_N * np.random.default_rng(seed).normal(size=time.size)
    run = run_of(f"run_{seed}", {"acceleration_tip": a}, {}, 0)
    return LatentForce(run, STRUCTURE, law(time, x, v, a) + noise, NOISE_N, time, np.stack([x, v, a], axis=1))


def asked(
    law: Law,
    own: Sequence[float] = (0.0, 0.0, 0.0),
    amplitudes: Sequence[float] = AMPLITUDES_M,
    omegas: Sequence[float] = OMEGAS,
    shift: float = 0.0,
) -> ForceCharacter:
    pairs = [(amplitude, omega) for amplitude in amplitudes for omega in omegas]
    forces = [latent(law, amplitude, omega, seed) for seed, (amplitude, omega) in enumerate(pairs)]
    return force_character(forces, np.array(own), damping_shift=shift)


def answer(character: ForceCharacter, question: str) -> Answer:
    return next(answer for answer in character.answers if answer.question == question)


def coulomb(t: np.ndarray, x: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    return np.asarray(-0.3 * np.sign(v))


def viscous(t: np.ndarray, x: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    return np.asarray(-1.5 * v)


def drag(t: np.ndarray, x: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    return np.asarray(-4.0 * v * np.abs(v))


def cubic(t: np.ndarray, x: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    return np.asarray(-5e6 * x**3)


@pytest.mark.parametrize(
    ("law", "amplitude", "frequency", "term", "rate"),
    [
        (coulomb, 1.0, 0.0, evidence.WORK_1, evidence.RATE_INDEPENDENT),
        (viscous, 2.0, 1.0, evidence.WORK_2, evidence.RATE_DEPENDENT),
        (drag, 3.0, 2.0, evidence.WORK_3, evidence.RATE_DEPENDENT),
    ],
)
def test_work_per_cycle_grows_as_the_formula_says(
    law: Law, amplitude: float, frequency: float, term: str, rate: str
) -> None:
    """W = 4 F X, π c ω X², 8/3 c ω² X³."""
    character = asked(law)
    assert answer(character, "work over amplitude").value == pytest.approx(amplitude, abs=0.06)
    assert answer(character, "work over frequency").value == pytest.approx(frequency, abs=0.12)
    assert character.says[term]
    assert character.says[rate]
    assert character.says[evidence.DISSIPATIVE]
    assert character.says[evidence.ODD_IN_VELOCITY]


def test_work_of_dry_friction_in_joule() -> None:
    """4 F X with X the amplitude in each window."""
    found = asked(coulomb).windows
    np.testing.assert_allclose(found.work_j, 4 * 0.3 * found.amplitude_m, rtol=0.06)


def test_energy_share_of_dry_friction() -> None:
    """Mean |v| over its RMS: 2√2/π of a sine."""
    energy = answer(asked(coulomb), "energy")
    assert energy.value == pytest.approx(2 * np.sqrt(2) / np.pi, abs=0.01)
    assert energy.low <= energy.value <= energy.high


def test_a_force_along_the_velocity_gives_energy() -> None:
    character = asked(lambda t, x, v, a: -viscous(t, x, v, a))
    assert character.says[evidence.ENERGY_INPUT]
    assert not character.says[evidence.DISSIPATIVE]


def test_doubt_of_the_own_damping_leaves_the_sign_open() -> None:
    """A hard spring with a little damping: how little, the block's own damping hides."""

    def weakly_damped(t: np.ndarray, x: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        return np.asarray(-5e6 * x**3 - 0.5 * v)

    assert asked(weakly_damped).says[evidence.DISSIPATIVE]
    assert evidence.DISSIPATIVE not in asked(weakly_damped, own=(0.0, 3.0, 0.0)).says


def test_damping_that_retuning_added_is_given_back() -> None:
    """Retuning hid 2 N s/m: what is left gives energy, together they take it."""
    character = asked(lambda t, x, v, a: 0.5 * v - 0.2 * np.sign(v), shift=2.0)
    assert character.says[evidence.DISSIPATIVE]


def test_a_cubic_spring_is_odd_and_works_nothing_and_has_a_third_order() -> None:
    """sin³ = ¾ sin − ¼ sin 3φ, so a tenth of its variance is at order 3."""
    character = asked(cubic)
    assert character.says[evidence.CONSERVATIVE]
    assert character.says[evidence.ODD_IN_DISPLACEMENT]
    assert not character.says[evidence.ODD_IN_VELOCITY]
    assert character.says[evidence.STATE_FUNCTION]
    assert not character.says[evidence.MEMORY]
    assert answer(character, "order 3").value == pytest.approx(0.1, abs=0.02)


def test_a_square_is_even_and_has_a_second_order() -> None:
    character = asked(lambda t, x, v, a: 4e4 * x**2)
    assert character.says[evidence.EVEN]
    assert not character.says[evidence.ODD_IN_DISPLACEMENT]
    assert character.says[evidence.SECOND_ORDER]


def test_a_constant_is_constant() -> None:
    character = asked(lambda t, x, v, a: np.full(t.size, 0.2))
    assert answer(character, "mean").value == pytest.approx(0.2, abs=2e-3)
    assert character.says[evidence.CONSTANT]


def test_half_the_frequency() -> None:
    character = asked(lambda t, x, v, a: 0.2 * np.cos(0.5 * 40.0 * t), omegas=(40.0,))
    assert answer(character, "order 0.5").value == pytest.approx(1.0, abs=0.05)
    assert character.says[evidence.HALF_ORDER]


def test_a_clearance_has_an_onset_where_its_gap_closes() -> None:
    gap, omega = 0.0045, 40.0

    def contact(t: np.ndarray, x: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        return np.asarray(-400.0 * np.sign(x) * np.maximum(np.abs(x) - gap, 0.0))

    character = asked(contact, amplitudes=(0.002, 0.003, 0.004, 0.005, 0.006, 0.008), omegas=(omega,))
    found = answer(character, "onset")
    assert character.says[evidence.ONSET]
    assert found.low <= omega**2 * gap / G <= found.high
    assert found.value == pytest.approx(omega**2 * gap / G, rel=0.25)


def test_dry_friction_is_there_at_the_smallest_level() -> None:
    assert asked(coulomb).says[evidence.NO_ONSET]


def test_a_slider_on_a_spring_remembers() -> None:
    """A Jenkins element: k (x − z), z dragged along when the force reaches F."""

    def slider(t: np.ndarray, x: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        stiffness, limit, place = 300.0, 0.3, 0.0
        force = np.empty(x.size)
        for i, position in enumerate(x):
            place = min(max(place, position - limit / stiffness), position + limit / stiffness)
            force[i] = -stiffness * (position - place)
        return force

    character = asked(slider, amplitudes=(0.0015, 0.003, 0.006))
    assert character.says[evidence.MEMORY]
    assert evidence.MEMORY not in {term for term, holds in asked(coulomb).says.items() if holds}


def test_a_force_that_grows_along_the_run() -> None:
    character = asked(lambda t, x, v, a: -1.5 * v * t / DURATION_S)
    assert character.says[evidence.TIME_VARYING]
    assert not asked(viscous).says[evidence.TIME_VARYING]


def test_blows() -> None:
    """Half sines of a twentieth of the cycle: the kurtosis is about 20 · 3/8 over ½², far beyond 1.5 of a sine."""
    character = asked(lambda t, x, v, a: np.where(np.sin(25.0 * t) > 0.985, 1.0, 0.0), omegas=(25.0,))
    assert character.says[evidence.IMPULSIVE]
    assert not asked(viscous).says[evidence.IMPULSIVE]


@pytest.mark.parametrize("left", [(0.0, 0.0), (1e-30, 1.0)], ids=["at rest", "no velocity, but an acceleration"])
def test_a_run_in_which_the_place_rests_is_left_out(left: tuple[float, float]) -> None:
    forces = [latent(viscous, amplitude, omega, 3) for amplitude in AMPLITUDES_M for omega in OMEGAS]
    moving = forces[-1]
    rest = moving.motion * 0.0
    rest[:, 1], rest[:, 2] = left[0], left[1] * np.sign(moving.motion[:, 2])
    resting = replace(moving, motion=rest, force_n=0.0 * moving.force_n)
    character = force_character([resting, *forces], np.zeros(3))
    assert character.size_n > 0
    assert answer(character, "energy").finding == "takes energy"


def test_a_motion_that_stops_dead_has_levels() -> None:
    """Running sums over squares that end in zeros round below zero."""
    force = latent(viscous, 0.004, 25.0, 3)
    for seed in range(20):
        motion = np.random.default_rng(seed).normal(size=force.motion.shape)
        motion[force.time_s > 0.4 * DURATION_S] = 0.0
        for part in stretches([replace(force, motion=motion)]):
            assert np.isfinite(part.level_g).all()
            assert np.isfinite(part.omega).all()


def test_noise_is_asked_nothing() -> None:
    character = asked(lambda t, x, v, a: np.zeros(t.size))
    assert not character.exceeds_noise
    assert character.says == {}


def test_one_level_and_one_frequency_leave_growth_open() -> None:
    character = asked(coulomb, amplitudes=(0.004,), omegas=(40.0,))
    for question in ("work over amplitude", "work over frequency", "onset"):
        assert answer(character, question).finding == evidence.CANNOT_TELL
        assert answer(character, question).remark


def test_evidence_sorts_terms() -> None:
    told = evidence.evidence(("takes energy", "onset", "memory"), {"takes energy": True, "onset": False})
    assert told == evidence.Evidence(("takes energy",), ("onset",), ("memory",))
