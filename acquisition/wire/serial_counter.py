"""From a counter of 32 bits that wraps to one of 64 that does not, or an error where that cannot be known."""

from __future__ import annotations

from typing import Final

_WRAP: Final = 1 << 32
_HALF: Final = 1 << 31


class CounterJumpError(ValueError):
    """So many samples would be missing that the counter is not to be believed.

    Attributes
    ----------
    jump : int
        Samples between the place expected and the place that the counter names; negative backwards.
    n_missing : int
        Samples that would be missing in the stream altogether.
    """

    def __init__(self, jump: int, n_missing: int) -> None:
        self.jump, self.n_missing = jump, n_missing
        super().__init__(f"counter jumps by {jump} samples, {n_missing} missing altogether")


class StreamCounter:
    """The counter of one stream of one device.

    A frame is placed where its counter is nearest to the place after the latest sample known: right as
    long as fewer than 2³¹ samples are missing or out of order at once.

    Parameters
    ----------
    longest_gap : int
        Samples that may be missing at once, either way. Altogether no more may be missing than have
        arrived and this, so that a peer that sends little cannot make a recording long.

    Examples
    --------
    >>> counter = StreamCounter(longest_gap=1000)
    >>> counter.place(2**32 - 3, 3), counter.place(1, 2), counter.place(0, 1)
    (4294967293, 4294967297, 4294967296)
    """

    def __init__(self, longest_gap: int) -> None:
        self._longest_gap = min(longest_gap, _HALF - 1)
        self._lowest = self.next = self._n_arrived = 0

    def place(self, counter: int, n_samples: int) -> int:
        """Unwrapped counter of the first of `n_samples` samples; may be negative, before all counting.

        Raises
        ------
        CounterJumpError
            If more samples would be missing than may be.
        """
        # a device that has been running begins anywhere
        if self._n_arrived == 0:
            self._lowest = self.next = counter
        # the nearest place, ahead or back: right while fewer than half a turn is missing or late at once
        jump = (counter - self.next + _HALF) % _WRAP - _HALF
        first = self.next + jump
        lowest, following = min(self._lowest, first), max(self.next, first + n_samples)
        n_missing = following - lowest - (self._n_arrived + n_samples)
        # a peer that sends one sample per allowed gap would otherwise fill a disk with lost ones
        if abs(jump) > self._longest_gap or n_missing > self._n_arrived + n_samples + self._longest_gap:
            raise CounterJumpError(jump, n_missing)
        self._lowest, self.next = lowest, following
        self._n_arrived += n_samples
        return first
