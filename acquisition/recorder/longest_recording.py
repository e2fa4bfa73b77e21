"""How long a recording of some devices may become: what no reader would take need not be recorded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from acquisition.recorder.recording_file import BYTES_PER_VALUE
from acquisition.sources.interface import SourceInfo
from sloshlab.recording import MAXIMUM_DECODED_BYTES

_SHARE: Final = 0.98
"""The rest is for what is still on its way when the recorder stops, and for the gap where a device starts anew."""


def longest_duration_s(infos: Sequence[SourceInfo], align: str) -> float:
    """Longest recording that its readers, and the assembly, take.

    Parameters
    ----------
    infos : sequence of SourceInfo
        The first is the time base.
    align : {"host", "device", "counter"}
        By a common trigger no counts are stored twice.

    Returns
    -------
    float
        Seconds of the first device.

    Examples
    --------
    A little less than 6 GiB of eight channels, time and quality, eight bytes each:

    >>> from acquisition.samples.channel import Channel
    >>> channels = tuple(Channel(f"force_cell_{k}", "force", "N") for k in range(8))
    >>> daq = SourceInfo("daq", "serial:/dev/ttyUSB0", 51_200.0, channels, (tuple(range(8)),))
    >>> round(longest_duration_s([daq], "host"))
    1541
    """
    # as the assembly counts: time and quality beside the channels of each device
    taken = sum((len(info.channels) + 2) * info.sampling_rate_hz for info in infos)
    written = (sum(len(info.channels) for info in infos) + 2) * infos[0].sampling_rate_hz
    if align != "counter":
        # devices that are resampled keep their own counts and flags beside the values
        written += sum((len(info.channels) + 1) * info.sampling_rate_hz for info in infos[1:])
    return _SHARE * MAXIMUM_DECODED_BYTES / (BYTES_PER_VALUE * max(taken, written))
