"""CAN devices: connections that break, hang or lie, and frames by hand over a server by hand."""

import time

import can
import pytest
from can_by_hand import (
    CELLS,
    RATE_HZ,
    ScriptedServer,
    run,
    samples,
    sending,
    text,
)
from can_deliveries import ENDING, complete, delivered, has_end, read_for_ever, read_until, troubles, url_of

from acquisition.sources import Block, End, TroubleKind, open_source
from sloshlab.errors import SourceError


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
