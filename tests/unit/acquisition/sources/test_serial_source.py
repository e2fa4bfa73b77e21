"""The conversation with a serial device, played on a clock of its own."""

from __future__ import annotations

import json
import struct
import zlib

import pytest
from scripted_line import Script

from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block, Delivery, End, Trouble, TroubleKind
from acquisition.sources.driver_counters import Counter
from acquisition.sources.serial_line import LineLostError
from acquisition.sources.serial_source import SerialSource
from acquisition.sources.urls import open_source, parse_url
from sloshlab.errors import SourceError

DESCRIBED = {
    "device": "daq",
    "sampling_rate_hz": 1000.0,
    "clock_hz": 1e6,
    "channels": [
        {"name": "force_cell_1", "quantity": "force", "units": "N"},
        {"name": "force_cell_2", "quantity": "force", "units": "N"},
    ],
}


def wire(
    kind: int, payload: bytes = b"", *, stream: int = 1, counter: int = 0, shape: tuple[int, int] = (0, 0)
) -> bytes:
    """A frame written by hand."""
    header = struct.pack("<BBHIQHHBBH", kind, 1, stream, counter, 0, shape[1], shape[0], 2 * (kind == 1), 0, 0)
    content = header + payload
    content += struct.pack("<I", zlib.crc32(content))
    assert len(content) < 254
    return b"".join(bytes([len(piece) + 1]) + piece for piece in content.split(b"\0")) + b"\0"


def samples(counter: int, n: int, stream: int = 1) -> bytes:
    payload = b"".join(struct.pack("<hh", k % 30_000, -(k % 30_000)) for k in range(counter, counter + n))
    return wire(1, payload, stream=stream, counter=counter, shape=(n, 2))


def described(**changes: object) -> bytes:
    text = json.dumps({**DESCRIBED, **changes}).encode()
    header = struct.pack("<BBHIQHHBBH", 2, 1, 1, 0, 0, 0, 0, 0, 0, 0)
    content = header + text + struct.pack("<I", zlib.crc32(header + text))
    pieces = []
    for piece in content.split(b"\0"):
        while len(piece) > 254:
            pieces.append(b"\xff" + piece[:254])
            piece = piece[254:]
        pieces.append(bytes([len(piece) + 1]) + piece)
    return b"".join(pieces) + b"\0"


CALIBRATION = described()
START, STOP, ASK = (b"\0" + wire(kind, stream=0) for kind in (0x81, 0x82, 0x83))


def end(n: int, stream: int = 1) -> bytes:
    return wire(3, struct.pack("<Q", n), stream=stream)


def answering(request: bytes) -> bytes:
    return CALIBRATION if request == ASK else b""


def source_of(script: Script, options: str = "") -> SerialSource:
    return SerialSource(
        parse_url(f"serial:/dev/ttyX{options}"),
        monotonic_ns=script.monotonic_ns,
        utc_ns=script.utc_ns,
        sleep=script.sleep,
        connect=script.connect,
    )


def lost() -> LineLostError:
    return LineLostError("serial:/dev/ttyX", got="the connection was lost (unplugged)")


def read_all(source: SerialSource, script: Script, until_s: float) -> list[Delivery]:
    found: list[Delivery] = []
    while script.now_s < 100.0 + until_s:
        found += source.read(0.5)
    return found


def kinds(deliveries: list[Delivery]) -> list[object]:
    return [d.kind if isinstance(d, Trouble) else type(d) for d in deliveries]


def test_the_entry_point_finds_it() -> None:
    assert isinstance(open_source("serial:/dev/ttyX?baudrate=9600"), SerialSource)


def test_opening_asks_for_the_calibration() -> None:
    script = Script([], answering)
    with source_of(script, "?baudrate=3000000") as source:
        assert (script.target, script.baudrate) == ("/dev/ttyX", 3_000_000)
        assert script.sent == [(0.0, ASK)]
        info = source.info
    assert (info.device, info.sampling_rate_hz, info.clock_hz) == ("daq", 1000.0, 1e6)
    assert info.url == "serial:/dev/ttyX?baudrate=3000000"
    assert info.channels[1] == Channel("force_cell_2", "force", "N")
    assert info.groups == ((0, 1),)


