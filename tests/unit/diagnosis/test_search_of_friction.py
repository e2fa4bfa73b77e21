"""What the search does with explanations, on decays under dry friction that scipy made: 0.3 N up, 0.1 N down."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from decays_under_friction import (
    ASYMMETRIC,
    CONSTANT,
    COULOMB,
    COULOMB_N,
    CUBIC,
    DOWN_N,
    MODE,
    STRIBECK,
    UP_N,
    Decays,
)
from recorded_oscillators import decays, effect, rig, surroundings

from pipelines.diagnosis.worker_threads import WorkerThreads
from sloshlab.diagnosis import effects
from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.case import Case
from sloshlab.diagnosis.explanation import Explanation, Findings
from sloshlab.diagnosis.force_starts import ForceStart
from sloshlab.diagnosis.free_run_fit import (
    INFLATION_STAGES,
    Start,
    coarsely_fitted,
    extended_to_all_runs,
    fitted,
    inflated_cost,
    refined,
)
from sloshlab.diagnosis.free_run_problem import FreeRunFit, FreeRunProblem, huber_cost
from sloshlab.diagnosis.observations import observations
from sloshlab.diagnosis.rig_model import RigModel
from sloshlab.diagnosis.search import (
    fits,
    model_search,
    refinement,
    screening,
    substitution,
    with_randomised_baselines,
)
from sloshlab.diagnosis.search.fits import Fits, best_fitting
from sloshlab.diagnosis.search.forward_selection import ForwardSelection
from sloshlab.diagnosis.search.refinement import Refinement
from sloshlab.diagnosis.search.screening import Screening
from sloshlab.diagnosis.search.substitution import Substitution
from sloshlab.diagnosis.split import Split

assert effects.__all__


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Decays:
    return Decays(tmp_path_factory.mktemp("friction"))


@pytest.fixture(scope="module")
def coulomb(case: Decays) -> Explanation:
    return case.fit(COULOMB)


def test_friction_of_one_direction_is_fitted_from_that_of_both(case: Decays, coulomb: Explanation) -> None:
    found = Substitution(case.fits).nesting_models(case.baseline, [coulomb], list(case.pool.values()), "")
    best = best_fitting([explanation for explanation in found if explanation.keys == (ASYMMETRIC,)])
    assert best is not None
    assert best.fit.cost <= coulomb.fit.cost
    up, down = (best.fit.values[f"{ASYMMETRIC}.force_{side}_n"] for side in ("up", "down"))
    assert up + down == pytest.approx(UP_N + DOWN_N, rel=0.05)


def test_it_is_fitted_where_it_clearly_differs_too(case: Decays, coulomb: Explanation) -> None:
    found = Substitution(case.fits).nesting_models(case.baseline, [coulomb], list(case.pool.values()), "")
    size = coulomb.fit.values[COULOMB_N]
    sides = [
        sorted(explanation.fit.values[f"{ASYMMETRIC}.force_{side}_n"] for side in ("up", "down"))
        for explanation in found
        if explanation.keys == (ASYMMETRIC,)
    ]
    assert sum(less <= 0.66 * size and more >= 1.34 * size for less, more in sides) >= 1


def test_a_nesting_model_is_left_out_where_it_is_known(case: Decays, coulomb: Explanation) -> None:
    """Only the forms that clearly differ are fitted again."""
    wide = case.fit(ASYMMETRIC)
    found = Substitution(case.fits).nesting_models(case.baseline, [coulomb, wide], list(case.pool.values()), "")
    assert len([explanation for explanation in found if explanation.keys == (ASYMMETRIC,)]) <= 2


def test_the_nested_model_replaces_the_nesting_one_once(case: Decays, coulomb: Explanation) -> None:
    stribeck = case.fit(STRIBECK)
    pool = list(case.pool.values())
    found = Substitution(case.fits).nested_models(stribeck, [stribeck], pool)
    assert [explanation.keys for explanation in found] == [(COULOMB,)]
    assert found[0].fit.values[COULOMB_N] == pytest.approx(coulomb.fit.values[COULOMB_N], rel=0.02)
    assert Substitution(case.fits).nested_models(stribeck, [stribeck, coulomb], pool) == []


def test_the_nested_model_is_refitted_from_a_better_optimum(case: Decays, coulomb: Explanation) -> None:
    stribeck, pool = case.fit(STRIBECK), list(case.pool.values())
    stuck = replace(coulomb, fit=replace(coulomb.fit, cost=1e9))
    [found] = Substitution(case.fits).nested_models(stribeck, [stribeck, stuck], pool)
    assert found.keys == (COULOMB,)
    assert found.fit.cost == pytest.approx(coulomb.fit.cost, rel=0.02)


def test_one_effect_takes_the_place_of_two(case: Decays, coulomb: Explanation) -> None:
    """Friction of two directions is what friction and a constant force are together."""
    both = case.fit(COULOMB, CONSTANT)
    found = Substitution(case.fits).replaced_by_single(both.fit, case.baseline, list(case.pool.values()))
    best = best_fitting(found)
    assert best is not None
    assert best.keys == (ASYMMETRIC,)
    assert best.fit.cost == pytest.approx(both.fit.cost, rel=0.02)
    up, down = (best.fit.values[f"{ASYMMETRIC}.force_{side}_n"] for side in ("up", "down"))
    assert up + down == pytest.approx(UP_N + DOWN_N, rel=0.05)


@pytest.mark.parametrize(("reached", "is_left"), [(0.4, True), (0.6, False)])
def test_a_look_alike_that_is_far_behind_is_not_fitted_to_the_end(
    case: Decays, reached: float, is_left: bool
) -> None:
    """Twice what was reached is far behind; after the first stage, that is, and with its softness."""
    problem = case.fits.problem([case.pool[CUBIC]])
    start = {**case.believed, **case.pool[CUBIC].starts()[0]}
    first, _ = fitted(problem, start, n_iterations=6, stages=INFLATION_STAGES[-3:-2], is_last=False)
    found = substitution._fitted_unless_abandoned(
        problem, start, reached * inflated_cost(problem, first, INFLATION_STAGES[-3])
    )
    whole, _ = fitted(problem, start, n_iterations=6, stages=INFLATION_STAGES[-3:])
    assert whole.cost < 0.999 * first.cost
    assert found.cost == pytest.approx((first if is_left else whole).cost, rel=1e-4)


def test_a_look_alike_replaces_one_of_two_effects(case: Decays) -> None:
    """A damper looks like friction; the constant force beside it stays. What is known is not tried again."""
    viscous = Candidate(effect("structure.viscous_damping"), case.pool[CUBIC].surroundings)
    candidates = (viscous, case.pool[CONSTANT])
    start = {**case.believed, **viscous.starts()[0], **case.pool[CONSTANT].starts()[0]}
    pair = case.fits.validated(fitted(case.fits.problem(candidates), start, n_iterations=6)[0])
    pool = [viscous, *(case.pool[key] for key in (COULOMB, CUBIC, CONSTANT))]
    [found] = Substitution(case.fits).exchanged(pair, case.baseline, [pair], pool)
    assert set(found.keys) == {CONSTANT, COULOMB}
    assert found.fit.cost < 0.5 * pair.fit.cost
    assert found.fit.values[COULOMB_N] == pytest.approx((UP_N + DOWN_N) / 2, rel=0.03)
    assert Substitution(case.fits).exchanged(pair, case.baseline, [pair, found], pool) == []


def test_what_is_no_nearer_than_the_baseline_takes_no_place(case: Decays, coulomb: Explanation) -> None:
    assert Substitution(case.fits).replaced_by_single(coulomb.fit, coulomb.fit, list(case.pool.values())) == []


def test_a_held_out_run_is_tried_with_other_releases(
    case: Decays, coulomb: Explanation, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fit that stays where it begins, as in a local minimum; two per cent more is the release."""
    release = "release of " + case.fits.held_out[0][0].run.name

    def stuck(problem: FreeRunProblem, start: Mapping[str, float], **_: object) -> tuple[FreeRunFit, None]:
        misfit = huber_cost(problem.residual(problem.theta_of(start)))
        return FreeRunFit(problem.candidates, dict(start), misfit, misfit), None

    monkeypatch.setattr(fits, "fitted", stuck)
    believed = case.believed[release]
    beside, right = (
        case.fits.validated(replace(coulomb.fit, values={**coulomb.fit.values, release: share * believed}))
        for share in (1 / 1.02, 1.0)
    )
    assert beside.held_out == pytest.approx(right.held_out, rel=1e-6)
    monkeypatch.setattr(fits, "_RELEASE_OFFSETS", (0.0,))
    alone = replace(coulomb.fit, values={**coulomb.fit.values, release: believed / 1.02})
    assert case.fits.validated(alone).held_out > 2 * right.held_out


