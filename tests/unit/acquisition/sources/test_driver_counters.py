"""Counters of drivers: the layouts of the kernel's headers by hand, a full socket for real."""

from __future__ import annotations

import os
import socket
import struct
import sys
from pathlib import Path

import pytest
from can.interfaces.virtual import VirtualBus
from can_by_hand import database

from acquisition.samples.delivery import Trouble, TroubleKind
from acquisition.sources import driver_counters
from acquisition.sources.can_source import CanSource
from acquisition.sources.driver_counters import (
    INTERVAL_NS,
    Counter,
    DriverLosses,
    interface_counts,
    port_counts,
    socket_counts,
)
from acquisition.sources.serial_line import open_line
from acquisition.sources.urls import parse_url

OVERRUN = Counter("overruns", TroubleKind.OVERRUN, 1 << 32)
FRAMES = Counter("rx_dropped of can0", TroubleKind.OVERRUN, 1 << 64)
on_linux = pytest.mark.skipif(sys.platform != "linux", reason="counters of Linux")


@pytest.mark.parametrize(
    ("counter", "before", "after", "growth"),
    [
        (OVERRUN, 5, 8, 3),
        (OVERRUN, 5, 5, None),
        (OVERRUN, 2**32 - 2, 3, 5),  # comes round
        (FRAMES, 2**33, 2**33 + 1, 1),
        (FRAMES, 100, 4, 4),  # the interface went down and up, and counts from 0
        (FRAMES, 100, 100, None),
    ],
)
def test_growth_since_the_last_look(counter: Counter, before: int, after: int, growth: int | None) -> None:
    counts = {counter: before}
    losses = DriverLosses(lambda: counts, 0)
    assert losses.grown(INTERVAL_NS) == []
    counts[counter] = after
    assert losses.grown(2 * INTERVAL_NS - 1) == []
    expected = [] if growth is None else [Trouble(counter.kind, f"{counter.name}: {growth} more", growth, 7)]
    assert losses.grown(7, at_once=True) == expected
    assert losses.grown(8, at_once=True) == []


def answer_of_a_port(frame: int, overrun: int, parity: int, buffer_overrun: int) -> bytes:
    """struct serial_icounter_struct of linux/serial.h, field by field."""
    cts = dsr = rng = dcd = brk = 0
    rx, tx = 1_000_000, 77
    fields = cts, dsr, rng, dcd, rx, tx, frame, overrun, parity, brk, buffer_overrun
    return struct.pack("<11i", *fields) + bytes(9 * 4)


@on_linux
def test_a_port_is_asked_by_its_descriptor(monkeypatch: pytest.MonkeyPatch) -> None:
    """Everything but the one system call, on a terminal that has no counters of its own."""
    asked = []

    def ioctl(descriptor: int, request: int, answer: bytes) -> bytes:
        asked.append((os.ttyname(descriptor), request, len(answer)))
        return answer_of_a_port(frame=1, overrun=2, parity=3, buffer_overrun=4)

    master, slave = os.openpty()
    line = open_line(os.ttyname(slave), 115_200)
    assert line.driver_counts() == {}
    monkeypatch.setattr("fcntl.ioctl", ioctl)
    counts = {counter.name: (counter.kind, count) for counter, count in line.driver_counts().items()}
    assert asked == [(os.ttyname(slave), 0x545D, 80)]
    assert counts == {
        "framing errors": (TroubleKind.LINE_ERROR, 1),
        "overruns of the port": (TroubleKind.OVERRUN, 2),
        "parity errors": (TroubleKind.LINE_ERROR, 3),
        "overruns of the driver's buffer": (TroubleKind.OVERRUN, 4),
    }
    line.close()
    assert line.driver_counts() == {}
    os.close(master)
    os.close(slave)


def test_what_is_no_port_has_no_counts() -> None:
    assert port_counts(-1) == {}
    assert socket_counts(-1) == {}
    assert interface_counts("no_such_interface") == {}


def statistics(folder: Path, **counts: int) -> None:
    """Files as the kernel shows them."""
    (folder / "can0" / "statistics").mkdir(parents=True, exist_ok=True)
    for name, count in counts.items():
        (folder / "can0" / "statistics" / name).write_text(f"{count}\n")


def test_an_interface_counts_lost_and_wrong_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(driver_counters, "INTERFACES", tmp_path)
    lost = {"rx_dropped": 1, "rx_over_errors": 20, "rx_fifo_errors": 300, "rx_missed_errors": 4000}
    statistics(tmp_path, rx_packets=10**6, rx_errors=25, tx_errors=9, **lost)
    counts = interface_counts("can0")
    assert {counter.name: count for counter, count in counts.items() if counter.kind is TroubleKind.OVERRUN} == {
        f"{name} of can0": count for name, count in lost.items()
    }
    assert {
        counter.name: count for counter, count in counts.items() if counter.kind is TroubleKind.LINE_ERROR
    } == {"other rx_errors of can0": 5}


@on_linux
def test_the_interfaces_of_this_computer_have_counts() -> None:
    assert len(interface_counts("lo")) == 5


@on_linux
def test_drops_of_a_full_socket_are_those_that_never_arrive() -> None:
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        receiver.bind(("127.0.0.1", 0))
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
        receiver.setblocking(False)
        losses = DriverLosses(lambda: socket_counts(receiver.fileno()), 0)
        for _ in range(100):
            sender.sendto(bytes(500), receiver.getsockname())
        n_received = 0
        while True:
            try:
                receiver.recv(1000)
            except BlockingIOError:
                break
            n_received += 1
        assert 0 < n_received < 100
        assert losses.grown(1, at_once=True) == [
            Trouble(TroubleKind.OVERRUN, f"drops of a full socket: {100 - n_received} more", 100 - n_received, 1)
        ]


def test_a_can_source_tells_what_its_interface_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SocketCAN as far as there is any here: python-can's bus is a virtual one, the kernel's files are made."""
    monkeypatch.setattr(driver_counters, "INTERFACES", tmp_path)

    class Bus(VirtualBus):
        """What a bus of SocketCAN has more: a socket, here a closed one."""

        def fileno(self) -> int:
            return -1

    monkeypatch.setattr("acquisition.sources.can_source.open_bus", lambda name, configuration: Bus("can0"))
    statistics(tmp_path, rx_dropped=5, rx_over_errors=0, rx_errors=0)
    url = f"can:socketcan?channel=can0&dbc={database(tmp_path / 'cells.dbc')}"
    now_ns = [10**9]

    def monotonic_ns() -> int:
        now_ns[0] += 10**7
        return now_ns[0]

    with CanSource(parse_url(url), monotonic_ns=monotonic_ns, sleep=lambda duration_s: None) as source:
        source.start()
        statistics(tmp_path, rx_dropped=5, rx_over_errors=3, rx_errors=4)
        found: list[object] = []
        while not found:
            found += source.read(0.0)
        statistics(tmp_path, rx_dropped=6)
        found += source.finish()
    told = {(each.kind, each.detail) for each in found if isinstance(each, Trouble)}
    assert told == {
        (TroubleKind.OVERRUN, "rx_over_errors of can0: 3 more"),
        (TroubleKind.LINE_ERROR, "other rx_errors of can0: 1 more"),
        (TroubleKind.OVERRUN, "rx_dropped of can0: 1 more"),
    }
