"""Noise of repeats about a model that explains what they differ by: that of their sensors alone is left."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import RATE_HZ, decays, driven, effect, rig, surroundings
from test_external_force import FORCE_N, PERIOD_S, WIDTH_S, pulses

from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.diagnosis.selection.known_fits import KnownFits, largest_evidence
from sloshlab.diagnosis.selection.noise_of_runs import NoiseOfRuns
from sloshlab.identification.free_run_fit import fitted, fitted_baseline
from sloshlab.identification.free_run_problem import HUBER_LIMIT, TEMPERING, FreeRunFit
from sloshlab.identification.observations import Observation, observations, with_scatter, with_typical_scatter
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, extension_of
from sloshlab.missing_physics.extension import NOTHING

assert effects.__all__
NOISE = {"acceleration_tip": 0.01, "displacement_tank": 1e-5}
STARTS_S = {"first": 0.37, "second": 0.81}


@pytest.fixture(name="model", scope="module")
def _model(tmp_path_factory: pytest.TempPathFactory) -> RigModel:
    """Two repeats with the noise of their sensors and a train of pulses that begins at another instant in each."""
    return recorded(tmp_path_factory.mktemp("explained"), has_pulses=True)


def recorded(folder: Path, *, has_pulses: bool) -> RigModel:
    runs = [
        replace(decays((0.01,), 6.0, noise={}, **({"force": pulses(start)} if has_pulses else {}))[0], name=name)
        for name, start in STARTS_S.items()
    ]
    generator = np.random.default_rng(2)
    for run in runs:
        for name, size in NOISE.items():
            values = run.recording[name].values
            run.recording[name].values[:] = values + size * generator.standard_normal(values.size)
    return RigModel(rig(folder), folder, runs)


def fit_of(model: RigModel, *, with_pulses: bool) -> FreeRunFit:
    if not with_pulses:
        return FreeRunFit((), dict(model.believed), 0.0, 0.0)
    at = replace(surroundings(model), runs=tuple(STARTS_S))
    train = Candidate(effect("structure.external_force").of_runs(tuple(STARTS_S)), at)
    numbers = {"size_n": FORCE_N, "period_s": PERIOD_S, "width_s": WIDTH_S}
    numbers |= {f"start_s in {run}": start for run, start in STARTS_S.items()}
    return FreeRunFit(
        (train,), {**model.believed, **{f"{train.key}.{n}": v for n, v in numbers.items()}}, 0.0, 0.0
    )


def scattered(model: RigModel) -> list[list[Observation]]:
    """As they are known about the baseline, which has no pulses."""
    plain = [observations(run, model.compared(run)) for run in model.runs]
    left = []
    for observed in plain:
        readings = model.simulate(observed[0].run, model.believed, NOTHING)
        left.append({each.channel: each.spectra - each.of(readings[each.channel]) for each in observed})
    return with_scatter(plain, left)


def test_what_scatters_about_a_model_of_the_pulses_is_the_noise_of_the_sensors(model: RigModel) -> None:
    runs = scattered(model)
    scatter = NoiseOfRuns(model, runs[:1], runs[1:], [list(STARTS_S)])
    assert not scatter.renew(fit_of(model, with_pulses=False))
    assert scatter.fitting[0][0] is runs[0][0]
    assert scatter.renew(fit_of(model, with_pulses=True))
    for after in (*scatter.fitting, *scatter.held_out):
        for new in after:
            # white noise has the variance of its samples in every coefficient of an orthonormal transform
            expected = NOISE[new.channel] ** 2
            bands = slice(round(10.0 / RATE_HZ * 2 * new.spectra.shape[1]), None)
            inner = new.variance[2:-2, bands]
            assert float(np.median(inner)) == pytest.approx(expected, rel=0.3)
    tip_before, tip_after = (each[0][0].variance[2:-2, :12].mean() for each in (runs, scatter.fitting))
    assert tip_before > 20.0 * tip_after


@pytest.mark.parametrize("are_there", [True, False])
def test_pulses_are_more_probable_where_each_model_has_its_own_noise(tmp_path: Path, are_there: bool) -> None:
    """Each model's noise by its own residuals; only where there are pulses."""
    model = recorded(tmp_path, has_pulses=are_there)
    runs, tests = scattered(model), [list(STARTS_S)]
    # repeats that are held out have no part in it
    known = KnownFits(FittedRuns(model, runs[:1], tests), NoiseOfRuns(model, runs[:1], runs[1:], tests))
    at_truth = fit_of(model, with_pulses=True)
    own = {name: value for name, value in at_truth.values.items() if not name.endswith("in second")}
    pulses, _ = fitted(known.runs.problem_of(at_truth), own)
    nothing, _ = fitted_baseline(known.runs.problem())
    # as if the scatter hid them, however much of it they explain
    nothing = replace(nothing, misfit=0.0, cost=nothing.cost - nothing.misfit)
    assert largest_evidence([pulses]) < largest_evidence([nothing])
    assert known.is_more_probable([pulses], nothing) == are_there
    if are_there:
        found = known._evidence_in_own_noise(pulses) - known._evidence_in_own_noise(nothing)
        expected = log_likelihood_in_own_noise(model, runs[0], pulses)
        expected -= log_likelihood_in_own_noise(model, runs[0], nothing)
        # the rest is what the freedom costs: some tens for four numbers
        assert expected - 60.0 < found < expected
        assert expected > 200.0


