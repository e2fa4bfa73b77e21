"""CAN devices whose connection breaks, comes back, or is not heard at first."""

import time

import pytest
from can_by_hand import (
    ENDED,
    ScriptedServer,
    counts_of,
    hanging_up_after,
    run,
    sending,
    status,
    text,
)
from can_deliveries import ENDING, complete, delivered, has, has_end, read_until, troubles, url_of

from acquisition.sources import Block, End, Trouble, TroubleKind, open_source, parse_url
from acquisition.sources.can_links import CanLink
from acquisition.sources.can_source import CanSource
from acquisition.sources.serial_line import LineLostError
from acquisition.wire.can_counter import CounterTracker
from sloshlab.errors import SourceError


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
