"""CAN devices: connections that break, hang or lie, and frames by hand over a server by hand."""

import os
import socket
import time
from pathlib import Path

import can
import pytest
from can_by_hand import (
    CELLS,
    ENDED,
    RATE_HZ,
    ScriptedServer,
    counts_of,
    database,
    hanging_up_after,
    run,
    samples,
    sending,
    status,
    text,
)

from acquisition.sources import Block, End, Trouble, TroubleKind, open_source, parse_url
from acquisition.sources.can_links import CanLink, PythonCanLink
from acquisition.sources.can_source import CanSource
from acquisition.sources.can_text_links import open_socketcand
from acquisition.sources.multicast_loopback import DEFAULT_GROUP, open_multicast_bus
from acquisition.sources.serial_line import LineLostError
from acquisition.wire.can_counter import CounterTracker
from sloshlab.errors import SourceError

PATIENCE_S = 60.0


@pytest.fixture
def dbc(tmp_path):
    return database(tmp_path / "cells.dbc")


def url_of(server, dbc, more=""):
    return f"can:socketcand?port={server.port}&channel=can1&dbc={dbc}{more}"


def read_until(source, is_enough):
    """Deliveries until there are enough."""
    found = []
    deadline = time.monotonic() + PATIENCE_S
    while not is_enough(found):
        assert time.monotonic() < deadline, found
        found += source.read(0.1)
    return found


def read_for_ever(source, deliveries):
    """Add to the deliveries until the source fails."""
    while True:
        deliveries += source.read(0.1)


def has_end(deliveries):
    return any(isinstance(delivery, End) for delivery in deliveries)


def has(kind):
    return lambda deliveries: any(isinstance(d, Trouble) and d.kind is kind for d in deliveries)


def troubles(deliveries):
    return [(d.kind, d.count) for d in deliveries if isinstance(d, Trouble)]


def delivered(deliveries):
    """Counter → counts, each once."""
    found = {}
    for block in deliveries:
        if isinstance(block, Block):
            for k, row in enumerate(block.counts.tolist()):
                assert block.counter + k not in found
                found[block.counter + k] = tuple(row)
    return found


def complete(n_samples):
    return {counter: counts_of(counter) for counter in range(n_samples)}


ENDING = [status(ENDED, 9, 200)] * 3


def test_a_device_is_what_its_database_says(dbc):
    with ScriptedServer(sending()) as server, open_source(url_of(server, dbc)) as source:
        source.start()
        info = source.info
    assert (info.device, info.sampling_rate_hz, info.clock_hz) == ("cells", RATE_HZ, 1e6)
    assert list(info.channels) == CELLS
    assert info.groups == ((0, 1),)


def test_frames_by_hand_become_their_counts(dbc):
    with ScriptedServer(sending(text(run(0, 200) + ENDING))) as server, open_source(url_of(server, dbc)) as source:
        source.start()
        deliveries = read_until(source, has_end)
    assert delivered(deliveries) == complete(200)
    assert troubles(deliveries) == []
    assert deliveries[-1].n_samples == 200
    clocks = {d.counter: d.clock_ticks for d in deliveries if isinstance(d, Block) and d.clock_ticks is not None}
    assert clocks
    # the clock ticks 1000 times per sample from 0 on
    assert all(ticks == 1000 * counter for counter, ticks in clocks.items())
    assert server.heard[:2] == [b"< open can1 >", b"< rawmode >"]
    # host_command: crc_16 over identifier 0x080 and six bytes, then 1 for start and 2 for stop
    assert server.heard[2] == b"< send 080 8 ad 40 1 0 0 0 0 0 >"
    assert server.heard[-1].startswith(b"< send 080 8 ")
    assert server.heard[-1].endswith(b" 2 0 0 0 0 0 >")