def test_the_name_of_the_device_can_be_given() -> None:
    with source_of(Script([], answering), "?device=left") as source:
        assert source.info.device == "left"


def test_a_lost_request_is_repeated_each_half_second() -> None:
    script = Script([(1.2, CALIBRATION)])
    with source_of(script) as source:
        assert script.sent == [(0.0, ASK), (0.5, ASK), (1.0, ASK)]
        assert source.info.device == "daq"


def test_a_babbling_line_is_not_asked_more_often() -> None:
    script = Script([(0.1 * k, b"babble") for k in range(12)] + [(1.2, b"\0" + CALIBRATION)])
    with source_of(script):
        assert [at_s for at_s, _ in script.sent] == pytest.approx([0.0, 0.5, 1.0])


@pytest.mark.parametrize(
    ("events", "got"),
    [
        ([], "got no answer within 5 s"),
        ([(1.0, b"login: ")], "got 7 bytes, none of them of a frame within 5 s"),
        ([(1.0, samples(0, 4))], "got 1 frames, none of them a calibration"),
        ([(1.0, wire(4, b"no sensor"))], "the device says 'no sensor'"),
    ],
)
def test_no_calibration_in_time(events: list[tuple[float, bytes]], got: str) -> None:
    script = Script(list(events))
    source = source_of(script)
    with pytest.raises(SourceError, match=got) as caught:
        source.open()
    assert "remedy: check that the device is switched on" in str(caught.value)
    assert script.now_s == pytest.approx(105.0)
    assert script.n_closed == 1
    # the line is asked, not polled
    assert script.n_reads <= 13


def test_the_patience_is_an_option() -> None:
    script = Script([])
    with pytest.raises(SourceError, match=r"no answer within 0\.7 s"):
        source_of(script, "?open_timeout_s=0.7").open()
    assert script.now_s == pytest.approx(100.7)


def test_an_impossible_calibration_ends_the_opening() -> None:
    script = Script([(0.1, described(sampling_rate_hz=-5))])
    with pytest.raises(SourceError, match="sampling_rate_hz: got -5"):
        source_of(script).open()
    assert script.n_closed == 1


def test_a_line_that_breaks_while_opening() -> None:
    script = Script([(0.1, lost())])
    with pytest.raises(SourceError, match="unplugged"):
        source_of(script).open()
    assert script.n_closed == 1


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ("?baud=9600", r"baud: got '9600'; allowed: options baudrate, device"),
        ("?baudrate=fast", "baudrate: got 'fast'"),
        ("?baudrate=0", "baudrate: got '0'"),
        ("?open_timeout_s=-1", "open_timeout_s: got '-1'"),
        ("?reconnect=maybe", "reconnect: got 'maybe'; allowed: yes, no"),
        ("?longest_gap_s=inf", "longest_gap_s: got 'inf'"),
        ("?device=a/b", "device: got 'a/b'"),
    ],
)
def test_options_are_checked(options: str, match: str) -> None:
    with pytest.raises(SourceError, match=match):
        source_of(Script([]), options)


def test_no_port() -> None:
    with pytest.raises(SourceError, match="got no port; allowed: serial:PORT"):
        SerialSource(parse_url("serial:"))


def test_before_open_and_after_close() -> None:
    source = source_of(Script([], answering))
    for use in (lambda: source.info, source.start, lambda: source.read(0.0)):
        with pytest.raises(SourceError, match="open"):
            use()
    source.close()
    source.open()
    source.close()
    source.close()
    with pytest.raises(SourceError, match="not open"):
        source.read(0.0)


def test_blocks_carry_the_clocks_of_the_read_that_completed_them() -> None:
    frame = samples(0, 8)
    script = Script([(1.0, frame[:10]), (2.0, frame[10:] + samples(8, 8))], answering)
    with source_of(script) as source:
        (block,) = source.read(5.0)
    assert isinstance(block, Block)
    assert (block.host_monotonic_ns, block.host_utc_ns) == (102 * 10**9, 10**18 + 102 * 10**9)
    assert block.counts[:, 1].tolist() == [-k for k in range(16)]


