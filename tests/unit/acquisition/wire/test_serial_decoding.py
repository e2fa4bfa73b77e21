"""Deliveries from bytes written by hand: places, merging, and every trouble."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
import serial_bytes as by_hand

from acquisition.samples.delivery import Block, Delivery, End, Trouble, TroubleKind
from acquisition.wire.serial_decoding import HostTime, SerialDecoder

RATE_HZ = 1000.0
WRAP = 2**32


def calibration(n_channels: int = 1, bits: int = 16, **changes: Any) -> bytes:
    channels = [
        {"name": f"force_cell_{k}", "quantity": "force", "units": "N", "bits": bits} for k in range(n_channels)
    ]
    described = {"device": "daq", "sampling_rate_hz": RATE_HZ, "clock_hz": 1e6, "channels": channels, **changes}
    return by_hand.frame(by_hand.CALIBRATION, json.dumps(described).encode())


def at(seconds: float) -> HostTime:
    return HostTime(int(seconds * 1e9), 10**18 + int(seconds * 1e9))


def ready(longest_gap_s: float = 3600.0, **changes: Any) -> SerialDecoder:
    decoder = SerialDecoder("serial:test", longest_gap_s)
    assert decoder.feed(calibration(**changes), at(0)) == []
    return decoder


def blocks(deliveries: Iterable[Delivery]) -> list[Block]:
    return [d for d in deliveries if isinstance(d, Block)]


def troubles(deliveries: Iterable[Delivery]) -> list[tuple[TroubleKind, int]]:
    return [(d.kind, d.count) for d in deliveries if isinstance(d, Trouble)]


def places(deliveries: Iterable[Delivery]) -> list[tuple[int, int, int]]:
    return [(b.stream, b.counter, len(b.counts)) for b in blocks(deliveries)]


def test_frames_of_one_read_become_one_block() -> None:
    decoder = ready(n_channels=2)
    data = b"".join(by_hand.ramp(n, 4, 2, stream=3, ticks=50 + n) for n in (0, 4, 8))
    (block,) = blocks(decoder.feed(data, at(2.5)))
    assert (block.group, block.stream, block.counter, block.clock_ticks) == (0, 3, 0, 50)
    assert (block.host_monotonic_ns, block.host_utc_ns) == (2_500_000_000, 10**18 + 2_500_000_000)
    assert block.counts.dtype == np.int32
    assert block.counts.tolist() == [[n, n + 1000] for n in range(12)]


def test_a_gap_a_repetition_and_an_earlier_frame_begin_new_blocks() -> None:
    data = b"".join(by_hand.ramp(n, 4) for n in (0, 4, 12, 12, 8, 16))
    assert places(ready().feed(data, at(1))) == [(0, 0, 8), (0, 12, 4), (0, 12, 4), (0, 8, 4), (0, 16, 4)]


def test_the_counter_is_unwrapped() -> None:
    decoder = ready()
    for n in range(WRAP - 8, WRAP + 8, 4):
        assert places(decoder.feed(by_hand.ramp(n, 4), at(1))) == [(0, n, 4)]


def test_bytes_may_come_one_by_one() -> None:
    decoder = ready()
    data = by_hand.ramp(0, 4) + by_hand.ramp(4, 4) + by_hand.end(8)
    found = [d for k in range(len(data)) for d in decoder.feed(data[k : k + 1], at(k))]
    assert places(found) == [(0, 0, 4), (0, 4, 4)]
    assert found[-1] == End(0, 8)
    assert blocks(found)[0].host_monotonic_ns == (len(by_hand.ramp(0, 4)) - 1) * 10**9


def test_a_device_without_a_clock_has_no_ticks() -> None:
    (block,) = blocks(ready(clock_hz=None).feed(by_hand.ramp(0, 1, ticks=77), at(1)))
    assert block.clock_ticks is None


def test_samples_before_the_calibration_are_held_with_their_times() -> None:
    decoder = SerialDecoder("serial:test", 3600.0)
    assert decoder.feed(by_hand.ramp(0, 4), at(1)) == []
    assert decoder.feed(by_hand.ramp(4, 4), at(2)) == []
    found = decoder.feed(calibration() + by_hand.ramp(8, 4) + by_hand.end(12), at(3))
    assert places(found) == [(0, 0, 4), (0, 4, 4), (0, 8, 4)]
    assert [b.host_monotonic_ns for b in blocks(found)] == [10**9, 2 * 10**9, 3 * 10**9]
    assert found[-1] == End(0, 12)


def test_what_is_held_is_bounded() -> None:
    decoder = SerialDecoder("serial:test", 3600.0)
    big = by_hand.samples([[7] * 250] * 100)  # 100 kB in memory
    for k in range(200):
        decoder.feed(big, at(k))
        if decoder.failure:
            break
    assert k == 83  # 84 · (100 000 + 200) is the first multiple beyond 8 MiB
    assert "and no calibration" in str(decoder.failure)


def test_troubles_are_counted_per_read_and_kind() -> None:
    decoder = ready()
    corrupt = bytearray(by_hand.ramp(0, 9))
    corrupt[-4] ^= 1
    version_2 = by_hand.ramp(0, 2, version=2)
    data = (b"\x05noise\0" + bytes(corrupt)) * 3 + version_2 * 2 + by_hand.ramp(0, 2, status=1)
    found = decoder.feed(data, at(4))
    assert troubles(found) == [
        (TroubleKind.CORRUPT_FRAME, 3),
        (TroubleKind.MALFORMED_FRAME, 2),
        (TroubleKind.GARBAGE, 18),
        (TroubleKind.OVERRUN, 1),
    ]
    assert all(d.host_monotonic_ns == 4 * 10**9 for d in found if isinstance(d, Trouble))
    assert places(found) == [(0, 0, 2)]


def test_an_overrun_begins_a_block_even_without_a_gap() -> None:
    found = ready().feed(by_hand.ramp(0, 2) + by_hand.ramp(2, 2, status=1), at(1))
    assert places(found) == [(0, 0, 2), (0, 2, 2)]


def test_a_new_stream_is_told_before_its_first_block() -> None:
    found = ready().feed(by_hand.ramp(500, 4, stream=9) + by_hand.ramp(0, 4, stream=2), at(1))
    assert [type(d) for d in found] == [Block, Trouble, Block]
    assert troubles(found) == [(TroubleKind.RESTARTED, 1)]
    assert "stream 2 after stream 9" in found[1].detail  # type: ignore[union-attr]
    assert places(found) == [(9, 500, 4), (2, 0, 4)]


def test_a_late_frame_of_the_stream_before_is_no_new_start() -> None:
    data = b"".join(by_hand.ramp(n, 4, stream=s) for n, s in ((0, 1), (8, 1), (0, 2), (4, 1), (4, 2)))
    found = ready().feed(data, at(1))
    assert troubles(found) == [(TroubleKind.RESTARTED, 1)]
    assert places(found) == [(1, 0, 4), (1, 8, 4), (2, 0, 4), (1, 4, 4), (2, 4, 4)]


def test_the_end_is_delivered_once_after_the_samples() -> None:
    decoder = ready()
    found = decoder.feed(by_hand.ramp(0, 4) + by_hand.end(4) * 2, at(1)) + decoder.feed(by_hand.end(4), at(2))
    assert [type(d) for d in found] == [Block, End]
    assert found[1] == End(0, 4)
    assert decoder.complete


def test_an_end_with_a_missing_tail_keeps_its_number() -> None:
    assert ready().feed(by_hand.ramp(0, 4) + by_hand.end(4000), at(1))[-1] == End(0, 4000)


@pytest.mark.parametrize("n_samples", [3, 2**63, 4 + 3_600_001])
def test_an_end_that_does_not_fit_the_counter_has_no_number(n_samples: int) -> None:
    found = ready().feed(by_hand.ramp(0, 4) + by_hand.end(n_samples), at(1))
    assert found[1] == End(0, None)
    assert troubles(found) == [(TroubleKind.UNCERTAIN_COUNTER, 1)]


def test_the_end_of_a_stream_of_which_nothing_came() -> None:
    assert ready().feed(by_hand.end(0, stream=4), at(1)) == [End(4, 0)]


def test_the_same_calibration_again_says_nothing() -> None:
    decoder = ready()
    assert decoder.feed(calibration() * 3, at(1)) == []
    spaced = json.dumps(
        {
            "channels": [{"units": "N", "name": "force_cell_0", "quantity": "force", "scale_factor": 1}],
            "clock_hz": 1_000_000,
            "sampling_rate_hz": 1e3,
            "device": "daq",
        },
        indent=2,
    )
    assert decoder.feed(by_hand.frame(by_hand.CALIBRATION, spaced.encode()), at(1)) == []


def test_another_calibration_is_told_where_it_comes() -> None:
    decoder = ready(n_channels=2)
    channels = [
        {"name": "force_cell_0", "quantity": "force", "units": "N"},
        {"name": "force_cell_1", "quantity": "force", "units": "N", "scale_factor": 2.0},
    ]
    changed = calibration(channels=channels)
    found = decoder.feed(by_hand.ramp(0, 2, 2) + changed * 2 + by_hand.ramp(2, 2, 2), at(1))
    assert [type(d) for d in found] == [Block, Trouble, Block]
    assert troubles(found) == [(TroubleKind.CALIBRATION_CHANGED, 1)]
    assert found[1].detail == "channel force_cell_1"  # type: ignore[union-attr]
    assert decoder.calibration is not None
    assert decoder.calibration.channels[1].scale_factor == 1.0
    back = decoder.feed(calibration(n_channels=2), at(2))
    assert troubles(back) == [(TroubleKind.CALIBRATION_CHANGED, 1)]


def test_other_channels_and_rate_are_named() -> None:
    found = ready().feed(calibration(n_channels=3, sampling_rate_hz=2000.0), at(1))
    assert found[0].detail == (  # type: ignore[union-attr]
        "sampling_rate_hz 1000.0 → 2000.0, 1 channels → 3 with other names or order"
    )


def test_a_later_calibration_that_is_impossible_is_a_trouble() -> None:
    decoder = ready()
    assert troubles(decoder.feed(calibration(n_channels=0) * 2, at(1))) == [(TroubleKind.MALFORMED_FRAME, 2)]
    assert decoder.failure is None


def test_a_first_calibration_that_is_impossible_is_a_failure() -> None:
    decoder = SerialDecoder("serial:test", 3600.0)
    assert decoder.feed(calibration(n_channels=257), at(1)) == []
    assert "got 257 channels" in str(decoder.failure)


@pytest.mark.parametrize("frame", [by_hand.ramp(0, 2, 3), by_hand.samples([[1, 2]], 2), by_hand.samples([[1]], 3)])
def test_samples_that_do_not_fit_the_calibration_are_left_out(frame: bytes) -> None:
    found = ready(n_channels=2, bits=24).feed(frame + by_hand.samples([[1, 2]], 3, counter=2), at(1))
    assert troubles(found) == [(TroubleKind.MALFORMED_FRAME, 1)]
    assert places(found) == [(0, 2, 1)]


def test_a_device_that_commands_or_a_line_that_echoes() -> None:
    found = ready().feed(by_hand.frame(by_hand.SEND_CALIBRATION) * 2, at(1))
    assert troubles(found) == [(TroubleKind.MALFORMED_FRAME, 2)]


def test_words_are_kept_printable_and_short() -> None:
    decoder = ready()
    decoder.feed(by_hand.frame(by_hand.MESSAGE, b"hot\x1b[2J\n!" + b"x" * 1000), at(1))
    assert decoder.words.startswith("hot[2J!xxx")
    assert len(decoder.words) <= 200


def test_samples_before_the_beginning_are_left_out() -> None:
    found = ready().feed(by_hand.ramp(4, 4) + by_hand.ramp(-8, 4), at(1))
    assert places(found) == [(0, 4, 4)]
    assert troubles(found) == [(TroubleKind.UNCERTAIN_COUNTER, 1)]


def test_a_jump_of_more_than_the_longest_gap_is_a_failure_that_keeps_what_came_before() -> None:
    decoder = ready(longest_gap_s=2.0)
    found = decoder.feed(by_hand.ramp(0, 4) + by_hand.ramp(2004, 4) + by_hand.ramp(4009, 4), at(1))
    assert places(found) == [(0, 0, 4), (0, 2004, 4)]
    assert "sample counter that jumps by 2001 samples (2 s" in str(decoder.failure)
    assert "longest_gap_s" in str(decoder.failure)
    assert decoder.feed(by_hand.ramp(2008, 4), at(2)) == []


def test_silence_in_which_the_counter_may_have_wrapped_is_a_failure() -> None:
    wrap_half_s = 2**31 / RATE_HZ
    decoder = ready(longest_gap_s=1e6)
    decoder.feed(by_hand.ramp(0, 4), at(0))
    assert places(decoder.feed(by_hand.ramp(4, 4), at(wrap_half_s - 1))) == [(0, 4, 4)]
    assert decoder.feed(by_hand.ramp(8, 4), at(2 * wrap_half_s)) == []
    assert "may have wrapped" in str(decoder.failure)
    steady = ready(longest_gap_s=1e6)
    for k in range(4):
        assert places(steady.feed(by_hand.ramp(4 * k, 4), at(0.9 * k * wrap_half_s))) == [(0, 4 * k, 4)]
    fresh = ready(longest_gap_s=1e6)
    fresh.feed(by_hand.ramp(0, 4, stream=1), at(0))
    assert places(fresh.feed(by_hand.ramp(0, 4, stream=2), at(3 * wrap_half_s))) == [(2, 0, 4)]


def test_a_device_that_starts_anew_without_end_is_a_failure() -> None:
    decoder = ready()
    data = b"".join(by_hand.ramp(0, 1, stream=s) for s in range(1500))
    found = decoder.feed(data, at(1))
    assert len(blocks(found)) == 1000
    assert "started anew 1000 times" in str(decoder.failure)


def test_a_broken_frame_is_forgotten_when_the_line_breaks() -> None:
    decoder = ready()
    decoder.feed(by_hand.ramp(0, 4)[:20], at(1))
    decoder.break_off()
    found = decoder.feed(by_hand.ramp(4, 4), at(2))
    assert places(found) == [(0, 4, 4)]
    assert troubles(found) == []
