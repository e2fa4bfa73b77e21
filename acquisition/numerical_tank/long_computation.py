"""A computation in blocks that saves itself now and then, and may be stopped between any two of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path

from sloshlab.interrupt import stop_signals_noted


class LongComputation(ABC):
    """What is computed block after block.

    Attributes
    ----------
    computing_s : float
        Time that it has taken, without interruptions.
    """

    computing_s: float = 0.0

    @property
    @abstractmethod
    def n_left(self) -> int:
        """How much is left to be computed."""

    @property
    @abstractmethod
    def share(self) -> float:
        """Share of the work that is done."""

    @abstractmethod
    def advance(self) -> str:
        """Compute a block; return why it became unstable, or nothing."""

    @abstractmethod
    def save(self, path: Path) -> None:
        """Write everything that is needed to go on."""

    def run(
        self,
        path: Path | None,
        progress: Callable[[float], None] | None,
        *,
        saved_every_s: float,
        monotonic_s: Callable[[], float],
    ) -> str:
        """Compute what is left; return why it became unstable, or nothing.

        Parameters
        ----------
        path : Path or None
            Where to save it.
        progress : callable or None
            Takes the share of the work that is done.
        saved_every_s : float
            Time of computing between two times of saving.
        monotonic_s : callable
            The clock.

        Raises
        ------
        KeyboardInterrupt
            At Ctrl-C or SIGTERM, which are heeded between two blocks.
        """
        stopped, saved_s = "", monotonic_s()
        with stop_signals_noted() as stopping:
            while self.n_left and not stopped:
                start_s = monotonic_s()
                stopped = self.advance()
                self.computing_s += monotonic_s() - start_s
                # only here, after the block has stored what it computed, so that the latest state can be saved
                if stopping:
                    raise KeyboardInterrupt
                if progress is not None:
                    progress(self.share)
                # an unstable state is none to go on from
                if path is not None and not stopped and monotonic_s() - saved_s >= saved_every_s:
                    self.save(path)
                    saved_s = monotonic_s()
        return stopped