def log_likelihood_in_own_noise(model: RigModel, observed: list[Observation], fit: FreeRunFit) -> float:
    """Tempered; the variance is the mean square in boxes of three blocks and nine bands, or that of the sensor."""
    readings = model.simulate(observed[0].run, fit.values, extension_of(fit.candidates, fit.values))
    total = 0.0
    for each in observed:
        left = each.spectra - each.of(readings[each.channel])
        around = np.lib.stride_tricks.sliding_window_view(np.pad(left**2, ((1, 1), (4, 4)), mode="edge"), (3, 9))
        assert each.without_scatter is not None
        variance = np.maximum(around.mean(axis=(2, 3)), each.without_scatter)
        size = np.abs(left) / np.sqrt(variance)
        # Huber's loss, as everywhere
        within = np.minimum(size, HUBER_LIMIT)
        total -= 0.5 * float((within * (2 * size - within) + np.log(variance)).sum())
    return total / TEMPERING


def test_a_run_that_was_not_repeated_scatters_as_the_repeats_do(model: RigModel) -> None:
    """About the fit, too; where nothing was repeated all stays as it is."""
    runs = scattered(model)
    [other] = decays((0.006,), 6.0, noise=NOISE, seed=9)
    alone = with_typical_scatter(
        observations(replace(other, name="alone"), [each.channel for each in runs[0]]), [*runs[0], *runs[1]]
    )
    scatter = NoiseOfRuns(model, [*runs, alone], [], [list(STARTS_S), ["alone"]])
    assert scatter.renew(fit_of(model, with_pulses=True))
    before, after = (float(each[0].variance[2:-2, :12].mean()) for each in (alone, scatter.fitting[2]))
    assert before > 5.0 * after
    single = NoiseOfRuns(model, [runs[0]], [], [["first"], ["second"]])
    assert single.renew(fit_of(model, with_pulses=True))
    assert all(new is old for new, old in zip(single.fitting[0], runs[0], strict=True))


@pytest.mark.parametrize(
    ("name", "number", "is_more"), [("quadratic_drag", 30.0, True), ("coulomb_friction", 2.0, False)]
)
def test_what_drives_make_beside_friction_is_no_noise(
    tmp_path: Path, name: str, number: float, is_more: bool
) -> None:
    """Friction magnifies differences until motions part; what a drag makes of a noisy base is noise."""
    model = RigModel(rig(tmp_path), tmp_path, driven(noise={"acceleration_root": 0.2, "acceleration_tip": 1e-4}))
    observed = [observations(run, model.compared(run), model.driving(run)) for run in model.runs]
    noise = NoiseOfRuns(model, observed, [], [[run.name] for run in model.runs])
    known = effect(f"structure.{name}")
    added = Candidate(known, surroundings(model))
    before = FreeRunFit((), dict(model.believed), 0.0, 0.0)
    values = {**model.believed, f"{added.key}.{known.parameters[0].name}": number}
    assert noise.renew_drive(before, FreeRunFit((added,), values, 0.0, 0.0)) is is_more
    assert (noise.fitting[0][0] is not observed[0][0]) is is_more
    if is_more:
        assert noise.renew_drive(before, before)
        assert noise.fitting[0][0] is observed[0][0]
