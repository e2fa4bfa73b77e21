"""What a recording states, what noise and compression show, and what errors do to W̄ and β."""

from __future__ import annotations

import math

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import quad
from shaken_tank import DRY_KG, LIQUID_KG, RATE_HZ, shifted, tank_run, with_channel

from sloshlab.conditioning.calibration import identify_dry_mass
from sloshlab.conditioning.combined_channels import tank_signals
from sloshlab.consistency.between_runs import calibration_findings, sibling_findings
from sloshlab.consistency.bounds import window_findings
from sloshlab.consistency.effect import Inertia
from sloshlab.consistency.examination import Reference, examined, like_series
from sloshlab.consistency.finding import Action
from sloshlab.consistency.force_response import start_response
from sloshlab.consistency.sensor_response import pair_noise
from sloshlab.rig import Rig

TOML = """
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = {dry}
[liquid]
density_kg_per_m3 = 1000.0
fill_level = {fill}
"""
RIG = Rig.from_toml_text(TOML.format(dry=0.61, fill=0.5))
FORCES = ("force_cell_1", "force_cell_2")
ROOFS = ("acceleration_roof_1", "acceleration_roof_2")


def flagged(recording, reference=None):
    return {f.check for f in examined(recording, reference).findings if f.action is not Action.NOTED}


def changed(recording, names, change):
    for name in names:
        recording = with_channel(recording, name, change)
    return recording


@pytest.mark.parametrize("frequency_hz", [5.0, 20.0])
def test_the_effect_of_a_delay_is_the_work_of_a_late_inertia_force(frequency_hz):
    total, liquid, delay, u0 = 0.75, 0.125, 0.7e-3, 2e-3
    omega = 2 * math.pi * frequency_hz

    def power(time):
        # u = u₀ cos Ωt; the force M ü comes later
        force = -total * omega**2 * u0 * math.cos(omega * (time - delay))
        return force * -omega * u0 * math.sin(omega * time)

    work = quad(power, 0, 1 / frequency_hz)[0]
    w_bar, beta = Inertia(total, liquid, frequency_hz).of_delay(delay)
    assert w_bar == pytest.approx(abs(work) / (liquid * (omega * u0) ** 2), rel=1e-6)
    assert beta == pytest.approx((1 - math.cos(omega * delay)) * total / liquid)


def test_a_gain_changes_the_liquid_by_the_whole_mass():
    # 1 % of 0.75 kg on 0.125 kg of liquid
    assert Inertia(0.75, 0.125, 20.0).of_gain(-0.01) == pytest.approx((0.01, 0.06))


def test_a_run_that_agrees_with_everything():
    result = examined(tank_run(), Reference(RIG))
    assert result.findings == ()
    assert result.flags == ()
    # one run cannot tell whether all sensors share a gain: it says so
    assert any("gain common to all" in point.text for point in result.not_checked)


@pytest.mark.parametrize(
    ("attribute", "factor", "check"),
    [
        ("acceleration_g", 5 / 3, "stated level"),
        ("acceleration_g", 0.95, "stated level"),
        ("sweep_start_hz", 1.01, "stated sweep and clock"),
        ("sweep_rate_octave_per_s", 0.97, "stated sweep and clock"),
    ],
)
def test_attributes_that_the_motion_contradicts(attribute, factor, check):
    recording = tank_run()
    wrong = recording.assign_attrs({attribute: recording.attrs[attribute] * factor})
    assert flagged(wrong, Reference(RIG)) == {check}


def test_a_sweep_rate_that_is_right_on_the_mean_frequency_only():
    recording = tank_run()
    # 3 % too slow, started as much higher that both laws meet in the middle of the run
    rate = recording.attrs["sweep_rate_octave_per_s"]
    start = recording.attrs["sweep_start_hz"] * 2 ** (0.03 * rate * 30.0)
    wrong = recording.assign_attrs(sweep_rate_octave_per_s=0.97 * rate, sweep_start_hz=start)
    assert flagged(wrong, Reference(RIG)) == {"stated sweep and clock"}


def test_a_sampling_rate_that_is_one_percent_wrong():
    recording = tank_run()
    slow = recording.assign_coords(time=("time", recording["time"].values / 1.01, {"units": "s"}))
    assert flagged(slow.assign_attrs(sampling_rate_hz=RATE_HZ * 1.01), Reference(RIG)) >= {
        "stated sweep and clock"
    }


