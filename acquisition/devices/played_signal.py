"""What `sloshlab replay` plays, from its first argument."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from acquisition.devices.pattern_signal import PatternSignal
from acquisition.devices.recorded_signal import RecordedSignal
from acquisition.devices.signal import MOST_SAMPLES, Signal
from acquisition.devices.virtual_signal import virtual_signal
from acquisition.samples.channel import HIGHEST_SAMPLING_RATE_HZ, MOST_CHANNELS
from acquisition.sources.urls import URLOptions, parse_url
from sloshlab.errors import InputError

_PATTERN, _VIRTUAL = "pattern:", "virtual:"


def played_signal(source: str, channels: Sequence[str] | None = None) -> Signal:
    """The signal that a source is.

    Parameters
    ----------
    source : str
        A recording, ``virtual:EXPERIMENT?rig=RIG.toml&…`` or
        ``pattern:channels=8&sampling_rate_hz=51200&bits=24&duration_s=600``.
    channels : sequence of str, optional
        Names of the channels that are played, in this order.

    Examples
    --------
    >>> played_signal("pattern:channels=2&sampling_rate_hz=100&duration_s=3").n_samples
    300
    """
    if source.startswith(_PATTERN):
        return _pattern(source, channels)
    if source.startswith(_VIRTUAL):
        return virtual_signal(parse_url(source), channels)
    return RecordedSignal(Path(source), channels)


def _pattern(source: str, channels: Sequence[str] | None) -> Signal:
    url = parse_url(source if "?" in source else source.replace(_PATTERN, f"{_PATTERN}?", 1))
    options = URLOptions(url)
    rate_hz = options.number("sampling_rate_hz", 51200.0, lowest=1e-3, highest=HIGHEST_SAMPLING_RATE_HZ)
    duration_s = options.number("duration_s", 60.0, lowest=0.0, highest=MOST_SAMPLES)
    n_channels = options.integer("channels", 8, lowest=1, highest=MOST_CHANNELS)
    bits = int(options.choice("bits", "24", ("16", "24", "32")))
    options.refuse_others()
    # the counts of a pattern are published by the number of the channel: a choice would renumber them
    if channels is not None:
        raise InputError("--channels", got=",".join(channels), allowed="nothing for a pattern")
    return PatternSignal(
        n_channels=n_channels, sampling_rate_hz=rate_hz, bits=bits, n_samples=round(duration_s * rate_hz)
    )
