"""Buses of python-can: options, errors, and multicast that stays on this computer."""

import os
import socket
import time
from pathlib import Path

import can
import pytest

from acquisition.sources import open_source
from acquisition.sources.can_links import PythonCanLink
from acquisition.sources.multicast_loopback import DEFAULT_GROUP, open_multicast_bus
from acquisition.sources.serial_line import LineLostError
from sloshlab.errors import SourceError


def test_options_for_the_interface_go_to_python_can(dbc, monkeypatch):
    given = {}

    def bus(**configuration):
        given.update(configuration)
        raise can.CanInitializationError("enough")

    monkeypatch.setattr(can, "Bus", bus)
    url = f"can:kvaser?channel=0&bitrate=500000&fd=yes&bus.single_handle=yes&bus.tseg=-3&bus.app=x&dbc={dbc}"
    with pytest.raises(SourceError, match="enough"):
        open_source(url).open()
    expected = {"interface": "kvaser", "channel": "0", "bitrate": 500000, "fd": True, "ignore_config": True}
    assert given == {**expected, "single_handle": True, "tseg": -3, "app": "x"}


class ScriptedBus:
    """A bus of python-can that gives messages and raises errors in turn."""

    def __init__(self, *script):
        self._script = list(script)

    def recv(self, timeout):
        step = self._script.pop(0) if self._script else None
        if isinstance(step, Exception):
            raise step
        return step

    def shutdown(self):
        """Nothing to do."""


def test_error_frames_of_python_can_are_counted_and_carry_no_samples():
    frame = can.Message(arbitration_id=0x101, data=[1, 2], is_extended_id=False)
    bus = ScriptedBus(frame, can.Message(is_error_frame=True), frame)
    received = PythonCanLink(bus, "bus", sleep=lambda duration_s: None).receive(0.0)
    assert received.batch.arbitration_id.tolist() == [0x101, 0x101]
    assert (received.n_error_frames, received.n_garbage) == (1, 0)


def test_what_python_can_cannot_unpack_is_garbage_and_a_dead_interface_is_lost():
    unpacking = can.CanOperationError("could not unpack received message")
    unpacking.__cause__ = ValueError("no message")
    link = PythonCanLink(ScriptedBus(unpacking), "bus")
    assert link.receive(0.0).n_garbage == 1
    dead = can.CanOperationError("failed to receive")
    dead.__cause__ = OSError(100, "network is down")
    for error in (dead, can.CanOperationError("bus off"), OSError(19, "no such device")):
        with pytest.raises(LineLostError):
            PythonCanLink(ScriptedBus(error), "bus").receive(0.0)


def options_of(bus):
    with socket.socket(fileno=os.dup(bus.fileno())) as same:
        return (
            same.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16).rstrip(b"\0"),
            same.getsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL),
            same.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF),
        )


@pytest.mark.parametrize(("exposed", "expected"), [(False, (b"lo", 0)), (True, (b"", 1))])
def test_multicast_stays_on_this_computer_unless_exposed(exposed, expected):
    bus = open_multicast_bus(DEFAULT_GROUP, 43199, fd=True, exposed=exposed)
    try:
        interface, hops, n_bytes = options_of(bus)
    finally:
        bus.shutdown()
    assert (interface, hops) == expected
    # a million bytes hold a second of 8 000 frames of some 100 bytes; the system's limit may be lower
    limit = int(Path("/proc/sys/net/core/rmem_max").read_text())
    assert n_bytes >= min(1_000_000, limit)


def joined_on(group: str) -> set[str]:
    """Interfaces on which somebody has joined an IPv4 group, as the kernel lists them."""
    little_endian = socket.inet_aton(group)[::-1].hex().upper()
    found, interface = set(), ""
    for line in Path("/proc/net/igmp").read_text().splitlines()[1:]:
        words = line.split()
        if words[0].isdigit():
            interface = words[1]
        elif words[0] == little_endian:
            found.add(interface)
    return found


@pytest.mark.parametrize("exposed", [False, True])
def test_a_group_is_joined_on_the_loopback_interface_alone_unless_exposed(exposed):
    """A membership elsewhere is told to the network, whatever the socket is confined to afterwards."""
    group = "239.74.163.77"
    assert joined_on(group) == set()
    try:
        bus = open_multicast_bus(group, 43198, fd=True, exposed=exposed)
    except SourceError:
        pytest.skip("no network interface to be exposed on")
    try:
        assert ("lo" in joined_on(group)) is not exposed
        assert bool(joined_on(group) - {"lo"}) is exposed
    finally:
        bus.shutdown()
    assert joined_on(group) == set()


def test_buses_on_this_computer_hear_each_other_and_their_group_alone():
    """Frames of both kinds, with the time at which the kernel got them; not what was sent to another group."""
    buses = [open_multicast_bus(group, 43197, fd=True, exposed=False) for group in ("239.74.163.78",) * 2]
    other = open_multicast_bus("239.74.163.79", 43197, fd=True, exposed=False)
    try:
        other.send(can.Message(arbitration_id=1, data=[1], is_extended_id=False))
        sent = can.Message(arbitration_id=0x1ABCDEF, data=bytes(range(64)), is_extended_id=True, is_fd=True)
        before = time.time()
        buses[0].send(sent)
        got = buses[1].recv(2.0)
        assert (got.arbitration_id, bytes(got.data), got.is_extended_id, got.is_fd) == (
            0x1ABCDEF,
            bytes(range(64)),
            True,
            True,
        )
        # the kernel's clock of time stamps may lag behind by a tick
        assert before - 0.05 <= got.timestamp <= time.time()
        assert buses[1].recv(0.05) is None
    finally:
        for bus in (*buses, other):
            bus.shutdown()
    with pytest.raises(can.CanOperationError):
        buses[1].recv(0.01)


def test_bytes_that_are_no_frame_are_an_error_of_the_bus():
    bus = open_multicast_bus("239.74.163.80", 43196, fd=True, exposed=False)
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
            stranger.sendto(b"\xc1 no frame", ("239.74.163.80", 43196))
        with pytest.raises(can.CanOperationError, match="unpack"):
            bus.recv(2.0)
    finally:
        bus.shutdown()