def with_baseline_at_bounds(case: Decays, coulomb: Explanation) -> Explanation:
    """Half of the friction, and a baseline that hides the rest as well as it can."""
    baseline = {**coulomb.fit.values, "damping of mode 1": 1.25, "modal mass of mode 1": 1.0125}
    values = {**baseline, COULOMB_N: 0.5 * coulomb.fit.values[COULOMB_N]}
    return replace(coulomb, fit=replace(coulomb.fit, values=values, cost=case.baseline.cost - 100.0))


def test_an_effect_is_fitted_again_from_what_is_believed(
    case: Decays, coulomb: Explanation, monkeypatch: pytest.MonkeyPatch
) -> None:
    coarsely_fitted: list[Mapping[str, float]] = []

    def watched(problem: FreeRunProblem, start: Mapping[str, float]) -> Any:
        coarsely_fitted.append(start)
        return fitted(problem, start)

    monkeypatch.setattr(refinement, "fitted", watched)
    [found] = Refinement(case.fits).restarted_from_prior(case.baseline, [with_baseline_at_bounds(case, coulomb)])
    assert found.keys == (COULOMB,)
    assert found.fit.values[COULOMB_N] == pytest.approx(coulomb.fit.values[COULOMB_N], rel=0.03)
    [start] = coarsely_fitted
    assert {name: value for name, value in start.items() if name in case.believed} == case.believed
    assert start[COULOMB_N] == pytest.approx(coulomb.fit.values[COULOMB_N])


