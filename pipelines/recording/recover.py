"""From a journal that a crash left behind to a recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from acquisition.recorder.assembly import assemble, options_of
from acquisition.recorder.journal import Journal, is_live, read_journal
from acquisition.recorder.source_alignment import require_alignable
from acquisition.sources.interface import SourceInfo
from pipelines.recording.alignment_choice import channel_pairs, checked_align
from pipelines.report.free_place import require_free_place
from pipelines.report.progress import amounts
from sloshlab.errors import InputError

_MOST_DAMAGE_NAMED = 20
_STILL_RUNS = "the recorder still runs: this is what its journal held when it was read"


def recover(
    journal_path: Path,
    output: Path,
    overwrite: bool = False,
    *,
    align: str | None = None,
    redundant: Sequence[str] = (),
) -> dict[str, Any]:
    """Write everything that a journal certainly holds; the journal stays as it is.

    Parameters
    ----------
    journal_path : Path
        Left by a recorder that was killed, ran out of disk, or closed it properly; or of one that still runs,
        which is not disturbed.
    output : Path
        The recording.
    overwrite : bool
        Whether an existing recording may be replaced.
    align : {"host", "device", "counter"}, optional
        Instead of what the recorder was told.
    redundant : sequence of str
        ``A:B``, instead of the pairs that the recorder was told of.

    Returns
    -------
    dict
        `lines` for a person, `flags` where anything is missing (exit code 3), `output`, `report`.

    Raises
    ------
    InputError
        If the recording is there already, is the journal itself or what its recorder will write, or the devices
        cannot be aligned so.
    JournalError
        If there is nothing to recover.
    """
    require_free_place(output, overwrite=overwrite)
    if output.exists() and journal_path.exists() and output.samefile(journal_path):
        raise InputError(f"recording {output}", got="the journal itself", remedy="another name than the journal's")
    # asked before it is read: whatever the recorder writes from now on is not in the recording
    live = is_live(journal_path)
    if live and output.absolute().with_suffix(journal_path.suffix) == journal_path.absolute():
        raise InputError(
            f"recording {output}",
            got="the name under which the recorder, which still runs, will write it",
            remedy="another name for what is there by now, or end the recorder",
        )
    chosen_align = None if align is None else checked_align(align)
    pairs = channel_pairs(redundant)
    with read_journal(journal_path) as journal:
        options = options_of(journal)
        options = replace(options, align=chosen_align or options.align, redundant=pairs or options.redundant)
        if infos := _delivering(journal):
            require_alignable(infos, options.align, pairs)
        with amounts("writing the recording") as watch:
            summary = assemble(journal, output, options, watch=watch)
        lines = [*_journal_lines(journal, live), *summary.lines]
        flags = [*([_STILL_RUNS] if live else []), *summary.flags]
        return {"lines": lines, "flags": flags, "output": str(output), "report": summary.to_dict()}


def _delivering(journal: Journal) -> list[SourceInfo]:
    """The devices of which a recording can be made."""
    numbers = {source for (source, _), entries in journal.entries.items() if len(entries)}
    return [info for number, info in journal.sources.items() if number in numbers]


def _journal_lines(journal: Journal, live: bool) -> Iterator[str]:
    closing = "its recorder still runs" if live else _closing(journal)
    yield f"journal {journal.path}: {journal.n_bytes} bytes, {closing}"
    if journal.n_bytes_left_out:
        yield f"left out: {journal.n_bytes_left_out} bytes"
    for damage in journal.damage[:_MOST_DAMAGE_NAMED]:
        yield f"left out: {damage.n_bytes} bytes from byte {damage.offset}, {damage.reason}"
    if len(journal.damage) > _MOST_DAMAGE_NAMED:
        yield f"left out: {len(journal.damage) - _MOST_DAMAGE_NAMED} more places"


def _closing(journal: Journal) -> str:
    return "closed by the recorder" if journal.closed_cleanly else "not closed: the recorder was cut short"
