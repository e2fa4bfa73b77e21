"""The study: all cases, the best first, nothing trained twice, other signals trained anew."""

import numpy as np
import pytest

from pipelines.liquid_model.sensitivity_study import MODEL_NAME, RESULT_NAME, _Task, sensitivity_study, train_case
from pipelines.liquid_model.study_cases import SOURCE_CASES, CaseResult, StudyCase, picked
from sloshlab.errors import AnalysisError, InputError
from sloshlab.reduced_order_model.regressors import Run
from sloshlab.reduced_order_model.storage import load_model
from sloshlab.reduced_order_model.training import TrainingSettings

pytestmark = pytest.mark.usefixtures("programs_are_forks")

SETTINGS = TrainingSettings(n_epochs=3)
CASES = (StudyCase("nfir", 2, 0, 2), StudyCase("nfir", 6, 0, 6), StudyCase("noe", 1, 1, 2))


def run(seed: int) -> Run:
    """y(k) = sin of the sum of the last four inputs."""
    x = np.random.default_rng(seed).normal(size=300)
    y = np.sin(np.convolve(x, [0, 0.5, 0.5, 0.5, 0.5])[: x.size])
    return Run(x, y)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder, told = tmp_path_factory.mktemp("study"), []
    results = sensitivity_study(
        [run(1), run(2)], [run(3)], 100.0, folder, SETTINGS, cases=CASES,
        on_case=lambda result, done, n: told.append((result.case, done, n)),
    )  # fmt: skip
    return folder, results, told


def test_all_cases_are_trained_and_the_best_comes_first(study):
    folder, results, told = study
    assert {result.case for result in results} == set(CASES)
    errors = [result.validation_mse for result in results]
    assert errors == sorted(errors)
    assert results[0].case == CASES[1]  # the only one that sees all four inputs
    assert [done for _, done, _ in told] == [1, 2, 3]
    for result in results:
        model = load_model(folder / result.case.name / MODEL_NAME)
        assert model.network.n_parameters == result.n_parameters


def test_nothing_is_trained_twice(study):
    folder, results, _ = study
    before = {case.name: (folder / case.name / RESULT_NAME).stat().st_mtime_ns for case in CASES}
    told = []
    again = sensitivity_study(
        [run(1), run(2)], [run(3)], 100.0, folder, SETTINGS, cases=CASES, on_case=lambda *args: told.append(args)
    )
    assert again == results
    assert not told
    assert before == {case.name: (folder / case.name / RESULT_NAME).stat().st_mtime_ns for case in CASES}


def test_other_signals_or_a_damaged_result_are_trained_anew(study, tmp_path):
    told = []
    case = CASES[0]
    for validation, damaged in ((run(3), False), (run(4), False), (run(4), True)):
        if damaged:
            (tmp_path / case.name / RESULT_NAME).write_text("{")
        sensitivity_study(
            [run(1)],
            [validation],
            100.0,
            tmp_path,
            SETTINGS,
            cases=[case],
            on_case=lambda *case: told.append(case),
        )
    assert len(told) == 3


def test_the_cases_of_the_source():
    assert sum(case.structure == "nfir" for case in SOURCE_CASES) == 24
    assert sum(case.structure == "noe" for case in SOURCE_CASES) == 3
    assert len({case.name for case in SOURCE_CASES}) == 27


def test_a_study_of_nothing_is_refused(tmp_path):
    with pytest.raises(InputError, match="study"):
        sensitivity_study([run(1)], [run(2)], 100.0, tmp_path, SETTINGS, cases=[])


def result(name: tuple[str, int, int, int], rms: float, n_parameters: int) -> CaseResult:
    return CaseResult(StudyCase(*name), rms**2, rms**2, n_parameters, 3, 1.0, "epochs used up")


def test_the_smallest_validation_error_is_picked_and_a_lighter_one_named():
    results = [
        result(("nfir", 70, 0, 35), 1.000, 2485),
        result(("nfir", 60, 0, 20), 1.019, 1220),
        result(("nfir", 50, 0, 5), 1.021, 255),
        CaseResult(StudyCase("noe", 2, 2, 10), np.inf, np.inf, 0, 0, 0.0, "no stable model"),
    ]
    pick = picked(results[::-1])
    assert (pick.best, pick.lighter) == (results[0], results[1])
    assert "nfir_70_35 has the smallest error" in pick.reason
    assert "next is nfir_60_20, 1.9 % behind" in pick.reason
    assert "1220 instead of 2485" in pick.reason
    assert picked(results[:1]).lighter == results[0]


def test_nothing_that_could_be_trained_is_told():
    with pytest.raises(AnalysisError, match="no case that could be trained"):
        picked([CaseResult(CASES[0], np.inf, np.inf, 0, 0, 0.0, "constant")])


def test_an_interrupted_case_leaves_nothing_behind(tmp_path):
    def stop(share):
        if share > 0.5:
            raise KeyboardInterrupt

    task = _Task(CASES[0], tmp_path / "case", "", (run(1),), (run(3),), 100.0, SETTINGS)
    with pytest.raises(KeyboardInterrupt):
        train_case(task, stop)
    assert not list(tmp_path.iterdir())


def test_facts_and_progress_arrive(tmp_path):
    shares = []
    sensitivity_study(
        [run(1)], [run(3)], 100.0, tmp_path, SETTINGS, cases=CASES[:2], n_workers=1, facts={"fill_level": 0.5},
        on_progress=shares.append,
    )  # fmt: skip
    assert load_model(tmp_path / CASES[0].name / MODEL_NAME).facts["fill_level"] == 0.5
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)
    assert shares[0] == pytest.approx(CASES[1].cost / (CASES[0].cost + CASES[1].cost) / (SETTINGS.n_epochs + 1))


def test_a_case_that_cannot_be_trained_does_not_stop_the_others(tmp_path):
    still = Run(np.zeros(300), run(1).y)
    results = sensitivity_study([still], [run(3)], 100.0, tmp_path, SETTINGS, cases=CASES[:2], n_workers=1)
    assert [result.is_trained for result in results] == [False, False]
    assert "input of the training runs: got a constant" in results[0].ended


@pytest.mark.parametrize("n_workers", [0, 257])
def test_an_impossible_number_of_workers_is_refused(tmp_path, n_workers):
    with pytest.raises(InputError, match="--workers"):
        sensitivity_study([run(1)], [run(2)], 100.0, tmp_path, SETTINGS, cases=CASES, n_workers=n_workers)
