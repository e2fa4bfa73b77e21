"""Runs that call themselves repeats: which are of two rigs, which are not, and what is said of them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from sloshlab.errors import AnalysisError
from sloshlab.identification.case import Case, CaseRun
from sloshlab.identification.repeats import RepeatDifference, repeat_differences, require_repeats
from sloshlab.recording import run_attributes

RATE_HZ = 250.0
TIME = np.arange(2000) / RATE_HZ


class _Shown:
    """What a check of repeats asks of a model: which channels drive, which are compared."""

    moving_mass_kg = 2.0

    def __init__(self, driving: tuple[str, ...] = ()) -> None:
        self._driving = driving

    def driving(self, run: CaseRun) -> tuple[str, ...]:
        return self._driving

    def compared(self, run: CaseRun) -> list[str]:
        return [str(name) for name in run.recording.data_vars if name not in self._driving]


def _run(name: str, channels: Mapping[str, np.ndarray], **attributes: Any) -> CaseRun:
    units = {"acceleration": "m s-2", "displacement": "m", "force": "N"}
    variables = {
        channel: ("time", values, {"units": units[channel.split("_")[0]], "quantity": channel.split("_")[0]})
        for channel, values in channels.items()
    }
    described = {
        "sloshlab_format": "1",
        "run_id": name,
        "experiment": "other",
        "configuration": "frozen",
        "rig": "rig",
        "sampling_rate_hz": RATE_HZ,
        "start_time_utc": "2026-01-01T00:00:00Z",
        **attributes,
    }
    recording = xr.Dataset(variables, coords={"time": TIME[: len(next(iter(channels.values())))]}, attrs=described)
    return CaseRun(name, recording, run_attributes(recording))


def _case(*runs: CaseRun) -> Case:
    return Case("case", Path(), None, runs)


def _decay(
    frequency_hz: float, ratio: float = 0.01, *, start: float = 0.02, seed: int = 0
) -> dict[str, np.ndarray]:
    """Closed form of a decay, displacement and acceleration, with noise."""
    omega, generator = 2 * np.pi * frequency_hz, np.random.default_rng(seed)
    rate = complex(-ratio * omega, omega * np.sqrt(1 - ratio**2))
    motion = start * np.exp(rate * TIME)
    return {
        "displacement_mass": motion.real + 1e-5 * generator.standard_normal(TIME.size),
        "acceleration_mass": (rate**2 * motion).real + 0.02 * generator.standard_normal(TIME.size),
    }


def test_decays_of_two_rigs() -> None:
    """6.42 and 6.61 Hz, in one line with both."""
    case = _case(_run("a", _decay(6.42, seed=1), repeat=1), _run("b", _decay(6.61, seed=2), repeat=2))
    (found,) = repeat_differences(case, _Shown())
    assert found.what == "frequency"
    assert found.values == pytest.approx((6.42, 6.61), rel=1e-3)
    with pytest.raises(
        AnalysisError, match=r"runs a and b call themselves repeats: their frequencies are 6\.42 and 6\.61 Hz"
    ):
        require_repeats(case, _Shown())


def test_damping_of_two_rigs() -> None:
    """One and two per cent."""
    case = _case(_run("a", _decay(6.5, 0.01, seed=1), repeat=1), _run("b", _decay(6.5, 0.02, seed=2), repeat=2))
    (found,) = repeat_differences(case, _Shown())
    assert found.what == "damping"
    assert found.values == pytest.approx((0.01, 0.02), rel=0.02)


@pytest.mark.parametrize("seed", range(20))
def test_repeats_of_one_rig_are_repeats(seed: int) -> None:
    """Other noise, another start, another zero, and a burst in one of them."""
    burst = np.where((TIME > 2) & (TIME < 2.3), 1.0, 0.0) * np.random.default_rng(seed).standard_normal(TIME.size)
    other = _decay(6.5, start=0.0195, seed=seed + 100)
    other["acceleration_mass"] = other["acceleration_mass"] + 20.0 * burst + 3.0
    other["displacement_mass"] = other["displacement_mass"] + 2e-3 * burst + 1e-3 * TIME
    case = _case(_run("a", _decay(6.5, seed=seed)), _run("b", other))
    assert repeat_differences(case, _Shown()) == []


@pytest.mark.parametrize("seed", range(4))
def test_one_sensor_that_differs_is_no_other_rig(seed: int) -> None:
    """A clock that runs three per cent fast, in one channel of two."""
    other = {**_decay(6.5, seed=seed + 9), "acceleration_mass": _decay(6.7, seed=2)["acceleration_mass"]}
    case = _case(_run("a", _decay(6.5, seed=seed)), _run("b", other))
    assert repeat_differences(case, _Shown()) == []


def test_a_spring_that_softens_is_compared_at_common_amplitudes() -> None:
    """Frequency falls by 20 % with the amplitude; starts 30 % apart are repeats, another rig is seen."""

    def softening(start: float, small_hz: float, seed: int) -> dict[str, np.ndarray]:
        amplitude = start * np.exp(-0.2 * TIME)
        phase = np.cumsum(2 * np.pi * small_hz * (1 - 0.2 * amplitude / 0.02)) / RATE_HZ
        noise = 1e-5 * np.random.default_rng(seed).standard_normal(TIME.size)
        return {"displacement_mass": amplitude * np.cos(phase) + noise}

    first = _run("a", softening(0.02, 6.5, 1), repeat=1)
    assert repeat_differences(_case(first, _run("b", softening(0.014, 6.5, 2), repeat=2)), _Shown()) == []
    (found,) = repeat_differences(_case(first, _run("b", softening(0.014, 6.63, 2), repeat=2)), _Shown())
    assert found.values[1] / found.values[0] == pytest.approx(1.02, abs=0.002)


@pytest.mark.parametrize("seed", range(10))
def test_a_frequency_that_wanders_within_a_run_may_differ_between_runs(seed: int) -> None:
    """By 4 % from one third of a second to the next: means of eight seconds differ by 1.2 %."""
    runs = []
    for name, generator in zip("ab", np.random.default_rng(seed).spawn(2), strict=True):
        frequency = 6.5 * (1 + 0.04 * np.repeat(generator.standard_normal(24), 84)[: TIME.size])
        motion = 0.02 * np.exp(-0.2 * TIME) * np.cos(2 * np.pi * np.cumsum(frequency) / RATE_HZ)
        runs.append(
            _run(name, {"displacement_mass": motion + 1e-5 * generator.standard_normal(TIME.size)}, test="t")
        )
    assert repeat_differences(_case(*runs), _Shown()) == []


def _driven(frequency_hz: float, seed: int) -> dict[str, np.ndarray]:
    """Steady state under a periodic force, line by line, after its first period."""
    # None at 6.625 Hz, so that the second rig answers less.
    lines = np.delete(np.arange(40, 73), 53 - 40) / 8.0
    phases = np.random.default_rng(9).uniform(0, 2 * np.pi, lines.size)
    # −ω²/(ω₀² − ω² + 2iζω₀ω)/m
    transfer = lines**2 / (lines**2 - frequency_hz**2 - 2j * 0.01 * frequency_hz * lines) / 2.2
    turning = np.exp(1j * (2 * np.pi * lines[:, None] * TIME + phases[:, None]))
    noise = 0.05 * np.random.default_rng(seed).standard_normal(TIME.size)
    return {
        "force_drive": turning.real.sum(axis=0),
        "acceleration_mass": (transfer[:, None] * turning).real.sum(axis=0) + noise,
    }


def test_driven_runs_of_two_rigs_are_seen_although_their_levels_differ() -> None:
    """They call themselves repeats by their number, and by nothing else that differs."""
    model = _Shown(("force_drive",))
    two = _case(_run("a", _driven(6.42, 1), repeat=1), _run("b", _driven(6.61, 2), repeat=2))
    assert len(two.tests()) == 2
    (found,) = [difference for difference in repeat_differences(two, model) if difference.what == "frequency"]
    assert found.values == pytest.approx((6.42, 6.61), rel=2e-3)
    one = _case(_run("a", _driven(6.42, 1), repeat=1), _run("b", _driven(6.42, 2), repeat=2))
    assert repeat_differences(one, model) == []
    # Two tests may differ in whatever they like.
    tests = _case(_run("a", _driven(6.42, 1), test="one"), _run("b", _driven(6.61, 2), test="two"))
    assert repeat_differences(tests, model) == []


def test_mass_of_what_a_shaker_moves() -> None:
    """Force over acceleration, ten per cent apart: a gain, as there is no mode."""
    generator, drive = np.random.default_rng(1), _driven(6.5, 1)["force_drive"]

    def shaken(mass_kg: float) -> dict[str, np.ndarray]:
        return {
            "acceleration_control": drive,
            "force_cell_1": mass_kg * drive + 0.5 * generator.standard_normal(TIME.size),
        }

    model = _Shown(("acceleration_control",))
    case = _case(_run("a", shaken(1.0), repeat=1), _run("b", shaken(1.1), repeat=2))
    (found,) = repeat_differences(case, model)
    assert (found.what, found.values[1]) == ("gain", pytest.approx(1.1, rel=0.02))
    assert "moves the second 1.1 times as much" in found.statement
    assert repeat_differences(_case(_run("a", shaken(1.0)), _run("b", shaken(1.02))), model) == []


def test_lost_samples_are_no_difference() -> None:
    """A gap and a masked beginning are left out; a channel without a stretch of samples says nothing."""
    gap = _decay(6.5, seed=2)
    gap["displacement_mass"][:100] = np.nan
    gap["displacement_mass"][900:910] = np.nan
    gap["acceleration_mass"][:] = np.nan
    assert repeat_differences(_case(_run("a", _decay(6.5, seed=1)), _run("b", gap)), _Shown()) == []
    short = {name: values[:20] for name, values in _decay(6.5).items()}
    assert repeat_differences(_case(_run("a", short), _run("b", short)), _Shown()) == []


def test_many_standard_errors_are_not_counted() -> None:
    """Beyond a hundred a number says no more."""
    said = RepeatDifference(("a", "b"), "damping", (0.01, 0.02), 6267.0).statement
    assert said.endswith("their damping ratios are 1 and 2 %, more than 100 standard errors apart")
