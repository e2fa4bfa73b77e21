"""Whoever gets a copy of everything that arrives while it is recorded."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from acquisition.samples.delivery import Delivery
from acquisition.sources.interface import SourceInfo


class Listener(Protocol):
    """Gets what the sources deliver, in the thread that writes the journal: every call returns at once."""

    def begins(
        self, infos: Sequence[SourceInfo], metadata: Mapping[str, Any], mark: Callable[[str], None]
    ) -> None:
        """The sources are open, the journal has `metadata`; `mark` puts a mark with a text into the recording."""

    def delivered(self, source: int, deliveries: Sequence[Delivery]) -> None:
        """What one read of a source brought."""


class NobodyListening:
    """A listener that hears nothing."""

    def begins(
        self, infos: Sequence[SourceInfo], metadata: Mapping[str, Any], mark: Callable[[str], None]
    ) -> None:
        """Nothing."""

    def delivered(self, source: int, deliveries: Sequence[Delivery]) -> None:
        """Nothing."""
