"""Noise of a channel by which of two accelerometers drive, against closed forms of a rigid mass on a shaker."""

from __future__ import annotations

import numpy as np
import pytest
from recorded_oscillators import RATE_HZ
from shaken_mass import CELL, LOUD, MASS_KG, NOISE, QUIET, case_of, shaken_run

from sloshlab.diagnosis.inference.run_noise import run_noise
from sloshlab.identification.free_run_problem import FreeRunProblem
from sloshlab.identification.noise_floor import weighted_observations
from sloshlab.identification.observations import Observation
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics.extension import Extension, Reading, SensorFault

BOTH = NOISE[QUIET] ** 2 * NOISE[LOUD] ** 2 / (NOISE[QUIET] ** 2 + NOISE[LOUD] ** 2)
"""Variance of the mean of both accelerometers, weighted by their variances [m²/s⁴]."""
WITHOUT = {QUIET: NOISE[LOUD] ** 2, LOUD: NOISE[QUIET] ** 2}


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> tuple[RigModel, list[list[Observation]]]:
    """A minute of random motion up to 20 Hz."""
    folder, n = tmp_path_factory.mktemp("shaken"), round(60.0 * RATE_HZ)
    lines = np.fft.rfft(np.random.default_rng(9).normal(size=n))
    lines[np.fft.rfftfreq(n, 1 / RATE_HZ) > 20.0] = 0.0
    acceleration = np.fft.irfft(lines, n)
    case = case_of(folder, [shaken_run("random", 1, 8.0 * acceleration / acceleration.std())])
    assert case.rig is not None
    model = RigModel(case.rig, folder, case.runs)
    return model, list(weighted_observations(case, model).values())


def middle(of: Observation) -> float:
    """Mean variance away from the tapered ends and the lowest band, in which means are removed."""
    assert of.ignored is not None
    return float(of.variance[2:-2, 2:][~of.ignored[2:-2, 2:]].mean())


def channel(run: list[Observation], name: str) -> Observation:
    return next(each for each in run if each.channel == name)


def test_a_channel_is_known_to_the_noise_of_those_that_drive(
    known: tuple[RigModel, list[list[Observation]]],
) -> None:
    """F = m ü: the noise of the cell, and m times that of the mean, or of the accelerometer that is left."""
    [run] = known[1]
    cell = channel(run, CELL)
    # Averages of four draws over nine blocks, of which neighbouring bands have the largest: up to a quarter more.
    assert middle(cell) == pytest.approx(NOISE[CELL] ** 2 + MASS_KG**2 * BOTH, rel=0.25)
    for name, alone in WITHOUT.items():
        beside = cell.beside_faults({name})
        assert middle(beside) == pytest.approx(NOISE[CELL] ** 2 + MASS_KG**2 * alone, rel=0.25)
        assert beside.of_drive is not None
        # draws have what is added to the variance
        added = middle(beside) - NOISE[CELL] ** 2
        assert float(np.mean(beside.of_drive[:, 2:-2, 2:] ** 2)) == pytest.approx(added, rel=0.05)
        assert cell.beside_faults({name}) is beside
        assert beside.beside_faults({name}) is beside
    both = cell.beside_faults({QUIET, LOUD})
    assert middle(both) == pytest.approx(middle(cell.beside_faults({QUIET})))
    assert cell.beside_faults({CELL}) is cell


def test_those_that_drive_count_as_what_tells_one_from_the_other(
    known: tuple[RigModel, list[list[Observation]]],
) -> None:
    """Two deviations from their mean are one difference δ, and count together δ²/(σ₁² + σ₂²) in every model.

    From a mean with the weights w they are w₂ δ and w₁ δ; without one of them its own is δ, and the other's zero.
    """
    [run] = known[1]
    difference = NOISE[QUIET] ** 2 + NOISE[LOUD] ** 2
    weights = np.array([NOISE[LOUD] ** 2, NOISE[QUIET] ** 2]) / difference
    for name in (QUIET, LOUD):
        one = channel(run, name)
        assert middle(one) == pytest.approx(difference * float(weights @ weights), rel=0.25)
        assert middle(one.beside_faults({name})) == pytest.approx(difference, rel=0.25)


def test_a_problem_beside_faults_has_the_noise_and_the_drive_of_the_others(
    known: tuple[RigModel, list[list[Observation]]],
) -> None:
    """F - m ü of the loud accelerometer, and the difference of the two, in closed form."""
    model, runs = known
    with_all, without = FreeRunProblem(model, runs), FreeRunProblem(model, runs, faulty={QUIET})
    theta = with_all.theta_of(model.believed)
    x, other = with_all.residual(theta), without.residual(theta)
    recorded = runs[0][0].run.recording
    for name, left in (
        (CELL, recorded[CELL].values - MASS_KG * recorded[LOUD].values),
        (QUIET, recorded[QUIET].values - recorded[LOUD].values),
        (LOUD, np.zeros(recorded[LOUD].size)),
    ):
        one = channel(without.runs[0], name)
        first = sum(each.spectra.size for each in without.runs[0][: without.runs[0].index(one)])
        own = other[first : first + one.spectra.size]
        np.testing.assert_allclose(own, (one.of(left) / np.sqrt(one.variance)).ravel(), atol=2e-3)
    np.testing.assert_array_equal(FreeRunProblem(model, runs, faulty={CELL}).residual(theta), x)
    squares = float(x @ x), float(other @ other)
    # As many independent differences, each known to its noise.
    assert squares[1] == pytest.approx(squares[0], rel=0.15)


