"""Recording live devices: check what can be checked, open, record through a journal, assemble, read back."""

from __future__ import annotations

import contextlib
import functools
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from acquisition.recorder.assembly import assemble
from acquisition.recorder.assembly_summary import AssemblySummary
from acquisition.recorder.journal import JournalWriter, existing_journal, is_live, read_journal
from acquisition.recorder.listener import Listener
from acquisition.recorder.longest_recording import longest_duration_s
from acquisition.recorder.pre_trigger import require_triggerable
from acquisition.recorder.recorder import Recorder, RecorderSettings, opened
from acquisition.recorder.recording_plan import require_recordable
from acquisition.recorder.source_alignment import require_alignable
from acquisition.recorder.status import Observer, RecordingOutcome, SourceStatus, StopReason
from acquisition.recorder.trigger_condition import parsed_condition
from acquisition.sources.interface import Source, SourceInfo
from acquisition.sources.urls import open_source
from pipelines.recording.alignment_choice import channel_pairs, checked_align
from pipelines.recording.run_attributes import checked_run_attributes, require_rate
from pipelines.report.free_place import require_free_place
from pipelines.report.progress import amounts
from sloshlab.errors import (
    InputError,
    JournalError,
    RecordingError,
    RecordingInterruptedError,
    SloshlabError,
    SourceError,
)
from sloshlab.netcdf_lock import NETCDF_LOCK
from sloshlab.recording import read_attributes
from sloshlab.rig import Rig

LONGEST_DURATION_S: Final = 30 * 86_400.0
_MOST_SOURCES: Final = 64
_SAMPLES_READ_BACK: Final = 1 << 20
"""At a time, of one channel, which bounds the memory."""


@dataclass(frozen=True)
class RecordSettings:
    """What to record, and how.

    Attributes
    ----------
    sources : tuple of str
        URLs; the first is the time base.
    rig : Path
        Description of the rig; its file name goes into the recording.
    output : Path
        The recording; the journal is beside it, with suffix ``.journal``.
    duration_s : float or None
        Of the first device's samples; None records until all devices end or a stop is requested.
    run : Path or None
        TOML table of attributes of the run.
    attributes : tuple of str
        ``KEY=VALUE``.
    align : {"host", "device", "counter"}
    redundant : tuple of str
        ``A:B``, channels of two devices that show the same motion.
    trigger : tuple of str
        Conditions, see `trigger_condition`; any of them starts the recording, and `duration_s` counts from it.
    pre_s : float
        Of the first device's samples before the trigger.
    keep_journal, overwrite : bool
    """

    sources: tuple[str, ...]
    rig: Path
    output: Path
    duration_s: float | None = None
    run: Path | None = None
    attributes: tuple[str, ...] = ()
    align: str = "host"
    redundant: tuple[str, ...] = ()
    trigger: tuple[str, ...] = ()
    pre_s: float = 0.0
    keep_journal: bool = False
    overwrite: bool = False

    @property
    def journal(self) -> Path:
        """Where the journal is."""
        return self.output.with_suffix(".journal")


def record(
    settings: RecordSettings,
    observer: Observer | None = None,
    *,
    listener: Listener | None = None,
    open_source: Callable[[str], Source] = open_source,
) -> dict[str, Any]:
    """Record one run.

    Parameters
    ----------
    settings : RecordSettings
    observer : Observer, optional
        Shown what happens while it records.
    listener : Listener, optional
        Gets a copy of everything that arrives.
    open_source : callable
        Makes the unopened source of a URL; given by tests.

    Returns
    -------
    dict
        `lines` for a person, `flags` for everything that is not as it should be, numbers for machines.

    Raises
    ------
    SloshlabError
        If nothing could be recorded, or not stored: the message says what is kept and how to get at it.
    """
    metadata = _checked_metadata(settings)
    _require_free_places(settings)
    # until the recording is written and the journal gone, so that no other recorder takes either
    with contextlib.ExitStack() as lock:
        with opened([open_source(url) for url in settings.sources]) as sources:
            recorder_settings = _checked_recorder_settings(settings, metadata, [source.info for source in sources])
            journal_of = functools.partial(_new_journal, settings, metadata, [source.info for source in sources])
            recorder_of = functools.partial(_recorder, sources, recorder_settings, listener)
            outcome = _recorded(journal_of, recorder_of, lock, observer)
        return _made_of_journal(settings, outcome)