def test_a_quiet_line_is_waited_for_and_not_polled() -> None:
    script = Script([], answering)
    with source_of(script) as source:
        n_before = script.n_reads
        assert source.read(10.0) == []
        assert script.now_s == pytest.approx(110.0)
        assert script.n_reads - n_before <= 21
        n_before = script.n_reads
        assert source.read(0.0) == []
        assert script.n_reads - n_before == 1


def test_samples_that_came_while_opening_are_the_first_delivered() -> None:
    script = Script([(0.1, samples(0, 4)), (0.2, CALIBRATION + samples(4, 4)), (0.3, samples(8, 4))])
    with source_of(script) as source:
        first = source.read(1.0)
        assert [d.counter for d in first if isinstance(d, Block)] == [0, 4]
        (second,) = source.read(1.0)
        assert isinstance(second, Block)
        assert second.counter == 8


def test_start_is_repeated_until_samples_come_and_stop_ends() -> None:
    script = Script([(1.7, samples(0, 4)), (4.0, samples(4, 4))], answering)
    with source_of(script) as source:
        source.start()
        found = read_all(source, script, 5.0)
    assert kinds(found) == [Block, Block]
    starts = [at_s for at_s, request in script.sent if request == START]
    assert starts == [0.0, 0.5, 1.0, 1.5]
    assert script.sent[-1][1] == STOP
    assert [request for _, request in script.sent].count(STOP) == 1


def test_a_source_that_was_not_started_sends_no_stop() -> None:
    script = Script([], answering)
    with source_of(script):
        pass
    assert script.sent == [(0.0, ASK)]


def test_a_line_that_breaks_is_opened_again_and_the_device_started() -> None:
    events = [(1.0, samples(0, 4)), (2.0, samples(4, 4)[:15]), (2.5, lost()), (6.0, samples(12, 4))]
    script = Script(events, answering, missing_until_s=[0.0, 4.9])
    with source_of(script) as source:
        source.start()
        found = read_all(source, script, 8.0)
    assert kinds(found) == [Block, TroubleKind.DISCONNECTED, TroubleKind.RECONNECTED, Block]
    assert found[1].detail == "the connection was lost (unplugged)"  # type: ignore[union-attr]
    assert [d.counter for d in found if isinstance(d, Block)] == [0, 12]
    assert script.n_connections == script.n_closed == 2
    assert 10 <= script.n_attempts <= 15  # each 0.2 s over 2.4 s
    assert START in [request for at_s, request in script.sent if at_s > 4.0]


def test_a_line_that_breaks_again_and_again_is_one_trouble() -> None:
    events = [(1.0, samples(0, 4)), *[(2.0 + 0.1 * k, lost()) for k in range(20)], (9.0, samples(4, 4))]
    script = Script(events, answering_nothing_later())
    with source_of(script) as source:
        found = read_all(source, script, 10.0)
    assert kinds(found) == [Block, TroubleKind.DISCONNECTED, TroubleKind.RECONNECTED, Block]


def test_noise_is_not_the_device_coming_back() -> None:
    events = [(1.0, samples(0, 4)), (2.0, lost()), (3.0, b"noise\0"), (4.0, samples(4, 4))]
    script = Script(events, answering_nothing_later())
    with source_of(script) as source:
        found = read_all(source, script, 5.0)
    expected = [Block, TroubleKind.DISCONNECTED, TroubleKind.GARBAGE, TroubleKind.RECONNECTED, Block]
    assert kinds(found) == expected


def answering_nothing_later():  # type: ignore[no-untyped-def]
    """A device that describes itself once."""
    said: list[bytes] = []

    def answer(request: bytes) -> bytes:
        if request == ASK and not said:
            said.append(request)
            return CALIBRATION
        return b""

    return answer


