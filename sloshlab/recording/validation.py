"""What every recording must hold, in a file or in memory."""

from __future__ import annotations

import numpy as np
import xarray as xr

from sloshlab.errors import RecordingError
from sloshlab.out_of_core import blocks
from sloshlab.recording.attributes import RunAttributes, channel_attributes, factor_to_si_of, run_attributes
from sloshlab.recording.channel_access import channels, is_channel
from sloshlab.recording.quality_bits import LOST
from sloshlab.recording.time_axis import require_uniform_time


def validate_recording(recording: xr.Dataset, *, name: str = "recording") -> RunAttributes:
    """Check an in-memory recording against the format.

    Returns
    -------
    RunAttributes
        Its validated global attributes.

    Raises
    ------
    RecordingError
        On the first breach found.
    """
    attributes = run_attributes(recording, name=name)
    if "time" not in recording.coords or recording["time"].dims != ("time",):
        raise RecordingError(f"{name}: time", got="no coordinate time(time)", allowed="seconds, uniform")
    time = np.asarray(recording["time"].values)
    require_uniform_time(time, attributes.sampling_rate_hz, name)
    found = False
    for channel, variable in recording.data_vars.items():
        if not is_channel(str(channel), variable.dims, variable.attrs):
            continue
        found = True
        described = channel_attributes(str(channel), variable.attrs, name)
        factor_to_si_of(str(channel), described, name)
    if not found:
        raise no_channel(name)
    require_lost_flagged(recording, name)
    return attributes


def require_lost_flagged(recording: xr.Dataset, name: str) -> None:
    """Refuse NaN without the flag of lost samples, and infinite values.

    Raises
    ------
    RecordingError
        Of the first channel that has some.
    """
    flags = recording.get("quality")
    if flags is not None and (flags.dims != ("time",) or flags.dtype.kind not in "ui"):
        raise RecordingError(f"{name}: quality", got=f"{flags.dtype}{flags.dims}", allowed="uint8(time)")
    lost = None if flags is None else flags.values
    for channel in channels(recording):
        values = recording[channel].values
        unflagged, first = 0, 0
        for part in blocks(values.size, values, *([] if lost is None else [lost])):
            # one pass without an array of flags; most blocks are whole
            if np.isfinite(values[part].sum()):
                continue
            not_finite = ~np.isfinite(values[part])
            if np.isinf(values[part][not_finite]).any():
                raise RecordingError(
                    f"{name}: {channel}", got="infinite values", allowed="numbers, NaN where lost"
                )
            wrong = not_finite if lost is None else not_finite & ((lost[part] & LOST) == 0)
            if not unflagged:
                first = part.start + int(wrong.argmax())
            unflagged += int(wrong.sum())
        if unflagged:
            at = float(recording["time"].values[first])
            raise RecordingError(
                f"{name}: {channel}",
                got=f"{unflagged} NaN samples that are not flagged as lost, the first at {at:.6g} s",
                allowed="NaN only where `quality` has bit 1 (lost)",
                remedy="flag them in `quality`, or find out where they come from",
            )


def no_channel(name: str) -> RecordingError:
    """The error of a recording without channels."""
    return RecordingError(
        f"{name}: channels",
        got="none",
        allowed="at least one variable(time) with `quantity`",
        remedy="use `sloshlab import` with a channel map",
    )
