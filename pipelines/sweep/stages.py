"""The stages that every sweep goes through, whatever was shaken."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.inputs.recordings import RunSource
from pipelines.report.outputs import sha256_of
from pipelines.sweep.results import RunResult, SweepOptions, SweepSignals
from pipelines.sweep.window_signals import Excerpt, WindowSignals, window_signals
from sloshlab.conditioning.clipping import clipped_samples
from sloshlab.conditioning.integration import displacement_of_part
from sloshlab.conditioning.quality import RunQuality, quality_of
from sloshlab.consistency.examination import Reference, examined
from sloshlab.consistency.finding import ConsistencyExamination
from sloshlab.errors import AnalysisError, InputError
from sloshlab.experiments import EXPERIMENTS
from sloshlab.out_of_core import blocks, empty
from sloshlab.recording import CLIPPED, CRC_REPAIRED, LOST, STUCK, RunAttributes, run_attributes
from sloshlab.rig import Rig
from sloshlab.sweep.cycles import evaluate_cycles
from sloshlab.sweep.law import SweepLaw, identify_law, stated_law
from sloshlab.sweep.motion_phase import MotionPhase, measured_phase
from sloshlab.sweep.windows import evaluate_windows

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

EXCERPT_FREQUENCIES_HZ = (9.0, 13.0, 17.0)
"""Reference points of Table 1.2, where time histories and loops are shown."""
_OF_EXCERPT = ["frequency_hz", "time_s", "acceleration_g"]
"""What an excerpt reads of its window, cut out of the others once."""
_EARLY_STOP_SHARE = 0.03
"""A sweep must move during all but this share of the time it is stated or recorded to last."""
_SMALLEST_NUMBER_OF_SAMPLES_PER_CYCLE = 8
"""Below it the quadrature of the loop errs by more than 0.1 %."""


@contextlib.contextmanager
def naming(path: RunSource) -> Iterator[None]:
    """Name the recording in every error that an analysis of it raises."""
    try:
        yield
    except InputError as error:
        if str(path) in error.what:
            raise
        raise AnalysisError(
            f"{path}: {error.what}", got=error.got, allowed=error.allowed, remedy=error.remedy
        ) from error


def require_usable(recording: xr.Dataset, path: RunSource) -> RunQuality:
    """Quality of a recording; refuse one that no analysis may rest on.

    Raises
    ------
    AnalysisError
        With every reason.
    """
    quality = quality_of(recording)
    if not quality.usable:
        raise AnalysisError(f"recording {path}", got="; ".join(quality.reasons), allowed="working sensors")
    return quality


def examined_recording(
    recording: xr.Dataset, path: RunSource, reference: Reference | None = None, names: Sequence[str] | None = None
) -> tuple[xr.Dataset, ConsistencyExamination]:
    """The recording with NaN where nothing was measured, and everything that was found in it.

    Raises
    ------
    AnalysisError
        If no result may rest on the run.
    """
    examination = examined(recording, reference, names)
    if examination.refusals:
        raise AnalysisError(
            f"recording {path}",
            got="; ".join(examination.refusals),
            allowed="a run that an analysis may rest on",
            remedy="record again; `sloshlab check` lists everything that was found",
        )
    return examination.measured_only(recording), examination


def not_measured(recording: xr.Dataset, names: list[str], quality: RunQuality) -> BoolArray | None:
    """True where a channel is clipped, or the recorder flags a sample as lost, clipped, repaired or stuck."""
    suffers = {channel.name for channel in quality.channels if channel.clipping.n_clipped}
    # a clipped or repaired sample need not be NaN: its value would enter the work
    mask: BoolArray | None = None
    if "quality" in recording:
        flags = recording["quality"].values
        mask = empty(flags.size, np.bool_)
        for part in blocks(flags.size, flags, mask):
            np.not_equal(flags[part] & (LOST | CLIPPED | CRC_REPAIRED | STUCK), 0, out=mask[part])
    for name in names:
        if name in suffers:
            clipped = clipped_samples(recording[name])
            mask = clipped if mask is None else mask
            for part in blocks(mask.size, mask, clipped):
                mask[part] |= clipped[part]
    return mask


def analyse_sweep(
    recording: xr.Dataset,
    path: RunSource,
    signals: SweepSignals,
    options: SweepOptions,
    *,
    quality: RunQuality,
    rig: Rig | None = None,
    rig_name: str = "",
    keep_signals: bool = False,
) -> RunResult:
    """Take one recording from its signals to its windows; its signals stay in memory if they are to be kept.

    Raises
    ------
    AnalysisError
        If there is no sweep in it, or the sweep stops early and that is not allowed.
    """
    attributes = run_attributes(recording, name=str(path))
    rate_hz = attributes.sampling_rate_hz
    start_time_s = float(recording["time"].values[0])
    phase = _phase(path, signals, rate_hz)
    stated = _stated(attributes)
    flags = _early_stop(path, phase, recording.sizes["time"], attributes, options)
    measured = phase.cycle_boundaries_s()
    # an error of a boundary changes the work of a cycle to second order only: the tank is at rest there
    boundaries = _boundaries(path, measured, stated, start_time_s, options)
    cycles = evaluate_cycles(
        signals.force_n,
        signals.motion,
        boundaries,
        sampling_rate_hz=rate_hz,
        inertia_kg=signals.inertia_kg,
        motion_is_velocity=signals.motion_is_velocity,
        unusable=signals.not_measured,
    )
    n_samples_per_cycle = rate_hz * float(np.quantile(np.diff(measured), 0.01))
    if n_samples_per_cycle < _SMALLEST_NUMBER_OF_SAMPLES_PER_CYCLE:
        flags.append(
            f"{attributes.run_id}: only {n_samples_per_cycle:.1f} samples in the shortest cycles; below "
            f"{_SMALLEST_NUMBER_OF_SAMPLES_PER_CYCLE} the quadrature errs by more than 0.1 %"
        )
    middle = 0.5 * (measured[1:] + measured[:-1])
    law = identify_law(middle + start_time_s, 1.0 / np.diff(measured))
    windows = evaluate_windows(
        cycles,
        run_id=attributes.run_id,
        law=stated or law,
        start_time_s=start_time_s,
        rig=rig,
        settings=options.windows,
        noise_power=signals.noise_power,
    )
    n_lost = int((~cycles.usable[3:-3]).sum())
    if n_lost:
        flags.append(f"{attributes.run_id}: lost or clipped samples cost {n_lost} of {cycles.usable.size} cycles")
    return RunResult(
        path=path,
        sha256=sha256_of(path),
        attributes=attributes,
        rig_name=rig_name,
        windows=windows,
        law=law,
        stated=stated,
        boundary_error_s=float("nan") if stated is None else stated.boundary_error_s(measured + start_time_s),
        quality=quality,
        n_cycles=cycles.usable.size,
        n_cycles_lost=n_lost,
        excerpts=_excerpts(windows, signals, rig, rate_hz, start_time_s),
        flags=tuple(flags),
        start_time_s=start_time_s,
        signals=signals if keep_signals else None,
        window_signals=_signals_of_windows(windows, signals, rig, rate_hz, start_time_s)
        if options.has_report
        else (),
    )


def _phase(path: RunSource, signals: SweepSignals, rate_hz: float) -> MotionPhase:
    reference = signals.motion if signals.phase_motion is None else signals.phase_motion
    # cycles are counted by the phase of the acceleration, a quarter of a cycle ahead of the velocity
    lead = np.pi / 2 if signals.motion_is_velocity and signals.phase_motion is None else 0.0
    with naming(path):
        return measured_phase(reference, None, rate_hz, lead_rad=lead)


def _stated(attributes: RunAttributes) -> SweepLaw | None:
    linear = (attributes.model_extra or {}).get("sweep_rate_hz_per_s")
    slope = float(linear) if isinstance(linear, int | float) else None
    return stated_law(attributes.sweep_start_hz, attributes.sweep_rate_octave_per_s, slope)


def _early_stop(
    path: RunSource, phase: MotionPhase, n_samples: int, attributes: RunAttributes, options: SweepOptions
) -> list[str]:
    """A flag, or an error, if the motion ends before the recording or before the stated end of the sweep."""
    if "end_of_sweep" not in EXPERIMENTS[attributes.experiment].stages:
        return []
    start, stop = phase.moving_interval_s()
    recorded = n_samples / attributes.sampling_rate_hz
    stated = (attributes.model_extra or {}).get("sweep_duration_s")
    expected = max(recorded, float(stated)) if isinstance(stated, int | float) else recorded
    if expected - stop <= max(_EARLY_STOP_SHARE * expected, 1.0):
        return []
    reached = float(phase.phase(stop, 1)) / (2 * np.pi)
    if options.allow_incomplete:
        return [f"{attributes.run_id}: the sweep stops at {stop:.1f} s ({reached:.2f} Hz) of {expected:.1f} s"]
    raise AnalysisError(
        f"{path}: the sweep stops early",
        got=f"motion from {start:.1f} s to {stop:.1f} s ({reached:.2f} Hz)",
        allowed=f"motion until {expected:.1f} s",
        remedy="repeat the run, or analyse what there is with --allow-incomplete",
    )


def _boundaries(
    path: RunSource, measured: FloatArray, stated: SweepLaw | None, start_time_s: float, options: SweepOptions
) -> FloatArray:
    if options.boundaries == "measured":
        return measured
    if stated is None:
        raise AnalysisError(
            f"{path}: --boundaries law",
            got="no sweep law in the attributes",
            allowed="sweep_start_hz with sweep_rate_octave_per_s",
            remedy="use --boundaries measured",
        )
    times = stated.cycle_boundaries_s(measured[0] + start_time_s, measured[-1] + start_time_s)
    return np.asarray(times - start_time_s)


def _excerpts(
    windows: xr.Dataset,
    signals: SweepSignals,
    rig: Rig | None,
    rate_hz: float,
    start_time_s: float,
) -> tuple[Excerpt, ...]:
    """Signals at the windows nearest the reference frequencies, or spread over the sweep."""
    frequency = windows["frequency_hz"].values
    if frequency.size == 0 or signals.motion_is_velocity:
        return ()
    wanted = np.array(EXCERPT_FREQUENCIES_HZ)
    if rig is None or frequency.min() > wanted[0] or frequency.max() < wanted[-1]:
        wanted = np.quantile(frequency, [0.25, 0.5, 0.75])
    # two places may have the same nearest window, which is shown once
    nearest = sorted({int(np.abs(frequency - wanted_hz).argmin()) for wanted_hz in wanted})
    read = windows[_OF_EXCERPT]
    return tuple(excerpt_of(read.isel(window=at), signals, rig, rate_hz, start_time_s) for at in nearest)


def _signals_of_windows(
    windows: xr.Dataset, signals: SweepSignals, rig: Rig | None, rate_hz: float, start_time_s: float
) -> tuple[WindowSignals, ...]:
    """What is seen of every window; none without a displacement."""
    if signals.motion_is_velocity:
        return ()
    read = windows[_OF_EXCERPT]
    return tuple(
        window_signals(excerpt_of(read.isel(window=at), signals, rig, rate_hz, start_time_s))
        for at in range(windows.sizes["window"])
    )


def excerpt_of(
    window: xr.Dataset, signals: SweepSignals, rig: Rig | None, rate_hz: float, start_time_s: float
) -> Excerpt:
    """Signals of twelve cycles about the middle of one window; the motion must be an acceleration."""
    frequency = float(window["frequency_hz"])
    middle = (float(window["time_s"]) - start_time_s) * rate_hz
    half = 6.0 / frequency * rate_hz
    shown = slice(max(0, int(middle - half)), min(signals.motion.size, int(middle + half) + 1))
    corner = max(0.2 * frequency, 0.5)
    shift = displacement_of_part(signals.motion, rate_hz, shown, corner_hz=corner, padding_s=2.0)
    force, motion = signals.force_n[shown], signals.motion[shown]
    dry = signals.inertia_kg - rig.liquid_mass_kg if rig is not None else 0.0
    shown_force = dry * motion - force if rig is not None else force.copy()
    return Excerpt(
        frequency_hz=frequency,
        acceleration_g=float(window["acceleration_g"]),
        time_s=start_time_s + np.arange(shown.start, shown.stop) / rate_hz,
        force_n=shown_force - np.nanmean(shown_force),
        displacement_m=shift - np.nanmean(shift),
    )