def test_a_handshake_in_one_piece_and_frames_that_come_in_crumbs(dbc):
    def crumbs(server, connection):
        connection.sendall(b"< hi >< ok >")
        server.hear(connection)
        server.hear(connection)
        content = b"< ok >" + text(run(0, 200) + ENDING)
        for start in range(0, len(content), 61):
            connection.sendall(content[start : start + 61])
            time.sleep(0.0005)
        server.hear_to_the_end(connection)

    with ScriptedServer(crumbs) as server, open_source(url_of(server, dbc)) as source:
        source.start()
        deliveries = read_until(source, has_end)
    assert delivered(deliveries) == complete(200)
    assert troubles(deliveries) == []


def test_a_corrupt_frame_is_left_out_and_the_rest_kept(dbc):
    frames = run(0, 200) + ENDING
    number, content = frames[101]  # behind the status: sample 100
    frames[101] = number, content[:5] + bytes([content[5] ^ 4]) + content[6:]
    with ScriptedServer(sending(text(frames))) as server, open_source(url_of(server, dbc)) as source:
        source.start()
        deliveries = read_until(source, has_end)
    expected = complete(200)
    del expected[100]
    assert delivered(deliveries) == expected
    assert troubles(deliveries) == [(TroubleKind.CORRUPT_FRAME, 1)]


def test_error_frames_garbage_and_other_devices_do_not_disturb(dbc):
    frames = run(0, 200)
    noise = b"< error 04 1.0 >< error 20 1.1 >what is this>< stat >"
    content = (
        text(frames[:100]) + noise + text([(0x123, bytes(8)), (0x101, bytes(3))]) + text(frames[100:] + ENDING)
    )
    with ScriptedServer(sending(content)) as server, open_source(url_of(server, dbc)) as source:
        source.start()
        deliveries = read_until(source, has_end)
    assert delivered(deliveries) == complete(200)
    found = dict(troubles(deliveries))
    assert found[TroubleKind.BUS_ERROR] == 2
    assert found[TroubleKind.GARBAGE] == len(b"whatisthis>") + len(b"<stat>")
    assert found[TroubleKind.MALFORMED_FRAME] == 1
    assert len(found) == 3


def test_a_broken_connection_comes_back_and_loses_only_what_was_sent_meanwhile(dbc):
    script = (hanging_up_after(text(run(0, 100))), sending(text(run(120, 200) + ENDING)))
    with ScriptedServer(*script) as server, open_source(url_of(server, dbc)) as source:
        source.start()
        deliveries = read_until(source, has_end)
    expected = complete(200)
    for counter in range(100, 120):
        del expected[counter]
    assert delivered(deliveries) == expected
    kinds = [kind for kind, _ in troubles(deliveries)]
    assert kinds == [TroubleKind.DISCONNECTED, TroubleKind.RECONNECTED]
    assert server.heard.count(b"< rawmode >") == 2
    assert len({d.stream for d in deliveries if isinstance(d, Block)}) == 1


def test_a_device_that_starts_anew_has_another_stream(dbc):
    content = text(run(0, 100) + run(0, 200, stream=10) + [status(ENDED, 10, 200)] * 3)
    with ScriptedServer(sending(content)) as server, open_source(url_of(server, dbc)) as source:
        source.start()
        deliveries = read_until(source, has_end)
    restart = next(k for k, d in enumerate(deliveries) if has(TroubleKind.RESTARTED)([d]))
    assert delivered(deliveries[restart:]) == complete(200)
    before = {d.stream for d in deliveries[:restart] if isinstance(d, Block)}
    after = {d.stream for d in deliveries[restart:] if isinstance(d, Block | End)}
    assert len(before) == len(after) == 1
    assert before != after


def test_a_device_that_started_anew_while_away_is_known_by_its_next_status(dbc):
    """Its first status was not heard, and its counter runs through the place where the old one stopped."""
    anew = [*run(60, 160, stream=12)[1:], *run(160, 400, stream=12), *[status(ENDED, 12, 400)] * 3]
    script = (hanging_up_after(text(run(0, 100))), sending(text(anew)))
    with ScriptedServer(*script) as server, open_source(url_of(server, dbc)) as source:
        source.start()
        deliveries = read_until(source, has_end)
    first = [block for block in deliveries if isinstance(block, Block) and block.stream == 9]
    second = [block for block in deliveries if isinstance(block, Block) and block.stream != 9]
    assert set(delivered(first)) <= set(range(100))
    assert {counter: counts_of(counter) for counter in range(80, 400)}.items() <= delivered(second).items()
    assert [kind for kind, _ in troubles(deliveries)].count(TroubleKind.RESTARTED) == 1