def _made_of_journal(settings: RecordSettings, outcome: RecordingOutcome) -> dict[str, Any]:
    if outcome.storage_error is not None:
        raise JournalError(f"{outcome.storage_error}; {_recovery(settings)}")
    waiting_for = outcome.status.waiting_for
    if waiting_for:
        settings.journal.unlink(missing_ok=True)
        raise SourceError(
            f"--trigger {waiting_for}", got=f"no event in {outcome.status.elapsed_s:.1f} s", allowed="an event",
            remedy="another level, or no trigger",
        )  # fmt: skip
    if not any(source.n_samples for source in outcome.status.sources):
        settings.journal.unlink(missing_ok=True)
        raise SourceError(_why_nothing(outcome))
    summary = _assembled_or_kept(settings)
    if not settings.keep_journal:
        settings.journal.unlink()
    return _summary(settings, outcome, summary)


def _checked_metadata(settings: RecordSettings) -> dict[str, Any]:
    if not 1 <= len(settings.sources) <= _MOST_SOURCES:
        raise InputError("--source", got=f"{len(settings.sources)} sources", allowed=f"1 … {_MOST_SOURCES}")
    if len(set(settings.sources)) < len(settings.sources):
        raise InputError("--source", got="the same source twice", allowed="each source once")
    if settings.duration_s is not None and not 0 < settings.duration_s <= LONGEST_DURATION_S:
        raise InputError("--duration", got=f"{settings.duration_s:g} s", allowed=f"0 … {LONGEST_DURATION_S:g} s")
    for condition in settings.trigger:
        parsed_condition(condition)
    chosen = {"align": checked_align(settings.align), "redundant": channel_pairs(settings.redundant)}
    Rig.from_toml(settings.rig)
    attributes = checked_run_attributes(settings.output, settings.rig, settings.run, settings.attributes)
    return {"attributes": attributes, **chosen}


def _require_free_places(settings: RecordSettings) -> None:
    """Refuse places that are taken or cannot be written, before any device is touched."""
    output, journal = settings.output, settings.journal
    if output == journal:
        raise InputError(f"recording {output}", got="the suffix of journals", allowed="RUN.nc")
    require_free_place(output, overwrite=settings.overwrite)
    if journal.is_dir():
        raise InputError(f"journal {journal}", got="a folder in the way", remedy="choose another name")
    # a link counts, too, wherever it leads
    if os.path.lexists(journal) and (not settings.overwrite or is_live(journal)):
        raise existing_journal(journal)


def _checked_recorder_settings(
    settings: RecordSettings, metadata: dict[str, Any], infos: Sequence[SourceInfo]
) -> RecorderSettings:
    """Refuse what the assembly would: found after the recording, no command could make one of its journal."""
    require_rate(metadata["attributes"], infos[0].sampling_rate_hz)
    require_recordable(infos, metadata["attributes"], f"recording {settings.output}")
    require_alignable(infos, settings.align, metadata["redundant"])
    longest_s = longest_duration_s(infos, settings.align)
    conditions = tuple(parsed_condition(condition) for condition in settings.trigger)
    duration_s = settings.duration_s
    n_before = 0
    if conditions:
        require_triggerable(conditions, infos, settings.pre_s)
        n_before = round(settings.pre_s * infos[0].sampling_rate_hz)
        # that of the recorder counts from the first sample that is kept
        duration_s = None if duration_s is None else duration_s + n_before / infos[0].sampling_rate_hz
    _require_readable_duration(duration_s, longest_s)
    return RecorderSettings(duration_s, longest_s=longest_s, trigger=conditions, n_before_trigger=n_before)


def _require_readable_duration(duration_s: float | None, longest_s: float) -> None:
    if duration_s is not None and duration_s > longest_s:
        raise InputError(
            "--duration",
            got=f"{duration_s:g} s",
            allowed=f"≤ {longest_s:.6g} s of these devices: longer recordings cannot be read",
            remedy="several recordings, one after the other",
        )


def _new_journal(settings: RecordSettings, metadata: dict[str, Any], infos: Sequence[SourceInfo]) -> JournalWriter:
    settings.journal.parent.mkdir(parents=True, exist_ok=True)
    return JournalWriter(settings.journal, metadata, infos, overwrite=settings.overwrite)


def _recorder(
    sources: Sequence[Source], settings: RecorderSettings, listener: Listener | None, journal: JournalWriter
) -> Recorder:
    return Recorder(sources, journal, settings, listener=listener)


def _recorded(
    journal_of: Callable[[], JournalWriter],
    recorder_of: Callable[[JournalWriter], Recorder],
    lock: contextlib.ExitStack,
    observer: Observer | None,
) -> RecordingOutcome:
    """Record; the journal stays locked until `lock` is closed."""
    with contextlib.ExitStack() as until_started:
        journal = journal_of()
        # an interrupt before the first sample leaves nothing behind
        until_started.callback(journal.path.unlink, missing_ok=True)
        until_started.callback(journal.abandon)
        lock.enter_context(journal.kept_locked())
        recorder = recorder_of(journal)
        with _signals_stop(recorder):
            until_started.pop_all()
            return recorder.run(observer)


