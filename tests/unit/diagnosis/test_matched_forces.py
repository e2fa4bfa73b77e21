"""A liquid that moves by itself, near the frequency of what carries it: found by its force, not by a free run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import DAMPING, LIQUID_KG, MASS_KG, RATE_HZ, STIFFNESS, base_motion, rig, run_of
from scipy.integrate import solve_ivp

from sloshlab.diagnosis.selection import forward_growth
from sloshlab.diagnosis.selection import matched_forces as module
from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.diagnosis.selection.full_fit import compensated_fit
from sloshlab.diagnosis.selection.matched_forces import matched_forces
from sloshlab.diagnosis.selection.model_selection import ModelSelection
from sloshlab.diagnosis.surroundings import surroundings_of
from sloshlab.identification.case import Case, CaseRun
from sloshlab.identification.free_run_fit import fitted_baseline
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.identification.noise_floor import weighted_observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_force.force_matching import Match
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, candidates

assert effects.__all__  # importing the vocabulary makes it known

SLUG_KG, SLUG_HZ, SLUG_DAMPING = 0.15 * LIQUID_KG, 5.5, 0.01
CUSHION = "tank.air_cushion"
TRIED = (CUSHION, "tank.liquid_sloshing", "tank.mass_error", "structure.hysteresis", "structure.quadratic_drag")
NOISE = {"acceleration_tip": 0.005, "acceleration_root": 0.005, "force_interface": 0.01}


def driven(size: float, seed: int) -> CaseRun:
    """(M − m) ẍ = −k x − c ẋ + m (ω² s + 2ζω ṡ) − (M − m) a_b, s̈ = −ω² s − 2ζω ṡ − ẍ − a_b, by SciPy."""
    omega = 2 * np.pi * SLUG_HZ

    def rates(t: float, y: np.ndarray) -> list[float]:
        pull, base = omega**2 * y[2] + 2 * SLUG_DAMPING * omega * y[3], size * base_motion(t)
        a = (-STIFFNESS * y[0] - DAMPING * y[1] + SLUG_KG * pull) / (MASS_KG - SLUG_KG) - base
        return [y[1], a, y[3], -pull - a - base]

    time = np.arange(round(6.0 * RATE_HZ)) / RATE_HZ
    y = solve_ivp(rates, (0, time[-1]), [0.0] * 4, t_eval=time, rtol=1e-9, atol=1e-12, max_step=0.01).y
    root = size * np.array([base_motion(t) for t in time])
    absolute = root + np.array([rates(t, each)[1] for t, each in zip(time, y.T, strict=True)])
    pull = omega**2 * y[2] + 2 * SLUG_DAMPING * omega * y[3]
    channels = {
        "acceleration_tip": absolute,
        "acceleration_root": root,
        "force_interface": (MASS_KG - SLUG_KG) * absolute - SLUG_KG * pull,
    }
    return run_of(f"driven_{seed}", channels, NOISE, seed, experiment="other")


@pytest.fixture(name="search")
def _search(tmp_path: Path) -> tuple[ModelSelection, FreeRunFit]:
    case = Case("case", tmp_path, rig(tmp_path), (driven(2.0, 1), driven(4.0, 2)))
    assert case.rig is not None
    model = RigModel(case.rig, tmp_path, case.runs)
    runs = FittedRuns(model, list(weighted_observations(case, model).values()), case.names_by_test())
    retuned = fitted_baseline(runs.problem())[0]
    at = surroundings_of(runs.problem(), retuned, case.rig)
    selection = ModelSelection(runs, at, lambda what, done, of: None)
    selection.growth.pool = [candidate for candidate in candidates(at) if candidate.key in TRIED]
    return selection, retuned


def test_a_mass_that_retuning_hides_is_fitted_from_its_force(search: tuple[ModelSelection, FreeRunFit]) -> None:
    selection, retuned = search
    found = matched_forces(selection.known.runs, retuned, selection.growth.pool, 3).evolved()
    leading = {candidate.key: (candidate, numbers) for candidate, numbers in found.leading}
    candidate, numbers = leading[CUSHION]
    # as far as what a spring, a damper and a mass could do is set aside
    assert frequency_hz(numbers) == pytest.approx(SLUG_HZ, rel=0.06)
    # Beside the baseline that had taken its place it makes things worse, so that no search by free runs goes on.
    problem = selection.known.runs.problem((candidate,))
    assert problem.costs([{**retuned.values, **numbers}])[0] > retuned.cost
    fit = compensated_fit(selection.known.runs, retuned, candidate, numbers)
    assert fit.cost < 0.5 * retuned.cost
    assert problem.is_down_to_noise(fit)
    assert frequency_hz(fit.values) == pytest.approx(SLUG_HZ, rel=0.002)
    assert fit.values[f"{CUSHION}.mass_kg"] == pytest.approx(SLUG_KG, rel=0.02)


def pools_of_proposals(monkeypatch: pytest.MonkeyPatch) -> list[set[str]]:
    """The pool of every proposal from here on; nothing is proposed."""
    pools: list[set[str]] = []

    def recorded_proposals(
        runs: FittedRuns, bases: object, pool: list[Candidate], *others: object
    ) -> list[object]:
        pools.append({candidate.key for candidate in pool})
        return []

    monkeypatch.setattr(forward_growth, "proposals", recorded_proposals)
    return pools


@pytest.mark.slow
def test_beside_what_leaves_nothing_come_only_forces_that_do_nearly_the_same(
    search: tuple[ModelSelection, FreeRunFit], monkeypatch: pytest.MonkeyPatch
) -> None:
    selection, retuned = search
    pools = pools_of_proposals(monkeypatch)
    selection.known.keep([retuned])
    selection.growth.added([retuned], "one effect", retuned)
    best = selection.known.best
    assert [candidate.key for candidate in best.candidates] == [CUSHION]
    # The drag leaves nearly all of the slug's force; retuning may have hidden a mass.
    assert pools == [{CUSHION, "tank.mass_error"}]


@pytest.mark.slow
def test_in_the_place_of_a_force_come_only_forces_that_do_nearly_the_same(
    search: tuple[ModelSelection, FreeRunFit], monkeypatch: pytest.MonkeyPatch
) -> None:
    selection, retuned = search
    delay = next(each for each in candidates(selection.growth.at) if each.key.startswith("sensor.sensor_delay"))
    selection.growth.pool = [*selection.growth.pool, delay]
    selection.known.keep([retuned])
    selection.growth.added([retuned], "one effect", retuned)
    best = selection.known.best_of(1)
    assert best is not None
    pools = pools_of_proposals(monkeypatch)
    selection._swapped(1)
    # The drag leaves all of the slug's force; a mass is hidden by what is set aside, a sensor makes no force.
    assert pools == [{CUSHION, delay.key, "tank.mass_error"}]


def test_without_a_remainder_single_effects_end_the_search(
    search: tuple[ModelSelection, FreeRunFit], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An effect that makes the baseline no more probable starts no further search."""
    selection, retuned = search
    uncovered = []
    monkeypatch.setattr(selection.known, "remains", lambda fit: False)
    monkeypatch.setattr(selection, "_uncovered", uncovered.append)
    assert selection.selected(retuned) == [retuned]
    assert uncovered == [retuned]


