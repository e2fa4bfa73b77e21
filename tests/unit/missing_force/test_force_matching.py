"""Numbers of forces from the missing one alone: laws by formula and by SciPy's integrator, on a known motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import decays, effect, rig, run_of, surroundings
from scipy.integrate import solve_ivp
from slow_cases import slow_but

from sloshlab.identification.integration_steps import MOST_STEPS_OF_MEMORY, steps_needed, steps_per_sample
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_force.force_matching import ForceMatching, Match, force_alone, matchings
from sloshlab.missing_force.latent_force import (
    EITHER,
    STRUCTURE,
    TANK,
    LatentForce,
    RunForces,
    along,
    forces_alone,
)
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate

RATE_HZ = 250.0
N = 1500
N_BEFORE = 50
TIME = np.arange(N) / RATE_HZ
OMEGA = 30.0
Law = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def motion_of(size_m: float) -> np.ndarray:
    """A tone that grows from rest and then beats."""
    grown = size_m * (1 - np.exp(-TIME)) * (1 + 0.5 * np.sin(2.0 * TIME))
    x = grown * np.sin(OMEGA * TIME)
    v = np.gradient(x, 1 / RATE_HZ, edge_order=2)
    return np.stack([x, v, np.gradient(v, 1 / RATE_HZ, edge_order=2)], axis=1)


def latent(
    force: np.ndarray, motion: np.ndarray, name: str, place: str = STRUCTURE, noise_n: float = 1e-3
) -> LatentForce:
    """A missing force that begins fifty samples after its run, with white noise."""
    run = run_of(name, {"acceleration_tip": motion[:, 2]}, {}, 0)
    kept = slice(N_BEFORE, N)
    everything = np.ones(N + 1)
    noise = np.full(N + 1, N * noise_n**2)
    before = motion[:N_BEFORE]
    return LatentForce(run, place, force[kept], noise_n, TIME[kept], motion[kept], before, everything, noise)


def matched(matching: ForceMatching, known: Candidate, starts: list[dict[str, float]]) -> Match:
    return matching.refined(known, matching.ranked(known, starts))[0]


def candidate(tmp_path: Path, key: str, channel: str = "") -> Candidate:
    assert effects.__all__  # importing the vocabulary makes it known
    model = RigModel(rig(tmp_path), tmp_path, decays())
    return Candidate(effect(key), surroundings(model), channel)


def starts_of(known: Candidate) -> list[dict[str, float]]:
    return [*known.starts(), *known.drawn(12)]


def test_size_of_friction_beside_what_the_baseline_may_be_off(tmp_path: Path) -> None:
    """A spring, a damper and a mass that are off are set aside; the friction is told by its form."""
    known = candidate(tmp_path, "structure.coulomb_friction")
    forces = []
    for k, size in enumerate((0.002, 0.004)):
        motion = motion_of(size)
        off = 300.0 * motion[:, 0] - 2.0 * motion[:, 1] + 0.1 * motion[:, 2] + 0.7
        forces.append(latent(-0.31 * np.sign(motion[:, 1]) + off, motion, f"run_{k}"))
    best = matched(ForceMatching(forces), known, starts_of(known))
    assert best.numbers["structure.coulomb_friction.force_n"] == pytest.approx(0.31, rel=0.02)
    # jumps between samples are all that is left
    assert best.misfit < 0.02


def loop(motion: np.ndarray, limit: float, yielding: float, closing: float = 0.5) -> np.ndarray:
    """ż = (z_y/x_y) v (1 − (c sgn(v z) + 1 − c) |z|/z_y), Bouc–Wen with ν = 1, by SciPy."""

    def rate(t: float, z: np.ndarray) -> np.ndarray:
        v = float(np.interp(t, TIME, motion[:, 1]))
        loading = (closing * np.sign(v * z) + 1 - closing) * np.abs(z) / limit
        return np.asarray(limit / yielding * v * (1 - loading))

    found = solve_ivp(rate, (0.0, TIME[-1]), [0.0], t_eval=TIME, max_step=1e-3, rtol=1e-7)
    return np.asarray(found.y[0])


def test_numbers_that_are_no_sizes_are_refined(tmp_path: Path) -> None:
    """A rope's hysteresis, from draws of its prior."""
    known = candidate(tmp_path, "structure.hysteresis")
    motion = motion_of(0.004)
    matching = ForceMatching([latent(-loop(motion, 1.2, 1.5e-3), motion, "run_1")])
    best = matched(matching, known, starts_of(known))
    assert best.numbers["structure.hysteresis.stiffness_n_per_m"] == pytest.approx(800.0, rel=0.01)
    assert best.numbers["structure.hysteresis.exponent"] == pytest.approx(1.0, rel=0.01)
    assert best.misfit < 1e-4