def test_the_noise_of_two_sensors_is_told_apart():
    generator = np.random.default_rng(3)
    time = np.arange(60_000) / RATE_HZ
    # a fast part that both feel is no noise of either
    common = 10 * np.sin(2 * np.pi * 7 * time) + 0.5 * generator.standard_normal(time.size)
    noisy = 0.9 * common + 0.2 * generator.standard_normal(time.size)
    quiet = common + 0.05 * generator.standard_normal(time.size)
    pair = pair_noise(noisy, quiet, 512)
    assert pair.std == pytest.approx(0.2, rel=0.05)
    assert pair.reference_std == pytest.approx(0.05, rel=0.2)


@pytest.mark.parametrize("peak", [0.0, 0.4, 0.8])
def test_a_compressed_sensor_feels_less_at_its_peaks(peak):
    generator = np.random.default_rng(8)
    time = np.arange(120_000) / RATE_HZ
    motion = np.sin(2 * np.pi * 7.3 * time)
    noise = 0.004 * generator.standard_normal((2, time.size))
    values = motion + noise[0]
    compressed = values if peak == 0 else np.tanh(peak * values) / peak
    pair = pair_noise(compressed, motion + 1e-6 * noise[1], 512)
    # the slope of tanh(p x)/p is 1 − tanh²(p x): on the mean over |x| > 7/9 and over |x| < 1/3, of a sine
    x = np.sin(np.linspace(0, 2 * np.pi, 100_000))
    slope = 1 - np.tanh(peak * x) ** 2
    expected = 1 - slope[np.abs(x) > 7 / 9].mean() / slope[np.abs(x) < 1 / 3].mean()
    assert pair.compression == pytest.approx(expected, abs=4 * pair.compression_std)
    assert pair.compression_std < 0.02


def test_noise_and_compression_are_flagged():
    generator = np.random.default_rng(4)
    noisy = changed(tank_run(), FORCES, lambda values: values + generator.standard_normal(values.size))
    assert "noise" in flagged(noisy, Reference(RIG))
    limit = np.abs(tank_run()["force_cell_1"].values).max() / 0.7
    bent = changed(tank_run(duration_s=120.0), FORCES, lambda values: limit * np.tanh(values / limit))
    assert "linearity" in flagged(bent, Reference(RIG))


def still_reference(**settings):
    empty = tank_run(mass_kg=DRY_KG, configuration="empty", seed=11, **settings)
    frozen = tank_run(configuration="frozen", seed=12, **settings)
    dry = identify_dry_mass([empty], [frozen], liquid_mass_kg=LIQUID_KG)
    return Reference(RIG, dry, like_series(frozen))


def test_a_run_is_compared_with_its_still_runs():
    reference = still_reference()
    assert flagged(tank_run(), reference) == set()
    late = changed(tank_run(), FORCES, lambda values: shifted(values, 1.0))
    assert flagged(late, reference) == {"delay at the quiet start"}
    strong = changed(tank_run(), FORCES, lambda values: 1.05 * values)
    assert flagged(strong, reference) == {"mass at the quiet start"}
    weak_cell = with_channel(tank_run(), "force_cell_2", lambda values: 0.9 * values)
    assert flagged(weak_cell, reference) == {"gain against the still runs", "mass at the quiet start"}


def test_a_delay_that_all_runs_share_is_said_of_the_still_runs():
    reference = still_reference(delay_samples=0.5)
    assert reference.dry is not None
    assert flagged(tank_run(delay_samples=0.5), reference) == set()
    [found] = calibration_findings(reference.dry, RIG, Inertia.of(RIG, 20.0))
    assert found.check == "delay of the still runs"
    assert "lags acceleration by 97" in found.what


@pytest.mark.parametrize(("dry", "fill", "wrong"), [(0.61, 0.5, False), (0.66, 0.5, True), (0.61, 0.9, True)])
def test_a_sweep_alone_against_the_rig_file(dry, fill, wrong):
    rig = Rig.from_toml_text(TOML.format(dry=dry, fill=fill))
    assert flagged(tank_run(), Reference(rig)) == ({"mass at the quiet start"} if wrong else set())


def test_samples_lost_from_both_forces():
    def dropped(values):
        return np.concatenate([values[:20_000], values[20_020:], values[-20:]])

    lost = changed(tank_run(duration_s=90.0), FORCES, dropped)
    found = {f.check: f for f in examined(lost, Reference(RIG)).findings}
    # half a cycle is missing at 12 Hz: an error of the phase that no liquid makes
    assert found["phase"].start_s == pytest.approx(20_000 / RATE_HZ, abs=1.5)


