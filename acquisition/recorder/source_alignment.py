"""Where the samples of several devices lie on the time base of the first one."""

from __future__ import annotations

import enum
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.recorder.placement import SourcePlacement
from acquisition.recorder.survey import SourceSurvey
from acquisition.sources.interface import SourceInfo
from sloshlab.channel_names import ACCELERATION_CONTROL, ACCELERATION_ROOF
from sloshlab.conditioning.device_clock import ClockStatus
from sloshlab.conditioning.redundancy import PHASE_ERROR_AT_HZ
from sloshlab.conditioning.time_alignment import (
    AlignmentStatus,
    ClockDelay,
    SampledSignal,
    clock_delay,
)
from sloshlab.errors import AnalysisError, InputError

LATENCY_DIFFERENCE_S: Final = 0.25
"""Shortest latencies of two paths may differ by this; signals are searched so far from the host times."""

UNKNOWN_START_S: Final = 30.0
"""How far starts are sought apart where host times mean nothing."""

# beyond what quartzes differ by: those of two devices are some 100 ppm apart
UNKNOWN_DRIFT_PPM: Final = 500.0
_MOST_PAIRS_TRIED = 6
_LARGEST_STEP_DIFFERENCE = 1e-9


class AlignmentMethod(enum.Enum):
    """What the place of a device on the first one's time base rests on; the text is the explanation."""

    FIRST = "its own clock is the time base"
    SIGNALS = "host arrival times, refined by signals that show the same motion"
    HOST = "host arrival times alone: the difference of the shortest latencies is unknown"
    DEVICE = "device clocks that are synchronised"
    COUNTER = "sample counters of a common trigger"
    NONE = "nothing: no real time, no common signal; both are taken to have begun together"