def test_a_refinement_changes_signs(tmp_path: Path) -> None:
    """It starts where βδ = (1 − c)/x_y is positive, and ends at that of a loop that bulges."""
    known = candidate(tmp_path, "structure.hysteresis")
    motion = motion_of(0.004)
    matching = ForceMatching([latent(-loop(motion, 1.2, 1e-3, closing=1.4), motion, "run_1")])
    start = {"stiffness_n_per_m": 800.0, "beta_gamma": 480.0, "beta_delta": 320.0, "exponent": 1.2}
    ranked = matching.ranked(known, [{f"{known.key}.{name}": value for name, value in start.items()}])
    best = matching.refined(known, ranked)[0]
    assert best.numbers["structure.hysteresis.beta_gamma"] == pytest.approx(1400.0, rel=0.02)
    assert best.numbers["structure.hysteresis.beta_delta"] == pytest.approx(-400.0, rel=0.05)


def test_a_loop_that_yields_at_once_is_followed(tmp_path: Path) -> None:
    """At 2 % of the amplitude: in steps of 2 ms it would explode."""
    known = candidate(tmp_path, "structure.hysteresis")
    motion = motion_of(0.004)
    limit, yielding = 1.2, 1e-4
    matching = ForceMatching([latent(-loop(motion, limit, yielding), motion, "run_1")])
    best = matching.evolved(known, matching.ranked(known, starts_of(known)))[0]
    total = best.numbers["structure.hysteresis.beta_gamma"] + best.numbers["structure.hysteresis.beta_delta"]
    stiffness = best.numbers["structure.hysteresis.stiffness_n_per_m"]
    exponent = best.numbers["structure.hysteresis.exponent"]
    assert (stiffness / total) ** (1 / exponent) == pytest.approx(limit, rel=0.02)
    assert stiffness == pytest.approx(limit / yielding, rel=0.1)
    assert best.misfit < 1e-3


def test_a_loop_that_no_step_follows_is_not_simulated(tmp_path: Path) -> None:
    """It yields within a nanometre, ten million times a second."""
    known = candidate(tmp_path, "structure.hysteresis")
    motion = motion_of(0.004)
    matching = ForceMatching([latent(-np.sign(motion[:, 1]), motion, "run_1")])
    numbers = {"stiffness_n_per_m": 1e9, "beta_gamma": 5e8, "beta_delta": 5e8, "exponent": 1.0}
    [match] = matching._matches(known, [{f"{known.key}.{n}": v for n, v in numbers.items()}], scales=False)
    assert match.misfit == pytest.approx(1e6)


def bounced(known: Candidate, motion: np.ndarray, gap: float, stiffness: float, damping: float) -> np.ndarray:
    """Force of a fifth of the liquid that flies between floor and ceiling, by SciPy."""
    mass = 0.2 * known.surroundings.rig.liquid_mass_kg

    def contact(z: float, speed: float) -> float:
        if z < 0:
            return min(stiffness * z + damping * speed, 0.0)
        if z > gap:
            return max(stiffness * (z - gap) + damping * speed, 0.0)
        return 0.0

    def rate(t: float, y: np.ndarray) -> list[float]:
        base = float(np.interp(t, TIME, motion[:, 2]))
        return [y[1], -9.81 - base - contact(y[0], y[1]) / mass]

    flown = solve_ivp(rate, (0.0, TIME[-1]), [-mass * 9.81 / stiffness, 0.0], t_eval=TIME, max_step=2e-4).y
    pushed = np.array([contact(z, speed) for z, speed in flown.T])
    return np.asarray(pushed + mass * motion[:, 2] + mass * 9.81)