@pytest.mark.parametrize("n", [1, 3])
def test_few_samples_lost_from_both_forces(n):
    def dropped(values):
        return np.concatenate([values[:20_000], values[20_000 + n :], values[-n:]])

    lost = changed(tank_run(duration_s=90.0), FORCES, dropped)
    [found] = [f for f in examined(lost, Reference(RIG)).findings if f.check == "lost samples"]
    assert found.start_s == pytest.approx(20_000 / RATE_HZ, abs=1.5)
    assert f"{1e3 * n / RATE_HZ:.3g} ms earlier" in found.what


def test_a_common_gain_that_steps():
    n = tank_run(duration_s=90.0).sizes["time"]
    step = np.where(np.arange(n) < n // 2, 1.0, 0.97)
    stepped = changed(tank_run(duration_s=90.0), FORCES, lambda values: step * values)
    assert "gain over time" in flagged(stepped, Reference(RIG))


def windows(w_bar, beta):
    n = len(w_bar)
    return xr.Dataset(
        {"w_bar": ("window", w_bar), "w_bar_std": ("window", [0.01] * n), "beta": ("window", beta),
         "time_s": ("window", np.arange(n, dtype=float))}
    )  # fmt: skip


@pytest.mark.parametrize(
    ("w_bar", "beta", "said"),
    [
        ([0.2, 1.6, -0.04], [-0.3, -0.6, 0.1], ""),
        ([0.2, -0.2, 0.3], [-0.3, -0.3, -0.3], "negative"),
        ([0.2, 4.5, 0.3], [-0.3, -0.3, -0.3], "two plastic blows"),
        ([0.2, 0.3, 0.3], [-0.3, -1.9, -0.3], "no liquid has"),
    ],
)
def test_results_that_no_liquid_gives(w_bar, beta, said):
    found = window_findings(windows(w_bar, beta))
    assert len(found) == (1 if said else 0)
    assert not said or said in found[0].what


@pytest.mark.parametrize(("n_samples", "wrong"), [(0.0, False), (0.1, False), (2.0, True), (-2.0, True)])
def test_a_delay_where_the_motion_dies_away(n_samples, wrong):
    # the first ten seconds are missing: there is no quiet start
    run = tank_run(stop_s=3.0, delay_samples=n_samples).isel(time=slice(5_120, None))
    run = run.assign_attrs({k: v for k, v in run.attrs.items() if not k.startswith("sweep")})
    result = examined(run, Reference(RIG))
    assert any("does not begin at rest" in point.why for point in result.not_checked)
    found = [finding for finding in result.findings if finding.check == "delay at the end"]
    assert bool(found) == wrong
    if wrong:
        assert f"{1e3 * abs(n_samples) / RATE_HZ:.2g}"[:3] in found[0].what
        assert ("late" in found[0].what) == (n_samples > 0)


@pytest.mark.parametrize("configuration", ["sloshing", "frozen"])
@pytest.mark.parametrize("experiment", ["shaker_sweep", "beam_free"])
@pytest.mark.parametrize(
    "change",
    [
        lambda values: 1e200 * values,
        lambda values: 1e-200 * values,
        lambda values: np.eye(1, values.size, 5_000).ravel(),
        lambda values: 1.0 * np.arange(values.size),
        lambda values: np.sign(values),
        lambda values: np.where(np.arange(values.size) % 600 < 590, np.nan, values),
        lambda values: np.where(np.arange(values.size) < 9_000, 0.0, values),
    ],
    ids=["huge", "tiny", "one blow", "ramp", "square", "mostly lost", "late"],
)
def test_any_readings_end_in_an_examination(change, experiment, configuration):
    base = tank_run(duration_s=20.0, experiment=experiment, configuration=configuration)
    examined(changed(base, list(base.data_vars), change), Reference(RIG))


@pytest.mark.parametrize(("factor", "odd"), [(1.0, set()), (1.04, {"c"}), (0.95, {"c"})])
def test_a_run_that_starts_unlike_its_siblings(factor, odd):
    starts = {name: start_response(tank_signals(tank_run(seed=seed))) for seed, name in enumerate("abd")}
    starts["c"] = start_response(tank_signals(changed(tank_run(seed=9), FORCES, lambda values: factor * values)))
    found = sibling_findings(starts, RIG, Inertia.of(RIG, 20.0))
    assert set(found) == odd
    # two runs do not tell which of them is odd
    assert not sibling_findings({name: starts[name] for name in "ac"}, RIG, Inertia.of(RIG, 20.0))
