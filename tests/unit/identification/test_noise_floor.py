"""Noise of the accelerometer that drives a simulation, through a resonance, against its closed form."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from recorded_oscillators import DAMPING, MASS_KG, OMEGA, RATE_HZ, rig, run_of
from shaken_mass import CELL, LOUD, QUIET, shaken_run
from shaken_mass import NOISE as NOISES
from shaken_mass import case_of as shaken_case

from sloshlab.conditioning.integration import DRIFT_CORNER_HZ
from sloshlab.identification.case import Case, CaseRun
from sloshlab.identification.drive_noise import WHITE, NoiseSpectrum
from sloshlab.identification.free_run_problem import TEMPERING, FreeRunFit
from sloshlab.identification.noise_floor import (
    _ignored_where_drive_noise_counts,
    _over_bands_of_a_resonance,
    _propagated_noise,
    _shared,
    _steady,
    _with_noise_of_drive,
    weighted_observations,
    with_noise_through,
)
from sloshlab.identification.observations import Observation, noise_of_sensor, observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, known_effects

assert effects.__all__
NOISE_M_PER_S2 = 0.1
MORE_DAMPING = 10.0
"""So that the resonance forgets within half a second, and a minute tells its noise."""


def quiet_run(duration_s: float, seed: int = 0, noise: float = NOISE_M_PER_S2) -> CaseRun:
    """A base that stands still and an accelerometer on it that does not know it."""
    still = np.zeros(round(duration_s * RATE_HZ))
    channels = {"acceleration_tip": still, "acceleration_root": still}
    sizes = {"acceleration_root": noise, "acceleration_tip": 1e-3}
    return run_of("quiet", channels, sizes, seed, experiment="other", repeat=seed)


def case_of(folder: Path, *runs: CaseRun) -> Case:
    return Case("case", folder, rig(folder), runs)


def test_noise_of_the_base_comes_through_the_resonance_as_its_closed_form_says(tmp_path: Path) -> None:
    """White noise of density S through |(1 + 2iζr)/(1 − r² + 2iζr)|² has the mean square S π f (1 + 4ζ²)/(4ζ)."""
    run = quiet_run(60.0)
    observed = observations(run, ["acceleration_tip"])
    model = RigModel(rig(tmp_path), tmp_path, [run])
    fit = FreeRunFit((), {"damping of mode 1": MORE_DAMPING}, 0.0, 0.0)
    [(place, draws)] = _propagated_noise(model, run, {"acceleration_root": WHITE}, observed, fit).items()
    found = np.mean(draws**2, axis=0)
    ratio = MORE_DAMPING * DAMPING / (2 * MASS_KG * OMEGA)
    density = 2 * NOISE_M_PER_S2**2 / RATE_HZ
    expected = density * np.pi * OMEGA / (2 * np.pi) * (1 + 4 * ratio**2) / (4 * ratio)
    assert place == ("quiet", "acceleration_tip")
    noisier = NoiseSpectrum(np.zeros(1), np.array([4.0]))
    [of_louder] = _propagated_noise(model, run, {"acceleration_root": noisier}, observed, fit).values()
    assert of_louder == pytest.approx(2.0 * draws)
    assert float(found.mean()) == pytest.approx(expected, rel=0.15)
    frequencies, bands = observed[0].frequencies_hz, found.mean(axis=0)
    resonance, above = (int(np.argmin(np.abs(frequencies - f))) for f in (OMEGA / (2 * np.pi), 25.0))
    assert bands[resonance] > 0.8 * bands.max() > 20 * bands[above]


def test_a_drag_turns_the_slow_error_of_a_velocity_into_noise(tmp_path: Path) -> None:
    """F = C |v| v beside an error δ of v is off by 2 C |v| δ; δ is the integral of white noise above the drift."""
    drag, tone_hz, duration_s = 40.0, 10.0, 60.0
    time = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
    window = np.minimum(1.0, np.minimum(time, time[-1] - time))
    run = shaken_run("tone", 3, 25.0 * window * np.sin(2 * np.pi * tone_hz * time))
    case = shaken_case(tmp_path, [run])
    assert case.rig is not None
    model = RigModel(case.rig, tmp_path, [run])
    observed = [each for each in weighted_observations(case, model)["tone"] if each.channel == CELL]
    effects_of_tank = {f"{known.block}.{known.name}": known for known in known_effects()}
    before = FreeRunFit((), dict(model.believed), 0.0, 0.0)

    def more(name: str, number: str, value: float) -> list[Observation]:
        added = Candidate(effects_of_tank[f"tank.{name}"], cast(Any, None))
        values = {**model.believed, f"tank.{name}.{number}": value}
        fit = FreeRunFit((added,), values, 0.0, 0.0)
        [found] = with_noise_through(model, [observed], [["tone"]], before, fit)
        return found

    assert more("mass_error", "mass_kg", 1e-4)[0] is observed[0]
    [noisier] = more("quadratic_drag", "drag_n_s2_per_m2", drag)
    generator, low = np.random.default_rng(8), noisier.frequencies_hz < 3.0
    speed = 25.0 * window / (2 * np.pi * tone_hz) * np.abs(np.cos(2 * np.pi * tone_hz * time))
    frequency = np.fft.rfftfreq(time.size, 1 / RATE_HZ)
    frequency[0] = 1e9
    std = (NOISES[QUIET] ** -2 + NOISES[LOUD] ** -2) ** -0.5
    energies = []
    for _ in range(200):
        noise = np.fft.rfft(std * generator.standard_normal(time.size))
        error = np.fft.irfft(
            noise / (2j * np.pi * frequency) / (1 + (DRIFT_CORNER_HZ / frequency) ** 4), time.size
        )
        power = np.abs(np.fft.rfft(2 * drag * speed * error)) ** 2 / time.size
        energies.append([2 * power[1:][(frequency[1:] >= k) & (frequency[1:] < k + 1)].sum() for k in range(4)])
    by_band = np.mean(energies, axis=0)
    # of each band the most of itself and its neighbours
    expected = sum(by_band[max(k - 1, 0) : k + 2].max() for k in range(3))
    found = (noisier.variance - observed[0].variance)[:, low].sum()
    assert found == pytest.approx(expected, rel=0.3)


def test_a_channel_that_is_left_out_of_the_drive_is_compared_with_another_sensor(tmp_path: Path) -> None:
    run = quiet_run(4.0)
    observed = observations(run, ["acceleration_tip"])
    without = CaseRun(run.name, run.recording.drop_vars("acceleration_tip"), run.attributes)
    fit = FreeRunFit((), {}, 0.0, 0.0)
    model = RigModel(rig(tmp_path), tmp_path, [run])
    [found] = _propagated_noise(model, without, {"acceleration_root": WHITE}, observed, fit).values()
    # Away from the tapered ends, draws of white noise as loud as the sensor: 4 × 5 × 124 of them tell 3 %.
    assert float(np.mean(found[:, 2:-2] ** 2)) == pytest.approx(NOISE_M_PER_S2**2, rel=0.08)


def test_the_floor_of_two_repeats_knows_the_noise_of_the_base(tmp_path: Path) -> None:
    """Two repeats whose noise happens to be the same: their difference is none, the floor is that of the noise."""
    runs = [quiet_run(8.0) for _ in range(2)]
    runs[1] = CaseRun("again", runs[0].recording.assign_attrs(repeat=1), runs[1].attributes)
    case = case_of(tmp_path, *runs)
    found = weighted_observations(case, RigModel(case.rig, tmp_path, case.runs))  # type: ignore[arg-type]
    [observation] = found["quiet"]
    least = observation.variance[:, np.argmax(observation.variance.mean(axis=0))].mean()
    assert least > 10 * 1e-3**2


def test_the_noise_of_a_sensor_is_what_is_stated_or_what_its_high_bands_show() -> None:
    run = quiet_run(20.0)
    assert noise_of_sensor(run, "acceleration_root") == pytest.approx(NOISE_M_PER_S2, rel=0.05)
    del run.recording["acceleration_root"].attrs["noise_std"]
    assert noise_of_sensor(run, "acceleration_root") == pytest.approx(NOISE_M_PER_S2, rel=0.15)


def test_what_a_drive_moves_counts_where_nothing_is_recorded(tmp_path: Path) -> None:
    """A hum on the accelerometer of the base alone: the simulated mass hums, the recorded one rests."""
    hum_hz, runs = 20.0, []
    for repeat in range(2):
        run = quiet_run(8.0, seed=repeat, noise=1e-3)
        root = run.recording["acceleration_root"]
        hum = 2.0 * np.sin(2 * np.pi * hum_hz * np.arange(root.size) / RATE_HZ + repeat)
        recording = run.recording.assign(acceleration_root=root.copy(data=root.values + hum))
        runs.append(CaseRun(f"run {repeat}", recording.assign_attrs(repeat=repeat), run.attributes))
    case = case_of(tmp_path, *runs)
    found = weighted_observations(case, RigModel(case.rig, tmp_path, case.runs))  # type: ignore[arg-type]
    for [observation] in found.values():
        hums = np.abs(observation.frequencies_hz - hum_hz) < 1.0
        assert observation.informative[2:-2, hums].all()
        assert observation.simulated is not None
        # well above its resonance a mass on a spring moves by 1/(r² − 1) of its base, and a first fit lessens it
        passed = 1 / ((2 * np.pi * hum_hz / OMEGA) ** 2 - 1)
        of_base = observation.of(hum)
        power = (observation.simulated[3:-3, hums] ** 2).sum() / (of_base[3:-3, hums] ** 2).sum()
        assert np.sqrt(power) == pytest.approx(passed, rel=0.3)


def test_noise_of_a_resonance_may_lie_where_the_resonance_may() -> None:
    """One narrow line: as large in all bands within five per cent, at least in the next ones, over some blocks."""
    square = np.zeros((40, 100))
    square[:, 5], square[:, 60] = 1.0, 2.0
    found = _over_bands_of_a_resonance(square)
    expected = np.zeros(100)
    # band k is at k + 1/2 and looks 0.05 (k + 1/2) bands to both sides, rounded up: 57 and 64 look at 60
    expected[4:7], expected[57:65] = 1.0, 2.0
    np.testing.assert_allclose(found, np.tile(expected, (40, 1)))
    burst = np.zeros((40, 100))
    burst[20, 30] = 9.0
    assert _over_bands_of_a_resonance(burst)[:, 30].tolist() == [0.0] * 16 + [1.0] * 9 + [0.0] * 15


def test_channels_share_all_of_the_noise_of_a_drive_that_is_added_to_them() -> None:
    """Variances get more than a draw has where a resonance may be elsewhere; what drives shares nothing."""
    generator = np.random.default_rng(3)
    force, root = ("driven", "force_interface"), ("driven", "acceleration_root")
    drawn = {place: generator.standard_normal((4, 40, 100)) * np.arange(1.0, 101.0) for place in (force, root)}
    added = {place: _over_bands_of_a_resonance(np.mean(draws**2, axis=0)) for place, draws in drawn.items()}
    shared = _shared(drawn, added, (root[1],))
    np.testing.assert_allclose(_steady(shared[force] ** 2).mean(), added[force].mean(), rtol=0.02)
    assert _steady(drawn[force] ** 2).mean() < 0.8 * added[force].mean()
    assert not shared[root].any()
    correlation = np.corrcoef(shared[force].ravel(), drawn[force].ravel())[0, 1]
    assert correlation > 0.99


def test_what_is_noise_of_the_drive_alone_counts_for_nothing() -> None:
    """Unless a model that passes none of it would gain less than a nat by it over the whole channel."""
    run = quiet_run(8.0)
    [rests] = observations(run, ["acceleration_tip"])
    sensor, place = rests.variance, ("quiet", "acceleration_tip")
    one_nat = 2 * TEMPERING / sensor.size

    def counts_for_less(observation: Observation, share: float, driving: tuple[str, ...] = ()) -> bool:
        noise = {place: share * sensor}
        noisier = _with_noise_of_drive(observation, noise, ())
        np.testing.assert_allclose(noisier.variance, (1 + share) * sensor)
        weighed = _ignored_where_drive_noise_counts(noisier, noise, driving)
        [factor] = np.unique((weighed.variance / noisier.variance).round(6))
        assert factor in (1.0, 100.0)
        return bool(factor > 1.0)

    assert 0 < one_nat < 0.1
    assert counts_for_less(rests, 3.0)
    assert counts_for_less(rests, 2.0 * one_nat)
    assert not counts_for_less(rests, 0.5 * one_nat)
    assert not counts_for_less(replace(rests, spectra=rests.spectra + 10 * np.sqrt(sensor)), 3.0)
    assert not counts_for_less(replace(rests, simulated=np.full(sensor.shape, 10 * np.sqrt(sensor.max()))), 3.0)
    np.testing.assert_array_equal(_ignored_where_drive_noise_counts(rests, {}, ()).variance, sensor)
    # of what drives all noise is that of a drive, however small what the others add to it
    assert counts_for_less(rests, 0.0, ("acceleration_tip",))
    assert not counts_for_less(rests, 0.5 * one_nat, ("acceleration_root",))
    moving = replace(rests, spectra=rests.spectra + 10 * np.sqrt(sensor))
    assert not counts_for_less(moving, 0.0, ("acceleration_tip",))


def test_slow_displacements_are_known_to_a_few_times_the_noise_of_the_base(tmp_path: Path) -> None:
    """Near the ends, where the filter that removes drift settles, and where that is not known: not at all."""
    still = np.zeros(round(20.0 * RATE_HZ))
    channels = {"displacement_tank": still + 1e-3, "acceleration_root": still}
    run = run_of("quiet", channels, {"acceleration_root": 0.1, "displacement_tank": 1e-5}, 1, experiment="other")
    driving = ("acceleration_root",)
    [observation] = observations(run, ["displacement_tank"], driving, knows_noise_of_drive=True)
    [unknown] = observations(run, ["displacement_tank"], driving)
    slow, middle = observation.frequencies_hz < 2.5, (observation.times_s > 2.5) & (observation.times_s < 17.0)
    sensor = observation.variance[-1, -1]
    assert (observation.variance[np.ix_(middle, slow)] == sensor).all()
    assert (observation.variance[np.ix_(~middle, slow)] > 1e3 * sensor).sum() >= 2 * 4 * slow.sum()
    assert (unknown.variance[:, slow] > 1e3 * sensor).all()
    assert (unknown.variance[:, ~slow] == sensor).all()
    noise = {("quiet", "displacement_tank"): np.full(observation.spectra.shape, 7.0 * sensor)}
    noisier = _with_noise_of_drive(observation, noise, driving).variance
    np.testing.assert_allclose(noisier[np.ix_(middle, slow)], 9 * 8.0 * sensor)
    np.testing.assert_allclose(noisier[:, ~slow], 8.0 * sensor)
    np.testing.assert_allclose(
        _with_noise_of_drive(observation, noise, ()).variance[np.ix_(middle, slow)], 8.0 * sensor
    )
