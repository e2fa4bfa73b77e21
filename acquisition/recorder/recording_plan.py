"""What a recording made of several devices contains: names, types and attributes of its variables."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from acquisition.recorder.placed_samples import PlacedSamples
from acquisition.recorder.placement import SourcePlacement
from acquisition.recorder.recording_file import Variable
from acquisition.recorder.source_alignment import SourceAlignment
from acquisition.recorder.survey import ChannelSurvey, SourceSurvey
from acquisition.samples.channel import Channel, attributes_of
from acquisition.sources.interface import SourceInfo
from sloshlab.errors import JournalError
from sloshlab.recording import FORMAT, quality_attributes, validate_recording

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,127}")


@dataclass(frozen=True)
class Part:
    """One source in the recording.

    Attributes
    ----------
    label : str
        Its device's name, unique and fit for names of variables.
    samples : PlacedSamples
    survey : SourceSurvey
    alignment : SourceAlignment
    names : tuple of str
        Names of its channels in the recording.
    stored : tuple of (numpy.dtype, int)
        Type of each channel's counts on disk, and the one that means "lost".
    """

    label: str
    samples: PlacedSamples
    survey: SourceSurvey
    alignment: SourceAlignment
    names: tuple[str, ...]
    stored: tuple[tuple[np.dtype[Any], int], ...]

    @property
    def placement(self) -> SourcePlacement:
        """Where its samples go."""
        return self.samples.placement

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Its channels, as the device describes them."""
        return self.placement.info.channels

    @property
    def named_channels(self) -> list[tuple[str, Channel]]:
        """Names in the recording and channels."""
        return list(zip(self.names, self.channels, strict=True))

    @property
    def shift(self) -> int:
        """Steps between the first place of the time base and its own, where it is sampled on it."""
        return round(self.alignment.start_s / self.alignment.step_s)


def device_labels(infos: Sequence[SourceInfo]) -> list[str]:
    """Unique names that may be part of a variable's name."""
    labels: list[str] = []
    for info in infos:
        # a device names itself, and its label becomes part of names of variables
        plain = re.sub(r"[^A-Za-z0-9_]+", "_", info.device)[:40] or "device"
        label, number = plain, 2
        while label in labels:
            label, number = f"{plain}_{number}", number + 1
        labels.append(label)
    return labels


def channel_names(infos: Sequence[SourceInfo], labels: Sequence[str]) -> list[tuple[str, ...]]:
    """Names in the recording; the second device to use a name gets its own appended.

    Raises
    ------
    JournalError
        If a name cannot be that of a variable, or a device uses one twice.
    """
    # a channel of that name would take the place of the time base
    taken: set[str] = {"time", "quality"}
    named = []
    for info, label in zip(infos, labels, strict=True):
        own = []
        for channel in info.channels:
            name = channel.name if channel.name not in taken else f"{channel.name}_{label}"
            # in netCDF a slash in a name leads into another group
            if name in taken or not _NAME.fullmatch(channel.name):
                raise JournalError(
                    f"channel of {info.device}",
                    got=repr(channel.name)[:80],
                    allowed="letters, digits and underscores; each name once",
                )
            taken.add(name)
            own.append(name)
        named.append(tuple(own))
    return named


def stored_type(channel: Channel, survey: ChannelSurvey) -> tuple[np.dtype[Any], int]:
    """Smallest type that holds the counts, and a count for "lost" that no reading has.

    Examples
    --------
    >>> quiet = ChannelSurvey(-5, 5, False, False, 0, 0, 0, ())
    >>> stored_type(Channel("force_cell_1", "force", "N"), quiet)
    (dtype('int16'), -32768)
    """
    readings = [count for count in (survey.minimum, survey.maximum) if count is not None]
    for n_bits in (16, 32, 64):
        lowest = -(2 ** (n_bits - 1))
        fill = lowest if channel.missing_count is None else channel.missing_count
        # A "lost" that a reading could have is no mark: the lowest count serves if no reading has it, else a wider
        # type.
        fits = all(lowest <= count < -lowest for count in (*readings, fill))
        is_used = {16: survey.has_lowest_16, 32: survey.has_lowest_32, 64: False}[n_bits]
        if n_bits >= min(channel.bits, 32) and fits and (channel.missing_count is not None or not is_used):
            return np.dtype(f"i{n_bits // 8}"), fill
    raise JournalError(
        f"channel {channel.name}", got=f"missing_count = {channel.missing_count}", allowed="a count of 64 bits"
    )


