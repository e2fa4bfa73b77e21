"""The journal: what the recorder writes while it records, so that a crash costs the last block at most.

`JournalWriter` writes it, `read_journal` reads it, whole or not; docs/journal.md describes every byte.
"""

from __future__ import annotations

from acquisition.recorder.journal_lock import is_live
from acquisition.recorder.journal_reading import Entries, Entry, Journal, read_journal
from acquisition.recorder.journal_scanning import Damage
from acquisition.recorder.journal_writing import JournalWriter, existing_journal

__all__ = [
    "Damage",
    "Entries",
    "Entry",
    "Journal",
    "JournalWriter",
    "existing_journal",
    "is_live",
    "read_journal",
]
