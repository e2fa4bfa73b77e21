"""Servers that are no socketcand, lie, or never end."""

import pytest
from can_by_hand import (
    ScriptedServer,
    database,
    sending,
)
from can_deliveries import read_until, troubles, url_of

from acquisition.sources import TroubleKind, open_source, parse_url
from acquisition.sources.can_source import CanSource
from acquisition.sources.can_text_links import open_socketcand
from sloshlab.errors import SourceError


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
