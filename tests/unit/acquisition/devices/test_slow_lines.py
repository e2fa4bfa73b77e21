"""Buffers before slow lines, counted by hand."""

import numpy as np
import pytest

from acquisition.devices.device_clock import DeviceClock
from acquisition.devices.faults import OverrunFault, Stall
from acquisition.devices.frames import FrameKind
from acquisition.devices.serial_wire import SerialWire
from acquisition.devices.truth import Truth
from acquisition.devices.uart import SlowLine, Uart
from acquisition.samples.channel import Channel


@pytest.mark.parametrize(
    ("begin_s", "units", "done_s"),
    [(0.0, 100, 1.0), (0.5, 50, 1.0), (0.5, 60, 3.1), (2.0, 0, 3.0), (3.0, 10, 3.1), (0.0, 700, 9.5)],
)
def test_a_line_stands_still_while_nobody_reads(begin_s, units, done_s):
    line = SlowLine(100.0, [Stall(at_s=4.0, for_s=0.5), Stall(at_s=1.0, for_s=2.0)])
    assert line.done_s(begin_s, units) == pytest.approx(done_s)


def frames(n):
    """Frames of one 16-bit sample each, one per 10 ms: 28 + 2 bytes, stuffed 31, and a zero."""
    wire = SerialWire("daq", DeviceClock(100.0), (Channel("voltage_a", "voltage", "V"),), samples_per_frame=1)
    made = wire.samples(1, 0, np.arange(1, n + 1)[:, None].astype(np.int32))
    made["due_s"] = (np.arange(n) + 1) / 100.0
    assert {len(data) for data in made["bytes"]} == {32}
    return wire, made


def test_the_frame_that_finds_no_room_is_cut_and_takes_the_next_one_with_it():
    wire, made = frames(12)
    truth = Truth()
    # nobody reads from 35 ms to 85 ms; the frames due at 40 … 80 ms are 5 × 32 bytes, room is for 100
    fault = OverrunFault(fifo_bytes=100, stalls=[{"at_s": 0.035, "for_s": 0.05}])
    out = Uart(fault, wire, truth).carried(made, 1)
    assert [len(data) for data in out["bytes"]] == [32, 32, 32, 32, 32, 32, 4, 32, 32, 32, 32]
    spoiled = out["counter"][out["kind"] == FrameKind.SPOILED]
    assert spoiled.tolist() == [6, 8]  # cut, and torn by the rest of it
    assert truth.counts["overrun"] == 3  # counters 6, 7, 8
    assert truth.counts["overrun_bytes"] == 28 + 32
    assert out["due_s"][3:7] == pytest.approx([0.085] * 4)  # they come when the host reads again
    marked = [
        k for k, data in zip(out["counter"], out["bytes"], strict=True) if data != made["bytes"][k][: len(data)]
    ]
    assert marked == [9]  # the first whole frame says that data were lost


def test_a_slow_line_delays_every_byte():
    wire, made = frames(3)
    out = Uart(OverrunFault(baud_rate=64_000, fifo_bytes=1000), wire, Truth()).carried(made, 1)
    assert out["due_s"] == pytest.approx([0.015, 0.025, 0.035])  # 32 bytes at 6400 bytes/s are 5 ms
