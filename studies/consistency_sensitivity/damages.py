"""Recordings made wrong in known ways; no code of the analysis is used.

A case is an empty, a frozen and a sloshing run with the dry mass and the fill level that the rig file states. A
damage is a function of a case and a size that returns another case.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfilt

FloatArray = npt.NDArray[np.float64]
Change = Callable[[FloatArray, np.random.Generator], FloatArray]
Apply = Callable[["Case", float, np.random.Generator], "Case"]


@dataclass(frozen=True)
class Case:
    """Runs of one tank and what its rig file says.

    Attributes
    ----------
    sloshing : xarray.Dataset
        The run that is analysed.
    empty, frozen : xarray.Dataset or None
        Runs that identify the dry mass; None where the sweep stands alone.
    dry_mass_kg, fill_level : float
        As the rig file states them.
    """

    sloshing: xr.Dataset
    empty: xr.Dataset | None
    frozen: xr.Dataset | None
    dry_mass_kg: float
    fill_level: float

    def alone(self) -> Case:
        """The sloshing run without the runs that identify the dry mass."""
        return replace(self, empty=None, frozen=None)


@dataclass(frozen=True)
class Damage:
    """One way in which a case can be wrong.

    Attributes
    ----------
    name, unit : str
        What is wrong, and what the sizes are in.
    sizes : tuple of float
        Four sizes.
    apply : callable
        ``apply(case, size, generator)`` returns the damaged case; the given one is not changed.
    """

    name: str
    unit: str
    sizes: tuple[float, float, float, float]
    apply: Callable[[Case, float, np.random.Generator], Case]


FORCES = ("force_cell_1", "force_cell_2")
CELL = ("force_cell_1",)
ACCELERATIONS = ("acceleration_control", "acceleration_roof_1", "acceleration_roof_2")
ROOF = ("acceleration_roof_1", "acceleration_roof_2")
ONE_ROOF = ("acceleration_roof_2",)
SLOSHING, EVERY_RUN = ("sloshing",), ("sloshing", "empty", "frozen")


def changed(
    case: Case,
    names: tuple[str, ...],
    change: Change,
    generator: np.random.Generator,
    runs: tuple[str, ...] = SLOSHING,
) -> Case:
    """The case with channels of some runs changed, and without their stated ranges, which would tell too much."""
    new: dict[str, Any] = {}
    for run in runs:
        recording = getattr(case, run)
        if recording is None:
            continue
        recording = recording.copy()
        for name in names:
            values = change(np.asarray(recording[name].values, dtype=np.float64), generator)
            kept = {k: v for k, v in recording[name].attrs.items() if k not in ("range_min", "range_max")}
            recording[name] = xr.Variable(("time",), values, kept)
        new[run] = recording
    return replace(case, **new)


def _on(
    names: tuple[str, ...],
    change_of: Callable[[float], Change],
    runs: tuple[str, ...] = SLOSHING,
    *,
    alone: bool = False,
) -> Apply:
    def apply(case: Case, size: float, generator: np.random.Generator) -> Case:
        return changed(case.alone() if alone else case, names, change_of(size), generator, runs)

    return apply


def _later(n_samples: float) -> Change:
    def change(values: FloatArray, _: np.random.Generator) -> FloatArray:
        at = np.arange(values.size, dtype=np.float64)
        return np.asarray(CubicSpline(at, values)(np.clip(at - n_samples, 0, values.size - 1)))

    return change


def _earlier(n_samples: float) -> Change:
    return _later(-n_samples)


def _times(factor: float) -> Change:
    return lambda values, _: values * factor


def _dropped(n: float) -> Change:
    def change(values: FloatArray, _: np.random.Generator) -> FloatArray:
        # nothing tells that they are missing: what comes later moves forward, the end repeats the last value
        at = int(0.4 * values.size)
        return np.concatenate([values[:at], values[at + int(n) :], np.full(int(n), values[-1])])

    return change


def _doubled(n: float) -> Change:
    def change(values: FloatArray, _: np.random.Generator) -> FloatArray:
        at = int(0.4 * values.size)
        return np.concatenate([values[:at], values[at - int(n) : at], values[at:]])[: values.size]

    return change


def _clipped(share: float) -> Change:
    def change(values: FloatArray, _: np.random.Generator) -> FloatArray:
        limit = share * np.abs(values).max()
        return np.clip(values, -limit, limit)

    return change


def _compressed(peak_over_limit: float) -> Change:
    def change(values: FloatArray, _: np.random.Generator) -> FloatArray:
        limit = np.abs(values).max() / peak_over_limit
        return np.asarray(limit * np.tanh(values / limit))

    return change


def _bent(share_at_peak: float) -> Change:
    def change(values: FloatArray, _: np.random.Generator) -> FloatArray:
        return np.asarray(values + share_at_peak * values**2 / np.abs(values).max())

    return change


def _between(
    start_share: float, n: Callable[[float], int], value: Callable[[FloatArray, slice], Any]
) -> Callable[[float], Change]:
    def of_size(seconds: float) -> Change:
        def change(values: FloatArray, _: np.random.Generator) -> FloatArray:
            start = int(start_share * values.size)
            part = slice(start, start + n(seconds))
            damaged = values.copy()
            damaged[part] = value(values, part)
            return damaged

        return change

    return of_size


def _first(values: FloatArray, part: slice) -> float:
    return float(values[part.start])


def _zero(values: FloatArray, part: slice) -> float:
    return 0.0


def _line(values: FloatArray, part: slice) -> FloatArray:
    return np.linspace(values[part.start], values[part.stop], part.stop - part.start)


def _at_rate(seconds: float) -> int:
    return max(int(seconds * 512.0), 2)


def _spiked(count: float) -> Change:
    def change(values: FloatArray, generator: np.random.Generator) -> FloatArray:
        damaged = values.copy()
        at = generator.choice(values.size, int(count), replace=False)
        damaged[at] += (
            generator.choice([-1.0, 1.0], at.size) * np.abs(values).max() * generator.uniform(0.5, 2, at.size)
        )
        return damaged

    return change


def _noisy(std: float) -> Change:
    return lambda values, generator: values + std * generator.standard_normal(values.size)


def _hum(amplitude: float) -> Change:
    return lambda values, _: values + amplitude * np.sin(2 * np.pi * 50.0 / 512.0 * np.arange(values.size))


def _offset(value: float) -> Change:
    return lambda values, _: values + value


def _ramped(value: float) -> Change:
    return lambda values, _: values + np.linspace(0.0, value, values.size)


def _stepped(factor: float) -> Change:
    return lambda values, _: values * np.where(np.arange(values.size) < 0.4 * values.size, 1.0, factor)


def _drifting(factor: float) -> Change:
    return lambda values, _: values * np.linspace(1.0, factor, values.size)


def _slow_clock(ppm: float) -> Change:
    def change(values: FloatArray, _: np.random.Generator) -> FloatArray:
        at = np.arange(values.size, dtype=np.float64)
        return np.asarray(CubicSpline(at, values)(np.clip(at * (1 - 1e-6 * ppm), 0, values.size - 1)))

    return change


def _coarse(step: float) -> Change:
    return lambda values, _: np.round(values / step) * step


def _repeated(every: float) -> Change:
    def change(values: FloatArray, _: np.random.Generator) -> FloatArray:
        n = int(every)
        return values[(np.arange(values.size) // n) * n]

    return change


def _filtered(corner_hz: float) -> Change:
    def change(values: FloatArray, _: np.random.Generator) -> FloatArray:
        low_pass = butter(2, corner_hz, fs=512.0, output="sos")
        return np.asarray(sosfilt(low_pass, values - values[0]) + values[0], dtype=np.float64)

    return change


def _swapped(case: Case, size: float, generator: np.random.Generator) -> Case:
    """Part of a force in an accelerometer: cross-talk of the cables."""
    recording = case.sloshing.copy()
    force = recording["force_cell_1"].values
    crossed = recording["acceleration_roof_2"]
    recording["acceleration_roof_2"] = crossed.copy(data=crossed.values + size * force)
    return replace(case, sloshing=recording)


def _rate(percent: float) -> Callable[[xr.Dataset], xr.Dataset]:
    def change(recording: xr.Dataset) -> xr.Dataset:
        factor = 1 + percent / 100
        rate_hz = float(recording.attrs["sampling_rate_hz"]) * factor
        slower = recording.assign_coords(time=("time", recording["time"].values / factor, recording["time"].attrs))
        return slower.assign_attrs(sampling_rate_hz=rate_hz)

    return change


def _rated(case: Case, size: float, _: np.random.Generator) -> Case:
    return replace(case, sloshing=_rate(size)(case.sloshing))


def _said(name: str) -> Callable[[Case, float, np.random.Generator], Case]:
    def apply(case: Case, size: float, _: np.random.Generator) -> Case:
        stated = float(case.sloshing.attrs[name]) * size
        return replace(case, sloshing=case.sloshing.assign_attrs({name: stated}))

    return apply


def _dry_mass(case: Case, size: float, _: np.random.Generator) -> Case:
    return replace(case.alone(), dry_mass_kg=case.dry_mass_kg * size)


def _fill(case: Case, size: float, _: np.random.Generator) -> Case:
    return replace(case, fill_level=case.fill_level * size)


def _fill_alone(case: Case, size: float, _: np.random.Generator) -> Case:
    return _fill(case.alone(), size, _)


def _exchanged(case: Case, size: float, _: np.random.Generator) -> Case:
    """Empty and frozen runs under each other's name; the size only makes four cases of it."""
    empty, frozen = case.empty, case.frozen
    assert empty is not None
    assert frozen is not None
    return replace(
        case,
        empty=frozen.assign_attrs(configuration="empty"),
        frozen=empty.assign_attrs(configuration="frozen"),
    )


