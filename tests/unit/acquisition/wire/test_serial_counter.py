"""The counter of 32 bits unwrapped: an integer of any size is sent modulo 2³² and must come back."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.wire.serial_counter import CounterJumpError, StreamCounter

WRAP = 2**32


def test_frames_in_order_across_three_wraps() -> None:
    counter = StreamCounter(longest_gap=2**30)
    true = WRAP - 1000
    while true < 4 * WRAP:
        assert counter.place(true % WRAP, 2**29) == true
        true += 2**29 + 2**29 - 7  # about half of all frames are lost


def test_reordered_and_repeated_frames_around_the_wrap() -> None:
    rng = np.random.default_rng(3)
    true = WRAP - 5000 + 100 * np.arange(100)
    shuffled = true[np.argsort(np.arange(100) + rng.uniform(0, 20, 100))]
    counter = StreamCounter(longest_gap=10_000)
    for place in np.repeat(shuffled, 2).tolist():
        assert counter.place(place % WRAP, 100) == place


def test_what_comes_before_the_first_frame_has_a_lower_place_and_may_be_negative() -> None:
    counter = StreamCounter(longest_gap=1000)
    assert counter.place(100, 50) == 100
    assert counter.place(20, 50) == 20
    assert counter.place(WRAP - 30, 50) == -30
    assert counter.next == 150


@pytest.mark.parametrize(
    ("following", "allowed"), [(100 + 1000, True), (100 + 1001, False), (WRAP + 100 - 1000, True)]
)
def test_the_longest_gap_is_allowed_and_one_more_is_not(following: int, allowed: bool) -> None:
    counter = StreamCounter(longest_gap=1000)
    counter.place(0, 100)
    if allowed:
        counter.place(following % WRAP, 100)
        return
    with pytest.raises(CounterJumpError, match="jumps by 1001 samples") as caught:
        counter.place(following, 100)
    assert (caught.value.jump, caught.value.n_missing) == (1001, 1001)


def test_a_jump_back_is_a_jump() -> None:
    counter = StreamCounter(longest_gap=1000)
    counter.place(50_000, 100)
    with pytest.raises(CounterJumpError, match="jumps by -1001 samples"):
        counter.place(50_100 - 1001, 100)


def test_many_allowed_gaps_do_not_add_up_without_end() -> None:
    # each gap is allowed; altogether no more may be missing than has arrived and one longest gap
    counter = StreamCounter(longest_gap=1000)
    assert [counter.place(901 * k, 1) for k in range(2)] == [0, 901]
    with pytest.raises(CounterJumpError, match="jumps by 900 samples, 1800 missing"):
        counter.place(1802, 1)  # 1800 > 3 + 1000
    assert counter.place(1802, 798) == 1802  # 1800 ≤ 800 + 1000


def test_half_of_all_samples_may_be_missing_for_ever() -> None:
    counter = StreamCounter(longest_gap=1000)
    for k in range(100_000):
        assert counter.place((200 * k) % WRAP, 100) == 200 * k
