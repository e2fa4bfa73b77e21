"""The place of every CAN frame in the stream of its message, proved or not at all.

A classic frame has room for the low 8 bits of the sample counter and, in turn, for one byte of the
rest. After 256 lost frames a frame looks as if nothing were missing, so the low bits alone prove
nothing. What does is the order of arrival: the counter only grows, and no frame arrives more than
`reach` samples late. Every frame so has a smallest counter that what arrived before it allows and a
largest that what arrived after it allows; where the two are the same, the place is proved. Frames
wait until later ones have decided that. Those of which it becomes clear that no later frame can decide it
are given up and counted; nothing is ever guessed.

The same holds at the ends of a stream: its first frames are proved by the counter that ``device_status``
announces, its last ones by the number of samples that it closes with. Without the message a few frames
at either end stay unproved.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from acquisition.wire.can_bits import IntArray
from acquisition.wire.can_layout import SampleMessage
from sloshlab.errors import SourceError

# one of the two facts that the proof of a place rests on; the other is that a counter only grows
LATEST_FRAMES: Final = 64
"""A frame may arrive after others that are up to so many frames ahead of it."""

LONGEST_GAP_S: Final = 3600.0

# frames that no later one ever decides, as those that repeat the same low bits, must not fill the memory
_MOST_WAITING: Final = 4096
# a counter that cannot be proved for so long makes no sense
_PATIENCE_S: Final = 3.0
_FEWEST_PATIENCE: Final = 1024
_MOST_CONTRADICTIONS: Final = 2
# a batch that contradicts itself is looked at again in such pieces
_PIECE: Final = 32
_CLOCK_DOUBT: Final = 1.02
"""A device may count so much faster than it should by the host's clock."""

_NONE: Final = -1
_NOTHING: Final = np.zeros(0, np.int64)


@dataclass(frozen=True, eq=False)
class Decided:
    """Frames whose place has been decided: the oldest of those that were waiting, in order of arrival.

    Attributes
    ----------
    counters : ndarray of int64, shape (n_decided,)
        Sample counter of each frame, unwrapped; −1 where it is not accepted.
    n_uncertain : int
        Frames given up because their place cannot be proved.
    n_repeated : int
        Frames that had come before.
    """

    counters: IntArray
    n_uncertain: int
    n_repeated: int

    @property
    def accepted(self) -> NDArray[np.bool_]:
        """Which frames have a proved counter and came for the first time, shape (n_decided,)."""
        accepted: NDArray[np.bool_] = self.counters >= 0
        return accepted

    def followed_by(self, other: Decided) -> Decided:
        """What was decided first and what next, as one."""
        return Decided(
            np.concatenate([self.counters, other.counters]),
            self.n_uncertain + other.n_uncertain,
            self.n_repeated + other.n_repeated,
        )