@dataclass(frozen=True)
class SourceAlignment:
    """One device on the time base of the first.

    Attributes
    ----------
    method : AlignmentMethod
    start_s, step_s : float
        Time of the device's first place and between places [s].
    error_s : float or None
        Half width of the 95 % interval where it is largest; None if unknown.
    delays : tuple of (str, str, ClockDelay)
        Signals compared (of the first source, of this one) and what came out, best first.
    """

    method: AlignmentMethod
    start_s: float
    step_s: float
    error_s: float | None
    delays: tuple[tuple[str, str, ClockDelay], ...] = ()

    @property
    def phase_error_at_20_hz_rad(self) -> float | None:
        """2π·20 Hz·`error_s`; times reactive over dissipative power it is the relative error of a loop area."""
        return None if self.error_s is None else 2 * math.pi * PHASE_ERROR_AT_HZ * self.error_s

    @property
    def is_on_base(self) -> bool:
        """Whether its samples are samples of the time base, shifted by whole steps."""
        return self.method in (AlignmentMethod.FIRST, AlignmentMethod.COUNTER)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and texts."""
        return {
            "method": self.method.name.lower(),
            "explanation": self.method.value,
            "start_s": self.start_s,
            "step_s": self.step_s,
            "error_s": self.error_s,
            "phase_error_at_20_hz_rad": self.phase_error_at_20_hz_rad,
            "delays": [{"reference": a, "channel": b, **delay.to_dict()} for a, b, delay in self.delays],
        }


def require_alignable(infos: Sequence[SourceInfo], align: str, redundant: Sequence[tuple[str, str]]) -> None:
    """Refuse devices that cannot be aligned in the way asked for, whatever they will deliver.

    Parameters
    ----------
    infos : sequence of SourceInfo
        The first is the time base.
    align : {"host", "device", "counter"}
    redundant : sequence of (str, str)
        Channels, one of the first device and one of another.

    Raises
    ------
    InputError
        If the rates differ under a common trigger, a device has no clock to be aligned by, or a pair does not
        name a channel of the first device and one of another.
    """
    for other in infos[1:]:
        if align == "counter":
            _require_equal_rates(infos[0], other)
        elif align == "device":
            _require_clock(infos[0])
            _require_clock(other)
    # before anything is recorded: a misspelt name would be noticed after the run
    own, *others = ({channel.name for channel in info.channels} for info in infos)
    for first, second in redundant:
        if not any((first in own and second in names) or (second in own and first in names) for names in others):
            raise InputError(
                f"redundant channels {first}:{second}",
                got="no such pair",
                allowed="a channel of the first device and one of another",
                remedy=f"the first, {infos[0].device}, has {', '.join(sorted(own))}"[:300],
            )


def _require_equal_rates(base: SourceInfo, other: SourceInfo) -> None:
    if abs(other.sampling_rate_hz / base.sampling_rate_hz - 1) > _LARGEST_STEP_DIFFERENCE:
        raise InputError(
            f"alignment by counter of {other.device}",
            got=f"{other.sampling_rate_hz:g} Hz beside {base.sampling_rate_hz:g} Hz",
            allowed="equal sampling rates",
            remedy="--align host, or device where the device clocks are synchronised",
        )


def _require_clock(info: SourceInfo) -> None:
    if info.clock_hz is None:
        raise InputError(
            f"alignment by device clock of {info.device}",
            got="no device clock",
            allowed="a device that sends its clock with its samples",
            remedy="--align host, or counter for a common trigger",
        )


def first_source(placement: SourcePlacement) -> SourceAlignment:
    """The time base itself."""
    return SourceAlignment(AlignmentMethod.FIRST, 0.0, 1.0 / placement.info.sampling_rate_hz, 0.0)


def aligned_by_counter(base: SourcePlacement, other: SourcePlacement) -> SourceAlignment:
    """Counters of a common trigger: sample 0 of both is the same instant.

    Raises
    ------
    InputError
        If the rates differ.
    """
    _require_equal_rates(base.info, other.info)
    rate_hz = base.info.sampling_rate_hz
    shift = _counter_at_place_0(other) - _counter_at_place_0(base)
    return SourceAlignment(AlignmentMethod.COUNTER, shift / rate_hz, 1.0 / rate_hz, 0.0)


def aligned_by_device_clock(base: SourcePlacement, other: SourcePlacement) -> SourceAlignment:
    """Device clocks that are synchronised among each other.

    Raises
    ------
    InputError
        If a device has no clock.
    """
    base_start, base_step, base_rms = _device_time(base)
    start, step, rms = _device_time(other)
    # seconds of the base's own clock: its sample k has the time k/rate exactly, whatever its quartz does
    unit = base_step * base.info.sampling_rate_hz
    # two standard deviations
    error_s = 2 * math.hypot(base_rms, rms)
    return SourceAlignment(AlignmentMethod.DEVICE, (start - base_start) / unit, step / unit, error_s)


def aligned_by_host(
    base: SourcePlacement,
    other: SourcePlacement,
    surveys: tuple[SourceSurvey, SourceSurvey],
    pairs: Sequence[tuple[str, str]],
) -> SourceAlignment:
    """Host arrival times, refined by signals that show the same motion.

    Parameters
    ----------
    base, other : SourcePlacement
    surveys : tuple of SourceSurvey
        Of both, with thinned copies of the channels in `pairs`.
    pairs : sequence of (str, str)
        A channel of `base` and one of `other` with the same motion.
    """
    # a phase knows a delay only up to a period, so arrivals bound the search
    prior, largest_delay_s, largest_drift_ppm = _by_arrival(base, other)
    delays = []
    for names in itertools.islice(pairs, _MOST_PAIRS_TRIED):
        signals = [
            _thinned(survey, name, line)
            for survey, name, line in zip(surveys, names, (first_source(base), prior), strict=True)
        ]
        try:
            delay = clock_delay(*signals, largest_delay_s=largest_delay_s, largest_drift_ppm=largest_drift_ppm)
        except AnalysisError:
            continue
        delays.append((*names, delay))
    # an ambiguous delay is not used, however small its residual
    delays.sort(key=lambda delay: (delay[2].status is not AlignmentStatus.ALIGNED, delay[2].error_s))
    # Load cells alone on one device and accelerometers alone on the other show no common motion while the liquid
    # sloshes. Arrivals alone leave milliseconds, and 20 µs at 20 Hz can be a tenth of the dissipated work.
    if not delays or delays[0][2].status is not AlignmentStatus.ALIGNED:
        return replace(prior, delays=tuple(delays))
    best = delays[0][2]
    start_s, step_s = best.reference_line(prior.start_s, prior.step_s)
    return SourceAlignment(AlignmentMethod.SIGNALS, start_s, step_s, best.error_s, tuple(delays))


def common_motion_pairs(
    base: SourcePlacement, other: SourcePlacement, chosen: Sequence[tuple[str, str]], experiment: str
) -> list[tuple[str, str]]:
    """Pairs of channels with the same motion: those that were named, or the accelerometers of a rigid tank."""
    own, others = ({channel.name for channel in placement.info.channels} for placement in (base, other))
    named = [pair for pair in (*chosen, *((b, a) for a, b in chosen)) if pair[0] in own and pair[1] in others]
    if named or not experiment.startswith("shaker_"):
        return named
    return list(itertools.product(_rigid_accelerometers(base), _rigid_accelerometers(other)))


def _rigid_accelerometers(placement: SourcePlacement) -> list[str]:
    # roof and control move as one, as the tank is rigid; a tip or a beam does not
    names = [channel.name for channel in placement.info.channels]
    return [name for name in names if name.startswith((ACCELERATION_ROOF, ACCELERATION_CONTROL))]


def _by_arrival(base: SourcePlacement, other: SourcePlacement) -> tuple[SourceAlignment, float, float]:
    """Alignment by host times, and how far it may be off: delay [s] and drift [ppm]."""
    clocks = [placement.main_stream.clock for placement in (base, other)]
    if any(clock.status is ClockStatus.NOT_REAL_TIME for clock in clocks):
        together = SourceAlignment(AlignmentMethod.NONE, 0.0, 1.0 / other.info.sampling_rate_hz, None)
        # at least half of the shorter run overlaps then
        shortest_s = min(placement.n_samples / placement.info.sampling_rate_hz for placement in (base, other))
        return together, min(UNKNOWN_START_S, 0.5 * shortest_s), UNKNOWN_DRIFT_PPM
    base_start, base_step = _host_time(base, clocks[0].host_origin_ns)
    start, step = _host_time(other, clocks[0].host_origin_ns)
    unit = base_step * base.info.sampling_rate_hz
    errors = [clock.offset_error_s for clock in clocks]
    error_s = sum(errors) if all(math.isfinite(error) for error in errors) else None
    alignment = SourceAlignment(AlignmentMethod.HOST, (start - base_start) / unit, step / unit, error_s)
    drift_ppm = 50.0 + 3 * sum(min(clock.drift_error_ppm, UNKNOWN_DRIFT_PPM) for clock in clocks)
    return alignment, LATENCY_DIFFERENCE_S + 3 * min(1.0, error_s or 1.0), min(drift_ppm, UNKNOWN_DRIFT_PPM)


def _host_time(placement: SourcePlacement, origin_ns: int) -> tuple[float, float]:
    """Host time of place 0 [s after `origin_ns`] and between places."""
    clock = placement.main_stream.clock
    origin_s = (clock.host_origin_ns - origin_ns) * 1e-9
    is_fitted = clock.status is ClockStatus.FITTED
    period_s = clock.period_s if is_fitted else 1.0 / placement.info.sampling_rate_hz
    return origin_s + clock.first_sample_s + period_s * _counter_at_place_0(placement), period_s


def _counter_at_place_0(placement: SourcePlacement) -> int:
    stream = placement.main_stream
    return stream.first_counter - stream.first_index


def _device_time(placement: SourcePlacement) -> tuple[float, float, float]:
    """Device clock at place 0 [s], between places, and the RMS of what a line leaves."""
    _require_clock(placement.info)
    ticks, places = _ticks(placement)
    if places.size < 2 or places[0] == places[-1]:
        raise InputError(
            f"alignment by device clock of {placement.info.device}",
            got=f"{places.size} readings of its clock",
            allowed="at least two, of different samples",
            remedy="--align host, or counter for a common trigger",
        )
    time = (ticks - ticks[0]) / placement.info.clock_hz
    middle = places.mean()
    # about the middle: far from zero a fit loses digits
    slope, height = np.polyfit(places - middle, time, 1)
    rms = float(np.sqrt(np.mean((time - height - slope * (places - middle)) ** 2)))
    return float(ticks[0] / placement.info.clock_hz + height - slope * middle), float(slope), rms


def _ticks(placement: SourcePlacement) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    stream = placement.main_stream.stream
    own = [(g, (g.entries.stream == stream) & (g.entries.clock_ticks >= 0)) for g in placement.groups]
    ticks = np.concatenate([group.entries.clock_ticks[mask] for group, mask in own])
    places = np.concatenate([group.index[mask] for group, mask in own]).astype(np.float64)
    order = np.argsort(places, kind="stable")
    return ticks[order], places[order]


def _thinned(survey: SourceSurvey, name: str, line: SourceAlignment) -> SampledSignal:
    factor = survey.thinned_by
    # a mean of samples belongs to the middle of them
    start_s = line.start_s + 0.5 * (factor - 1) * line.step_s
    return SampledSignal(survey.thinned[name], start_s, factor * line.step_s)


def described(alignments: Mapping[str, SourceAlignment]) -> list[str]:
    """One line per device that is not the time base."""
    return [
        f"{device}: {_sentence(alignment)}"
        for device, alignment in alignments.items()
        if alignment.method is not AlignmentMethod.FIRST
    ]


def _sentence(alignment: SourceAlignment) -> str:
    if alignment.error_s is None:
        return f"aligned by {alignment.method.value}"
    phase = alignment.phase_error_at_20_hz_rad
    return (
        f"aligned by {alignment.method.value}; begins at {alignment.start_s:+.6f} s, error ≤ "
        f"{1e6 * alignment.error_s:.3g} µs = {phase:.2g} rad at 20 Hz (times reactive over dissipative power: "
        "relative error of a loop area)"
    )