def variables_of(parts: Sequence[Part], before_s: float = 0.0) -> list[Variable]:
    """All variables of the recording, time and quality included; it begins `before_s` before time 0."""
    variables = [Variable("time", "time", np.float64, {"units": "s"})]
    for part in parts:
        columns = zip(part.names, part.channels, part.stored, strict=True)
        if part.alignment.is_on_base:
            variables += [
                Variable(name, "time", dtype, {**attributes_of(channel), **_scaling(channel)}, fill)
                for name, channel, (dtype, fill) in columns
            ]
        else:
            variables += _resampled_variables(part, before_s)
    return [*variables, Variable("quality", "time", np.uint8, quality_attributes())]


def dimensions_of(parts: Sequence[Part], n_samples: int) -> dict[str, int]:
    """Sizes of all dimensions."""
    own = {f"sample_{part.label}": part.placement.n_samples for part in parts if not part.alignment.is_on_base}
    return {"time": n_samples, **own}


def _resampled_variables(part: Part, before_s: float) -> list[Variable]:
    """Values on the time base, and beside them the counts as they were taken."""
    dimension = f"sample_{part.label}"
    place = {"first_sample_s": part.alignment.start_s - before_s, "sample_step_s": part.alignment.step_s}
    values, counts = [], []
    for name, channel, (dtype, fill) in zip(part.names, part.channels, part.stored, strict=True):
        resampled = {**attributes_of(channel), "resampled_from": f"counts_{name}"}
        # Nothing is lost by resampling: the counts as they were taken stand beside the values.
        values.append(Variable(name, "time", np.float32, resampled, math.nan))
        described = {"units": channel.units, "channel": name, **place, **_scaling(channel)}
        counts.append(Variable(f"counts_{name}", dimension, dtype, described, fill))
    return [
        *values,
        *counts,
        Variable(f"quality_{part.label}", dimension, np.uint8, {**quality_attributes(), **place}),
    ]


def _scaling(channel: Channel) -> dict[str, float]:
    offset = {"add_offset": float(channel.add_offset)} if channel.add_offset else {}
    return {"scale_factor": float(channel.scale_factor), **offset}


def require_recordable(infos: Sequence[SourceInfo], attributes: Mapping[str, Any], what: str) -> None:
    """Refuse devices whose channels no recording can hold, before anything is recorded.

    Parameters
    ----------
    infos : sequence of SourceInfo
        The first is the time base.
    attributes : mapping
        Of the run, as far as they are known.
    what : str
        For the message.

    Raises
    ------
    JournalError, RecordingError
        As at the assembly.
    """
    # any start will do: it is known only with the first sample
    measured = {"start_time_utc": "2026-01-01T00:00:00Z", "sampling_rate_hz": infos[0].sampling_rate_hz}
    names = channel_names(infos, device_labels(infos))
    named = [pair for own, info in zip(names, infos, strict=True) for pair in zip(own, info.channels, strict=True)]
    checked_attributes(
        {"sloshlab_format": FORMAT, **measured, **attributes}, named, what, infos[0].sampling_rate_hz
    )


def checked_attributes(
    attributes: Mapping[str, Any], named_channels: Iterable[tuple[str, Channel]], what: str, rate_hz: float
) -> dict[str, Any]:
    """Global attributes as they can be written.

    Raises
    ------
    RecordingError
        If they, or a channel's, are not those of a recording: found out before anything is written.
    """
    plain = {key: _plain(value) for key, value in attributes.items() if value is not None}
    empty = {name: ("time", np.zeros(2), attributes_of(channel)) for name, channel in named_channels}
    # by the reader's own check, on two samples: what it would refuse is not written
    validate_recording(xr.Dataset(empty, coords={"time": [0.0, 1.0 / rate_hz]}, attrs=plain), name=what)
    return plain


def _plain(value: Any) -> Any:
    return value if isinstance(value, str | int | float) and not isinstance(value, bool) else json.dumps(value)
