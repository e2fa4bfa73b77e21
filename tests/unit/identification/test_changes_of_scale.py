"""What masses, forces and lengths do in proportion, by closed forms, and fits of friction that depend on it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded_oscillators import MASS_KG, decays, driven, effect, rig, surroundings

from sloshlab.identification.block_jacobian import BlockJacobian
from sloshlab.identification.free_run_fit import _metric, fitted
from sloshlab.identification.free_run_problem import FreeRunProblem
from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate

assert effects.__all__
FRICTION, MASS = "structure.coulomb_friction.force_n", "modal mass of mode 1"
FRICTION_N = 0.37


def problem_of(folder: Path, keys: Sequence[str], **physics: object) -> FreeRunProblem:
    """All numbers free."""
    model = RigModel(rig(folder), folder, decays(**physics))  # type: ignore[arg-type]
    chosen = [Candidate(effect(key), surroundings(model), "") for key in keys]
    return FreeRunProblem(model, [observations(run, model.compared(run)) for run in model.runs], chosen)


def with_force(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """A force cell below the whole mass."""
    return {**channels, "force_interface": -MASS_KG * channels["acceleration_tip"]}


@pytest.fixture(scope="module")
def of_friction(tmp_path_factory: pytest.TempPathFactory) -> FreeRunProblem:
    """Dry friction, recorded."""
    folder = tmp_path_factory.mktemp("friction")
    return problem_of(folder, ["structure.coulomb_friction"], friction_n=(FRICTION_N, FRICTION_N))


def test_readings_stay_where_all_numbers_grow_as_their_unit_becomes_smaller(tmp_path: Path) -> None:
    """A mass or a length alone changes them a thousand times as much."""
    problem = problem_of(
        tmp_path,
        ["structure.coulomb_friction", "structure.quadratic_drag", "structure.cubic_stiffness"],
        friction_n=(FRICTION_N, FRICTION_N),
    )
    numbers = {FRICTION: FRICTION_N, "structure.quadratic_drag.drag_n_s2_per_m2": 0.5}
    numbers |= {"structure.cubic_stiffness.stiffness_n_per_m3": 2e5}
    theta = problem.theta_of({**problem.model.believed, **numbers})
    at = problem.residual(theta)
    of_mass, of_length = problem.changes_of_scale(theta)
    alone = {"mass": np.where(np.arange(theta.size) == problem.names.index(MASS), of_mass, 0.0)}
    releases = [i for i, name in enumerate(problem.names) if name.startswith("release")]
    alone["length"] = np.where(np.isin(np.arange(theta.size), releases), of_length, 0.0)
    for direction, one in zip((of_mass, of_length), alone.values(), strict=True):
        change = problem.residual(theta + 0.03 * direction) - at
        assert np.linalg.norm(change) < 1e-3 * np.linalg.norm(problem.residual(theta + 0.03 * one) - at)


def test_a_jacobian_is_right_for_changes_of_scale(of_friction: FreeRunProblem) -> None:
    problem = of_friction
    theta = problem.theta_of({**problem.model.believed, FRICTION: FRICTION_N})
    at = problem.residual(theta)
    jacobian = problem.jacobian(theta, at, range(theta.size))
    for direction in problem.changes_of_scale(theta):
        # As wide as the differences by which it was made.
        change = problem.residual(theta + 0.005 * direction) - at
        np.testing.assert_allclose(jacobian.times(0.005 * direction), change, atol=1e-9 * np.abs(at).max())


def test_a_scale_that_no_gain_is_free_to_take_is_none(of_friction: FreeRunProblem) -> None:
    """With all numbers held but one nothing grows in proportion."""
    held = {name: value for name, value in of_friction.model.believed.items() if name != MASS}
    problem = FreeRunProblem(of_friction.model, of_friction.runs, [], held)
    assert problem.changes_of_scale(np.zeros(1)) == []


def test_units_that_change_the_same_numbers_alike_count_once(tmp_path: Path) -> None:
    """Only forces are free: a force is a mass times a length."""
    model = RigModel(rig(tmp_path), tmp_path, driven(changed=with_force))
    candidate = Candidate(effect("structure.coulomb_friction"), surroundings(model), "")
    held = {name: value for name, value in model.believed.items() if name != "gain of force_interface"}
    observed = [observations(run, model.compared(run)) for run in model.runs]
    problem = FreeRunProblem(model, observed, [candidate], held)
    theta = problem.theta_of({FRICTION: FRICTION_N})
    [direction] = problem.changes_of_scale(theta)
    np.testing.assert_allclose(np.abs(direction), [1.0, 0.01 * FRICTION_N / problem.scales[1]])
    fit, _ = fitted(problem, problem.values(theta), stages=(0.0,))
    assert np.isfinite(list(fit.values.values())).all()


def test_differences_are_as_narrow_as_is_asked(of_friction: FreeRunProblem) -> None:
    """And none is wider than without."""
    problem = of_friction
    theta = problem.theta_of({**problem.model.believed, FRICTION: FRICTION_N})
    at, moved = problem.residual(theta), list[np.ndarray]()
    problem.values = lambda place, values=problem.values: moved.append(place - theta) or values(place)  # type: ignore
    try:
        problem.jacobian(theta, at, range(theta.size))
        n = len(moved)
        problem.jacobian(theta, at, range(theta.size), most=np.full(theta.size, 1 / 400.0))
    finally:
        del problem.values
    wide, fine = np.abs(np.array(moved[:n])), np.abs(np.array(moved[n:]))
    columns = np.arange(theta.size)
    fine_steps = np.array([fine[fine[:, i] > 0][:, i].min() for i in columns])
    wide_steps = np.array([wide[wide[:, i] > 0][:, i].min() for i in columns])
    np.testing.assert_allclose(fine_steps, np.minimum(wide_steps, 1 / 400.0))


def test_slopes_are_the_norms_of_columns() -> None:
    columns = np.random.default_rng(0).normal(size=(3, 7))
    columns[0, :4] = 0.0
    found = BlockJacobian.of_columns(list(columns), [4, 3]).slopes()
    np.testing.assert_allclose(found, np.linalg.norm(columns, axis=1))


def test_damping_does_not_hold_a_change_of_scale() -> None:
    """Two numbers of which the ratio is known to 1e-4 and the scale to 1: Marquardt's metric alone holds it."""
    hessian = 1e8 * np.array([[1.0, -1.0], [-1.0, 1.0]]) + np.eye(2)
    scale = np.ones(2)
    assert scale @ _metric(hessian, []) @ scale == pytest.approx(2e8, rel=1e-6)
    found = _metric(hessian, [scale])
    assert scale @ found @ scale == pytest.approx(scale @ hessian @ scale)
    np.testing.assert_allclose(found, found.T)
    assert np.linalg.eigvalsh(found).min() > 0


