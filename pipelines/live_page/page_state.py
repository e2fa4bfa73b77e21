"""What the page shows, put together of what comes through the pipe; any number of browsers look at it."""

from __future__ import annotations

import math
import shutil
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Final

from acquisition.recorder.journal_format import source_from
from acquisition.samples.delivery import Block
from pipelines.live_page.source_view import WINDOWS_S, SourceView

_MOST_EVENTS: Final = 200
MOST_SHOWN: Final = 16
"""Channels whose curves one browser can have at once."""


class PageState:
    """The state of the recording, as the page shows it; used by several threads.

    Parameters
    ----------
    monotonic_ns : callable
        Clock; given by tests.
    """

    def __init__(self, monotonic_ns: Callable[[], int] = time.monotonic_ns) -> None:
        self._monotonic_ns = monotonic_ns
        self._lock = threading.Lock()
        self.sources: list[SourceView] = []
        self.about: dict[str, Any] = {}
        self.status: dict[str, Any] = {}
        self.finished: dict[str, Any] | None = None
        self.has_ended = False
        self.analyses: dict[str, Any] = {}
        self.n_analyses = 0
        self._events: deque[dict[str, Any]] = deque(maxlen=_MOST_EVENTS)
        self._n_events = 0

    def take(self, frame: Mapping[str, Any] | tuple[int, Block]) -> None:
        """Take one frame of the pipe into account."""
        with self._lock:
            if isinstance(frame, tuple):
                self.sources[frame[0]].take(frame[1])
            elif frame["about"] == "begin":
                self.sources = [SourceView(source_from(content)) for content in frame["sources"]]
                self.about = {key: value for key, value in frame.items() if key not in ("about", "sources")}
            elif frame["about"] == "status":
                self.status = dict(frame)
            elif frame["about"] == "event":
                self._add_event(frame)
            elif frame["about"] == "finished":
                self.finished = dict(frame)

    def latest(self, source: int, seconds: float, channels: list[int]) -> tuple[int, Any]:
        """Place of the first and values of the last samples of some channels, see `LatestSamples.last`."""
        with self._lock:
            view = self.sources[source]
            return view.samples.last(round(seconds * view.info.sampling_rate_hz), channels)

    def put_analyses(self, found: Mapping[str, Any]) -> None:
        """New spectra, loops and works; each replaces the one before."""
        with self._lock:
            self.analyses = {**self.analyses, **found}
            self.n_analyses += 1

    def events_since(self, number: int) -> tuple[int, list[dict[str, Any]]]:
        """Number of all events so far, and those kept that a browser which knows `number` of them does not."""
        n_new = min(self._n_events - number, len(self._events))
        return self._n_events, list(self._events)[len(self._events) - n_new :] if n_new > 0 else []

    def locked(self) -> threading.Lock:
        """Held by whoever reads several things that must belong together."""
        return self._lock

    def n_bytes_free(self) -> int | None:
        """Free space where the journal grows; None where it cannot be told for a moment."""
        if "folder" not in self.about:
            return None
        try:
            return shutil.disk_usage(self.about["folder"]).free
        except OSError:
            return None

    def now_s(self) -> list[float]:
        """Time of each source at the right edge of its curves [s]."""
        now_ns = self._monotonic_ns()
        if self.finished is not None or self.has_ended:
            return [view.now_s(0) for view in self.sources]
        return [view.now_s(now_ns) for view in self.sources]

    def _add_event(self, frame: Mapping[str, Any]) -> None:
        at_ns = int(frame.get("host_monotonic_ns", self._monotonic_ns()))
        times = [rounded(view.time_s(at_ns)) for view in self.sources]
        kept = {key: value for key, value in frame.items() if key not in ("about", "host_monotonic_ns")}
        self._events.append({**kept, "t": times})
        self._n_events += 1


class Viewer:
    """What one browser has seen, so that each message brings what is new since the last that it took.

    Messages are made when the browser is ready for one: none waits, and a slow browser gets fewer.
    """

    def __init__(self, state: PageState) -> None:
        self._state = state
        self._window_s = WINDOWS_S[0]
        self._shown: list[tuple[int, int]] | None = None
        self._since: list[int] = []
        self._n_events = self._n_analyses = 0
        self._is_described = False

    def wishes(self, message: Mapping[str, Any]) -> None:
        """Another window or other channels; whatever is impossible is left as it was."""
        window = message.get("window")
        if window in WINDOWS_S:
            self._window_s, self._since = float(window), []
        shown = message.get("show")
        if isinstance(shown, list):
            pairs = [tuple(pair) for pair in shown[:MOST_SHOWN] if isinstance(pair, list) and len(pair) == 2]
            self._shown = [(source, channel) for source, channel in pairs if self._is_channel(source, channel)]
            self._since = []

    def message(self) -> dict[str, Any]:
        """Everything that is new."""
        state = self._state
        with state.locked():
            status = {**state.status, "n_bytes_free": state.n_bytes_free()}
            new: dict[str, Any] = {"status": status, "now": [rounded(at) for at in state.now_s()]}
            if state.sources and not self._is_described:
                self._is_described = True
                new["about"] = {
                    **state.about,
                    "sources": [view.described() for view in state.sources],
                    "windows": list(WINDOWS_S),
                    "most_shown": MOST_SHOWN,
                }
            new["window"] = self._window_s
            new["curves"] = self._curves()
            self._n_events, events = state.events_since(self._n_events)
            new |= {"events": events} if events else {}
            if state.n_analyses != self._n_analyses:
                self._n_analyses, new["analyses"] = state.n_analyses, state.analyses
            if state.finished is not None:
                new["finished"] = state.finished
            new["ended"] = state.has_ended
        return new

    def _curves(self) -> list[dict[str, Any]]:
        sources = self._state.sources
        if self._shown is None and sources:
            every = [(number, k) for number, view in enumerate(sources) for k in range(len(view.info.channels))]
            self._shown = every[:8]
        is_anew = not self._since
        if is_anew:
            self._since = [0] * len(sources)
        curves = []
        for number, view in enumerate(sources):
            channels = [channel for source, channel in self._shown or () if source == number]
            first, low, high = view.columns(self._window_s, self._since[number])
            self._since[number] = view.windows[self._window_s].newest
            curves += [
                {
                    "source": number, "channel": channel, "first": first, "anew": is_anew,
                    "low": [rounded(value) for value in low[:, channel].tolist()],
                    "high": [rounded(value) for value in high[:, channel].tolist()],
                }
                for channel in channels
            ]  # fmt: skip
        return curves

    def _is_channel(self, source: Any, channel: Any) -> bool:
        sources = self._state.sources
        return (
            isinstance(source, int)
            and isinstance(channel, int)
            and 0 <= source < len(sources)
            and 0 <= channel < len(sources[source].info.channels)
        )


def rounded(value: float) -> float | None:
    """Six digits, which a screen cannot show; None where there is no number, as JSON has none."""
    return float(f"{value:.6g}") if math.isfinite(value) else None
