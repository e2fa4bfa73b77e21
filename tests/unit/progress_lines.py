"""What a command says besides its progress.

How often a command in a pipe says how far it is depends on the computer, never on what is tested: one that has to
compile its loops takes longer than the half minute between two lines.
"""

from __future__ import annotations

import re

_LINE = re.compile(r"^.+, (?:\d+ s|\d+ min|\d+ h \d+ min)(?: so far.*|: done)\n?", re.MULTILINE)


def without_progress(stderr: str) -> str:
    """Standard error without the lines of `pipelines.report.progress`; all others stay as they are.

    Examples
    --------
    >>> without_progress("shaker, 40 s so far: run.nc, 50 %\\nflagged: a\\nshaker, 2 min: done\\n")
    'flagged: a\\n'
    """
    return _LINE.sub("", stderr)
