"""The clock of the laboratory: one physical time for all simulated devices."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray


class LaboratoryTime:
    """Time that begins when every device has been started.

    Parameters
    ----------
    n_devices : int
        How many devices must have been started, or have given up, before time begins.
    speed : float
        1 is real time; infinity as fast as the hosts take it.
    monotonic_s, utc_s : callable
        Clocks of this computer.

    Examples
    --------
    >>> ticking = iter([100.0, 102.5])
    >>> laboratory = LaboratoryTime(1, speed=2.0, monotonic_s=lambda: next(ticking), utc_s=lambda: 0.0)
    >>> laboratory.arrive()
    >>> laboratory.now_s()
    5.0
    """

    def __init__(
        self,
        n_devices: int = 1,
        *,
        speed: float = 1.0,
        monotonic_s: Callable[[], float] = time.monotonic,
        utc_s: Callable[[], float] = time.time,
    ) -> None:
        self.speed = speed
        self.monotonic_s, self._utc_s = monotonic_s, utc_s
        self._n_awaited = n_devices
        self._lock = threading.Lock()
        self._began_s: float | None = None
        self._began_utc_s = 0.0

    @property
    def is_paced(self) -> bool:
        """Whether frames wait for their time."""
        return math.isfinite(self.speed)

    @property
    def has_begun(self) -> bool:
        """Whether every device has arrived."""
        return self._began_s is not None

    def arrive(self) -> None:
        """Say that one device has been started, or never will be; each says so once."""
        with self._lock:
            self._n_awaited -= 1
            # physical time begins for all devices with the last of them, so that they measure the same
            if self._n_awaited == 0:
                self._began_utc_s = self._utc_s()
                self._began_s = self.monotonic_s()

    def now_s(self) -> float:
        """Physical time; only meaningful when time has begun and is paced."""
        return (self.monotonic_s() - (self._began_s or 0.0)) * self.speed

    def utc_s(self, physical_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Time of day at physical times, seconds since 1970."""
        return self._began_utc_s + physical_s / (self.speed if self.is_paced else 1.0)