def test_hanging_up_after_the_end_is_no_trouble(dbc):
    script = hanging_up_after(text(run(0, 200) + ENDING))
    with ScriptedServer(script) as server, open_source(url_of(server, dbc)) as source:
        source.start()
        deliveries = read_until(source, has_end)
        deliveries += [d for _ in range(5) for d in source.read(0.1)]
    assert delivered(deliveries) == complete(200)
    assert troubles(deliveries) == []


def test_a_lost_server_is_asked_again_now_and_then(dbc):
    slept_s = []

    def sleep(duration_s):
        slept_s.append(duration_s)
        time.sleep(duration_s)

    with (
        ScriptedServer(hanging_up_after(text(run(0, 50)))) as server,
        CanSource(parse_url(url_of(server, dbc)), sleep=sleep) as source,
    ):
        source.start()
        read_until(source, has(TroubleKind.DISCONNECTED))
        server.listening.close()
        slept_s.clear()
        assert [d for _ in range(4) for d in source.read(0.25) if isinstance(d, Trouble)] == []
    # of the second, the processor gets what connecting in vain needs
    assert sum(slept_s) > 0.5


class LostLink(CanLink):
    """Gone when it is first used."""

    def start(self):
        raise LineLostError("bus", got="it is gone")

    def receive(self, timeout_s):
        raise AssertionError("nothing can be received")

    def send(self, arbitration_id, data, *, extended, fd):
        raise LineLostError("bus", got="it is gone")

    def close(self):
        """Nothing to do."""


def test_a_bus_that_is_lost_at_the_start_is_reported_by_the_next_read(dbc, monkeypatch):
    monkeypatch.setattr("acquisition.sources.can_source.open_socketcand", lambda *_, **__: LostLink())
    with open_source(f"can:socketcand?dbc={dbc}") as source:
        source.start()
        assert troubles(source.read(0.0)) == [(TroubleKind.DISCONNECTED, 1)]
        # it comes back only to be lost again, which is the same trouble
        assert troubles([d for _ in range(3) for d in source.read(0.3)]) == []


def test_what_takes_frames_apart_is_loaded_before_frames_can_come(dbc, monkeypatch):
    order = []

    class Tracker(CounterTracker):
        def take(self, value, known):
            order.append("taken apart")
            return super().take(value, known)

    def connect(*_, **__):
        order.append("connected")
        return LostLink()

    monkeypatch.setattr("acquisition.sources.can_source.CounterTracker", Tracker)
    monkeypatch.setattr("acquisition.sources.can_source.open_socketcand", connect)
    with open_source(f"can:socketcand?dbc={dbc}"):
        assert order == ["taken apart", "connected"]


def test_without_reconnecting_a_broken_connection_is_an_error(dbc):
    script = hanging_up_after(text(run(0, 50)))
    with ScriptedServer(script) as server, open_source(url_of(server, dbc, "&reconnect=no")) as source:
        source.start()
        with pytest.raises(SourceError, match="the connection was lost") as caught:
            read_until(source, has_end)
    assert str(caught.value).startswith(f"source {source.url}: 127.0.0.1:{server.port}: got")


FRAMES_OF_OTHERS = [b"", b"< frame 00000101 12.0 0000000000000000 >", b"< frame 555 12.0 00 >"]


@pytest.mark.parametrize("between", FRAMES_OF_OTHERS)
def test_start_is_said_again_until_the_device_is_heard(dbc, between):
    """The second of the others has the number of the device's frames, but with 29 bits."""

    def deaf(server, connection):
        server.handshake(connection)
        for _ in range(3):
            server.hear(connection)
            connection.sendall(between)
        connection.sendall(text(run(0, 200) + ENDING))
        server.hear_to_the_end(connection)

    with ScriptedServer(deaf) as server, open_source(url_of(server, dbc)) as source:
        source.start()
        read_until(source, has_end)
    assert server.heard[2] == server.heard[3] == server.heard[4]


