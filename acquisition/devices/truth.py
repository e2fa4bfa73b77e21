"""What a simulated device did to its samples: the truth that a recording of it is judged by."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any, Final

# a long run with many faults must not fill the memory with places
MOST_ENTRIES: Final = 200_000
"""Touched places kept one by one; more are only counted."""


@dataclass
class Truth:
    """Counts and places of everything that went as a fault wanted it.

    Attributes
    ----------
    n_taken, n_sent : int
        Samples that the device has taken, and samples × groups that left it whole and once.
    counts : Counter of str
        How often each fault struck; frames, bytes or samples as the fault has it.
    """

    n_taken: int = 0
    n_sent: int = 0
    counts: Counter[str] = field(default_factory=Counter)
    _entries: list[dict[str, Any]] = field(default_factory=list)
    _n_left_out: int = 0

    def note(self, fault: str, *, n: int = 1, **place: Any) -> None:
        """Note that a fault struck `n` times, at one place."""
        self.counts[fault] += n
        if len(self._entries) < MOST_ENTRIES:
            self._entries.append({"fault": fault, **place})
        else:
            self._n_left_out += 1

    def summary(self) -> dict[str, Any]:
        """Numbers alone."""
        return {"samples_taken": self.n_taken, "samples_sent": self.n_sent, **dict(sorted(self.counts.items()))}

    def to_json(self) -> dict[str, Any]:
        """Numbers and places.

        Examples
        --------
        >>> truth = Truth()
        >>> truth.note("drop", stream=1, group=0, counter=5, n_samples=2)
        >>> truth.to_json()["places"]
        [{'fault': 'drop', 'stream': 1, 'group': 0, 'counter': 5, 'n_samples': 2}]
        """
        return {**self.summary(), "places": self._entries, "places_left_out": self._n_left_out}
