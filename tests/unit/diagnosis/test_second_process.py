"""Simulations in a second process are those of this one, and are made here where it cannot be had."""

from __future__ import annotations

import gc
import weakref
from pathlib import Path

import numpy as np
import pytest
from decays_under_friction import COULOMB, CUBIC, STRIBECK, Decays
from recorded_oscillators import decays, rig

from sloshlab.diagnosis import forked_process, rig_model
from sloshlab.diagnosis import second_process as module
from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.free_run_problem import FreeRunProblem, residuals_of_runs
from sloshlab.diagnosis.rig_model import RigModel
from sloshlab.diagnosis.second_process import SecondProcess
from sloshlab.recording import channels

pytestmark = pytest.mark.skipif(not forked_process.CAN_FORK, reason="no copies of a process here")


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Decays:
    return Decays(tmp_path_factory.mktemp("second"))


@pytest.fixture(autouse=True)
def of_small_problems_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_LEAST_COEFFICIENTS", 0)


def process_of(problem: FreeRunProblem) -> SecondProcess | None:
    return module.second_process(residuals_of_runs, problem.model, problem.runs, problem.candidates)


def made(problem: FreeRunProblem) -> SecondProcess:
    found = process_of(problem)
    assert found is not None
    return found


def test_it_gives_the_same_numbers_bit_for_bit(case: Decays, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = case.fits.problem([case.pool[COULOMB]])
    theta = problem.theta_of({**case.believed, **case.pool[COULOMB].starts()[0]})
    places = [theta + shift for shift in (0.0, 0.1, -0.1, 0.2)]
    beside = made(problem)
    residuals = problem.residuals(places)
    jacobian = problem.jacobian(theta, residuals[0], range(theta.size))
    assert made(problem) is beside
    assert beside.n_done > 0
    monkeypatch.setattr(forked_process, "N_WORKERS", 1)
    for found, expected in zip(residuals, problem.residuals(places), strict=True):
        np.testing.assert_array_equal(found, expected)
    alone = problem.jacobian(theta, residuals[0], range(theta.size))
    for unit in np.eye(theta.size):
        np.testing.assert_array_equal(jacobian.times(unit), alone.times(unit))


def test_it_is_started_again_for_an_unknown_effect(case: Decays) -> None:
    known = made(case.fits.problem([case.pool[COULOMB]]))
    problem = case.fits.problem([case.pool[COULOMB], case.pool[CUBIC]])
    assert case.pool[CUBIC] not in known.candidates
    restarted_from_prior = made(problem)
    assert restarted_from_prior is not known
    assert known.done(problem.runs[:1], case.believed, ()) is None  # it has ended
    forgotten = weakref.ref(known)
    del known
    gc.collect()
    assert forgotten() is None  # and holds no memory until the model ends
    assert made(case.fits.problem([case.pool[CUBIC]])) is restarted_from_prior
    alike = Candidate(case.pool[CUBIC].effect, case.pool[CUBIC].surroundings)  # equal, and yet another one
    assert made(case.fits.problem([alike])) is not restarted_from_prior


def test_all_is_done_here_where_it_has_ended_or_is_busy(case: Decays) -> None:
    problem = case.fits.problem([case.pool[STRIBECK]])
    theta = problem.theta_of({**case.believed, **case.pool[STRIBECK].starts()[0]})
    expected = problem.residual(theta)
    beside = made(problem)
    with beside._is_busy:
        assert beside.done(problem.runs, problem.values(theta), problem.candidates) is None
        np.testing.assert_array_equal(problem.residual(theta), expected)
    beside._process.kill()
    beside._process.join()
    assert beside.done(problem.runs, problem.values(theta), problem.candidates) is None
    np.testing.assert_array_equal(problem.residual(theta), expected)


def test_it_ends_with_its_model(tmp_path: Path) -> None:
    own = Decays(tmp_path)
    beside = made(own.fits.problem())
    model = weakref.ref(own.fits.model)
    assert beside._process.is_alive()
    del own
    gc.collect()
    assert model() is None
    assert not beside._process.is_alive()


def test_there_is_none_for_code_of_others_for_little_work_or_on_one_core(
    case: Decays, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with monkeypatch.context() as changed:
        changed.setattr(module, "_LEAST_COEFFICIENTS", 10**9)
        problem = Decays(tmp_path).fits.problem()
        assert process_of(problem) is None
    with monkeypatch.context() as changed:
        changed.setattr(problem.model, "may_be_forked", False)
        assert process_of(problem) is None
    with monkeypatch.context() as changed:
        changed.setattr(forked_process, "N_WORKERS", 1)
        assert process_of(problem) is None
    assert process_of(problem) is not None


def test_there_is_none_where_copies_of_the_recordings_would_take_the_memory(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    runs = decays((0.02, 0.01), 2.0)
    n_readings = sum(run.recording[name].size for run in runs for name in channels(run.recording))
    may_be = []
    for most in (n_readings, n_readings - 1):
        monkeypatch.setattr(rig_model, "_MOST_READINGS_TO_FORK", most)
        may_be.append(RigModel(rig(tmp_path), tmp_path, runs).may_be_forked)
    assert may_be == [True, False]
