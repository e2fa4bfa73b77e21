"""How much has been simulated: what a search spends, whoever of its workers does it."""

from __future__ import annotations

from threading import Lock


class Effort:
    """Readings that simulations have made.

    They are counted, not timed, so that the same case ends with the same answer on any machine.

    Attributes
    ----------
    n_readings : int
        Of all channels and runs.
    """

    def __init__(self) -> None:
        self._lock, self.n_readings = Lock(), 0

    def add(self, n_readings: int) -> None:
        """Count some more.

        Parameters
        ----------
        n_readings : int
        """
        with self._lock:
            self.n_readings += n_readings
