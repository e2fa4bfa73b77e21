"""The study: all cases, the best first, nothing trained twice, other signals trained anew."""

import numpy as np
import pytest

from pipelines.sensitivity_study import MODEL_NAME, RESULT_NAME, SOURCE_CASES, StudyCase, sensitivity_study
from sloshlab.errors import InputError
from sloshlab.reduced_order_model.regressors import Run
from sloshlab.reduced_order_model.storage import load_model
from sloshlab.reduced_order_model.training import TrainingSettings

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
        told=lambda result, done, n: told.append((result.case, done, n)),
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
        [run(1), run(2)], [run(3)], 100.0, folder, SETTINGS, cases=CASES, told=lambda *one: told.append(one)
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
            [run(1)], [validation], 100.0, tmp_path, SETTINGS, cases=[case], told=lambda *one: told.append(one)
        )
    assert len(told) == 3


def test_the_cases_of_the_source():
    assert sum(case.structure == "nfir" for case in SOURCE_CASES) == 24
    assert sum(case.structure == "noe" for case in SOURCE_CASES) == 3
    assert len({case.name for case in SOURCE_CASES}) == 27


def test_a_study_of_nothing_is_refused(tmp_path):
    with pytest.raises(InputError, match="study"):
        sensitivity_study([run(1)], [run(2)], 100.0, tmp_path, SETTINGS, cases=[])