def frequency_hz(numbers: dict[str, float]) -> float:
    return float(np.sqrt(numbers[f"{CUSHION}.stiffness_n_per_m"] / numbers[f"{CUSHION}.mass_kg"]) / (2 * np.pi))


def test_a_limit_of_a_form_that_matches_is_not_passed_over(search: tuple[ModelSelection, FreeRunFit]) -> None:
    """Where a place sticks, dry friction jumps with the noise of its velocity; a spring behind a play does not."""
    selection, _ = search
    left = {
        "structure.friction_behind_play": 100.0,
        "structure.quadratic_drag": 150.0,
        "structure.hysteresis": 350.0,
        "structure.coulomb_friction": 400.0,
    }
    pool = [candidate for candidate in candidates(selection.growth.at) if candidate.key in left]

    class Matches(module._Matches):
        def __init__(self) -> None:
            self.candidates = pool
            self.of = {candidate.key: [] for candidate in pool}

        def left(self, candidate: Candidate) -> float:
            return left[candidate.key]

    found = Matches().hopeful()
    assert [candidate.effect.name for candidate in found] == [
        "coulomb_friction",
        "friction_behind_play",
        "quadratic_drag",
    ]


def test_a_limit_begins_where_the_form_matches_that_leaves_less(search: tuple[ModelSelection, FreeRunFit]) -> None:
    """Noise has spoilt its own match, which explains nothing."""
    selection, _ = search
    numbers = {
        "structure.friction_behind_play": {"force_n": 2.0, "stiffness_n_per_m": 4e4, "play_m": 1e-4},
        "structure.coulomb_friction": {"force_n": 9.0},
    }
    pool = [candidate for candidate in candidates(selection.growth.at) if candidate.key in numbers]
    behind_play, friction = sorted(pool, key=lambda candidate: len(candidate.names), reverse=True)

    class Matches(module._Matches):
        def __init__(self, misfit_of_friction: float) -> None:
            misfits = {behind_play.key: 0.1, friction.key: misfit_of_friction}
            self.candidates = pool
            self.of = {
                key: [Match(misfit, {f"{key}.{name}": value for name, value in numbers[key].items()})]
                for key, misfit in misfits.items()
            }

        def left(self, candidate: Candidate) -> float:
            return self.of[candidate.key][0].misfit

    spoilt, better = Matches(1.0), Matches(0.05)
    assert spoilt.explains(friction)
    assert spoilt.numbers(friction) == {"structure.coulomb_friction.force_n": 2.0}
    assert better.numbers(friction) == {"structure.coulomb_friction.force_n": 9.0}
    assert spoilt.numbers(behind_play) == spoilt.of[behind_play.key][0].numbers


def test_forces_are_fitted_in_the_order_of_what_they_leave_in_a_simulation(
    search: tuple[ModelSelection, FreeRunFit], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A loop that matches best along the motion leaves most of it; a limit comes before the form it is one of."""
    selection, retuned = search
    left = {
        "structure.hysteresis": 300.0,
        "structure.friction_behind_play": 100.0,
        "structure.coulomb_friction": 400.0,
    }
    pool = {candidate.key: candidate for candidate in candidates(selection.growth.at)}
    leading = [(pool[key], pool[key].starts()[0]) for key in left]
    monkeypatch.setattr(
        forward_growth,
        "fitted",
        lambda problem, start, **how: (FreeRunFit(problem.candidates, dict(start), 0.0, 0.0), None),
    )
    monkeypatch.setattr(
        forward_growth, "inflated_cost", lambda problem, fit, inflation: left[fit.candidates[-1].key]
    )
    found = selection.growth._in_order_of_simulation(retuned, leading)
    assert [candidate.effect.name for candidate, _ in found] == [
        "coulomb_friction",
        "friction_behind_play",
        "hysteresis",
    ]
