"""What a person at the rig sees while it records: levels, clipping, losses, drift, time and space left.

On a terminal only, a few times per second; in a pipe only failures are said, one line each. Text that
comes from devices is shown with its control characters written out.
"""

from __future__ import annotations

import contextlib
import math
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Final, Self

from acquisition.recorder.statistics import ChannelLevel
from acquisition.recorder.status import Event, RecorderStatus, SourceState, SourceStatus
from acquisition.samples.delivery import TroubleKind
from pipelines.report.progress import is_silenced
from pipelines.report.terminal import printable

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.table import Table
    from rich.text import Text

SHORTEST_UPDATE_INTERVAL_NS: Final = 200_000_000
_BAR_WIDTH: Final = 30
_NUMBER_WIDTH: Final = 9
_LONGEST_NAME: Final = 28
_FEWEST_CHANNELS_SHOWN: Final = 3
_LINES_PER_SOURCE: Final = 5
_NEARLY_FULL: Final = 0.9
_LITTLE_SPACE_BYTES: Final = 1 << 30
_STATE_STYLES: Final = {
    SourceState.WAITING: "yellow",
    SourceState.RUNNING: "green",
    SourceState.SILENT: "bold red",
    SourceState.DISCONNECTED: "bold red",
    SourceState.ENDED: "cyan",
    SourceState.FAILED: "bold red",
    SourceState.STOPPED: "cyan",
}
_TROUBLE_NAMES: Final = {
    TroubleKind.CORRUPT_FRAME: "corrupt frames",
    TroubleKind.GARBAGE: "bytes of garbage",
    TroubleKind.MALFORMED_FRAME: "malformed frames",
    TroubleKind.OVERRUN: "overruns",
    TroubleKind.DISCONNECTED: "disconnections",
    TroubleKind.RECONNECTED: "reconnections",
    TroubleKind.RESTARTED: "restarts",
    TroubleKind.CALIBRATION_CHANGED: "changed calibrations",
    TroubleKind.UNCERTAIN_COUNTER: "samples of uncertain place",
    TroubleKind.BUS_ERROR: "bus errors",
    TroubleKind.LINE_ERROR: "line errors",
}


class LiveView:
    """Shows a recording while it runs; an observer of the recorder.

    Use it as a context manager around the recording.

    Parameters
    ----------
    folder : Path
        Where the journal is written; its free space is shown.
    n_sources : int
    console : rich.console.Console, optional
        Standard error if not given.
    monotonic_ns, free_bytes : callable
        Clock, and free space of a folder; given by tests.
    """

    def __init__(
        self,
        folder: Path,
        n_sources: int,
        console: Console | None = None,
        *,
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
        free_bytes: Callable[[Path], int] = lambda folder: shutil.disk_usage(folder).free,
    ) -> None:
        from rich.console import Console
        from rich.live import Live

        self._console = console or Console(file=sys.stderr)
        self._folder, self._n_sources = folder, n_sources
        self._monotonic_ns, self._free_bytes = monotonic_ns, free_bytes
        self._shown_ns: int | None = None
        self._n_failed = 0
        self._live: Live | None = None
        # a terminal that cannot show the bars, or shall not, is served as a pipe is
        if self._console.is_terminal and self._console.encoding.lower().startswith("utf") and not is_silenced():
            self._live = Live(console=self._console, auto_refresh=False, transient=True)

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            with contextlib.suppress(OSError):
                self._live.stop()

    def event(self, event: Event) -> None:
        """Show what happened above the view; in a pipe only what fails while others go on."""
        from rich.text import Text

        self._n_failed += event.is_failure
        is_last = event.source is None or self._n_failed >= self._n_sources
        if self._live is None and (not event.is_failure or is_last):
            return
        style = "bold red" if event.is_failure else "yellow"
        with self._terminal_may_go():
            self._console.print(Text(printable(event.message), style=style), soft_wrap=True)

    def status(self, status: RecorderStatus) -> None:
        """Show the state, at most five times per second."""
        if self._live is None:
            return
        now_ns = self._monotonic_ns()
        if self._shown_ns is not None and now_ns - self._shown_ns < SHORTEST_UPDATE_INTERVAL_NS:
            return
        self._shown_ns = now_ns
        height = self._console.size.height
        with self._terminal_may_go():
            self._live.update(rendered(status, self._space_left(), height), refresh=True)

    @contextlib.contextmanager
    def _terminal_may_go(self) -> Iterator[None]:
        """A terminal that was closed must not end the recording: from then on nothing is shown."""
        try:
            yield
        except (OSError, UnicodeEncodeError):
            self._live = None

    def _space_left(self) -> int | None:
        try:
            return self._free_bytes(self._folder)
        except OSError:
            # a network folder that is gone for a moment must not end the recording
            return None