def answering(*pieces):
    def part(server, connection):
        for piece in pieces:
            connection.sendall(piece)
            server.hear(connection)
        server.hear_to_the_end(connection)

    return part


@pytest.mark.parametrize(
    ("script", "said"),
    [
        (answering(), "got no answer; allowed: '< hi >'"),
        (answering(b"220 mail server >\n"), "got '220 mail server >'; allowed: '< hi >'"),
        (answering(b"x" * 3000), "got 'xxxx.*allowed: '< hi >'"),
        (
            answering(b"< hi >", b"< error could not open bus >"),
            "could not open bus.*remedy: check port and channel",
        ),
        (answering(b"< hi >", b"< o"), "got '< o'; allowed: '< ok >'"),
        (lambda server, connection: None, "the other end closed it|reset"),
    ],
)
def test_what_is_no_socketcand_is_one_line(dbc, script, said):
    with ScriptedServer(script) as server:
        source = open_source(url_of(server, dbc, "&open_timeout_s=0.5"))
        with pytest.raises(SourceError, match=said) as caught:
            source.open()
        assert "\n" not in str(caught.value)
        assert str(caught.value).startswith(f"source {source.url}: 127.0.0.1:{server.port}: got")
        source.close()


class EndlessLine:
    """A peer that talks and never comes to the point."""

    n_reads = 0

    def read(self, timeout_s):
        self.n_reads += 1
        assert self.n_reads < 3
        return b"x" * 65536

    def close(self):
        """Nothing to do."""


def test_a_handshake_without_end_is_broken_off(monkeypatch):
    monkeypatch.setattr("acquisition.sources.can_text_links.open_line", lambda *_, **__: EndlessLine())
    with pytest.raises(SourceError, match="allowed: '< hi >'"):
        open_socketcand("127.0.0.1", 1, "can0", url="can:socketcand", timeout_s=60.0)


def test_a_server_that_never_stops_talking_costs_no_memory(dbc):
    """Text without an end is thrown away as it comes."""
    with (
        ScriptedServer(sending(b"< frame 101 " + b"7" * 3_000_000)) as server,
        open_source(url_of(server, dbc)) as source,
    ):
        source.start()
        found = read_until(
            source,
            lambda deliveries: sum(count for _, count in troubles(deliveries)) > 2_500_000,
        )
        assert {kind for kind, _ in troubles(found)} == {TroubleKind.GARBAGE}
        assert len(source._link._rest) <= 200


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("can:", "got ''; allowed: can:INTERFACE"),
        ("can:So cket?dbc=x", "allowed: can:INTERFACE"),
        ("can:socketcand?port=1", "dbc: got none; .*remedy: add dbc=FILE.dbc"),
        ("can:socketcand?port=70000&dbc=DBC", "port: got '70000'"),
        ("can:socketcand?channel=a%20b&dbc=DBC", "channel: got 'a b'"),
        ("can:socketcand?dbc=DBC&bus.x=1", "bus.x: got '1'"),
        ("can:socketcand?host=no.such.host.invalid&dbc=DBC", "no.such.host.invalid"),
        ("can:socketcand?dbc=nowhere.dbc", "nowhere.dbc"),
        ("can:socketcand?port=1&dbc=DBC", "127.0.0.1:1: got .*refused"),
        ("can:slcan?dbc=DBC", "channel: got ''; allowed: the port of the adapter"),
        ("can:slcan?channel=/no/such/port&dbc=DBC", "got no such port"),
        ("can:slcan?channel=socket://127.0.0.1:1&dbc=DBC", "got .*refused"),
        ("can:slcan?channel=/dev/null&bitrate=123&dbc=DBC", "bitrate: got '123'; allowed: 10000, 20000"),
        ("can:udp_multicast?channel=127.0.0.1&dbc=DBC", "allowed: a multicast address"),
        ("can:udp_multicast?channel=ff15::42&dbc=DBC", "allowed: a multicast address"),
        ("can:no_such_interface?channel=1&dbc=DBC", "no_such_interface.*remedy: check interface"),
        ("can:virtual?channel=1&dbc=DBC&chanel=2", "chanel: got '2'"),
        ("can:virtual?channel=1&dbc=DBC&reconnect=perhaps", "reconnect: got 'perhaps'"),
    ],
)
def test_what_cannot_be_opened_is_one_line(dbc, url, said):
    url = url.replace("DBC", str(dbc))
    with pytest.raises(SourceError, match=said) as caught:
        CanSource(parse_url(url)).open()
    assert "\n" not in str(caught.value)
    # of several sources, a person must know which one
    assert str(caught.value).startswith((f"source {url}: ", "nowhere.dbc: "))
    assert "serial:" not in str(caught.value)


