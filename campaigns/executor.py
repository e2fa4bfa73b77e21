"""What takes tasks and tells how they end: processes of this machine, or a cluster."""

from __future__ import annotations

from typing import Protocol

from campaigns.task import Ending, Task

Event = tuple[int, float | Ending]
"""Number of a task, and the share of it that is done or how it ended."""


class Executor(Protocol):
    """Where tasks are carried out."""

    @property
    def n_at_once(self) -> int:
        """How many tasks it wants to have at a time; no more are handed over."""
        ...

    def submit(self, number: int, task: Task, attempt: int) -> None:
        """Take a task, which is told of by its number."""
        ...

    def events(self, timeout_s: float) -> list[Event]:
        """What has happened; waits for something so long at most."""
        ...

    def stop(self) -> list[Event]:
        """Ask all tasks to stop and save, wait for them, and tell how they ended."""
        ...

    def close(self) -> None:
        """Leave nothing behind; whatever is under way is given up."""
        ...
