"""One source as the page shows it: its samples in their places, and envelopes of them."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.samples.delivery import Block
from acquisition.sources.interface import SourceInfo
from pipelines.live_page.envelope import COLUMNS, Envelope
from pipelines.live_page.latest_samples import LatestSamples

WINDOWS_S: Final = (5.0, 30.0, 300.0)
"""Lengths of time that the curves can show."""

KEPT_S: Final = 20.0
"""Of single samples, for spectra and loops."""

_MOST_KEPT_VALUES: Final = 16 << 20
_LATE_S: Final = 1.0
"""Messages of one CAN device may differ by this, as in the recording."""
_QUIET_NS: Final = 400_000_000


class SourceView:
    """Places, envelopes and latest samples of one source.

    Parameters
    ----------
    info : SourceInfo
    """

    def __init__(self, info: SourceInfo) -> None:
        self.info, n_channels = info, len(info.channels)
        rate_hz = info.sampling_rate_hz
        self.windows = {
            window_s: Envelope(n_channels, max(1, round(window_s * rate_hz / COLUMNS))) for window_s in WINDOWS_S
        }
        n_kept = int(min(KEPT_S * rate_hz, _MOST_KEPT_VALUES / n_channels))
        self.samples = LatestSamples(max(n_kept, 2), n_channels)
        self._scale = np.array([channel.scale_factor for channel in info.channels])
        self._offset = np.array([channel.add_offset for channel in info.channels])
        self._stream: int | None = None
        self._shift = 0
        self._end, self._end_ns = 0, 0

    def take(self, block: Block) -> None:
        """Take consecutive samples of one group."""
        place = self._place(block)
        if place < 0:
            return
        members = self.info.groups[block.group]
        values = self._values(block, list(members))
        self.samples.put(place, values, members)
        for envelope in self.windows.values():
            envelope.update(place, values, members)
        end = place + len(block.counts)
        if end >= self._end:
            self._end, self._end_ns = end, block.host_monotonic_ns

    def now_s(self, host_monotonic_ns: int) -> float:
        """Time of the page: that of the newest sample, and what has passed since if nothing comes any more [s]."""
        if self._stream is None:
            return 0.0
        return (self._end + self._waited(host_monotonic_ns, _QUIET_NS)) / self.info.sampling_rate_hz

    def time_s(self, host_monotonic_ns: int) -> float:
        """Time at which a sample of that moment is shown [s], as well as arrivals tell."""
        if self._stream is None:
            return 0.0
        since_s = (host_monotonic_ns - self._end_ns) * 1e-9
        return max(0.0, self._end / self.info.sampling_rate_hz + since_s)

    def columns(self, window_s: float, since: int) -> tuple[int, NDArray[np.float64], NDArray[np.float64]]:
        """Columns that are new or may still have changed; see `Envelope.since`."""
        envelope = self.windows[window_s]
        late = _LATE_S * self.info.sampling_rate_hz / envelope.n_per_column if len(self.info.groups) > 1 else 0
        return envelope.since(since - int(late) - 1)

    def described(self) -> dict[str, Any]:
        """What the page must know before anything comes."""
        info = self.info
        return {
            "device": info.device,
            "rate_hz": info.sampling_rate_hz,
            "channels": [{"name": channel.name, "units": channel.units} for channel in info.channels],
            "column_s": {
                f"{window_s:g}": envelope.n_per_column / info.sampling_rate_hz
                for window_s, envelope in self.windows.items()
            },
        }

    def _place(self, block: Block) -> int:
        """Place of the first sample; a new stream begins where the clock of this computer puts it."""
        if self._stream is None:
            self._shift = -block.counter
        elif block.stream != self._stream:
            begin = self._end + self._waited(block.host_monotonic_ns, 0) - len(block.counts)
            self._shift = max(self._end + 1, begin) - block.counter
        self._stream = block.stream
        return block.counter + self._shift

    def _waited(self, host_monotonic_ns: int, at_least_ns: int) -> int:
        """Samples due since the newest one, 0 while that is younger than `at_least_ns`."""
        waited_ns = host_monotonic_ns - self._end_ns
        return round(waited_ns * 1e-9 * self.info.sampling_rate_hz) if waited_ns > at_least_ns else 0

    def _values(self, block: Block, members: list[int]) -> NDArray[np.float64]:
        values: NDArray[np.float64] = block.counts * self._scale[members] + self._offset[members]
        for column, number in enumerate(members):
            missing = self.info.channels[number].missing_count
            if missing is not None:
                values[block.counts[:, column] == missing, column] = np.nan
        return values
