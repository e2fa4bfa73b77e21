"""What the results of a call rest on: its words, and the hashes of everything that was handed over."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pipelines.report.outputs import InMemory, sha256_of

_MOST_NAMES = 3
"""Of recordings that a call is shown with."""


def call_text(function: str, runs: Iterable[Path | InMemory], **options: Any) -> str:
    """A call as a report shows it, folders left out.

    Examples
    --------
    >>> call_text("train", [Path("a.nc"), Path("b.nc")], rig=Path("rig.toml"), seed=1, test=None)
    'sloshlab.train([a.nc, b.nc], rig=rig.toml, seed=1)'
    """
    names = [run.name for run in runs]
    shown = ", ".join(names[:_MOST_NAMES]) + (f", … {len(names)} in all" if len(names) > _MOST_NAMES else "")
    given = [f"{name}={_word(value)}" for name, value in options.items() if value not in (None, "", (), [])]
    return f"sloshlab.{function}({', '.join([f'[{shown}]', *given])})"


def _word(value: Any) -> str:
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_word, value))}]"
    return value.name if isinstance(value, Path | InMemory) else repr(value)


def hashes_of(inputs: Iterable[Path | InMemory], known: Mapping[Any, str] | None = None) -> dict[Any, str]:
    """Hashes of inputs as they are now: a program may leave its folder before it asks for a report."""
    found = dict(known or {})
    return {source: found.get(source) or sha256_of(source) for source in inputs}