def rendered(status: RecorderStatus, n_bytes_free: int | None, height: int = 50) -> RenderableType:
    """The view of one moment, for a terminal of so many lines."""
    from rich.console import Group

    n_sources = max(1, len(status.sources))
    n_channels = max(_FEWEST_CHANNELS_SHOWN, (height - 2) // n_sources - _LINES_PER_SOURCE)
    # the same widths for all sources and moments, so that nothing jumps
    names = [level.name for source in status.sources for level in source.levels]
    n_letters = min(_LONGEST_NAME, max(map(len, names), default=0))
    parts: list[RenderableType] = [_heading(status, n_bytes_free)]
    for source in status.sources:
        parts += [_source_line(source), *_remarks(source), _levels(source, n_channels, n_letters)]
    return Group(*parts)


def _heading(status: RecorderStatus, n_bytes_free: int | None) -> Text:
    from rich.text import Text

    line = Text("stopping " if status.is_stopping else "recording ", style="bold")
    if status.waiting_for:
        line = Text(f"waiting for {printable(status.waiting_for)} ", style="bold yellow")
    line.append(clock_text(status.elapsed_s))
    if status.remaining_s is not None:
        line.append(f"   {clock_text(status.remaining_s)} left")
    line.append(f"   on disk {bytes_text(status.n_bytes_written)}")
    if n_bytes_free is not None:
        style = "bold red" if n_bytes_free < _LITTLE_SPACE_BYTES else ""
        line.append(f"   free {bytes_text(n_bytes_free)}", style=style)
    line.append("   Ctrl-C ends and keeps all", style="dim")
    return line


def _source_line(source: SourceStatus) -> Text:
    from rich.text import Text

    line = Text("\n")
    line.append(printable(source.device), style="bold")
    line.append(f"  {source.state.value}", style=_STATE_STYLES[source.state])
    line.append(f"  {_grouped(source.n_samples)} samples")
    measured = "" if source.measured_rate_hz is None else f"{source.measured_rate_hz:.1f} of "
    line.append(f"  {measured}{source.sampling_rate_hz:.10g} Hz")
    line.append(f"  lost {_grouped(source.n_lost)}", style="bold red" if source.n_lost else "green")
    if source.drift is not None:
        line.append(f"  drift {source.drift.ppm:+.1f} ± {source.drift.uncertainty_ppm:.1f} ppm")
    style = "bold red" if source.queue_fill > _NEARLY_FULL else ""
    line.append(f"  buffer {source.queue_fill:.0%}", style=style)
    return line


def _remarks(source: SourceStatus) -> Iterator[Text]:
    from rich.text import Text

    counts = [f"{_TROUBLE_NAMES[kind]} {_grouped(count)}" for kind, count in source.troubles.items() if count]
    if counts:
        yield Text("  " + ", ".join(counts), style="red")
    if source.error:
        yield Text("  " + printable(source.error), style="bold red")


def _levels(source: SourceStatus, n_shown: int, n_letters: int) -> Table:
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, padding=(0, 1), header_style="dim")
    table.add_column("channel", no_wrap=True, width=max(n_letters, len("channel")))
    for title in ("RMS", "peak"):
        table.add_column(title, justify="right", no_wrap=True, width=_NUMBER_WIDTH)
    table.add_column("units", no_wrap=True, min_width=5)
    table.add_column("RMS, peak of range", width=_BAR_WIDTH)
    table.add_column("clipped")
    for level in source.levels[:n_shown]:
        clipped = _grouped(level.n_clipped)
        missing = f" + {_grouped(level.n_missing)} missing" if level.n_missing else ""
        style = "bold red" if level.clipped_in_window else "red" if level.n_clipped else "dim"
        # not as text with markup, in which a bracket of a channel's name would be an instruction or an error
        name, units = Text(printable(level.name)), Text(printable(level.units))
        row = (name, _number(level.rms), _number(level.peak), units, _bar(level), Text(clipped + missing, style))
        table.add_row(*row)
    if len(source.levels) > n_shown:
        table.add_row(f"… {len(source.levels) - n_shown} more")
    return table


def _bar(level: ChannelLevel) -> Text:
    """RMS solid, peak shaded, the limit at the end; red with a mark while it clips."""
    from rich.text import Text

    n_cells = _BAR_WIDTH - 2
    n_rms, n_peak = (_cells(value, level.limit, n_cells) for value in (level.rms, level.peak))
    style = "red" if level.clipped_in_window else "yellow" if n_peak > 0.8 * n_cells else "green"
    bar = Text("█" * n_rms + "▒" * (n_peak - n_rms), style=style)
    bar.append("·" * (n_cells - max(n_peak, n_rms)), style="dim")
    bar.append("▌!" if level.clipped_in_window else "▏", style="bold red" if level.clipped_in_window else "dim")
    return bar


def _cells(value: float | None, limit: float, n_cells: int) -> int:
    if value is None or not math.isfinite(value) or not limit > 0:
        return 0
    return min(n_cells, math.ceil(n_cells * value / limit)) if value > 0 else 0


def _number(value: float | None) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{value:.4g}"


def _grouped(count: int) -> str:
    return f"{count:,}".replace(",", " ")


def clock_text(seconds: float) -> str:
    """Hours, minutes, seconds.

    Examples
    --------
    >>> clock_text(3725.4), clock_text(59.9)
    ('1:02:05', '0:59')
    """
    minutes, rest = divmod(int(max(0.0, seconds)), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def bytes_text(n_bytes: int) -> str:
    """A number of bytes for a person, in powers of ten.

    Examples
    --------
    >>> bytes_text(999), bytes_text(4_030_000), bytes_text(12_300_000_000)
    ('999 B', '4.0 MB', '12.3 GB')
    """
    for unit, size in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if n_bytes >= size:
            return f"{n_bytes / size:.1f} {unit}"
    return f"{n_bytes} B"