def test_socketcand_carries_no_can_fd(tmp_path):
    dbc = database(tmp_path / "fd.dbc", fd=True)
    with pytest.raises(SourceError, match="got messages of CAN FD; allowed: classic frames"):
        open_source(f"can:socketcand?dbc={dbc}").open()


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


def test_silence_is_quiet_and_frames_of_nobody_are_nothing(dbc, tmp_path):
    name = f"silent_{tmp_path.name}"
    with (
        can.Bus(interface="virtual", channel=name) as other,
        open_source(f"can:virtual?channel={name}&dbc={dbc}") as source,
    ):
        source.start()
        other.send(can.Message(arbitration_id=0x555, data=[1], is_extended_id=False))
        other.send(can.Message(arbitration_id=0x101, data=samples(0, (1, 2))[1], is_extended_id=True))
        assert list(source.read(0.2)) == []
        assert list(source.read(0.0)) == []


def test_a_device_that_is_asked_to_stop_loses_no_sample(dbc):
    def stopping_when_told(server, connection):
        server.handshake(connection)
        connection.sendall(text(run(0, 150)))
        while not server.heard[-1].endswith(b" 2 0 0 0 0 0 >"):
            server.hear(connection)
        connection.sendall(text(run(150, 200)[1:] + ENDING))
        server.hear_to_the_end(connection)

    with ScriptedServer(stopping_when_told) as server, open_source(url_of(server, dbc)) as source:
        source.start()
        deliveries = read_until(source, lambda found: len(delivered(found)) >= 100)
        deliveries += source.finish()
    assert delivered(deliveries) == complete(200)
    assert deliveries[-1] == End(9, 200)
    assert troubles(deliveries) == []


def test_frames_that_nothing_proves_at_the_end_are_counted(dbc):
    with ScriptedServer(sending(text(run(0, 200)))) as server, open_source(url_of(server, dbc)) as source:
        source.start()
        deliveries = read_until(source, lambda found: len(delivered(found)) >= 150)
        n_read = len(delivered(deliveries))
        deliveries += source.finish()
    found = delivered(deliveries)
    assert found == complete(len(found))
    ((kind, n_uncertain),) = troubles(deliveries)
    assert kind is TroubleKind.UNCERTAIN_COUNTER
    assert len(found) + n_uncertain == 200
    assert n_read < len(found)


def test_what_came_before_a_senseless_counter_is_delivered_before_the_error(dbc):
    frames = run(0, 300) + run(500_000, 504_000)[1:]
    url = "&longest_gap_s=100"
    with ScriptedServer(sending(text(frames))) as server, open_source(url_of(server, dbc, url)) as source:
        source.start()
        deliveries = []
        with pytest.raises(SourceError) as caught:
            read_for_ever(source, deliveries)
    found = delivered(deliveries)
    assert found == complete(len(found))
    assert len(found) >= 270
    assert str(caught.value).startswith(f"source can:socketcand?port={server.port}")
    assert "longest_gap_s" in str(caught.value)
