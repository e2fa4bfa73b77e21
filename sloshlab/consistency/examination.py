"""One run examined before its results are believed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import xarray as xr

from sloshlab.conditioning.calibration import DryMass
from sloshlab.conditioning.combined_channels import (
    acceleration_channels,
    force_channels,
    mean_acceleration,
    total_force,
)
from sloshlab.conditioning.gaps import sampling_step_s
from sloshlab.configurations import FROZEN, SLOSHING
from sloshlab.consistency.between_runs import (
    carried_mass_findings,
    sensor_findings,
    start_findings,
    still_findings,
    stop_findings,
)
from sloshlab.consistency.bounds import LARGEST_W_BAR
from sloshlab.consistency.effect import Inertia
from sloshlab.consistency.finding import ConsistencyExamination, Finding, OpenPoint, contradiction
from sloshlab.consistency.force_response import ForceResponse, start_response, still_response, stop_response
from sloshlab.consistency.like_sensors import N_EACH_SIDE, SIGMA, compared_series, examined_pair
from sloshlab.consistency.samples import examined_samples
from sloshlab.consistency.sensor_response import PairNoise, pair_noise
from sloshlab.consistency.series import SensorSeries, sensor_series
from sloshlab.consistency.statement import law_finding, level_finding
from sloshlab.consistency.step_test import largest_step, step_sigma_near
from sloshlab.errors import AnalysisError
from sloshlab.experiments import EXPERIMENTS, OTHER
from sloshlab.rig import Rig

_LARGEST_NOISE_RATIO: Final = 1.5
_COMPRESSION_SIGMA: Final = 5.0
_WINDOW_CYCLES: Final = 12
_FEWEST_BLOCKS: Final = 3
_SHARE_OF_BLOCKS: Final = 0.02
"""A block of a second may be out of phase by a start or a stop."""
_SHARP: Final = 4
"""Seconds on each side of a step of the gain: a liquid takes longer to change."""
_NO_STEP_SIGMA: Final = 4.0
_LARGEST_PHYSICAL_STEP_OF_W_BAR: Final = 1.0
"""What the liquid itself does within some seconds of a sweep; the largest measured W̄ is 1.65 (Table 1.2)."""


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
    experiment = str(recording.attrs.get("experiment", OTHER))
    if experiment in EXPERIMENTS and EXPERIMENTS[experiment].moves == "shaker":
        return _examined_on_shaker(result, measured, known, is_modulated=EXPERIMENTS[experiment].is_modulated)
    found, missing = _of_like_sensors(measured, Inertia.of(None, math.nan))
    more, not_checked = _of_carried_tank(measured, known.rig)
    return result.with_findings(found + more, missing + not_checked)


def _of_carried_tank(recording: xr.Dataset, rig: Rig | None) -> tuple[list[Finding], list[OpenPoint]]:
    """Force on a tank that a structure carries, against its acceleration, where the liquid is still."""
    try:
        total_force(recording)
        mean_acceleration(recording)
    except AnalysisError:
        return [], []
    if rig is None or recording.attrs.get("configuration") == SLOSHING:
        return [], [
            OpenPoint("force against acceleration", "only a run without liquid motion, with its rig, can tell")
        ]
    frozen = recording.attrs.get("configuration") == FROZEN
    believed_kg = rig.tank.dry_mass_kg + (rig.liquid_mass_kg if frozen else 0.0)
    return carried_mass_findings(still_response(recording), believed_kg, Inertia.of(rig, math.nan)), []


def _examined_on_shaker(
    result: ConsistencyExamination, recording: xr.Dataset, known: Reference, *, is_modulated: bool
) -> ConsistencyExamination:
    try:
        reference_series = _against_acceleration(recording)
    except AnalysisError as error:
        return result.with_findings((), (OpenPoint("sensors against each other and against physics", str(error)),))
    inertia = Inertia.of(known.rig, _highest_hz(reference_series))
    series, missing = compared_series(recording)
    found: list[Finding] = []
    for one, share in series:
        found += examined_pair(one, share, inertia, sampling_step_s(recording))
    found += sensor_findings(series, known.still_series, inertia)
    found += _noise_findings(recording, inertia, reference_series)
    if not is_modulated:
        found += [
            finding for finding in (level_finding(recording), law_finding(recording, reference_series)) if finding
        ]
    start = start_response(recording) if recording.attrs.get("configuration") == SLOSHING else None
    more, not_checked = _of_force(recording, known, inertia, reference_series, start)
    return replace(result.with_findings(found + more, missing + not_checked), start=start)


def _of_like_sensors(recording: xr.Dataset, inertia: Inertia) -> tuple[list[Finding], list[OpenPoint]]:
    series, missing = compared_series(recording)
    step_s = sampling_step_s(recording)
    return [finding for one, share in series for finding in examined_pair(one, share, inertia, step_s)], missing


def _of_force(
    recording: xr.Dataset, known: Reference, inertia: Inertia, series: SensorSeries, start: ForceResponse | None
) -> tuple[list[Finding], list[OpenPoint]]:
    """Force against acceleration: over time, and where the liquid cannot move."""
    if known.rig is None:
        return [], [OpenPoint("force against acceleration with the liquid at rest", "no rig is given")]
    if recording.attrs.get("configuration") != SLOSHING:
        return still_findings(still_response(recording), inertia), []
    found = [
        *_lost_between_force_and_acceleration(series, inertia),
        *_impossible_phase(series, inertia),
        *_common_gain_step(series, inertia),
    ]
    more, not_checked = start_findings(start, known.rig, known.dry, inertia, sampling_step_s(recording))
    more += stop_findings(stop_response(recording), known.dry, inertia)
    return found + more, not_checked


def _lost_between_force_and_acceleration(series: SensorSeries, inertia: Inertia) -> list[Finding]:
    """A step of the delay between force and acceleration that no liquid makes."""
    step = largest_step(series.delay_s, N_EACH_SIDE)
    if step is None or step.sigma < SIGMA:
        return []
    omega = float(series.omega_rad_per_s[step.index])
    w_bar = math.pi * omega * abs(step.size) * inertia.total_kg / inertia.liquid_kg
    if w_bar < _LARGEST_PHYSICAL_STEP_OF_W_BAR:
        return []
    what = (
        f"the force comes {1e3 * abs(step.size):.3g} ms {'later' if step.size > 0 else 'earlier'} against the "
        "acceleration from here on: samples lost or doubled"
    )
    worst, beta = inertia.of_delay(step.size)
    return [
        contradiction("lost samples", what, effect=(worst, beta), time_s=series.from_index(step.index)),
    ]


def _impossible_phase(series: SensorSeries, inertia: Inertia) -> list[Finding]:
    """Blocks in which force and acceleration are further out of phase than any liquid can bring them."""
    dry_kg = inertia.total_kg - inertia.liquid_kg
    # W̄ is bounded, and the dry mass is always in phase: tan φ = W̄ m_l/(π M)
    largest = math.atan2(LARGEST_W_BAR * inertia.liquid_kg, math.pi * dry_kg)
    phase = series.delay_s * series.omega_rad_per_s
    beyond = np.abs(phase) > largest
    if beyond.sum() < max(_FEWEST_BLOCKS, _SHARE_OF_BLOCKS * phase.size):
        return []
    at = np.flatnonzero(beyond)
    found = float(np.abs(phase).max())
    what = f"force and acceleration are up to {found:.2g} rad out of phase, a liquid gives at most {largest:.2g}"
    return [contradiction("phase", what, time_s=(float(series.time_s[at[0]]), float(series.time_s[at[-1]])))]


def _common_gain_step(series: SensorSeries, inertia: Inertia) -> list[Finding]:
    """A step in force over acceleration that stands alone and leaves their delay as it was.

    Where waves come and go the liquid steps, too, but more than once, and mostly with a change of the delay.
    """
    step = largest_step(series.gain, _SHARP)
    if step is None or step.sigma < SIGMA or abs(step.size) < 2 * step.next_size:
        return []
    if step_sigma_near(series.delay_s, _SHARP, step.index) > _NO_STEP_SIGMA:
        return []
    relative = step.size / series.mean_gain.value
    what = f"force over acceleration steps by {100 * relative:+.3g} % while their delay stays"
    effect = inertia.of_gain(relative)
    return [contradiction("gain over time", what, effect=effect, time_s=series.from_index(step.index))]


def _noise_findings(recording: xr.Dataset, inertia: Inertia, series: SensorSeries) -> list[Finding]:
    """Noise and compression of force cells and accelerometers, in pairs."""
    found: list[Finding] = []
    n_per_block = round(1.0 / sampling_step_s(recording))
    for names, mass in ((force_channels(recording), 1.0), (acceleration_channels(recording), inertia.total_kg)):
        for name, partner in zip(names, [*names[1:], names[0]], strict=True):
            if name == partner:
                continue
            pair = pair_noise(
                np.asarray(recording[name].values, dtype=np.float64),
                np.asarray(recording[partner].values, dtype=np.float64),
                n_per_block,
            )
            share = 1.0 if mass == 1.0 else mass / len(names)
            std_per_unit = share * _w_bar_std_of_noise(recording, inertia, series)
            found += _noise(recording[name], pair, std_per_unit)
            found += _compression(name, pair, inertia, 1.0 / len(names))
    return found


def _noise(channel: xr.DataArray, pair: PairNoise, w_bar_std_per_unit: float) -> list[Finding]:
    stated = float(channel.attrs.get("noise_std", 0.0))
    if not stated > 0 or not pair.std > _LARGEST_NOISE_RATIO * stated:
        return []
    what = f"noise of {pair.std:.3g} {channel.attrs.get('units', '')}, {pair.std / stated:.3g} times its noise_std"
    error = 2 * w_bar_std_per_unit * pair.std
    return [contradiction("noise", what, (str(channel.name),), effect=(error, math.nan))]


def _compression(name: str, pair: PairNoise, inertia: Inertia, share: float) -> list[Finding]:
    if not pair.compression > _COMPRESSION_SIGMA * pair.compression_std:
        return []
    # y = x − x³/(3 L²): the slope at the peak is 1 − (x̂/L)², the fundamental is short by (x̂/L)²/4
    effect = inertia.of_gain(0.25 * share * pair.compression)
    what = (
        f"its gain is {100 * pair.compression:.2g} ± {100 * pair.compression_std:.1g} % smaller at both ends of "
        "its range than in the middle"
    )
    return [contradiction("linearity", what, (name,), effect=effect)]


def _w_bar_std_of_noise(recording: xr.Dataset, inertia: Inertia, series: SensorSeries) -> float:
    """Standard deviation of W̄ of a window for white noise of 1 N on the force.

    The work of a cycle is ∑ F u̇ Δt, so that noise σ gives σ (Ωu₀/√2) √(T Δt); W̄ divides by m_l (Ωu₀)².
    """
    omega = float(np.median(series.omega_rad_per_s))
    acceleration = np.asarray(mean_acceleration(recording).values, dtype=np.float64)
    velocity = math.sqrt(2.0) * float(np.nanstd(acceleration)) / omega
    period = 2 * math.pi / omega
    of_cycle = math.sqrt(0.5 * period * sampling_step_s(recording)) / (inertia.liquid_kg * velocity)
    return of_cycle / math.sqrt(_WINDOW_CYCLES)


def _against_acceleration(recording: xr.Dataset) -> SensorSeries:
    force = total_force(recording)
    return sensor_series(force.to_dataset(), str(force.name), mean_acceleration(recording))


def like_series(recording: xr.Dataset) -> tuple[SensorSeries, ...]:
    """Like sensors of a still run, for `Reference`."""
    return tuple(one for one, _ in compared_series(recording)[0])


def _highest_hz(series: SensorSeries) -> float:
    return float(np.quantile(series.omega_rad_per_s, 0.95)) / (2 * math.pi)
