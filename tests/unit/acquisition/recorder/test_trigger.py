"""Triggers: the very sample that meets a condition, and every sample before it that was asked for."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import pytest
from fake_source import block, counts_of, info

from acquisition.recorder.pre_trigger import PreTrigger, Trigger, require_triggerable, trigger_from
from acquisition.recorder.trigger_condition import Condition, CrossingDetector, parsed_condition
from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block, Trouble, TroubleKind
from sloshlab.errors import InputError, JournalError

RATE_HZ = 1000.0


def in_blocks(counts: np.ndarray, sizes: Sequence[int]) -> Iterator[tuple[int, np.ndarray]]:
    """Consecutive parts with their counters; the last takes what is left."""
    start = 0
    for size in [*sizes, counts.size]:
        if start < counts.size:
            yield start, counts[start : start + size]
        start += size


def first_of(
    condition: str, counts: np.ndarray, sizes: Sequence[int] = (), channel: Channel | None = None
) -> int | None:
    detector = CrossingDetector(parsed_condition(condition), channel or Channel("force", "force", "N"), RATE_HZ)
    for counter, part in in_blocks(counts, sizes):
        found = detector.first(1, counter, part.astype(np.int32))
        if found is not None:
            return found
    return None


def test_a_rising_sine_crosses_its_level_where_the_closed_form_says() -> None:
    # 1000 sin(2π 5 t) > 500 from t = asin(0.5)/(2π 5) on: sample 16.67, so that 17 is the first
    counts = np.round(1000 * np.sin(2 * np.pi * 5 * np.arange(400) / RATE_HZ)).astype(int)
    expected = math.floor(math.asin(0.5) / (2 * math.pi * 5) * RATE_HZ) + 1
    assert expected == 17
    for sizes in ([], [1] * 40, [16], [17], [18], [7, 10, 3]):
        assert first_of("force>500", counts, sizes) == expected
    # falling: below again at half a period less that time
    assert first_of("force<500", counts) == math.floor(RATE_HZ / 10 - 16.6667) + 1


def test_a_signal_that_begins_beyond_its_level_has_to_come_back_first() -> None:
    counts = np.array([9, 9, 9, 3, 9])
    assert first_of("force>5", counts) == 4
    assert first_of("force>5,3", counts) is None
    assert first_of("force>5,2", counts) == 4
    assert first_of("force<5", np.array([3, 3, 6, 4])) == 3


def test_equal_to_the_level_is_not_beyond_it() -> None:
    assert first_of("force>5", np.array([0, 5, 6])) == 2
    assert first_of("force<-5", np.array([0, -5, -6])) == 2


def by_hand(values: Sequence[float], level: float, hysteresis: float) -> int | None:
    """The definition, sample by sample."""
    is_armed = False
    for number, value in enumerate(values):
        if is_armed and value > level:
            return number
        is_armed = is_armed or value <= level - hysteresis
    return None


@pytest.mark.parametrize("seed", range(40))
def test_any_signal_in_any_blocks_as_sample_by_sample(seed: int) -> None:
    random = np.random.default_rng(seed)
    counts = np.round(np.cumsum(random.normal(size=300)) * 3).astype(int)
    level, hysteresis = float(random.integers(-10, 10)), float(random.integers(0, 8))
    sizes = random.integers(1, 50, 30).tolist()
    expected = by_hand(counts.tolist(), level, hysteresis)
    assert first_of(f"force>{level},{hysteresis}", counts, sizes) == expected
    # what falls is what rises upside down
    assert first_of(f"force<{-level},{hysteresis}", -counts, sizes) == expected
    apart = int(random.integers(1, 6))
    slopes = [math.nan] * apart + [(b - a) * RATE_HZ / apart for a, b in zip(counts, counts[apart:], strict=False)]
    slope = float(random.integers(1, 9)) * 500
    expected = by_hand(slopes, slope, 100.0)
    assert first_of(f"slope(force,{apart / RATE_HZ})>{slope},100", counts, sizes) == expected


def test_levels_are_in_units_of_the_channel() -> None:
    channel = Channel("force", "force", "N", scale_factor=0.5, add_offset=-1.0)
    # values −1, −0.5, 0, 0.5, 1
    assert first_of("force>0.4", np.arange(5), channel=channel) == 3


def test_a_count_that_means_nothing_starts_nothing() -> None:
    channel = Channel("force", "force", "N", missing_count=99)
    assert first_of("force>5", np.array([0, 99, 99, 6]), channel=channel) == 3


def test_no_slope_across_a_gap_and_nothing_from_late_samples() -> None:
    detector = CrossingDetector(parsed_condition("slope(force)>5000"), Channel("force", "force", "N"), RATE_HZ)
    assert detector.first(1, 0, np.array([0, 0], np.int32)) is None
    # 100 more after ten lost samples: no slope is known
    assert detector.first(1, 12, np.array([100, 101], np.int32)) is None
    assert detector.first(1, 5, np.array([0, 100], np.int32)) is None
    assert detector.first(1, 14, np.array([107, 108], np.int32)) == 14


@pytest.mark.parametrize(
    "text",
    ["", "force", "force>", "force>much", "force>>1", "force>1,2,3", "force>1e999", "force>1,-1", "slope()>1",
     "slope(force,11)>1", "force>1;rm", "Mark", "force=1"],
)  # fmt: skip
def test_what_is_no_condition_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(InputError, match="--trigger") as refusal:
        parsed_condition(text)
    assert "\n" not in str(refusal.value)


def test_conditions_of_channels_that_are_not_there_and_too_long_histories_are_refused() -> None:
    with pytest.raises(InputError, match="channels of the first device: force_daq_0, force_daq_1"):
        require_triggerable([parsed_condition("force_other_0>1")], [info(), info("other")], 1.0)
    # 2 channels of 4 bytes at 1 kHz, less two seconds: an hour is the bound; at 1 MHz memory is
    require_triggerable([parsed_condition("mark")], [info()], 3600.0)
    with pytest.raises(InputError, match="0 … 3600 s"):
        require_triggerable([parsed_condition("mark")], [info()], 3601.0)
    with pytest.raises(InputError, match=r"0 … 65\.11 s"):
        require_triggerable([parsed_condition("mark")], [info(rate_hz=1e6)], 66.0)


def condition_at(counter: int) -> Condition:
    """Met first at this counter by `counts_of`, whose first channel rises by 31 a sample."""
    return parsed_condition(f"force_daq_0>{int(counts_of(counter, 1)[0, 0]) - 1}")


def filled(gate: PreTrigger, sizes: Sequence[int], *, begin: int = 0) -> list[Block]:
    """Blocks from `begin` on until the trigger; those that the gate releases."""
    counter = begin
    for size in sizes:
        gate.take(0, block(counter, size))
        counter += size
        if gate.trigger is not None:
            return [delivery for _, delivery in gate.released() if isinstance(delivery, Block)]
    raise AssertionError("no trigger")


@pytest.mark.parametrize("seed", range(20))
def test_exactly_the_samples_before_the_trigger_are_kept(seed: int) -> None:
    random = np.random.default_rng(seed)
    n_before, at = int(random.integers(0, 1500)), int(random.integers(1600, 1900))
    gate = PreTrigger([info()], [condition_at(at)], n_before)
    released = filled(gate, random.integers(1, 60, 400).tolist())
    assert gate.trigger is not None
    assert (gate.trigger.counter, gate.trigger.starts) == (at, ((0, 1, at - n_before),))
    counts = np.concatenate([part.counts for part in released])
    assert released[0].counter == at - n_before
    np.testing.assert_array_equal(counts, counts_of(at - n_before, len(counts)))
    assert at - n_before + len(counts) > at


def test_what_is_held_is_bounded() -> None:
    gate = PreTrigger([info()], [parsed_condition("force_daq_0>1e9")], 100)
    for counter in range(0, 50_000, 10):
        gate.take(0, block(counter, 10))
        gate.take(0, Trouble(TroubleKind.GARBAGE, "", 1, 0))
    # 100 before and a second for messages that lag behind, in blocks of ten
    assert sum(isinstance(one, Block) for one in gate._held[0]) <= 112
    assert len(gate._held[0]) <= 225


def test_a_trigger_that_comes_too_soon_keeps_what_there_is() -> None:
    gate = PreTrigger([info()], [condition_at(70)], 500)
    released = filled(gate, [10] * 20, begin=20)
    assert gate.trigger is not None
    assert gate.trigger.starts == ((0, 1, 20),)
    assert released[0].counter == 20


def test_a_restart_before_the_trigger_takes_nothing_of_the_stream_before() -> None:
    gate = PreTrigger([info()], [condition_at(70)], 500)
    gate.take(0, block(0, 60, stream=7))
    gate.take(0, block(0, 50, stream=8))
    gate.take(0, block(50, 50, stream=8))
    assert gate.trigger is not None
    assert [(one.stream, one.counter) for _, one in gate.released() if isinstance(one, Block)] == [(8, 0), (8, 50)]


def test_a_mark_starts_at_the_newest_sample_if_it_may() -> None:
    gate = PreTrigger([info()], [parsed_condition("mark"), parsed_condition("force_daq_0>1e9")], 30)
    assert gate.waiting_for == "mark or force_daq_0>1e9"
    assert not gate.mark()  # nothing has come
    gate.take(0, block(0, 100))
    assert gate.mark()
    assert gate.trigger is not None
    assert (gate.trigger.counter, gate.trigger.starts) == (99, ((0, 1, 69),))
    other = PreTrigger([info()], [parsed_condition("force_daq_0>1e9")], 30)
    other.take(0, block(0, 100))
    assert not other.mark()


def test_groups_are_cut_at_the_same_counter() -> None:
    """Two messages of a CAN device; the second lags behind."""
    source = info(n_channels=2, n_groups=2)
    gate = PreTrigger([source], [condition_at(205)], 55)
    for counter in range(0, 300, 10):
        gate.take(0, block(counter, 10, n_channels=1, group=0))
        if counter >= 20:
            gate.take(0, block(counter - 20, 10, n_channels=1, group=1))
        if gate.trigger is not None:
            break
    released = [one for _, one in gate.released() if isinstance(one, Block)]
    assert {one.group: one.counter for one in reversed(released)} == {0: 150, 1: 150}


def test_a_described_trigger_comes_back_and_nonsense_is_refused() -> None:
    trigger = Trigger("force>1", 3, 1234, 100, ((0, 3, 1134), (1, 9, 17)))
    assert trigger_from({"trigger": trigger.described()}, "journal") == trigger
    assert trigger_from({}, "journal") is None
    changes = ({"starts": [[0, 1]]}, {"counter": "x"}, {"counter": 10**30}, {"starts": [[0, 3, -1]]})
    for wrong in ({}, [], 7, *({**trigger.described(), **change} for change in changes)):
        with pytest.raises(JournalError, match="trigger"):
            trigger_from({"trigger": wrong}, "journal")
