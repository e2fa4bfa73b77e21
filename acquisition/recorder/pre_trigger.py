"""Waiting for a trigger: what arrives is held for a while, so that the recording begins before it.

Everything is counted by the sample counter of the first device: the trigger is one of its samples, and so many
samples before it are kept exactly. The other devices keep what arrived about the same time and a little more.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from acquisition.recorder.trigger_condition import MARK, Condition, CrossingDetector
from acquisition.samples.delivery import Block, Delivery
from acquisition.sources.interface import SourceInfo
from sloshlab.errors import InputError, JournalError

MOST_HELD_BYTES: Final = 512 << 20
LONGEST_PRE_S: Final = 3600.0
_LARGEST_COUNTER: Final = 2**62
_MARGIN_S: Final = 1.0
"""Messages of a CAN device, and devices among each other, may be so far apart."""


@dataclass(frozen=True)
class Trigger:
    """The sample that started a recording.

    Attributes
    ----------
    condition : str
        As it was written.
    stream, counter : int
        Of the first device.
    n_asked : int
        Samples before it that were asked for.
    starts : tuple of (int, int, int)
        Source, stream and counter of the first sample that belongs to the recording.
    """

    condition: str
    stream: int
    counter: int
    n_asked: int
    starts: tuple[tuple[int, int, int], ...]

    def described(self) -> dict[str, Any]:
        """JSON object for the journal; the inverse of `trigger_from`."""
        return {
            "condition": self.condition, "stream": self.stream, "counter": self.counter, "n_asked": self.n_asked,
            "starts": [list(start) for start in self.starts],
        }  # fmt: skip


def trigger_from(metadata: Mapping[str, Any], what: str) -> Trigger | None:
    """The trigger that the metadata of a journal name; None if there was none.

    Raises
    ------
    JournalError
        If what they name is no trigger.
    """
    content = metadata.get("trigger")
    if content is None:
        return None
    try:
        starts = tuple((int(source), int(stream), int(counter)) for source, stream, counter in content["starts"])
        numbers = int(content["stream"]), int(content["counter"]), int(content["n_asked"])
        # a journal may name any number: one that no device can have would make a recording of that length
        if not all(
            0 <= counter <= _LARGEST_COUNTER for counter in (*numbers[1:], *(start[2] for start in starts))
        ):
            raise ValueError("a counter that no device has")
        return Trigger(str(content["condition"])[:200], *numbers, starts)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise JournalError(f"{what}: metadata", got="a trigger that is described wrongly") from error


def require_triggerable(conditions: Sequence[Condition], infos: Sequence[SourceInfo], pre_s: float) -> None:
    """Refuse conditions that can never be met, and more samples before the trigger than memory holds.

    Raises
    ------
    InputError
    """
    names = [channel.name for channel in infos[0].channels]
    for condition in conditions:
        if condition.channel and condition.channel not in names:
            raise InputError(
                f"--trigger {condition.text}", got=f"channel {condition.channel}",
                allowed=f"channels of the first device: {', '.join(names)}",
            )  # fmt: skip
    rate = sum(4 * len(info.channels) * info.sampling_rate_hz for info in infos)
    longest_s = min(LONGEST_PRE_S, MOST_HELD_BYTES / rate - 2 * _MARGIN_S)
    if not 0 <= pre_s <= longest_s:
        raise InputError("--pre-seconds", got=f"{pre_s:g} s", allowed=f"0 … {longest_s:.4g} s of these devices")


class PreTrigger:
    """Holds the last samples of all sources until a condition is met.

    Parameters
    ----------
    infos : sequence of SourceInfo
    conditions : sequence of Condition
        Any of them starts the recording.
    n_before : int
        Samples of the first device before the trigger.
    """

    def __init__(self, infos: Sequence[SourceInfo], conditions: Sequence[Condition], n_before: int) -> None:
        self._infos, self._n_before = tuple(infos), n_before
        self.waiting_for = " or ".join(condition.text for condition in conditions)
        self._waits_for_mark = any(condition.text == MARK for condition in conditions)
        first = infos[0]
        self._detectors: list[list[tuple[int, Condition, CrossingDetector]]] = [
            [
                (column, condition, CrossingDetector(condition, first.channels[number], first.sampling_rate_hz))
                for column, number in enumerate(group)
                for condition in conditions
                if condition.channel == first.channels[number].name
            ]
            for group in first.groups
        ]
        self._held: list[deque[Delivery]] = [deque() for _ in infos]
        self._newest: tuple[int, int] | None = None
        self._newest_ns = 0
        self.trigger: Trigger | None = None

    @property
    def is_waiting(self) -> bool:
        """Whether nothing has started the recording yet."""
        return self.trigger is None

    def take(self, source: int, delivery: Delivery) -> None:
        """Hold a delivery; afterwards `trigger` tells whether it has met a condition."""
        self._held[source].append(delivery)
        if isinstance(delivery, Block) and len(delivery.counts):
            if source == 0:
                self._take_first(delivery)
            self._forget(source, delivery)

    def mark(self) -> bool:
        """A person has set a mark; True if that starts the recording, at the newest sample."""
        if not self._waits_for_mark or self._newest is None:
            return False
        stream, end = self._newest
        self._start(MARK, stream, end - 1)
        return True

    def released(self) -> Iterator[tuple[int, Delivery]]:
        """Everything held that belongs to the recording, source by source, in order; nothing is held any more."""
        assert self.trigger is not None
        for source, stream, counter in self.trigger.starts:
            held, self._held[source] = self._held[source], deque()
            has_begun = False
            for delivery in held:
                if not isinstance(delivery, Block):
                    # troubles and ends of what is not recorded are no part of it
                    if has_begun:
                        yield source, delivery
                    continue
                kept = _from_counter(delivery, stream, counter)
                if kept is not None:
                    has_begun = True
                    yield source, kept

    def _take_first(self, block: Block) -> None:
        end = block.counter + len(block.counts)
        if self._newest is None or self._newest[0] != block.stream or end > self._newest[1]:
            self._newest, self._newest_ns = (block.stream, end), block.host_monotonic_ns
        found = [
            (at, condition.text)
            for column, condition, detector in self._detectors[block.group]
            if (at := detector.first(block.stream, block.counter, block.counts[:, column])) is not None
        ]
        if found and self.trigger is None:
            counter, text = min(found)
            self._start(text, block.stream, counter)

    def _start(self, text: str, stream: int, counter: int) -> None:
        starts = [(0, stream, max(counter - self._n_before, _first_of_all(self._held[0], stream)))]
        before_s = (self._n_before + self._newest_end() - counter) / self._infos[0].sampling_rate_hz
        since_ns = self._newest_ns - round((before_s + _MARGIN_S) * 1e9)
        for source in range(1, len(self._infos)):
            start = _start_since(self._held[source], since_ns)
            if start is not None:
                starts.append((source, *start))
        self.trigger = Trigger(text, stream, counter, self._n_before, tuple(starts))

    def _newest_end(self) -> int:
        assert self._newest is not None
        return self._newest[1]

    def _forget(self, source: int, newest: Block) -> None:
        """Let go what no trigger that is still to come could reach."""
        held, info = self._held[source], self._infos[source]
        rate_hz = info.sampling_rate_hz
        n_kept = self._n_before * rate_hz / self._infos[0].sampling_rate_hz + _MARGIN_S * rate_hz * (1 + source)
        oldest = newest.counter - n_kept
        while len(held) > 1:
            delivery = held[0]
            is_older = isinstance(delivery, Block) and (
                delivery.stream != newest.stream or delivery.counter + len(delivery.counts) < oldest
            )
            if not is_older and isinstance(delivery, Block):
                return
            held.popleft()


def _start_since(held: Iterable[Delivery], since_ns: int) -> tuple[int, int] | None:
    """Stream and counter of the first sample that all groups have of those which arrived since then."""
    blocks = [one for one in held if isinstance(one, Block) and one.host_monotonic_ns >= since_ns]
    if not blocks:
        return None
    stream = blocks[-1].stream
    return stream, _first_of_all(blocks, stream)


def _first_of_all(held: Iterable[Delivery], stream: int) -> int:
    """Counter of the first sample of a stream that all groups of which any is held have."""
    firsts: dict[int, int] = {}
    for block in held:
        if isinstance(block, Block) and block.stream == stream:
            firsts[block.group] = min(firsts.get(block.group, block.counter), block.counter)
    return max(firsts.values())


def _from_counter(block: Block, stream: int, counter: int) -> Block | None:
    """The part of a block from a counter on; blocks of streams before are none of the recording's."""
    if block.stream != stream:
        return None
    skipped = counter - block.counter
    if skipped <= 0:
        return block
    if skipped >= len(block.counts):
        return None
    # the device's clock belongs to the first sample, which is left out
    return Block(
        block.group, stream, counter, block.counts[skipped:], None, block.host_monotonic_ns, block.host_utc_ns
    )