def test_two_changes_of_scale_take_two_places() -> None:
    """The metric is diagonal in a basis with both, whichever numbers they share."""
    generator = np.random.default_rng(1)
    root = generator.normal(size=(4, 4))
    hessian = root @ root.T
    directions = [np.array([1.0, 1.0, 0.0, 0.0]), np.array([1.0, 0.9, 0.2, 0.0])]
    found = _metric(hessian, directions)
    for direction in directions:
        assert direction @ found @ direction == pytest.approx(direction @ hessian @ direction)
    assert directions[0] @ found @ directions[1] == pytest.approx(0.0, abs=1e-9)


def test_friction_and_masses_that_are_off_in_proportion_come_back(of_friction: FreeRunProblem) -> None:
    """Decays tell their ratio alone, so that masses come back to what is believed, and friction with them."""
    problem = of_friction
    start = {**problem.model.believed, FRICTION: FRICTION_N}
    best, _ = fitted(problem, start)
    off = {**best.values, FRICTION: 1.03 * best.values[FRICTION], MASS: 1.03 * best.values[MASS]}
    found, _ = fitted(problem, off, stages=(0.0,))
    assert found.cost - best.cost < 1.0
    assert found.values[FRICTION] == pytest.approx(FRICTION_N, rel=0.01)


def test_differences_at_the_optimum_change_the_cost_by_what_the_end_of_a_fit_neglects(
    of_friction: FreeRunProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A thirtieth of a thousandth; those with which fits of friction ended change it far more."""
    problem, asked = of_friction, list[tuple[np.ndarray, np.ndarray]]()
    original = FreeRunProblem.jacobian

    def recorded(self: FreeRunProblem, theta: np.ndarray, *others: object, **how: object) -> BlockJacobian:
        if how.get("most") is not None:
            asked.append((theta.copy(), np.asarray(how["most"])))
        return original(self, theta, *others, **how)  # type: ignore[arg-type]

    monkeypatch.setattr(FreeRunProblem, "jacobian", recorded)
    fitted(problem, {**problem.model.believed, FRICTION: 0.9 * FRICTION_N}, stages=(0.03, 0.0))
    theta, most = asked[0]
    at = problem.residual(theta)
    neglected = 3e-5 * (problem.misfit(at) + problem.prior_cost(theta))
    stiff = [problem.names.index(name) for name in ("frequency of mode 1", FRICTION)]
    for i in stiff:
        moved = theta.copy()
        moved[i] += most[i]
        assert neglected / 4 < np.sum((problem.residual(moved) - at) ** 2) < 4 * neglected
        moved[i] = theta[i] + 0.005
        assert np.sum((problem.residual(moved) - at) ** 2) > 10 * neglected


def test_a_fit_whose_steps_shrink_slowly_makes_its_derivatives_anew(
    of_friction: FreeRunProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With slopes five times too large every step succeeds, and is a fifth of what it should be."""
    problem, made = of_friction, list[str]()
    theta = problem.theta_of({**problem.model.believed, FRICTION: FRICTION_N})
    theta[: problem.n_baseline] += 0.3 * problem.changes_motion
    right = problem.jacobian(theta, problem.residual(theta), range(theta.size))
    too_large = [5.0 * right.times(unit) for unit in np.eye(theta.size)]
    known = BlockJacobian.of_columns(too_large, [each.spectra.size for run in problem.runs for each in run])
    for name in ("jacobian", "residual"):
        original = getattr(FreeRunProblem, name)

        def noted(
            self: FreeRunProblem, *of: object, name: str = name, original: Any = original, **how: object
        ) -> object:
            made.append(name)
            return original(self, *of, **how)

        monkeypatch.setattr(FreeRunProblem, name, noted)
    fitted(problem, problem.values(theta), stages=(0.0,), n_iterations=10, known=known)
    assert made.index("jacobian") <= 4
