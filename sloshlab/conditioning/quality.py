"""How good a recording is, in numbers, and whether an analysis may rest on it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr
from numba import njit

from sloshlab.conditioning.clipping import Clipping, clipping
from sloshlab.conditioning.gaps import Gap, gaps, sampling_step_s
from sloshlab.conditioning.redundancy import SensorAgreement, agreement, redundant_accelerometers
from sloshlab.errors import AnalysisError
from sloshlab.out_of_core import blocks
from sloshlab.recording import CLIPPED, CRC_REPAIRED, OUT_OF_ORDER, STUCK, channels

LARGEST_LOST_FRACTION = 0.5
"""A channel with more lost samples than this share makes the run unusable."""

# Fewer cost only the cycles that they touch.
LARGEST_CLIPPED_FRACTION = 0.01
"""A channel with more clipped samples than this share makes the run unusable."""

LARGEST_GAIN_DISAGREEMENT = 0.05
"""Redundant sensors further apart than this share are remarked on."""


@dataclass(frozen=True)
class ChannelQuality:
    """One channel in numbers.

    Attributes
    ----------
    name, quantity, units : str
        What it is.
    minimum, maximum, mean, standard_deviation : float
        Of the samples that are not lost, in `units`. NaN if all are lost.
    n_samples, n_lost : int
        All samples, and those that are NaN.
    clipping : Clipping
        Samples at the limits.
    """

    name: str
    quantity: str
    units: str
    minimum: float
    maximum: float
    mean: float
    standard_deviation: float
    n_samples: int
    n_lost: int
    clipping: Clipping

    @property
    def is_constant(self) -> bool:
        """The value never changes: a dead or unplugged sensor."""
        return self.n_lost < self.n_samples and self.minimum == self.maximum


@dataclass(frozen=True)
class RunQuality:
    """A whole recording in numbers.

    Attributes
    ----------
    run_id : str
        Which run.
    sampling_rate_hz, duration_s : float
        Of the time coordinate.
    n_samples : int
        Samples per channel.
    channels : tuple of ChannelQuality
        By name.
    gaps : tuple of Gap
        Where any channel is lost.
    n_flagged_clipped, n_crc_repaired, n_out_of_order, n_stuck : int
        Samples with these bits in `quality`.
    accelerometers : SensorAgreement or None
        Agreement of the redundant accelerometers; None where there are fewer than two or they cannot be
        compared.
    reasons : tuple of str
        Why the run is unusable; empty if it is usable.
    remarks : tuple of str
        What a reader should know although the run is usable.
    """

    run_id: str
    sampling_rate_hz: float
    duration_s: float
    n_samples: int
    channels: tuple[ChannelQuality, ...]
    gaps: tuple[Gap, ...]
    n_flagged_clipped: int
    n_crc_repaired: int
    n_out_of_order: int
    n_stuck: int
    accelerometers: SensorAgreement | None
    reasons: tuple[str, ...]
    remarks: tuple[str, ...]

    @property
    def usable(self) -> bool:
        """Whether an analysis may rest on the run."""
        return not self.reasons

    @property
    def n_lost(self) -> int:
        """Samples lost in at least one channel."""
        return sum(gap.n_samples for gap in self.gaps)


def quality_of(recording: xr.Dataset) -> RunQuality:
    """Everything that is checked about a recording, channel by channel and across channels.

    Parameters
    ----------
    recording : xarray.Dataset
        A recording in SI units; it is not changed.

    Returns
    -------
    RunQuality

    Raises
    ------
    AnalysisError
        If it has fewer than two samples.
    """
    step_s = sampling_step_s(recording)
    qualities = tuple(channel_quality(recording[name]) for name in channels(recording))
    lost = gaps(recording)
    flags = _flag_counts(recording)
    # a comparison that fails is a remark: the channels may be good each by itself
    agreed, failure = _accelerometer_agreement(recording, qualities)
    reasons = [*_channel_reasons(qualities), *_sign_reasons(agreed)]
    remarks = [*_channel_remarks(qualities), *_gap_remarks(lost, flags), *_gain_remarks(agreed), *failure]
    return RunQuality(
        run_id=str(recording.attrs.get("run_id", "unnamed")),
        sampling_rate_hz=1.0 / step_s,
        duration_s=step_s * (recording.sizes["time"] - 1),
        n_samples=int(recording.sizes["time"]),
        channels=qualities,
        gaps=lost,
        n_flagged_clipped=flags[CLIPPED],
        n_crc_repaired=flags[CRC_REPAIRED],
        n_out_of_order=flags[OUT_OF_ORDER],
        n_stuck=flags[STUCK],
        accelerometers=agreed,
        reasons=tuple(reasons),
        remarks=tuple(remarks),
    )


def channel_quality(channel: xr.DataArray) -> ChannelQuality:
    """Range, mean, RMS, lost and clipped samples of one channel."""
    n, minimum, maximum, mean, deviation = sample_statistics(channel.values)
    return ChannelQuality(
        name=str(channel.name),
        quantity=str(channel.attrs.get("quantity", "")),
        units=str(channel.attrs.get("units", "")),
        minimum=float(minimum),
        maximum=float(maximum),
        mean=float(mean),
        standard_deviation=float(deviation),
        n_samples=int(channel.size),
        n_lost=int(channel.size - n),
        clipping=clipping(channel),
    )


def _flag_counts(recording: xr.Dataset) -> dict[int, int]:
    bits = (CLIPPED, CRC_REPAIRED, OUT_OF_ORDER, STUCK)
    if "quality" not in recording:
        return dict.fromkeys(bits, 0)
    flags, counts = recording["quality"].values, dict.fromkeys(bits, 0)
    for part in blocks(flags.size, flags):
        # most blocks have no flags: one pass instead of four
        if flags[part].any():
            for bit in bits:
                counts[bit] += int(np.count_nonzero(flags[part] & bit))
    return counts


def _accelerometer_agreement(
    recording: xr.Dataset, qualities: tuple[ChannelQuality, ...]
) -> tuple[SensorAgreement | None, list[str]]:
    """The agreement, or None with the reason why it could not be had."""
    # a dead sensor is a reason of its own, and would disagree with every other one
    alive = {
        channel.name for channel in qualities if channel.n_lost < channel.n_samples and not channel.is_constant
    }
    names = [name for name in redundant_accelerometers(recording) if name in alive]
    if len(names) < 2:
        return None, []
    try:
        return agreement(recording, names), []
    except AnalysisError as error:
        return None, [f"redundant accelerometers were not compared: {error}"]


def _channel_reasons(qualities: tuple[ChannelQuality, ...]) -> list[str]:
    reasons = []
    for channel in qualities:
        # one reason per channel, the gravest first
        lost, clipped = channel.n_lost / channel.n_samples, channel.clipping.n_clipped / channel.n_samples
        if channel.is_constant:
            reasons.append(f"{channel.name}: constant at {channel.minimum:.6g} {channel.units}")
        elif lost > LARGEST_LOST_FRACTION:
            reasons.append(f"{channel.name}: {100 * lost:.3g} % of the samples are lost")
        elif clipped > LARGEST_CLIPPED_FRACTION:
            reasons.append(f"{channel.name}: {100 * clipped:.3g} % of the samples are clipped")
    return reasons


def _channel_remarks(qualities: tuple[ChannelQuality, ...]) -> list[str]:
    remarks = []
    for channel in qualities:
        if channel.clipping.n_clipped:
            remarks.append(
                f"{channel.name}: {channel.clipping.n_clipped} clipped samples in {channel.clipping.n_runs} runs, "
                f"the first at {channel.clipping.first_s:.6g} s"
            )
        if channel.clipping.is_suspected:
            remarks.append(
                f"{channel.name}: {channel.clipping.n_suspected} samples look cut off at the channel's own extreme"
            )
        if channel.n_lost:
            remarks.append(f"{channel.name}: {channel.n_lost} lost samples")
    return remarks


def _gap_remarks(lost: tuple[Gap, ...], flags: dict[int, int]) -> list[str]:
    remarks = []
    if lost:
        longest = max(lost, key=lambda gap: gap.n_samples)
        remarks.append(f"{len(lost)} gaps, the longest {longest.n_samples} samples from {longest.start_s:.6g} s")
    texts = {
        CLIPPED: "flagged as clipped",
        CRC_REPAIRED: "repaired after a CRC error",
        OUT_OF_ORDER: "out of order",
        STUCK: "of a sensor that did not move",
    }
    remarks += [f"{flags[bit]} samples {text}" for bit, text in texts.items() if flags[bit]]
    return remarks


def _sign_reasons(agreed: SensorAgreement | None) -> list[str]:
    if agreed is None or not agreed.wrong_sign:
        return []
    return [f"{' or '.join(agreed.wrong_sign)}: sign is against the redundant accelerometers"]


def _gain_remarks(agreed: SensorAgreement | None) -> list[str]:
    if agreed is None:
        return []
    return [
        f"{pair.name}: gain {pair.gain_ratio:.4g} of {pair.reference}"
        for pair in agreed.pairs
        if abs(pair.gain_ratio - 1) > LARGEST_GAIN_DISAGREEMENT
    ]


def sample_statistics(values: npt.NDArray[Any]) -> tuple[int, float, float, float, float]:
    """How many values are no NaN; their minimum, maximum, mean and standard deviation, NaN if there are none."""
    sums = _Sums(0, math.inf, -math.inf, 0.0, 0.0, 0.0)
    for part in blocks(values.size, values):
        sums = _added(values[part], sums)
    n, minimum, maximum, origin, total, squares = sums
    if n == 0:
        return 0, math.nan, math.nan, math.nan, math.nan
    mean = total / n
    # taken about the first value: a force with a large static part would lose the digits of its small motion
    variance = squares / n - mean * mean
    return n, minimum, maximum, origin + mean, math.sqrt(max(variance, 0.0)) if variance < math.inf else math.inf


class _Sums(NamedTuple):
    """Running sums of the values so far."""

    n: int
    minimum: float
    maximum: float
    origin: float  # the first value
    total: float  # Σ(x − origin)
    squares: float  # Σ(x − origin)²


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _added(values: npt.NDArray[np.float64], before: _Sums) -> _Sums:
    """The sums with more values."""
    n, minimum, maximum, origin, total, squares = before
    for i in range(values.size):
        value = float(values[i])
        # NaN, a lost sample
        if value != value:
            continue
        if n == 0:
            origin = value
        n += 1
        minimum = min(minimum, value)
        maximum = max(maximum, value)
        value -= origin
        total += value
        squares += value * value
    return _Sums(n, minimum, maximum, origin, total, squares)