@pytest.mark.slow
def test_impacts_are_met_by_a_population(tmp_path: Path) -> None:
    """A mass that flies between floor and ceiling; its numbers come from far away."""
    known = candidate(tmp_path, "tank.ceiling_impact")
    motion, gap = motion_of(0.03), 0.015
    force = bounced(known, motion, gap, 2000.0, 1.5)
    matching = ForceMatching([latent(force, motion, "run_1", TANK)])
    starts = [*starts_of(known), *known.sought_at()[:100]]
    ranked = matching.ranked(known, starts)
    best = matching.evolved(known, ranked)[0]
    assert best.misfit < 0.9 * matching.refined(known, ranked)[0].misfit
    assert best.numbers["tank.ceiling_impact.gap_m"] == pytest.approx(gap, rel=0.05)
    assert best.numbers["tank.ceiling_impact.share"] == pytest.approx(0.2, rel=0.3)


def test_amplitudes_tell_bounces_that_have_parted(tmp_path: Path) -> None:
    """Numbers that are off by a hundredth have other phases and nearly the same amplitudes."""
    known = candidate(tmp_path, "tank.ceiling_impact")
    motion = motion_of(0.02)
    true = {"gap_m": 0.015, "stiffness_n_per_m": 2000.0, "damping_kg_per_s": 0.3, "share": 0.2}
    force = bounced(known, motion, true["gap_m"], true["stiffness_n_per_m"], true["damping_kg_per_s"])
    matching = ForceMatching([latent(force, motion, "run_1", TANK)])
    named = {f"{known.key}.{name}": value for name, value in true.items()}
    near, far = ({name: factor * value for name, value in named.items()} for factor in (1.01, 0.5))
    assert matching._parts(known, named)
    # worse than no force at all
    assert matching._matches(known, [near], scales=False)[0].misfit > 1.5
    of_near, of_far = matching._misfits_of_amplitudes(known, [near, far])
    assert of_near < 0.25
    assert of_far > 2.0 * of_near


def test_forces_are_compared_over_their_noise(tmp_path: Path) -> None:
    """Noise of seven times the friction, above the frequencies at which a structure shows a force."""
    known = candidate(tmp_path, "structure.coulomb_friction")
    motion = motion_of(0.003)
    lines = np.fft.rfftfreq(2 * N, 1 / RATE_HZ)
    noise_n = np.where(lines < 20.0, 0.002, 3.0)
    draws = np.random.default_rng(5).normal(size=(2, N + 1))
    noise = np.fft.irfft(noise_n * np.sqrt(N) * (draws[0] + 1j * draws[1]), 2 * N)[:N]
    assert np.std(noise) > 7 * 0.31
    share = np.where(lines < 20.0, 1.0, 0.3)
    noisy = np.fft.irfft(share * np.fft.rfft(noise - 0.31 * np.sign(motion[:, 1]), 2 * N), 2 * N)[:N]
    as_if_white = replace(latent(noisy, motion, "run_1"), kept_share=share)
    as_it_is = replace(as_if_white, noise_power=2 * N * noise_n**2)
    match, blind = (matched(ForceMatching([each]), known, known.starts()) for each in (as_it_is, as_if_white))
    assert match.numbers["structure.coulomb_friction.force_n"] == pytest.approx(0.31, rel=0.01)
    assert match.misfit < 0.1
    assert blind.misfit > 0.9


def test_what_the_regularisation_took_is_no_misfit(tmp_path: Path) -> None:
    known = candidate(tmp_path, "structure.coulomb_friction")
    motion = motion_of(0.003)
    force = -0.2 * np.sign(motion[:, 1])
    spectrum = np.fft.rfft(force, 2 * N)
    share = (np.arange(N + 1) < 0.15 * N).astype(float)
    whole = latent(np.fft.irfft(share * spectrum, 2 * N)[:N], motion, "run_1")
    taken = replace(whole, kept_share=share)
    start = [{"structure.coulomb_friction.force_n": 0.2}]
    as_known, as_if_whole = (matched(ForceMatching([each]), known, start).misfit for each in (taken, whole))
    assert as_known < 1e-9
    assert as_if_whole > 0.01


def test_what_is_no_force_of_the_motion_has_no_match(tmp_path: Path) -> None:
    late = candidate(tmp_path, "sensor.sensor_delay", "acceleration_tip")
    matching = ForceMatching([latent(np.sin(OMEGA * TIME), motion_of(0.003), "run_1")])
    assert matching.ranked(late, late.starts()) == []


def of_run(*forces: LatentForce, undivided: LatentForce | None = None) -> RunForces:
    return RunForces(forces, {}, {}, None, 0.0, undivided=undivided)