class CounterTracker:
    """Unwraps the sample counter of one message.

    Parameters
    ----------
    message : SampleMessage
    sampling_rate_hz : float
    longest_gap_s : float
        A longer gap between proved frames is no gap but an error: samples that are missing cost memory, too.

    Attributes
    ----------
    reach : int
        How late a frame may be [samples]: 64 frames, or less where the counter's low bits do not carry that far.
    longest_gap_samples : int
        Longer gaps are refused. A gap of 2^bits samples of the whole counter cannot be seen at all.
    highest : int or None
        Largest counter proved so far.
    failure : SourceError or None
        For seconds no counter fitted what came before: a jump beyond the longest gap, or back.
    """

    def __init__(
        self, message: SampleMessage, sampling_rate_hz: float, longest_gap_s: float = LONGEST_GAP_S
    ) -> None:
        parts = message.counter
        always = sum(part.field.length for part in parts if not part.selectors)
        self._wrap = 1 << sum(part.field.length for part in parts)
        self._name = message.name
        per_frame = message.samples_per_frame
        self.reach = min(LATEST_FRAMES * per_frame, (1 << always) // 4)
        # only a frame with the highest bits of the counter has a smallest counter by itself
        self._top_bits = ((1 << parts[-1].field.length) - 1) << parts[-1].bit
        coarsest = 1 << parts[-1].bit if any(part.selectors for part in parts) else 0
        # less than a turn of the whole counter, so that one place at most agrees with the bits of a frame
        self._horizon = self._wrap - 2 * coarsest - 4 * self.reach
        self.longest_gap_samples = min(round(longest_gap_s * sampling_rate_hz), self._horizon // 2)
        self._chunk = max(16, min(_MOST_WAITING, self._horizon // (8 * per_frame)))
        self.failure: SourceError | None = None
        self._patience = max(_FEWEST_PATIENCE, round(_PATIENCE_S * sampling_rate_hz / per_frame))
        self.restart()

    def restart(self) -> int:
        """Begin with a new stream; the frames that were waiting are given up.

        Returns
        -------
        int
            How many those are.
        """
        n_given_up = self.n_waiting if hasattr(self, "_value") else 0
        self._value, self._known, self._recent = _NOTHING, _NOTHING, _NOTHING
        self.highest: int | None = None
        self._begin: int | None = None
        self.end: int | None = None
        self._near: int | None = None
        self._n_impossible, self._n_contradictions = 0, 0
        return n_given_up

    @property
    def n_waiting(self) -> int:
        """Frames that are not yet decided."""
        return len(self._value)

    def begin_near(self, counter: int) -> None:
        """Unwrap the first counter to within half a wrap of this one, which another message has."""
        self._near = counter

    def begins_at(self, counter: int) -> None:
        """Learn from the device that the frames that come from now on have this counter or a higher one.

        Only before the first frame of a stream; later it is ignored. As many bits of it as the counter
        has are used.
        """
        if self.highest is None and self._begin is None and not self.n_waiting:
            self._begin = self._unwrapped(counter)

    def is_behind(self, counter: int, late_samples: int) -> bool:
        """Whether a counter that the device announces lies further back than a late message explains."""
        if self.highest is None:
            return False
        behind = (self.highest + 1 - counter) % self._wrap
        return late_samples < behind < self._wrap - self.longest_gap_samples

    def _unwrapped(self, counter: int) -> int:
        """The number nearest to what another message has that agrees with these bits."""
        counter %= self._wrap
        if self._near is None:
            return counter
        return max(counter, counter + self._wrap * round((self._near - counter) / self._wrap))

    def ends_at(self, n_samples: int | None) -> Decided:
        """Learn from the device that no counter reaches `n_samples` (as many bits of it as the counter has).

        The last frames of a stream are proved by this, as no later ones come. None takes it back.
        """
        self.end = None
        if n_samples is not None:
            known = self.highest + 1 if self.highest is not None else self._begin
            after = known if known is not None else self._near or 0
            self.end = after + (n_samples - after) % self._wrap
        return self.take(_NOTHING, _NOTHING)

    def give_up(self) -> Decided:
        """Decide all that wait, because no more will come."""
        decided = self.take(_NOTHING, _NOTHING)
        n_left = self.n_waiting
        self._value, self._known = _NOTHING, _NOTHING
        counters = np.concatenate([decided.counters, np.full(n_left, _NONE)])
        return Decided(counters, decided.n_uncertain + n_left, decided.n_repeated)

    def take(self, value: IntArray, known: IntArray) -> Decided:
        """Add frames in order of arrival and decide what can be decided.

        Parameters
        ----------
        value, known : ndarray of int64, shape (n_frames,)
            Bits of the counter in each frame and which those are, as `decode` gives them.

        Returns
        -------
        Decided
            The first `len(counters)` of all frames that waited and came, in order of arrival.

        Notes
        -----
        After much that fits nothing `failure` says why; nothing is accepted from then on.
        """
        return self._in_pieces(value, known, self._chunk)

    def refuse_after_silence(self, silence_s: float, sampling_rate_hz: float) -> None:
        """Fail if the whole counter may have come round unseen in a silence of the device.

        Parameters
        ----------
        silence_s : float
            By a clock of the host; only short ones prove that nothing of the kind happened.
        sampling_rate_hz : float
        """
        n_samples = _CLOCK_DOUBT * silence_s * sampling_rate_hz
        if self.highest is None or n_samples < self._horizon:
            return
        self.failure = SourceError(
            f"{self._name}: sample counter",
            got=f"{silence_s:.3g} s of silence",
            allowed=f"< {self._horizon / _CLOCK_DOUBT / sampling_rate_hz:.3g} s, as the counter may come round "
            f"unseen after {self._wrap} samples",
            remedy="record again; a device with more bits of counter can be silent longer",
        )

    def _take(self, value: IntArray, known: IntArray) -> Decided:
        if self.failure is not None:
            return self._refused(len(value))
        waiting = self._value, self._known
        self._value = np.concatenate([self._value, value])
        self._known = np.concatenate([self._known, known])
        n_before = self._n_before_begin()
        self._drop(n_before)
        if not len(self._value) or (self._begin is None and self.highest is None):
            return Decided(np.full(n_before, _NONE), n_before, 0)
        counters, n_decided = self._bounded()
        # one frame too late makes all that came with it impossible: in pieces it costs its neighbours only,
        # however many frames come at once
        if n_decided is None and len(value) > _PIECE and not n_before and not self._is_distrusted:
            self._value, self._known = waiting
            return self._in_pieces(value, known, _PIECE)
        decided = self._impossible(counters) if n_decided is None else self._proved(counters[:n_decided])
        if not n_before:
            return decided
        counters = np.concatenate([np.full(n_before, _NONE), decided.counters])
        return Decided(counters, decided.n_uncertain + n_before, decided.n_repeated)

    def _in_pieces(self, value: IntArray, known: IntArray, n_frames: int) -> Decided:
        parts = [
            self._take(value[start : start + n_frames], known[start : start + n_frames])
            for start in range(0, max(len(value), 1), n_frames)
        ]
        return Decided(
            np.concatenate([part.counters for part in parts]),
            sum(part.n_uncertain for part in parts),
            sum(part.n_repeated for part in parts),
        )

    def _bounded(self) -> tuple[IntArray, int | None]:
        """Counters of all that wait and how many of them are decided; None if they cannot be as they are."""
        lowest, highest = self._window()
        counters, n_decided, is_possible = _decide(self._value, self._known, lowest, highest, self.reach)
        # the oldest are given up rather than kept without end
        n_decided = max(n_decided, len(counters) - _MOST_WAITING)
        if not is_possible or self._is_distrusted or self._has_jump(counters[:n_decided]):
            return counters, None
        return counters, n_decided

    def _n_before_begin(self) -> int:
        """Frames before the first that has a smallest counter; that frame becomes the beginning."""
        if self._begin is not None or self.highest is not None:
            return 0
        bounded = np.flatnonzero(self._known & self._top_bits == self._top_bits)
        if not len(bounded):
            return max(0, len(self._value) - _MOST_WAITING)
        self._begin = self._unwrapped(int(self._value[bounded[0]]))
        return int(bounded[0])

    def _window(self) -> tuple[int, int]:
        """Bounds for every frame that waits, from what is proved, the beginning and the end."""
        lowest = self.highest if self.highest is not None else self._begin or 0
        highest = lowest + self._horizon
        return lowest, min(highest, self.end - 1) if self.end is not None else highest

    @property
    def _is_distrusted(self) -> bool:
        """Twice in succession is no late frame but a device that counts anew: it must not catch up unnoticed."""
        return self._n_contradictions >= _MOST_CONTRADICTIONS

    def _has_jump(self, counters: IntArray) -> bool:
        """Whether any frame lies further ahead than the longest gap."""
        proved = counters[counters >= 0]
        if not len(proved):
            return False
        # ahead of everything before it: a late frame is no jump back
        before = np.maximum.accumulate(proved)
        start = self.highest if self.highest is not None else int(before[0])
        before = np.concatenate([[start], before[:-1]])
        return bool((proved - before > self.longest_gap_samples).any())

    def _impossible(self, counters: IntArray) -> Decided:
        """Give up all that waits; too much of that is an error."""
        n_frames = len(counters)
        self._drop(n_frames)
        # A device that started anew without saying so counts up to where its stream stopped; from there on its
        # frames would fit again, in wrong places.
        self._n_contradictions += 1
        self._n_impossible += n_frames
        if self._n_impossible > self._patience:
            limit = self.longest_gap_samples
            self.failure = SourceError(
                f"{self._name}: sample counter",
                got=f"{self._n_impossible} frames that do not follow counter {self.highest}",
                allowed=f"a gap of ≤ {limit} samples; a step back only with a new stream in device_status",
                remedy="record again; after a longer silence with a larger longest_gap_s; a device that starts "
                "anew must send device_status, and no two devices the same identifier",
            )
        return Decided(np.full(n_frames, _NONE), n_frames, 0)

    def _refused(self, n_new: int) -> Decided:
        n_frames = self.n_waiting + n_new
        self._drop(self.n_waiting)
        return Decided(np.full(n_frames, _NONE), n_frames, 0)

    def _drop(self, n_decided: int) -> None:
        self._value, self._known = self._value[n_decided:], self._known[n_decided:]

    def _proved(self, counters: IntArray) -> Decided:
        """Accept the oldest frames, each counter once."""
        self._drop(len(counters))
        n_uncertain = int((counters < 0).sum())
        proved = np.flatnonzero(counters >= 0)
        if not len(proved):
            return Decided(counters, n_uncertain, 0)
        found = counters[proved]
        if (self.highest is None or found[0] > self.highest) and (found[1:] > found[:-1]).all():
            # nothing late and nothing twice, as nearly always
            self._remember(found)
            return Decided(counters, n_uncertain, 0)
        _, first = np.unique(found, return_index=True)
        is_new = np.zeros(len(proved), np.bool_)
        is_new[first] = True
        # a copy may come in another batch, but not later than any frame may be
        is_new &= ~np.isin(counters[proved], self._recent)
        counters = counters.copy()
        counters[proved[~is_new]] = _NONE
        self._remember(counters[proved[is_new]])
        return Decided(counters, n_uncertain, int((~is_new).sum()))

    def _remember(self, new: IntArray) -> None:
        if not len(new):
            return
        self._n_impossible, self._n_contradictions = 0, 0
        self.highest = max(int(new.max()), self.highest if self.highest is not None else 0)
        recent = np.concatenate([self._recent, new])
        self._recent = recent[recent >= self.highest - 2 * self.reach]


@njit(cache=True)  # type: ignore[untyped-decorator]
def _decide(value: IntArray, known: IntArray, lowest: int, highest: int, reach: int) -> tuple[IntArray, int, bool]:
    """Counters (−1 where not proved), how many of the oldest are decided, and whether all is possible."""
    n = len(value)
    smallest = np.empty(n, np.int64)
    largest = np.empty(n, np.int64)
    after = np.empty(n, np.int64)
    # forwards: by all that came before, each frame is at least so far
    ahead = lowest
    for i in range(n):
        smallest[i] = _smallest_from(max(ahead - reach, 0), value[i], known[i])
        ahead = max(ahead, smallest[i])
    # backwards: by all that came after, it is at most so far
    behind = highest
    for i in range(n - 1, -1, -1):
        after[i] = min(behind + reach, highest)
        largest[i] = _largest_to(after[i], value[i], known[i])
        behind = min(behind, largest[i])
    counters = np.full(n, -1, np.int64)
    n_decided = n
    for i in range(n - 1, -1, -1):
        if largest[i] < smallest[i]:
            return counters, n, False
        if largest[i] == smallest[i]:
            counters[i] = largest[i]
        # No later frame can bound it by less than the furthest counter so far. Where that would decide, it waits;
        # else it stays without a place.
        elif _largest_to(min(after[i], ahead), value[i], known[i]) <= smallest[i]:
            n_decided = i
    return counters, n_decided, True


@njit(cache=True)  # type: ignore[untyped-decorator]
def _smallest_from(bound: int, value: int, known: int) -> int:
    """Smallest c ≥ bound with c & known == value."""
    wrong = (bound ^ value) & known
    if wrong == 0:
        return bound
    # Above its highest wrong bit the number may stay the bound's. The lowest bit from there up that may be raised
    # makes it larger; below it all is as small as the known bits allow.
    bit: int = _highest_bit(wrong)
    while bit < 62:
        weight = 1 << bit
        if bound & weight == 0 and (known & weight == 0 or value & weight != 0):
            return ((bound >> bit) << bit) | weight | (value & (weight - 1))
        bit += 1
    return 1 << 62


@njit(cache=True)  # type: ignore[untyped-decorator]
def _largest_to(bound: int, value: int, known: int) -> int:
    """Largest c ≤ bound with c & known == value; −1 without one."""
    if bound < 0:
        return -1
    wrong = (bound ^ value) & known
    if wrong == 0:
        return bound
    # the mirror image: a bit that may be lowered is lowered, and below it all is as large as the known bits allow
    bit: int = _highest_bit(wrong)
    while bit < 62:
        weight = 1 << bit
        if bound & weight != 0 and (known & weight == 0 or value & weight == 0):
            above = (bound >> (bit + 1)) << (bit + 1)
            return above | ((value & known) & (weight - 1)) | (~known & (weight - 1))
        bit += 1
    return -1


@njit(cache=True)  # type: ignore[untyped-decorator]
def _highest_bit(number: int) -> int:
    bit = 0
    while number > 1:
        number >>= 1
        bit += 1
    return bit
