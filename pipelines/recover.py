"""From a journal that a crash left behind to a recording."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from acquisition.recorder.assembly import assemble
from acquisition.recorder.journal import Journal, read_journal
from pipelines.progress import amounts
from sloshlab.errors import InputError

_MOST_DAMAGE_NAMED = 20


def recover(journal_path: Path, output: Path, overwrite: bool = False) -> dict[str, Any]:
    """Write everything that a journal certainly holds; the journal stays as it is.

    Parameters
    ----------
    journal_path : Path
        Left by a recorder that was killed, ran out of disk, or closed it properly.
    output : Path
        The recording.
    overwrite : bool
        Whether an existing recording may be replaced.

    Returns
    -------
    dict
        `lines` for a person, `flags` where anything is missing (exit code 3), `output`, `report`.

    Raises
    ------
    InputError
        If the recording is there already, or is the journal itself.
    JournalError
        If there is nothing to recover.
    """
    if output.exists() and (not overwrite or output.samefile(journal_path)):
        raise InputError(
            f"recording {output}",
            got="a file that is there already",
            remedy="another name, or --overwrite" if not overwrite else "another name than the journal's",
        )
    with read_journal(journal_path) as journal:
        with amounts("writing the recording") as watch:
            summary = assemble(journal, output, watch=watch)
        lines = [*_journal_lines(journal), *summary.lines]
        return {"lines": lines, "flags": list(summary.flags), "output": str(output), "report": summary.to_dict()}


def _journal_lines(journal: Journal) -> Iterator[str]:
    yield f"journal {journal.path}: {journal.n_bytes} bytes, {_closing(journal)}"
    if journal.n_bytes_left_out:
        yield f"left out: {journal.n_bytes_left_out} bytes"
    for damage in journal.damage[:_MOST_DAMAGE_NAMED]:
        yield f"left out: {damage.n_bytes} bytes from byte {damage.offset}, {damage.reason}"
    if len(journal.damage) > _MOST_DAMAGE_NAMED:
        yield f"left out: {len(journal.damage) - _MOST_DAMAGE_NAMED} more places"


def _closing(journal: Journal) -> str:
    return "closed by the recorder" if journal.closed_cleanly else "not closed: the recorder was cut short"
