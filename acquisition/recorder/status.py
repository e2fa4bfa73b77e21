"""What the recorder tells whoever watches it: events as they happen, and its state when asked."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from acquisition.recorder.statistics import ChannelLevel, Drift
from acquisition.samples.delivery import TroubleKind


class SourceState(enum.Enum):
    """What a source is doing."""

    WAITING = "waiting for samples"
    RUNNING = "running"
    SILENT = "silent"
    DISCONNECTED = "disconnected"
    ENDED = "ended"
    FAILED = "failed"
    STOPPED = "stopped"


class StopReason(enum.Enum):
    """Why a recording ended; the text is the explanation."""

    DURATION = "the duration asked for was recorded"
    END = "all devices said that they are done"
    REQUESTED = "stopped on request"
    SOURCES_FAILED = "no source was left"
    SILENCE = "no source delivered anything for too long"
    TOO_LONG = "a longer recording could not be read; record the rest into another"
    STORAGE = "the journal could not be written"


@dataclass(frozen=True)
class Event:
    """Something a person must see at once; `source` is None if it concerns all.

    `mark_ns` is the moment of a mark that was set, on the monotonic clock.
    """

    source: int | None
    message: str
    is_failure: bool
    mark_ns: int | None = None


@dataclass(frozen=True)
class SourceStatus:
    """One source at a moment."""

    device: str
    url: str
    state: SourceState
    sampling_rate_hz: float
    measured_rate_hz: float | None
    n_samples: int
    n_lost: int
    levels: tuple[ChannelLevel, ...]
    troubles: Mapping[TroubleKind, int]
    drift: Drift | None
    queue_fill: float
    error: str | None


@dataclass(frozen=True)
class RecorderStatus:
    """The recorder at a moment; times in seconds of this computer's clock since the start.

    `waiting_for` says which trigger has not come yet; nothing is recorded until then.
    """

    elapsed_s: float
    remaining_s: float | None
    n_bytes_written: int
    is_stopping: bool
    sources: tuple[SourceStatus, ...]
    waiting_for: str = ""


@dataclass(frozen=True)
class RecordingOutcome:
    """How a recording went; `storage_error` is the one line about a journal that could not be written."""

    reason: StopReason
    status: RecorderStatus
    failures: Mapping[int, str]
    storage_error: str | None


class Observer(Protocol):
    """Whoever watches a recording; called in the thread that runs the recorder."""

    def event(self, event: Event) -> None:
        """Something happened."""

    def status(self, status: RecorderStatus) -> None:
        """The state now, a few times per second."""


class NobodyWatching:
    """An observer that looks away."""

    def event(self, event: Event) -> None:
        """Nothing."""

    def status(self, status: RecorderStatus) -> None:
        """Nothing."""


class SeveralWatching:
    """Passes everything on to several observers, in their order."""

    def __init__(self, *observers: Observer) -> None:
        self._observers = observers

    def event(self, event: Event) -> None:
        """Tell each."""
        for observer in self._observers:
            observer.event(event)

    def status(self, status: RecorderStatus) -> None:
        """Show each."""
        for observer in self._observers:
            observer.status(status)
