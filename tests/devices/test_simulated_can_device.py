"""The simulated CAN device, read by python-can's own clients and cantools."""

import socket
from queue import Queue

import can
import numpy as np
import pytest
from independent_host import (
    LOST,
    Heard,
    heard_on,
    listen_can,
    opened_bus,
    options,
    playing,
    write_recording,
)

from acquisition.sources.multicast_loopback import open_multicast_bus
from sloshlab.errors import SourceError


@pytest.fixture
def recording(tmp_path):
    path = tmp_path / "run.nc"
    return path, write_recording(path)


def address(kind, tmp_path):
    where = {
        "socketcand": "socketcand?port=0",
        "slcan": f"slcan?channel={tmp_path / 'tty'}",
        "slcan_fd": f"slcan?channel={tmp_path / 'tty'}&fd=yes",
        "virtual": f"virtual?channel={tmp_path.name}",
        "virtual_fd": f"virtual?channel={tmp_path.name}&fd=yes",
    }[kind]
    return f"can:{where}&dbc={tmp_path / 'device.dbc'}"


@pytest.mark.parametrize("kind", ["socketcand", "slcan", "slcan_fd", "virtual", "virtual_fd"])
def test_every_stored_count_arrives_at_its_counter(recording, tmp_path, kind):
    path, counts = recording
    with playing(path, address(kind, tmp_path)) as (ready, summary):
        heard = listen_can(ready[0])
    # two 16-bit channels share a classic frame; with CAN FD all three do
    groups = {0: [0, 1, 2]} if kind.endswith("fd") else {0: [0, 1], 1: [2]}
    taken = [k for k in range(1500) if not LOST.start <= k < LOST.stop]
    for group, columns in groups.items():
        assert heard.counts_by_counter(group=group) == {k: counts[k, columns].tolist() for k in taken}
    assert heard.ends[0][1] == 1500
    assert heard.n_bad == heard.n_foreign == heard.n_error_frames == 0
    assert summary["devices"]["device_1"]["samples_sent"] == len(groups) * 1460


def test_multicast_stays_on_this_computer_and_brings_every_count(recording, tmp_path):
    path, counts = recording
    url = f"can:udp_multicast?port=43871&dbc={tmp_path / 'device.dbc'}"
    with playing(path, url, channels=["force_cell_2"]) as (ready, _):
        its = options(ready[0])
        bus = open_multicast_bus(its["channel"], int(its["port"]), fd=True, exposed=False)
        try:
            bus.send(
                can.Message(arbitration_id=0x80, is_extended_id=False, data=bytes.fromhex("ad40010000000000"))
            )
            heard = heard_on(bus, its["dbc"])
        finally:
            bus.shutdown()
    taken = [k for k in range(1500) if counts[k, 1] != -32768]
    assert heard.counts_by_counter() == {k: [int(counts[k, 1])] for k in taken}


def test_the_device_waits_for_as_many_clients_as_told_and_serves_them_all(recording, tmp_path):
    with playing(recording[0], address("socketcand", tmp_path), wait_clients=2) as (ready, _):
        first = opened_bus(ready[0])
        try:
            assert first.recv(0.5) is None
            other = listen_can(ready[0])
            heard = heard_on(first, tmp_path / "device.dbc")
        finally:
            first.shutdown()
    assert len(heard.counts_by_counter()) == 1460
    assert heard.counts_by_counter() == other.counts_by_counter()


def test_what_a_device_waits_for_is_said_and_it_waits_on(recording, tmp_path, monkeypatch):
    monkeypatch.setattr("pipelines.recording.replay._PATIENCE_S", 0.0)
    reminded = Queue()
    url = f"{address('socketcand', tmp_path)}&device=adapter"
    with playing(recording[0], url, wait_clients=2, remind=reminded.put) as (ready, _):
        first = opened_bus(ready[0])
        try:
            assert reminded.get(timeout=30) == "waiting: adapter for 1 of 2 hosts; Ctrl-C ends"
            assert listen_can(ready[0]).ends
        finally:
            first.shutdown()
    assert reminded.empty()


def test_a_hostile_client_of_the_socketcand_server_does_no_harm(recording, tmp_path):
    noise = np.random.default_rng(2)
    with playing(recording[0], address("socketcand", tmp_path)) as (ready, _):
        place = ("127.0.0.1", int(options(ready[0])["port"]))
        for words in (
            b"< open can0 >< open >< rawmod",
            b"<" * 100_000,
            b"< send 80 9 1 2 >< send zz 1 1 >< bcmmode >",
            b"< open nothing >",
            noise.integers(0, 256, 200_000, dtype=np.uint8).tobytes(),
        ):
            with socket.create_connection(place, timeout=30) as client:
                assert client.recv(6) == b"< hi >"
                try:
                    client.sendall(words)
                except ConnectionError:
                    continue  # turned out before it had said all
        heard = listen_can(ready[0])
    assert len(heard.counts_by_counter()) == 1460


# python-can leaves its socket open when a handshake fails
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_no_more_than_eight_clients_are_let_in(recording, tmp_path):
    with playing(recording[0], address("socketcand", tmp_path)) as (ready, _):
        place = ("127.0.0.1", int(options(ready[0])["port"]))
        clients = [socket.create_connection(place, timeout=30) for _ in range(8)]
        assert [client.recv(6) for client in clients] == [b"< hi >"] * 8
        with socket.create_connection(place, timeout=30) as ninth:
            assert ninth.recv(6) == b""
        for client in clients:
            client.close()
        heard = Heard()
        while not heard.ends:
            heard = listen_can(ready[0])
    assert len(heard.counts_by_counter()) == 1460


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("can:socketcand?port=0", "dbc"),
        ("can:socketcand?port=0&dbc=a.dbc&fd=yes", "fd=yes"),
        ("can:socketcand?host=0.0.0.0&port=0&dbc=a.dbc", "--expose"),
        ("can:slcan?dbc=a.dbc", "channel"),
        ("can:socketcand?prot=0&dbc=a.dbc", "prot"),
        ("file:a.nc", "serial, can"),
    ],
)
def test_addresses_that_make_no_device_are_refused_in_one_line(recording, url, message):
    with pytest.raises(SourceError, match=message) as raised, playing(recording[0], url):
        pass
    assert "\n" not in str(raised.value)
