"""One run examined before its results are believed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.conditioning.calibration import DryMass
from sloshlab.conditioning.combined_channels import TankSignals, tank_signals
from sloshlab.conditioning.gaps import sampling_step_s
from sloshlab.configurations import FROZEN, SLOSHING
from sloshlab.consistency.between_runs import (
    carried_mass_findings,
    sensor_findings,
    start_findings,
    still_findings,
    stop_findings,
)
from sloshlab.consistency.effect import Inertia
from sloshlab.consistency.finding import ConsistencyExamination, Finding, OpenPoint
from sloshlab.consistency.force_over_time import findings_over_time
from sloshlab.consistency.force_response import ForceResponse, start_response, still_response, stop_response
from sloshlab.consistency.like_sensors import compared_series, examined_pair
from sloshlab.consistency.noise_findings import noise_findings
from sloshlab.consistency.samples import examined_samples
from sloshlab.consistency.series import SensorSeries, sensor_series
from sloshlab.consistency.statement import law_finding, level_finding
from sloshlab.errors import AnalysisError
from sloshlab.experiments import EXPERIMENTS, OTHER
from sloshlab.out_of_core import blocks
from sloshlab.recording import channels
from sloshlab.rig import Rig

_READABLE: Final = (1e-100, 1e100)
"""Magnitudes of which squares and products are numbers; no sensor reads others."""
_NO_RIG: Final = OpenPoint("force against acceleration with the liquid at rest", "no rig is given")


@dataclass(frozen=True)
class Reference:
    """What a run is compared with.

    Attributes
    ----------
    rig : Rig or None
    dry : DryMass or None
        From empty and frozen runs.
    still_series : tuple of SensorSeries
        Like sensors in a still run.
    """

    rig: Rig | None = None
    dry: DryMass | None = None
    still_series: tuple[SensorSeries, ...] = ()


def examined(
    recording: xr.Dataset, reference: Reference | None = None, names: Sequence[str] | None = None
) -> ConsistencyExamination:
    """Examine a run: its samples, its sensors against each other and against physics, and what it states.

    Parameters
    ----------
    recording : xarray.Dataset
        In SI units; not changed.
    reference : Reference, optional
        Rig and still runs; without them what needs them is named in `not_checked`.
    names : sequence of str, optional
        Channels that are used, if not all are: only their samples are examined.

    Returns
    -------
    ConsistencyExamination
    """
    known = reference or Reference()
    findings, wrong = examined_samples(recording, names)
    result = ConsistencyExamination(str(recording.attrs.get("run_id", "unnamed")), tuple(findings), (), wrong)
    measured = result.measured_only(recording)
    if beyond := _beyond_computing(measured):
        why = f"its readings are not within {_READABLE[0]:g} … {_READABLE[1]:g}"
        return result.with_findings((), [OpenPoint(f"all but single samples of {beyond}", why)])
    experiment = str(recording.attrs.get("experiment", OTHER))
    if experiment in EXPERIMENTS and EXPERIMENTS[experiment].moves == "shaker":
        return _examined_on_shaker(result, measured, known, is_modulated=EXPERIMENTS[experiment].is_modulated)
    found, missing = _of_like_sensors(measured, Inertia.of(None, math.nan))
    more, not_checked = _of_carried_tank(measured, known.rig)
    return result.with_findings(found + more, missing + not_checked)


def _beyond_computing(recording: xr.Dataset) -> str:
    """The first channel whose largest reading is no magnitude to compute with; empty if all are."""
    for name in channels(recording):
        largest = _largest_magnitude(recording[name].values)
        if largest and not _READABLE[0] <= largest <= _READABLE[1]:
            return name
    return ""


def _largest_magnitude(values: npt.NDArray[np.floating]) -> float:
    """Of the values that are not NaN, 0 if none is."""
    largest = 0.0
    for part in blocks(values.size, values):
        highest, lowest = np.fmax.reduce(values[part]), np.fmin.reduce(values[part])
        largest = float(np.fmax(largest, np.fmax(highest, -lowest)))
    return largest


def _of_carried_tank(recording: xr.Dataset, rig: Rig | None) -> tuple[list[Finding], list[OpenPoint]]:
    """Force on a tank that a structure carries, against its acceleration, where the liquid is still."""
    try:
        tank = tank_signals(recording)
    except AnalysisError:
        return [], []
    if rig is None or recording.attrs.get("configuration") == SLOSHING:
        return [], [
            OpenPoint("force against acceleration", "only a run without liquid motion, with its rig, can tell")
        ]
    frozen = recording.attrs.get("configuration") == FROZEN
    believed_kg = rig.tank.dry_mass_kg + (rig.liquid_mass_kg if frozen else 0.0)
    return carried_mass_findings(still_response(tank), believed_kg, Inertia.of(rig, math.nan)), []


def _examined_on_shaker(
    result: ConsistencyExamination, recording: xr.Dataset, known: Reference, *, is_modulated: bool
) -> ConsistencyExamination:
    try:
        tank = tank_signals(recording)
        reference_series = _against_acceleration(tank)
    except AnalysisError as error:
        return result.with_findings((), (OpenPoint("sensors against each other and against physics", str(error)),))
    inertia = Inertia.of(known.rig, _highest_hz(reference_series))
    series, missing = compared_series(recording, tank.acceleration)
    found: list[Finding] = []
    for one, share in series:
        found += examined_pair(one, share, inertia, sampling_step_s(recording))
    found += sensor_findings(series, known.still_series, inertia)
    found += noise_findings(recording, tank.acceleration, inertia, reference_series)
    if not is_modulated:
        found += [
            finding
            for finding in (level_finding(recording, tank.acceleration), law_finding(recording, reference_series))
            if finding
        ]
    if recording.attrs.get("configuration") != SLOSHING:
        more, not_checked = _of_still_force(tank, known, inertia)
        return result.with_findings(found + more, missing + not_checked)
    start = start_response(tank)
    more, not_checked = _of_force(tank, known, inertia, reference_series, start)
    return replace(result.with_findings(found + more, missing + not_checked), start=start)


def _of_like_sensors(recording: xr.Dataset, inertia: Inertia) -> tuple[list[Finding], list[OpenPoint]]:
    series, missing = compared_series(recording)
    step_s = sampling_step_s(recording)
    return [finding for one, share in series for finding in examined_pair(one, share, inertia, step_s)], missing


def _of_still_force(
    tank: TankSignals, known: Reference, inertia: Inertia
) -> tuple[list[Finding], list[OpenPoint]]:
    """Force against acceleration of a run whose liquid does not move."""
    if known.rig is None:
        return [], [_NO_RIG]
    return still_findings(still_response(tank), inertia), []


def _of_force(
    tank: TankSignals, known: Reference, inertia: Inertia, series: SensorSeries, start: ForceResponse | None
) -> tuple[list[Finding], list[OpenPoint]]:
    """Force against acceleration: over time, and where the liquid cannot move."""
    if known.rig is None:
        return [], [_NO_RIG]
    found = findings_over_time(series, inertia)
    more, not_checked = start_findings(start, known.rig, known.dry, inertia, sampling_step_s(tank.force))
    more += stop_findings(stop_response(tank), known.dry, inertia)
    return found + more, not_checked


def _against_acceleration(tank: TankSignals) -> SensorSeries:
    return sensor_series(tank.force.to_dataset(), str(tank.force.name), tank.acceleration)


def like_series(recording: xr.Dataset) -> tuple[SensorSeries, ...]:
    """Like sensors of a still run, for `Reference`."""
    return tuple(one for one, _ in compared_series(recording)[0])


def _highest_hz(series: SensorSeries) -> float:
    return float(np.quantile(series.omega_rad_per_s, 0.95)) / (2 * math.pi)