def test_a_mode_is_fitted_again_from_other_frequencies(case: Decays, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the nearest of its sizes, beside what is believed; its own and the two best beginnings to the end."""
    mode = Candidate(effect(MODE), case.pool[COULOMB].surroundings)
    frequency = f"{MODE}.frequency_hz"
    numbers = {frequency: 10.0, f"{MODE}.damping_ratio": 0.02, f"{MODE}.participation": 0.03}
    fit = FreeRunFit((mode,), {**case.baseline.values, **numbers}, case.baseline.cost - 100.0, 0.0)
    first: list[Mapping[str, float]] = []
    last: list[Mapping[str, float]] = []

    def beginning(problem: FreeRunProblem, starts: Sequence[Start]) -> Any:
        [start] = starts
        first.append(start.values)
        moved = {**start.values, frequency: 1.01 * start.values[frequency]}
        trouble = "does not run" if start.values[frequency] == pytest.approx(12.188, rel=1e-3) else ""
        coarse_fit = replace(fit, values=moved, trouble=trouble)
        return SimpleNamespace(fit=coarse_fit, cost=abs(start.values[frequency] - 12.0))

    def watched(problem: FreeRunProblem, start: Mapping[str, float]) -> Any:
        last.append(start)
        return replace(fit, values=dict(start), cost=fit.cost - 50.0 + abs(start[frequency] - 12.0)), None

    monkeypatch.setattr(refinement, "coarsely_fitted", beginning)
    monkeypatch.setattr(refinement, "fitted", watched)
    [found] = Refinement(case.fits).restarted_from_prior(case.baseline, [Explanation(fit, 0.0, 1.0)])
    begun_hz, ended_hz = ([start[frequency] for start in starts] for starts in (first, last))
    np.testing.assert_allclose(begun_hz, [7.0, 8.041, 9.237, 10.61, 12.188, 14.0], rtol=1e-3)
    np.testing.assert_allclose(ended_hz, [10.0, 1.01 * 10.61, 1.01 * 14.0], rtol=1e-3)
    assert all(start[name] == value for start in (*first, *last) for name, value in case.believed.items())
    assert {start[f"{MODE}.participation"] for start in first} <= {0.03, 0.06, 0.12}
    assert found.fit.values[frequency] == pytest.approx(1.01 * 10.61, rel=1e-3)


@pytest.mark.parametrize(
    ("is_dry", "is_complete", "also_general", "is_tried"),
    [
        pytest.param(True, False, False, True, id="something is left"),
        pytest.param(True, True, True, True, id="an effect of more numbers is best"),
        pytest.param(True, True, False, False, id="nothing is left"),
        pytest.param(False, False, False, False, id="no dry friction"),
    ],
)
def test_beside_dry_friction_simple_effects_are_fitted_from_other_sizes(
    case: Decays,
    coulomb: Explanation,
    monkeypatch: pytest.MonkeyPatch,
    *,
    is_dry: bool,
    is_complete: bool,
    also_general: bool,
    is_tried: bool,
) -> None:
    """Each local minimum keeps what begins in it; here the one about twice the size is the deepest."""
    size, cost = coulomb.fit.values[COULOMB_N], coulomb.fit.cost
    coarsely_fitted: list[Mapping[str, float]] = []

    def stays(problem: FreeRunProblem, start: Mapping[str, float]) -> Any:
        coarsely_fitted.append(start)
        left = cost - 50.0 + 10.0 * abs(start[COULOMB_N] / size - 2.0)
        return replace(coulomb.fit, values=dict(start), cost=left), None

    monkeypatch.setattr(refinement, "fitted", stays)
    monkeypatch.setattr(Fits, "is_complete", lambda self, explanation: is_complete)
    terms = (SimpleNamespace(kind=SimpleNamespace(dry_friction=is_dry)),)
    monkeypatch.setattr(case.fits.model, "twin", SimpleNamespace(terms=terms))
    monkeypatch.setattr(case.fits, "validated", lambda fit: Explanation(fit, 0.0, 1.0))
    known = [coulomb]
    if also_general:
        general = Candidate(effect(STRIBECK), case.pool[COULOMB].surroundings)
        known.append(replace(coulomb, fit=replace(coulomb.fit, candidates=(general,), cost=cost - 10.0)))
    found = Refinement(case.fits).from_other_sizes(case.baseline, known)
    if not is_tried:
        assert (found, coarsely_fitted) == ([], [])
        return
    np.testing.assert_allclose([start[COULOMB_N] / size for start in coarsely_fitted], [0.5, 0.75, 1.5, 2.0, 3.0])
    assert all(start[name] == value for start in coarsely_fitted for name, value in case.baseline.values.items())
    [best] = found
    assert best.fit.values[COULOMB_N] == pytest.approx(2.0 * size)


def test_rivals_with_the_baseline_at_its_bounds_are_refitted_from_the_prior(
    case: Decays, coulomb: Explanation
) -> None:
    """The best one and what is nearly as good, not what is far behind."""
    best = with_baseline_at_bounds(case, coulomb)
    other = case.fit(STRIBECK)
    near, far = (replace(other, fit=replace(other.fit, cost=best.fit.cost + more)) for more in (23.0, 25.0))
    found = Refinement(case.fits).rivals_restarted_from_prior([near, best])
    assert {explanation.keys for explanation in found} <= {(COULOMB,), (STRIBECK,)}
    assert found[0].keys == (COULOMB,)
    assert found[0].fit.values[COULOMB_N] == pytest.approx(coulomb.fit.values[COULOMB_N], rel=0.03)
    assert not case.fits.rests_on_baseline_bounds(found[0].fit)
    assert Refinement(case.fits).rivals_restarted_from_prior([far, best]) == []
    relaxed = replace(coulomb, fit=replace(coulomb.fit, cost=best.fit.cost))
    assert not case.fits.rests_on_baseline_bounds(relaxed.fit)
    assert Refinement(case.fits).rivals_restarted_from_prior([near, relaxed]) == []
    assert Refinement(case.fits).rivals_restarted_from_prior([]) == []


def test_what_gains_nothing_is_not_fitted_again(case: Decays, coulomb: Explanation) -> None:
    no_gain = replace(coulomb, fit=replace(coulomb.fit, cost=case.baseline.cost - 10.0))
    assert Refinement(case.fits).restarted_from_prior(case.baseline, [no_gain]) == []


def findings(case: Decays, *explanations: Explanation) -> Findings:
    baseline = case.fits.validated(case.baseline)
    return Findings(
        cast(Case, SimpleNamespace(names_by_test=list)), case.fits.model, Split((), (), ()), cast(Any, None),
        case.fits.fitting, case.fits.held_out, baseline, baseline, list(explanations), [], {}, {},
    )  # fmt: skip


def test_numbers_spread_as_far_as_what_is_believed_leaves_them(case: Decays, coulomb: Explanation) -> None:
    """Friction is known to the modal mass and the gains, a per cent each, but not to a tenth of that."""
    other = case.fit(CUBIC)
    found = with_randomised_baselines(findings(case, other, coulomb), coulomb).explanations
    assert [explanation.keys for explanation in found] == [(COULOMB,), (CUBIC,)]
    assert found[1].spread == {}
    assert 6e-3 < found[0].spread[COULOMB_N] / coulomb.fit.values[COULOMB_N] < 2.5e-2


def test_a_better_place_takes_the_place_of_what_was_found(case: Decays, coulomb: Explanation) -> None:
    worse = case.fits.validated(with_baseline_at_bounds(case, coulomb).fit)
    at_worse = huber_cost(
        case.fits.problem_of(worse.fit).residual(case.fits.problem_of(worse.fit).theta_of(worse.fit.values))
    )
    worse = replace(worse, fit=replace(worse.fit, misfit=at_worse, cost=at_worse + 4.0))
    [found] = with_randomised_baselines(findings(case, worse), worse).explanations
    assert found.fit.cost < 0.5 * at_worse
    assert found.fit.values[COULOMB_N] == pytest.approx(coulomb.fit.values[COULOMB_N], rel=0.03)


class LastFirst:
    """Does work in the reverse order."""

    def map(self, function: Callable[[Any], Any], items: Iterable[Any], /) -> list[Any]:
        return [function(item) for item in reversed(list(items))][::-1]


@pytest.mark.parametrize("executor", [LastFirst(), WorkerThreads(2), WorkerThreads(5)])
def test_residuals_and_derivatives_do_not_depend_on_who_works_in_which_order(
    case: Decays, coulomb: Explanation, monkeypatch: pytest.MonkeyPatch, executor: Any
) -> None:
    problem = case.fits.problem_of(coulomb.fit)
    at_fit = problem.theta_of(coulomb.fit.values)
    places = [at_fit + shift for shift in (0.0, 0.3, -0.2, 0.1)]
    units = np.eye(at_fit.size)

    def found() -> tuple[Any, ...]:
        # what is kept from before must not answer
        problem.model._truths.clear()
        residuals = problem.residuals(places)
        jacobian = problem.jacobian(at_fit, residuals[0], range(at_fit.size))
        return np.array(residuals), np.array([jacobian.times(unit) for unit in units])

    in_turn = found()
    monkeypatch.setattr(problem.model, "executor", executor)
    for by_others, expected in zip(found(), in_turn, strict=True):
        np.testing.assert_array_equal(by_others, expected)
    for residual, place in zip(in_turn[0], places, strict=True):
        problem.model._truths.clear()
        np.testing.assert_array_equal(residual, problem.residual(place))


def test_the_best_fit_is_taken_to_convergence(case: Decays) -> None:
    coarsely_fitted = case.fit(COULOMB, n_iterations=1)
    found = Refinement(case.fits).converged(coarsely_fitted.fit, [coarsely_fitted], [])
    best = best_fitting(found)
    assert best is not None
    assert best.fit.cost < coarsely_fitted.fit.cost
    assert best.fit.values[COULOMB_N] == pytest.approx((UP_N + DOWN_N) / 2, rel=0.05)


def test_each_of_a_pair_is_fitted_alone(case: Decays) -> None:
    pair = case.fit(COULOMB, CUBIC)
    alone = Refinement(case.fits).backward_eliminated([pair])
    assert [explanation.keys for explanation in alone] == [(COULOMB,), (CUBIC,)]
    assert alone[0].fit.cost < alone[1].fit.cost
    assert Refinement(case.fits).backward_eliminated([]) == []


def test_the_baseline_is_retuned_from_an_explanation_and_never_worse(case: Decays, coulomb: Explanation) -> None:
    numbers = {name: value for name, value in case.believed.items()}
    poor = FreeRunFit((), numbers, 1e12, 1e12)
    before = case.fits.validated(poor)
    after = Refinement(case.fits).retuned_from([coulomb], before)
    assert after.keys == ()
    assert after.fit.cost <= 1.001 * case.baseline.cost
    assert Refinement(case.fits).retuned_from([], before) is before


def test_numbers_at_their_bounds_are_eased_to_what_is_believed(case: Decays) -> None:
    problem = case.fits.problem()
    values = {**case.believed, "damping of mode 1": 1.25, "frequency of mode 1": 1.003}
    fit = FreeRunFit((), problem.values(problem.theta_of(values)), 0.0, 0.0)
    assert case.fits.rests_on_baseline_bounds(fit)
    reset_from_bounds = case.fits.reset_from_bounds(fit)
    assert reset_from_bounds["damping of mode 1"] == case.believed["damping of mode 1"]
    assert reset_from_bounds["frequency of mode 1"] == pytest.approx(1.003)
    assert not case.fits.rests_on_baseline_bounds(FreeRunFit((), case.believed, 0.0, 0.0))


def test_screening_keeps_what_explains_and_begins_it_near(case: Decays, monkeypatch: pytest.MonkeyPatch) -> None:
    """Places to begin from afar are sought for those alone that are fitted: each costs simulations."""
    sought: list[str] = []

    def starts_from_prior_and_fit(
        self: Screening, base: object, problem: FreeRunProblem, *others: Any
    ) -> list[Start]:
        sought.append(problem.candidates[-1].key)
        return plain(self, base, problem, *others)  # type: ignore[arg-type]

    plain = Screening._starts_from_prior_and_fit
    monkeypatch.setattr(Screening, "_starts_from_prior_and_fit", starts_from_prior_and_fit)
    monkeypatch.setattr(screening, "_MOST_FITTED", 3)
    problem = case.fits.problem()
    theta = problem.theta_of(case.baseline.values)
    jacobian = problem.jacobian(theta, problem.residual(theta), range(theta.size))
    all_screened = Screening(case.fits).chosen(
        case.baseline, jacobian, list(case.pool.values()), "", (0.3, 0.1, 0.03, 0.01, 0.0), is_near=False
    )
    keys = [screened.candidate.key for screened in all_screened]
    assert COULOMB in keys
    assert sought == keys
    assert len(keys) < len(case.pool)
    for screened in all_screened:
        assert any(start.is_near for start in screened.starts)
        assert (screened.gains > 0).any()


class Repeated(Decays):
    """Two repeats of one test and one of another are fitted."""

    def __init__(self, folder: Path) -> None:
        runs = decays((0.014, 0.014, 0.006, 0.01), duration_s=2.0, friction_n=(UP_N, DOWN_N))
        self.model = RigModel(rig(folder), folder, runs)
        observed = [observations(run, self.model.compared(run)) for run in runs]
        tests = [["decay_0", "decay_1"], ["decay_2"], ["decay_3"]]
        self.fits = Fits(self.model, observed[:3], observed[3:], lambda what, done, of: None, tests)
        self.believed = self.model.believed
        self.pool = {COULOMB: Candidate(effect(COULOMB), surroundings(self.model))}
        self.baseline = fitted(self.fits.problem(), self.believed, n_iterations=4)[0]


@pytest.fixture(scope="module")
def repeated(tmp_path_factory: pytest.TempPathFactory) -> Repeated:
    return Repeated(tmp_path_factory.mktemp("repeated"))


def test_one_repeat_of_every_test_is_looked_at(case: Decays, repeated: Repeated) -> None:
    few = repeated.fits.one_repeat_per_test
    assert [run[0].run.name for run in few.fitting] == ["decay_0", "decay_2"]
    assert few is repeated.fits.one_repeat_per_test
    assert few.one_repeat_per_test is few
    assert few.failed is repeated.fits.failed
    assert few.screened is repeated.fits.screened
    assert case.fits.one_repeat_per_test is case.fits
    assert repeated.fits.n_coefficients > 1.4 * few.n_coefficients


def test_the_part_of_a_jacobian_is_that_of_fewer_runs(repeated: Repeated) -> None:
    few, fit = repeated.fits.one_repeat_per_test, repeated.baseline
    part = few.jacobian_of_part(repeated.fits.jacobian(fit), fit, repeated.fits)
    expected = few.jacobian(fit)
    assert part.n_columns == expected.n_columns == len(few.problem().names) < len(repeated.fits.problem().names)
    for unit in np.eye(part.n_columns):
        np.testing.assert_allclose(part.times(unit), expected.times(unit), rtol=1e-9, atol=1e-9)


def test_a_coarse_fit_to_some_runs_is_refined_on_all(repeated: Repeated) -> None:
    few, fits, base = repeated.fits.one_repeat_per_test, repeated.fits, repeated.baseline
    candidate = repeated.pool[COULOMB]
    jacobian = fits.jacobian(base)
    start = Start({**base.values, **candidate.starts()[0]}, is_near=True)
    coarse_fit = coarsely_fitted(
        few.problem((candidate,)), [start], near=few.jacobian_of_part(jacobian, base, fits)
    )
    whole = extended_to_all_runs(coarse_fit, fits.problem((candidate,)), base.values, jacobian)
    assert whole.fit.values["release of decay_1"] == base.values["release of decay_1"]
    assert whole.fit.values[COULOMB_N] == coarse_fit.fit.values[COULOMB_N]
    assert whole.jacobian.n_columns == len(fits.problem((candidate,)).names)
    done = refined(whole)
    assert done.values[COULOMB_N] == pytest.approx(0.5 * (UP_N + DOWN_N), rel=0.15)
    assert done.cost < base.cost
    [found, *_] = ForwardSelection(fits).fitted(base, jacobian, [candidate], "")
    assert found.fit.cost == pytest.approx(done.cost, rel=0.02)
    assert set(found.fit.names) == {*fits.problem().names, COULOMB_N}


def test_a_multimodal_effect_starts_from_the_best_of_places_and_sizes(
    case: Decays, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its force was like the missing one at two places, both too small; what is smooth starts at the first."""
    near, far = (
        {f"{ASYMMETRIC}.force_up_n": up, f"{ASYMMETRIC}.force_down_n": 0.5 * DOWN_N} for up in (0.15, 0.02)
    )
    smooth = case.pool[ASYMMETRIC]
    sudden = replace(smooth, effect=replace(smooth.effect, sought_at=lambda at: [{}]))
    places = SimpleNamespace(of=lambda candidate: ForceStart(far, 0.1, (near,)))
    monkeypatch.setattr(Screening, "_force_starts", lambda self, base: places)
    base = replace(case.baseline, values={**case.baseline.values, **case.believed})
    jacobian = case.fits.jacobian(base)

    def begun_from(candidate: Candidate) -> list[dict[str, float]]:
        [screened] = Screening(case.fits).chosen(
            base, jacobian, [candidate], "", INFLATION_STAGES[-2:], is_near=True
        )
        return [{name: start.values[name] for name in near} for start in screened.starts]

    assert begun_from(smooth)[0] == far
    twice = {name: pytest.approx(2.0 * value) for name, value in near.items()}
    assert begun_from(sudden)[0] == twice


@pytest.mark.parametrize("other_size_gains", [0.0, 100.0])
def test_look_alikes_are_fitted_from_a_better_size(
    case: Decays, coulomb: Explanation, monkeypatch: pytest.MonkeyPatch, other_size_gains: float
) -> None:
    """Where the best effect has left its local minimum, look-alikes may still be in it; six of them."""
    other = replace(coulomb, fit=replace(coulomb.fit, cost=coulomb.fit.cost - other_size_gains + 1.0))
    alike, asked = case.fit(STRIBECK, n_iterations=1), []

    def look_alikes(self: Substitution, base: FreeRunFit, kept: Any, pool: Any, what: str, most: int) -> Any:
        asked.append((base, kept, most))
        return [alike]

    monkeypatch.setattr(Refinement, "from_other_sizes", lambda self, base, known: [other])
    monkeypatch.setattr(Substitution, "look_alikes", look_alikes)
    found = model_search._restarted_from_other_sizes(case.fits, case.baseline, [coulomb], list(case.pool.values()))
    if other_size_gains:
        assert found == [other, alike]
        assert asked == [(case.baseline, [other], 6)]
    else:
        assert (found, asked) == ([other], [])