DELAYS, SHARES = (0.25, 0.5, 1.0, 2.0), (0.9, 0.8, 0.7, 0.5)
UP, DOWN, TANH = (1.0125, 1.025, 1.05, 1.1), (0.9875, 0.975, 0.95, 0.9), (0.3, 0.5, 0.7, 1.0)
SECONDS, LOST = (0.1, 0.5, 2.0, 10.0), (1.0, 3.0, 20.0, 60.0)

DAMAGES: tuple[Damage, ...] = (
    Damage("forces late", "samples", DELAYS, _on(FORCES, _later)),
    Damage("forces early", "samples", DELAYS, _on(FORCES, _earlier)),
    Damage("forces late, no dry runs", "samples", DELAYS, _on(FORCES, _later, alone=True)),
    Damage("forces early, no dry runs", "samples", DELAYS, _on(FORCES, _earlier, alone=True)),
    Damage("forces late in all runs", "samples", DELAYS, _on(FORCES, _later, EVERY_RUN)),
    Damage("one cell late", "samples", DELAYS, _on(CELL, _later)),
    Damage("one cell early", "samples", DELAYS, _on(CELL, _earlier)),
    Damage("roof accelerometers late", "samples", DELAYS, _on(ROOF, _later)),
    Damage("one roof accelerometer late", "samples", DELAYS, _on(ONE_ROOF, _later)),
    Damage("samples dropped from the forces", "samples", LOST, _on(FORCES, _dropped)),
    Damage("samples dropped from one cell", "samples", LOST, _on(CELL, _dropped)),
    Damage("samples dropped from one roof accelerometer", "samples", LOST, _on(ONE_ROOF, _dropped)),
    Damage("samples of the forces doubled", "samples", LOST, _on(FORCES, _doubled)),
    Damage("clock of the forces slow", "ppm", (2.0, 10.0, 50.0, 250.0), _on(FORCES, _slow_clock)),
    Damage("forces clipped", "of the peak", SHARES, _on(FORCES, _clipped)),
    Damage("one cell clipped", "of the peak", SHARES, _on(CELL, _clipped)),
    Damage("roof accelerometers clipped", "of the peak", SHARES, _on(ROOF, _clipped)),
    Damage("forces compressed (tanh)", "peak/limit", TANH, _on(FORCES, _compressed)),
    Damage("one cell compressed (tanh)", "peak/limit", TANH, _on(CELL, _compressed)),
    Damage("accelerometers compressed (tanh)", "peak/limit", TANH, _on(ACCELERATIONS, _compressed)),
    Damage("forces bent (square)", "share at peak", (0.02, 0.05, 0.1, 0.2), _on(FORCES, _bent)),
    Damage("one cell weak", "factor", (0.98, 0.9, 0.7, 0.5), _on(CELL, _times)),
    Damage("one cell strong", "factor", (1.02, 1.1, 1.4, 2.0), _on(CELL, _times)),
    Damage("forces strong", "factor", UP, _on(FORCES, _times)),
    Damage("forces weak", "factor", DOWN, _on(FORCES, _times)),
    Damage("accelerations strong", "factor", UP, _on(ACCELERATIONS, _times)),
    Damage("accelerations weak", "factor", DOWN, _on(ACCELERATIONS, _times)),
    Damage("one roof accelerometer strong", "factor", (1.01, 1.02, 1.04, 1.1), _on(ONE_ROOF, _times)),
    Damage("one roof accelerometer weak", "factor", (0.99, 0.98, 0.96, 0.9), _on(ONE_ROOF, _times)),
    Damage("forces strong, no dry runs", "factor", UP, _on(FORCES, _times, alone=True)),
    Damage("forces weak in the empty run", "factor", DOWN, _on(FORCES, _times, ("empty",))),
    Damage("forces strong in the frozen run", "factor", UP, _on(FORCES, _times, ("frozen",))),
    Damage("forces step in gain", "factor", DOWN, _on(FORCES, _stepped)),
    Damage("one cell steps in gain", "factor", (0.98, 0.9, 0.7, 0.5), _on(CELL, _stepped)),
    Damage("one cell drifts in gain", "factor", (0.98, 0.9, 0.7, 0.5), _on(CELL, _drifting)),
    Damage("a cell stuck", "s", SECONDS, _on(CELL, _between(0.4, _at_rate, _first))),
    Damage("a roof accelerometer stuck", "s", SECONDS, _on(ONE_ROOF, _between(0.4, _at_rate, _first))),
    Damage("a gap of the forces filled with zeros", "s", SECONDS, _on(FORCES, _between(0.4, _at_rate, _zero))),
    Damage("a gap of all filled with zeros", "s", SECONDS,
           _on((*FORCES, *ACCELERATIONS), _between(0.4, _at_rate, _zero))),
    Damage("a gap of the forces filled by a line", "s", SECONDS,
           _on(FORCES, _between(0.4, _at_rate, _line))),
    Damage("spikes in the forces", "spikes", (4.0, 40.0, 400.0, 4000.0), _on(FORCES, _spiked)),
    Damage("spikes in one cell", "spikes", (4.0, 40.0, 400.0, 4000.0), _on(CELL, _spiked)),
    Damage("spikes in one roof accelerometer", "spikes", (4.0, 40.0, 400.0, 4000.0), _on(ONE_ROOF, _spiked)),
    Damage("noise on the forces", "N", (0.1, 0.3, 1.0, 3.0), _on(FORCES, _noisy)),
    Damage("noise on the roof accelerometers", "m/s²", (0.3, 1.0, 3.0, 10.0), _on(ROOF, _noisy)),
    Damage("hum of 50 Hz on the forces", "N", (0.03, 0.1, 0.3, 1.0), _on(FORCES, _hum)),
    Damage("offset of the forces", "N", (0.1, 1.0, 5.0, 20.0), _on(FORCES, _offset)),
    Damage("drift of the forces", "N", (0.1, 1.0, 5.0, 20.0), _on(FORCES, _ramped)),
    Damage("forces in coarse steps", "N", (0.1, 0.5, 1.0, 3.0), _on(FORCES, _coarse)),
    Damage("every sample of the forces repeated", "times", (2.0, 3.0, 4.0, 8.0), _on(FORCES, _repeated)),
    Damage("forces through a low-pass filter", "Hz", (200.0, 120.0, 80.0, 50.0), _on(FORCES, _filtered)),
    Damage("force in an accelerometer", "m/s²/N", (0.01, 0.03, 0.1, 0.3), _swapped),
    Damage("sampling rate wrong", "%", (0.1, 0.3, 1.0, 3.0), _rated),
    Damage("dry mass of the rig file, no dry runs", "factor", (1.01, 1.025, 1.05, 1.1), _dry_mass),
    Damage("fill level of the rig file", "factor", (0.97, 1.05, 1.1, 1.3), _fill),
    Damage("fill level of the rig file, no dry runs", "factor", (0.9, 1.1, 1.2, 1.4), _fill_alone),
    Damage("empty and frozen exchanged", "", (1.0, 2.0, 3.0, 4.0), _exchanged),
    Damage("acceleration_g", "factor", (1.05, 1.1, 1.3, 5 / 3), _said("acceleration_g")),
    Damage("sweep_start_hz", "factor", (1.003, 1.01, 1.05, 1.2), _said("sweep_start_hz")),
    Damage("sweep_rate_octave_per_s", "factor", (1.003, 1.01, 1.05, 1.2), _said("sweep_rate_octave_per_s")),
)  # fmt: skip
