"""Runs under models with other noise, channels correlated, against multivariate normal densities."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from recorded_oscillators import RATE_HZ, decays, effect, rig, surroundings
from scipy.stats import multivariate_normal
from shaken_mass import QUIET, case_of, shaken_run
from test_run_noise import OWN_TWIN, SHAPE

from sloshlab.diagnosis.inference.independent_residuals import independent_residuals
from sloshlab.diagnosis.inference.known_runs import KnownRuns
from sloshlab.diagnosis.inference.whitened import WhitenedRun
from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.diagnosis.selection.proposals import Base, _comparable, proposals
from sloshlab.diagnosis.surroundings import surroundings_of
from sloshlab.identification.case import CaseRun
from sloshlab.identification.free_run_fit import fitted
from sloshlab.identification.noise_floor import weighted_observations
from sloshlab.identification.observations import Observation, OtherDrive
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, candidates

assert effects.__all__  # importing the vocabulary makes it known
DRIVING, CHANNELS = "acceleration_roof_1", ("force_cell_1", "force_cell_2")
SHARED = {False: 0.3, True: 2.0}
"""Variance of both channels by the noise of the drive, over that of their sensors, without and with a fault."""
N_DRAWS = 4000


def observed(recorded: np.ndarray, name: str, draws: dict[bool, np.ndarray]) -> Observation:
    run = SimpleNamespace(
        name="run_1",
        attributes=SimpleNamespace(sampling_rate_hz=RATE_HZ),
        recording=SimpleNamespace(sizes={"time": 500}),
    )
    return Observation(
        cast(CaseRun, run),
        name,
        False,
        np.ones(500, bool),
        recorded,
        np.full(SHAPE, 1.0 + SHARED[False]),
        of_drive=draws[False],
        other_drives={
            DRIVING: OtherDrive(np.full(SHAPE, SHARED[True] - SHARED[False]), draws[True], np.zeros(SHAPE))
        },
    )


def covariance(is_faulty: bool) -> np.ndarray:
    """Of both channels; sensors are said to have noise of their own of a twentieth of what is shared at least."""
    shared = 0.95 * SHARED[is_faulty]
    return np.array([[1.0 + SHARED[is_faulty], shared], [shared, 1.0 + SHARED[is_faulty]]])


def clipping(folder: Path, channel: str) -> Candidate:
    """A fault that nothing undoes."""
    at = surroundings(RigModel(rig(Path(folder)), Path(folder), decays()))
    at = replace(at, peaks={DRIVING: 1.0, CHANNELS[0]: 1.0})
    return Candidate(effect("sensor.sensor_clipping"), at, channel)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[bool, WhitenedRun]:
    """One recording under a model without faults, and under one in which an accelerometer does not drive."""
    generator = np.random.default_rng(6)
    recorded = generator.normal(scale=3.0, size=(2, *SHAPE))
    draws = {key: np.sqrt(size) * generator.normal(size=(N_DRAWS, *SHAPE)) for key, size in SHARED.items()}
    channels = [observed(values, name, draws) for values, name in zip(recorded, CHANNELS, strict=True)]
    known, folder = KnownRuns(OWN_TWIN, [channels], {}), tmp_path_factory.mktemp("rig")
    [plain], [beside] = known.under(()), known.under((clipping(folder, DRIVING),))
    assert known.under((clipping(folder, CHANNELS[0]),)) == [plain]
    assert plain.log_density is None
    return {
        is_faulty: WhitenedRun(
            each,
            np.stack([each_channel.spectra / np.sqrt(each_channel.variance) for each_channel in each.observed]),
        )
        for is_faulty, each in ((False, plain), (True, beside))
    }


def log_likelihood(run: WhitenedRun) -> float:
    [each] = independent_residuals([run])
    return float((-0.5 * each.residual**2).sum() + each.log_density.sum())


def test_models_of_other_noise_differ_by_the_ratio_of_their_densities(runs: dict[bool, WhitenedRun]) -> None:
    found = log_likelihood(runs[True]) - log_likelihood(runs[False])
    recorded = np.stack([each.spectra.ravel() for each in runs[False].observed], axis=1)
    of = {key: multivariate_normal([0.0, 0.0], covariance(key)).logpdf(recorded).sum() for key in SHARED}
    # 4000 draws over nine blocks tell the correlation to half a per cent.
    assert found == pytest.approx(of[True] - of[False], rel=0.02)


def test_repeats_together_have_the_densities_of_all(runs: dict[bool, WhitenedRun]) -> None:
    run = runs[True]
    alone, together = independent_residuals([run]), independent_residuals([run, run], tests=[["run_1"]])
    total = sum(each.log_density.sum() for each in together)
    assert len(together) == 2
    assert total == pytest.approx(2 * alone[0].log_density.sum())


def test_residuals_are_brought_to_the_noise_of_another_model(runs: dict[bool, WhitenedRun]) -> None:
    np.testing.assert_allclose(runs[True].in_noise_of(runs[False]), runs[False].residual)
    assert runs[True].in_noise_of(runs[True]) is runs[True].residual


def test_a_step_beside_a_fault_is_predicted_in_the_noise_that_is_left(tmp_path: Path) -> None:
    """From where the fit ends a step promises what the fit leaves, but for outliers, whose squares it takes."""
    n = round(20.0 * RATE_HZ)
    lines = np.fft.rfft(np.random.default_rng(4).normal(size=n))
    lines[np.fft.rfftfreq(n, 1 / RATE_HZ) > 20.0] = 0.0
    acceleration = np.fft.irfft(lines, n)
    of_g = 8.0 * acceleration / acceleration.std()
    case = case_of(
        tmp_path, [shaken_run(f"run_{k}", k, of_g, drift_of_quiet=0.0025, gain_of_quiet=1.012) for k in range(2)]
    )
    assert case.rig is not None
    model = RigModel(case.rig, tmp_path, case.runs)
    runs = FittedRuns(model, list(weighted_observations(case, model).values()), case.names_by_test())
    plain = runs.problem()
    nothing, _ = fitted(plain, model.believed)
    at = surroundings_of(plain, nothing, case.rig)
    [candidate] = [each for each in candidates(at) if each.key == f"sensor.sensor_drift.{QUIET}"]
    problem = runs.problem((candidate,))
    fit, _ = fitted(problem, {**nothing.values, **candidate.starts()[0]})
    own = {name: value for name, value in fit.values.items() if name.startswith(candidate.key)}
    proposed = proposals(runs, [Base.of(runs, nothing)], [candidate], [0.0], {candidate.key: [own]})
    start = min(proposed, key=lambda each: each.predicted[0])
    assert start.predicted[0] * nothing.misfit == pytest.approx(fit.misfit, rel=0.01)
    assert fit.cost < nothing.cost
    assert runs.left_out((candidate,)) == {QUIET}
    # The gain of the faulty sensor is in its own reading alone, and no more in the drive.
    gain = problem.names.index(f"gain of {QUIET}")
    for plain_block in Base.of(runs, nothing).jacobian.blocks:
        assert gain in plain_block.columns
    moved = [gain in block.columns for block in start.jacobian.blocks]
    assert moved == [each.channel == QUIET for run in problem.runs for each in run]
    # Followers of an effect are compared as it is.
    unit = np.eye(start.jacobian.n_columns)[gain]
    compared = _comparable(problem, start.jacobian)
    np.testing.assert_allclose(compared.times(unit), problem.comparable(start.jacobian.times(unit)))
    assert not np.allclose(compared.times(unit), start.jacobian.times(unit))