def test_a_force_of_either_place_is_looked_for_in_the_structure() -> None:
    motion = motion_of(0.003)
    found = matchings([of_run(latent(np.sin(OMEGA * TIME), motion, "run_1", EITHER))])
    assert list(found.of) == [STRUCTURE]
    both = [latent(np.sin(2 * OMEGA * TIME), motion, "run_1", place) for place in (STRUCTURE, TANK)]
    found = matchings([of_run(*both)])
    assert set(found.of) == {STRUCTURE, TANK}
    # what both lack adds up
    assert found.power == pytest.approx(2 * found.of[TANK].power)


@pytest.mark.parametrize("place", [STRUCTURE, TANK])
def test_a_force_too_small_for_the_measured_one_shows_in_the_motion(tmp_path: Path, place: str) -> None:
    """Friction of 0.31 N beneath 1 N of noise of the force cells, and 5 mN of what the motion tells."""
    known = candidate(tmp_path, "structure.coulomb_friction")
    motion = motion_of(0.003)
    friction = -0.31 * np.sign(motion[:, 1])
    spread = np.random.default_rng(3).normal(size=N)
    parts = {STRUCTURE: -spread, TANK: spread}
    parts[place] = parts[place] + friction
    divided = [latent(series, motion, "run_1", at, noise_n=1.0) for at, series in parts.items()]
    undivided = latent(friction, motion, "run_1", EITHER, noise_n=0.005)
    alone = matchings([of_run(*divided)])
    assert alone.power == 0.0
    assert not alone.of[place].is_more_than_noise
    found = matchings([of_run(*divided, undivided=undivided)])
    matching = found.of[place]
    assert matching.is_more_than_noise
    assert found.power == max(each.power for each in found.of.values())
    match = matched(matching, known, starts_of(known))
    assert match.numbers["structure.coulomb_friction.force_n"] == pytest.approx(0.31, rel=0.01)
    assert match.misfit < 0.02


def test_what_the_baseline_is_off_by_at_either_place_is_set_aside_in_what_both_lack(tmp_path: Path) -> None:
    """A spring that acts on the structure's motion and a mass on the tank's, a hundred times the friction."""
    known = candidate(tmp_path, "structure.coulomb_friction")
    relative, absolute = motion_of(0.003), 3.0 * np.roll(motion_of(0.002), 40, axis=0)
    friction = -0.31 * np.sign(relative[:, 1])
    noise = np.random.default_rng(3).normal(size=N)
    off = 3000.0 * relative[:, 0] + 0.5 * absolute[:, 2]
    assert np.std(off) > 10 * 0.31
    divided = [latent(part, relative, "run_1", noise_n=1.0) for part in (friction - noise,)]
    divided += [latent(noise, absolute, "run_1", TANK, noise_n=1.0)]
    undivided = latent(friction + off, relative, "run_1", EITHER, noise_n=0.005)
    match = matched(matchings([of_run(*divided, undivided=undivided)]).of[STRUCTURE], known, starts_of(known))
    assert match.numbers["structure.coulomb_friction.force_n"] == pytest.approx(0.31, rel=0.02)
    assert match.misfit < 0.02


def test_what_both_lack_is_left_to_the_place_that_lacks_more_than_noise() -> None:
    motion = motion_of(0.003)
    tone = np.sin(2 * OMEGA * TIME)
    noise = 1e-3 * np.random.default_rng(3).normal(size=N)
    divided = (latent(noise, motion, "run_1"), latent(tone, motion, "run_1", TANK))
    found = matchings([of_run(*divided, undivided=latent(tone, motion, "run_1", EITHER))])
    assert not found.of[STRUCTURE].is_more_than_noise
    assert found.power == found.of[TANK].power


def test_what_two_places_lack_is_not_taken_for_that_of_one() -> None:
    """Where both lack more than noise, each is matched to its own share."""
    motion = motion_of(0.003)
    tone, other = np.sin(2 * OMEGA * TIME), 0.8 * np.sin(3 * OMEGA * TIME)
    divided = (latent(tone, motion, "run_1"), latent(other, motion, "run_1", TANK))
    undivided = latent(tone + other, motion, "run_1", EITHER)
    found, alone = (matchings([of_run(*divided, undivided=each)]) for each in (undivided, None))
    assert found.power == alone.power
    assert {place: each.power for place, each in found.of.items()} == {
        place: each.power for place, each in alone.of.items()
    }