@contextlib.contextmanager
def _signals_stop(recorder: Recorder) -> Iterator[None]:
    """While it records, Ctrl-C, a termination and a closed terminal end the recording and keep it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    names = ("SIGINT", "SIGTERM", "SIGHUP")
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    before = {number: signal.getsignal(number) for number in numbers}
    try:
        for number in numbers:
            signal.signal(number, lambda *_: recorder.request_stop())
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _why_nothing(outcome: RecordingOutcome) -> str:
    if outcome.failures:
        return "; ".join(outcome.failures.values())
    urls = ", ".join(source.url for source in outcome.status.sources)
    return f"source {urls}: got not one sample; remedy: check that the device was started"


def _recovery(settings: RecordSettings) -> str:
    """What to type to get the recording out of its journal, if it is still there."""
    if not settings.journal.exists():
        return f"{settings.journal} was removed by somebody else meanwhile: its samples are lost"
    overwrite = " --overwrite" if settings.output.exists() else ""
    return f"then: sloshlab recover {settings.journal} -o {settings.output}{overwrite}"


def _what_is_kept(settings: RecordSettings) -> str:
    every = f"every sample is in {settings.journal}; " if settings.journal.exists() else ""
    return every + _recovery(settings)


def _assembled_or_kept(settings: RecordSettings) -> AssemblySummary:
    """Assemble; whatever prevents it, the journal stays, and the error says where it is."""
    try:
        return _assembled(settings)
    except KeyboardInterrupt as error:
        raise RecordingInterruptedError(
            f"interrupted before {settings.output} was complete; {_what_is_kept(settings)}"
        ) from error
    except SloshlabError as error:
        raise JournalError(f"{error}; {_what_is_kept(settings)}") from error


def _assembled(settings: RecordSettings) -> AssemblySummary:
    with read_journal(settings.journal) as journal, amounts("writing the recording") as watch:
        summary = assemble(journal, settings.output, watch=watch)
    with amounts("reading it back") as watch:
        _require_readable(settings.output, summary.n_samples, watch)
    return summary


def _require_readable(output: Path, n_samples: int, watch: Callable[[int, int], None]) -> None:
    """Read a recording back, every byte of it: compressed chunks carry checksums.

    Raises
    ------
    RecordingError
        If it is not what was written; the journal is still there then.
    """
    import netCDF4

    read_attributes(output)
    try:
        with NETCDF_LOCK, netCDF4.Dataset(output, mode="r") as file:
            file.set_auto_maskandscale(False)
            n_found = len(file.dimensions["time"])
            for number, variable in enumerate(file.variables.values(), start=1):
                # nothing is read twice, so a cache would only hold memory
                variable.set_var_chunk_cache(1, 1, 1.0)
                for start in range(0, len(variable) if variable.ndim else 0, _SAMPLES_READ_BACK):
                    variable[start : start + _SAMPLES_READ_BACK]
                watch(number, len(file.variables))
    except (OSError, RuntimeError, KeyError) as error:
        raise RecordingError(
            f"recording {output}", got=f"a file that cannot be read back ({error})", remedy="recover the journal"
        ) from error
    if n_found != n_samples:
        raise RecordingError(
            f"recording {output}", got=f"{n_found} samples", allowed=f"{n_samples}", remedy="recover the journal"
        )


def _summary(settings: RecordSettings, outcome: RecordingOutcome, assembled: AssemblySummary) -> dict[str, Any]:
    lines = [*assembled.lines, f"ended: {outcome.reason.value}"]
    lines += [f"journal: {settings.journal}"] if settings.keep_journal else []
    flags = list(assembled.flags)
    if outcome.reason in (StopReason.SILENCE, StopReason.SOURCES_FAILED, StopReason.TOO_LONG):
        flags.append(f"recording ended: {outcome.reason.value}")
    return {
        "lines": lines,
        "flags": flags,
        "output": str(settings.output),
        "journal": str(settings.journal) if settings.keep_journal else None,
        "reason": outcome.reason.name.lower(),
        "sources": [_source_numbers(source) for source in outcome.status.sources],
        "report": assembled.to_dict(),
    }


def _source_numbers(source: SourceStatus) -> dict[str, Any]:
    return {
        "device": source.device,
        "url": source.url,
        "state": source.state.name.lower(),
        "n_samples": source.n_samples,
        "n_lost": source.n_lost,
        "sampling_rate_hz": source.sampling_rate_hz,
        "measured_rate_hz": source.measured_rate_hz,
        "drift_ppm": None if source.drift is None else source.drift.ppm,
        "drift_uncertainty_ppm": None if source.drift is None else source.drift.uncertainty_ppm,
        "n_clipped": {level.name: level.n_clipped for level in source.levels},
        "troubles": {kind.name: count for kind, count in source.troubles.items()},
        "error": source.error,
    }