def test_a_request_that_cannot_be_sent_is_a_broken_line() -> None:
    script = Script([(1.0, samples(0, 4))], answering)
    with source_of(script) as source:
        script.unwritable = True
        source.start()
        assert kinds(list(source.read(0.1))) == [TroubleKind.DISCONNECTED]
        assert source.read(0.5) == []  # opened again, but it cannot be written to
        script.unwritable = False
        assert kinds(read_all(source, script, 3.0)) == [TroubleKind.RECONNECTED, Block]


def test_without_reconnection_a_broken_line_is_an_error() -> None:
    script = Script([(1.0, samples(0, 4)), (2.0, lost())], answering)
    with source_of(script, "?reconnect=no") as source:
        assert kinds(list(source.read(5.0))) == [Block]
        with pytest.raises(SourceError, match="unplugged"):
            source.read(5.0)
    assert script.n_closed == 1


@pytest.mark.parametrize("options", ["", "?reconnect=no"])
def test_a_line_that_closes_after_the_end_is_no_trouble(options: str) -> None:
    script = Script([(1.0, samples(0, 4) + end(4)), (1.1, end(4)), (1.2, lost())], answering, [0.0, 1e9])
    with source_of(script, options) as source:
        source.start()
        found = read_all(source, script, 5.0)
    assert found[1:] == [End(1, 4)]
    assert kinds(found[:1]) == [Block]
    assert (script.n_attempts == 1) == bool(options)


def test_a_device_that_is_done_is_not_started_again() -> None:
    script = Script([(1.0, samples(0, 4) + end(4)), (1.2, lost())], answering)
    with source_of(script) as source:
        source.start()
        read_all(source, script, 5.0)
    assert [at_s for at_s, request in script.sent if request == START] == [0.0, 0.5]
    assert script.n_connections == 2


def test_another_calibration_after_the_reconnection_is_told() -> None:
    swapped = described(channels=list(reversed(DESCRIBED["channels"])))  # type: ignore[call-overload]
    script = Script(
        [(1.0, samples(0, 4)), (2.0, lost()), (3.0, swapped + samples(4, 4))], answering_nothing_later()
    )
    with source_of(script) as source:
        found = read_all(source, script, 4.0)
    assert kinds(found) == [
        Block,
        TroubleKind.DISCONNECTED,
        TroubleKind.RECONNECTED,
        TroubleKind.CALIBRATION_CHANGED,
        Block,
    ]


def test_a_jump_of_the_counter_is_an_error_after_what_came_before_it() -> None:
    script = Script([(1.0, samples(0, 4) + samples(10_005, 4))], answering)
    with source_of(script, "?longest_gap_s=10") as source:
        assert kinds(list(source.read(5.0))) == [Block]
        with pytest.raises(SourceError, match=r"jumps by 10001 samples \(10 s"):
            source.read(5.0)


def test_sleeps_are_never_longer_than_asked() -> None:
    script = Script([(1.0, lost())], answering, missing_until_s=[0.0, 1e9])
    with source_of(script) as source:
        source.read(2.0)
        before_s = script.now_s
        assert source.read(0.05) == []
        assert script.now_s - before_s == pytest.approx(0.05)
        assert source.read(3.0) == []
        assert script.now_s - before_s == pytest.approx(3.05)
        assert len(script.slept_s) < 25


def test_what_the_driver_has_lost_is_told_every_half_second_and_at_the_end() -> None:
    overrun = Counter("overruns of the port", TroubleKind.OVERRUN, 1 << 32)
    events = [(0.1 * k, samples(10 * k, 10)) for k in range(1, 20)]
    script = Script([(0.0, CALIBRATION), *events])
    # from before this program opened the port
    script.counts = {overrun: 7}
    source = source_of(script)
    source.open()
    source.start()
    found = read_all(source, script, 0.9)
    assert TroubleKind.OVERRUN not in kinds(found)
    script.counts = {overrun: 12}
    found = read_all(source, script, 1.8)
    script.counts = {overrun: 13}
    found += source.finish()
    told = [(each.kind, each.count, each.detail) for each in found if isinstance(each, Trouble)]
    assert told == [
        (TroubleKind.OVERRUN, 5, "overruns of the port: 5 more"),
        (TroubleKind.OVERRUN, 1, "overruns of the port: 1 more"),
    ]
    source.close()