def test_a_force_within_its_noise_is_told_from_others() -> None:
    motion = motion_of(0.003)
    tone = 0.5 * np.sin(2 * OMEGA * TIME)
    assert ForceMatching([latent(tone, motion, "run_1", TANK, noise_n=0.2)]).is_more_than_noise
    assert not ForceMatching([latent(tone, motion, "run_1", TANK, noise_n=0.3)]).is_more_than_noise


@pytest.mark.parametrize(
    ("key", "compares"),
    [
        ("structure.viscous_damping", False),
        pytest.param("structure.constant_force", False, marks=pytest.mark.slow),
        pytest.param("structure.missing_mode", False, marks=pytest.mark.slow),
        ("structure.cubic_stiffness", True),
        pytest.param("structure.coulomb_friction", True, marks=pytest.mark.slow),
        ("structure.hysteresis", True),
    ],
)
def test_what_is_linear_in_the_motion_is_not_compared(tmp_path: Path, key: str, compares: bool) -> None:
    known = candidate(tmp_path, key)
    motion = motion_of(0.003)
    matching = ForceMatching([latent(np.sin(2 * OMEGA * TIME), motion, "run_1")])
    assert matching.compares(known, known.starts()[0]) is compares


def test_a_loop_that_steps_just_follow_is_compared_and_a_faster_one_is_no_force(tmp_path: Path) -> None:
    """No multiple of the recorded motion may ask for more steps than this one, which may take all there are."""
    known = candidate(tmp_path, "structure.hysteresis")
    motion = motion_of(0.003)
    matching = ForceMatching([latent(np.sin(2 * OMEGA * TIME), motion, "run_1")])

    def yielding(times: float) -> dict[str, float]:
        numbers = known.starts()[0]
        yields = {name: times * value for name, value in numbers.items() if ".beta_" in name}
        assert len(yields) == 2
        return {**numbers, **yields}

    def is_followed(times: float) -> bool:
        twin = force_alone(known, yielding(times))
        assert twin is not None
        speed = float(np.abs(motion[:, 1]).max())
        return steps_needed(twin.terms, RATE_HZ, speed) <= MOST_STEPS_OF_MEMORY

    fastest = max(times for times in np.geomspace(1.0, 1e4, 400) if is_followed(times))
    assert not is_followed(1.5 * fastest)
    assert matching.compares(known, yielding(fastest))
    assert not matching.compares(known, yielding(1.5 * fastest))


def test_a_multiple_stays_within_the_bounds_of_every_size(tmp_path: Path) -> None:
    """Half as much again of nine tenths of a liquid are more than there is."""
    known = candidate(tmp_path, "tank.ceiling_impact")
    motion = motion_of(0.03)
    numbers = {**known.starts()[0], f"{known.key}.share": 0.9}
    twin = forces_alone(
        known.extension({each.name: numbers[f"{known.key}.{each.name}"] for each in known.effect.parameters}).terms
    )
    acts = twin.simulate(along(motion, RATE_HZ), n_substeps=steps_per_sample(twin, RATE_HZ)).require_done()
    whole = 1.5 * acts.tank_force_n
    matching = ForceMatching([latent(whole, motion, "run_1", TANK)])
    [match] = matching._matches(known, [numbers], scales=True)
    assert match.numbers[f"{known.key}.share"] == pytest.approx(1.0)
    assert match.misfit == pytest.approx((1 - (1 / 0.9) / 1.5) ** 2, rel=1e-6)


@pytest.mark.parametrize("sign", slow_but([1.0], [1.0, -1.0]))
def test_what_does_not_run_matches_worst(tmp_path: Path, sign: float) -> None:
    known = candidate(tmp_path, "tank.ceiling_impact")
    # Springs that the weight of the liquid presses through.
    soft = {**known.starts()[0], f"{known.key}.stiffness_n_per_m": 50.0}
    matching = ForceMatching([latent(sign * np.sin(OMEGA * TIME) ** 3, motion_of(0.003), "run_1", TANK)])
    [broken], [sound] = (matching._matches(known, [numbers], scales=True) for numbers in (soft, known.starts()[0]))
    assert broken.misfit > 1e5 > sound.misfit
    assert broken.numbers == soft
