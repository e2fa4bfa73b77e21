"""What the recorder knows about one source while it records."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from acquisition.recorder.statistics import SourceMeters
from acquisition.recorder.status import SourceState, SourceStatus
from acquisition.samples.delivery import Block, Delivery, End, Trouble, TroubleKind
from acquisition.sources.interface import SourceInfo

_TOLD_AT_ONCE: Final = frozenset(
    {
        TroubleKind.DISCONNECTED,
        TroubleKind.RECONNECTED,
        TroubleKind.RESTARTED,
        TroubleKind.CALIBRATION_CHANGED,
        TroubleKind.OVERRUN,
    }
)
# a line that breaks again and again must not fill the terminal; all are counted and in the journal
_MOST_TOLD_PER_KIND: Final = 20


class SourceRecord:
    """State and meters of one source.

    Parameters
    ----------
    info : SourceInfo
    monotonic_ns : callable
    """

    def __init__(self, info: SourceInfo, monotonic_ns: Callable[[], int]) -> None:
        self.info, self._monotonic_ns = info, monotonic_ns
        self.meters = SourceMeters(info)
        self.error: str | None = None
        self.is_finished = False
        self._last_block_ns = monotonic_ns()
        self._first_block_ns: int | None = None
        self._has_ended = self._is_silent = False
        self._is_disconnected = False
        self._n_told: dict[TroubleKind, int] = {}

    def take(self, delivery: Delivery) -> str | None:
        """Take one delivery into account; what a person must see at once is returned."""
        if isinstance(delivery, Block):
            self._last_block_ns = self._monotonic_ns()
            if self._first_block_ns is None:
                self._first_block_ns = self._last_block_ns
            self._has_ended = self._is_silent = self._is_disconnected = False
            self.meters.arrived(delivery)
            return None
        if isinstance(delivery, End):
            self._has_ended = True
            return None
        return self._take_trouble(delivery)

    def begun_anew(self) -> SourceRecord:
        """The same source, of which nothing was recorded yet."""
        new = SourceRecord(self.info, self._monotonic_ns)
        new.error, new.is_finished = self.error, self.is_finished
        new._has_ended, new._is_disconnected = self._has_ended, self._is_disconnected
        return new

    def finish(self, error: str | None) -> None:
        """Nothing more comes."""
        self.is_finished, self.error = True, error

    def became_silent(self, after_s: float) -> bool:
        """True once, when nothing has come for `after_s`."""
        is_due = not self._is_silent and not self._has_ended and not self.is_finished and self.quiet_s > after_s
        self._is_silent = self._is_silent or is_due
        return is_due

    @property
    def quiet_s(self) -> float:
        """Time since the last samples came [s]."""
        return (self._monotonic_ns() - self._last_block_ns) * 1e-9

    @property
    def recorded_s(self) -> float:
        """What the device has sampled since its first sample, lost ones included [s]."""
        return self.meters.n_spanned / self.info.sampling_rate_hz

    @property
    def length_s(self) -> float:
        """How much of a recording the device will fill [s].

        Its samples, or the time since the first of them if that is longer: if it starts anew after a silence,
        the silence will be a gap of that length.
        """
        if self._first_block_ns is None:
            return 0.0
        # waiting for the first sample does not count: it leaves no gap
        return max(self.recorded_s, (self._monotonic_ns() - self._first_block_ns) * 1e-9)

    @property
    def state(self) -> SourceState:
        """What the source is doing."""
        if self.error:
            return SourceState.FAILED
        if self._has_ended:
            return SourceState.ENDED
        if self.is_finished:
            return SourceState.STOPPED
        if self._is_disconnected:
            return SourceState.DISCONNECTED
        if self._is_silent:
            return SourceState.SILENT
        return SourceState.RUNNING if self.meters.n_spanned else SourceState.WAITING

    def status(self, queue_fill: float) -> SourceStatus:
        """Everything for a person."""
        meters = self.meters
        return SourceStatus(
            device=self.info.device,
            url=self.info.url,
            state=self.state,
            sampling_rate_hz=self.info.sampling_rate_hz,
            measured_rate_hz=meters.measured_rate_hz,
            n_samples=meters.n_samples,
            n_lost=meters.n_lost,
            levels=meters.levels(),
            troubles=dict(meters.troubles),
            drift=meters.drift_meter.drift(),
            queue_fill=queue_fill,
            error=self.error,
        )

    def _take_trouble(self, trouble: Trouble) -> str | None:
        self.meters.add_trouble(trouble)
        if trouble.kind in (TroubleKind.DISCONNECTED, TroubleKind.RECONNECTED):
            self._is_disconnected = trouble.kind is TroubleKind.DISCONNECTED
        n_told = self._n_told.get(trouble.kind, 0)
        if trouble.kind not in _TOLD_AT_ONCE or n_told >= _MOST_TOLD_PER_KIND:
            return None
        self._n_told[trouble.kind] = n_told + 1
        return " ".join(f"{self.info.device}: {trouble.kind.value}: {trouble.detail}".split())