def test_models_with_other_drives_are_compared_given_what_was_left_out(
    known: tuple[RigModel, list[list[Observation]]],
) -> None:
    """F - m u of the loud accelerometer, given its difference to the quiet one: F - m of the mean of both."""
    model, runs = known
    with_all, without = FreeRunProblem(model, runs), FreeRunProblem(model, runs, faulty={QUIET})
    theta = with_all.theta_of(model.believed)
    recorded, cell = runs[0][0].run.recording, channel(runs[0], CELL)
    weight = NOISE[LOUD] ** 2 / (NOISE[QUIET] ** 2 + NOISE[LOUD] ** 2)
    mean = weight * recorded[QUIET].values + (1 - weight) * recorded[LOUD].values
    expected = cell.of(recorded[CELL].values - MASS_KG * mean) / np.sqrt(cell.variance)
    first = sum(each.spectra.size for each in runs[0][: runs[0].index(cell)])
    given = without.comparable(without.residual(theta))[first : first + cell.spectra.size]
    shown = cell.informative
    # What 36 draws say of the reading is off by a sixth of what it does not tell.
    left = (given.reshape(expected.shape) - expected)[shown]
    assert float(np.sqrt(np.mean(left**2))) < 0.5 * float(np.sqrt(np.mean(expected[shown] ** 2)))
    for inflation in (0.0, 0.02):
        costs = [problem.misfit(problem.residual(theta), inflation) for problem in (with_all, without)]
        assert costs[1] == pytest.approx(costs[0], rel=0.1)
    # An error of the mass shows as well beside the fault.
    heavier = with_all.theta_of({**model.believed, "carried mass": 1.03})
    added = [
        problem.misfit(problem.residual(heavier)) - problem.misfit(problem.residual(theta))
        for problem in (with_all, without)
    ]
    assert added[1] == pytest.approx(added[0], rel=0.15)


def test_deviations_from_the_mean_share_nothing_with_what_it_drives(
    known: tuple[RigModel, list[list[Observation]]],
) -> None:
    """Together they are one difference, once: as two that are correlated it would count for less."""
    model, [run] = known
    noise = run_noise(model, run, model.believed)
    place = [each.channel for each in run].index
    covariance = np.linalg.inv(np.swapaxes(noise.inverse_root, -1, -2) @ noise.inverse_root)
    np.testing.assert_allclose(covariance[..., place(QUIET), place(LOUD)], 0.0, atol=1e-12)
    np.testing.assert_allclose(covariance[..., place(QUIET), place(CELL)], 0.0, atol=1e-12)
    beside = run_noise(model, [each.beside_faults({QUIET}) for each in run], model.believed)
    covariance = np.linalg.inv(np.swapaxes(beside.inverse_root, -1, -2) @ beside.inverse_root)
    # −σ₂ of the reading and −m σ₂ of the force: 0.92 and 0.99 of their deviations, which are said to be larger.
    largest = 0.95 * NOISE[LOUD] / np.hypot(NOISE[QUIET], NOISE[LOUD])
    found = float(covariance[..., place(QUIET), place(CELL)][channel(run, CELL).informative].mean())
    assert 0.6 * largest < found < largest


@pytest.mark.parametrize(
    ("is_undone", "gain", "reads_others"),
    [(True, 1.0, False), (True, 1.03, False), (False, 1.0, False), (True, 1.0, True)],
)
def test_a_fault_that_can_be_undone_leaves_its_sensor_in_the_drive(
    known: tuple[RigModel, list[list[Observation]]], is_undone: bool, gain: float, reads_others: bool
) -> None:
    """F is m times the mean of both, of which the quiet one reads a half of its gain; else times the other."""
    model, runs = known
    run = runs[0][0].run

    def scaled(factor: float) -> Reading:
        return lambda shown, rate, others, recorded: factor * shown

    back, key = scaled(2.0) if is_undone else None, ("half", QUIET, is_undone, reads_others)
    fault = SensorFault(QUIET, scaled(0.5), back, key, reads_others=reads_others)
    values = {**model.believed, f"gain of {QUIET}": gain}
    found = model.simulate(run, values, Extension(faults=(fault,)))
    quiet, loud = (run.recording[name].values for name in (QUIET, LOUD))
    weight = NOISE[LOUD] ** 2 / (NOISE[QUIET] ** 2 + NOISE[LOUD] ** 2) if is_undone and not reads_others else 0.0
    drive = (weight * 2.0 * quiet + (1 - weight) * loud) / (weight * gain + 1 - weight)
    middle_of_run = slice(100, -100)
    size = MASS_KG * drive.std()
    np.testing.assert_allclose(found[CELL][middle_of_run], MASS_KG * drive[middle_of_run], atol=0.02 * size)
    np.testing.assert_allclose(
        found[QUIET][middle_of_run], 0.5 * gain * drive[middle_of_run], atol=0.02 * drive.std()
    )
