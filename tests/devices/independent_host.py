"""Hosts that read simulated devices without any code of the acquisition: the documented bytes, by hand."""

import contextlib
import json
import socket
import struct
import threading
import time
import zlib
from dataclasses import dataclass, field
from queue import Queue
from urllib.parse import parse_qs, unquote

import can
import cantools
import netCDF4
import numpy as np
import serial

from pipelines.recording.replay import ReplaySettings, replay

PATIENCE_S = 30.0
START, STOP, SEND_CALIBRATION = 0x81, 0x82, 0x83
HEADER = struct.Struct("<BBHIQHHBBH")


@contextlib.contextmanager
def playing(source, *urls, speed="max", remind=None, **settings):
    """Devices in a thread; yields their URLs and the summary, which fills when they have ended."""
    lines, summary, errors = Queue(), {}, []

    def run():
        try:
            asked = ReplaySettings(str(source), urls, speed=speed, **settings)
            summary.update(replay(asked, announce=lines.put, remind=remind))
        except BaseException as error:  # noqa: BLE001 - raised in the test
            errors.append(error)
            lines.put("failed")

    # a device that waits in vain fails its test; it must not keep the tests from ending
    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    ready = []
    try:
        while len(ready) < len(urls):
            line = lines.get(timeout=PATIENCE_S)
            if line == "failed":
                break
            if line.startswith("ready "):
                ready.append(line.removeprefix("ready "))
        if not errors:
            yield ready, summary
    finally:
        thread.join(PATIENCE_S)
    assert not thread.is_alive()
    if errors:
        raise errors[0]


def options(url):
    """Options of a URL."""
    return {key: values[0] for key, values in parse_qs(url.partition("?")[2]).items()}


def target(url):
    return unquote(url.partition(":")[2].partition("?")[0])


def unstuffed(run):
    """COBS, from its definition."""
    body, at = bytearray(), 0
    while at < len(run):
        code = run[at]
        if code == 0 or at + code > len(run):
            return None
        body += run[at + 1 : at + code]
        at += code
        if code < 255 and at < len(run):
            body.append(0)
    return bytes(body)


def stuffed(body):
    """COBS of a body whose runs without zero are short."""
    parts = body.split(b"\0")
    assert all(len(part) < 254 for part in parts)
    return b"".join(bytes([len(part) + 1]) + part for part in parts) + b"\0"


def command(kind):
    header = HEADER.pack(kind, 1, 0, 0, 0, 0, 0, 0, 0, 0)
    return stuffed(header + struct.pack("<I", zlib.crc32(header)))


@dataclass
class Heard:
    """What came out of a device."""

    samples: list = field(default_factory=list)  # (stream, group, counter, counts (n, channels))
    ends: list = field(default_factory=list)  # (stream, n_samples)
    calibrations: list = field(default_factory=list)
    ticks: list = field(default_factory=list)  # (stream, counter, ticks)
    n_overrun: int = 0
    n_bad: int = 0
    n_foreign: int = 0
    n_error_frames: int = 0

    def counts_by_counter(self, stream=None, group=0):
        """Counter → counts; a counter that comes twice must bring the same counts."""
        found = {}
        for its_stream, its_group, counter, counts in self.samples:
            if its_group != group or (stream is not None and its_stream != stream):
                continue
            for k, row in enumerate(counts.tolist()):
                assert found.setdefault(counter + k, row) == row
        return found


class TcpPort:
    """What the tests need of a serial port, over TCP."""

    def __init__(self, address):
        host, _, port = address.removeprefix("socket://").rpartition(":")
        self._socket = socket.create_connection((host, int(port)), timeout=PATIENCE_S)
        self.timeout = 0.2

    def write(self, data):
        self._socket.settimeout(PATIENCE_S)
        self._socket.sendall(data)

    def read(self, size):
        self._socket.settimeout(self.timeout)
        try:
            data = self._socket.recv(size)
        except TimeoutError:
            return b""
        if not data:
            raise ConnectionResetError("closed by the device")
        return data

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._socket.close()


def open_port(url):
    """A serial port, waiting for a device that is just coming back."""
    until = time.monotonic() + PATIENCE_S
    while True:
        try:
            if target(url).startswith("socket://"):
                return TcpPort(target(url))
            return serial.Serial(target(url), timeout=0.2)
        except OSError:
            assert time.monotonic() < until
            time.sleep(0.02)


def listen_serial(url, *, until_end=True, commands=(SEND_CALIBRATION, START), n_samples=None):
    """Open, start, and read until the end, the loss of the connection, or so many samples."""
    heard = Heard()
    with open_port(url) as port:
        for kind in commands:
            port.write(command(kind))
        rest, last_s = b"", time.monotonic()
        while not heard.ends if until_end else True:
            try:
                data = port.read(65536 if isinstance(port, TcpPort) else max(1, port.in_waiting))
            except OSError:
                break
            if data:
                last_s = time.monotonic()
            assert time.monotonic() - last_s < PATIENCE_S
            *runs, rest = (rest + data).split(b"\0")
            for run in runs:
                take_frame(heard, run)
            if n_samples is not None and sum(len(counts) for *_, counts in heard.samples) >= n_samples:
                port.write(command(STOP))
                n_samples = None
    return heard


def take_frame(heard, run):
    """One frame between two zeros."""
    body = unstuffed(run)
    if body is None or len(body) < 28 or zlib.crc32(body[:-4]) != struct.unpack("<I", body[-4:])[0]:
        heard.n_bad += bool(run)
        return
    kind, version, stream, counter, ticks, n_channels, n_samples, width, status, zero = HEADER.unpack(body[:24])
    payload = body[24:-4]
    assert (version, zero) == (1, 0)
    if kind == 1:
        assert len(payload) == n_channels * n_samples * width
        columns = [payload[k : k + width] for k in range(0, len(payload), width)]
        counts = [int.from_bytes(column, "little", signed=True) for column in columns]
        heard.samples.append((stream, 0, counter, np.array(counts).reshape(n_samples, n_channels)))
        heard.ticks.append((stream, counter, ticks))
        heard.n_overrun += status & 1
    elif kind == 2:
        heard.calibrations.append(json.loads(payload))
    elif kind == 3:
        heard.ends.append((stream, struct.unpack("<Q", payload)[0]))


def open_bus(url):
    """python-can's own client for the device, waiting for one that is just coming back."""
    until = time.monotonic() + PATIENCE_S
    while True:
        try:
            return opened_bus(url)
        except (can.CanError, OSError):
            assert time.monotonic() < until
            time.sleep(0.02)


def opened_bus(url):
    its, interface = options(url), target(url)
    if interface == "socketcand":
        return can.Bus(interface="socketcand", host=its["host"], port=int(its["port"]), channel=its["channel"])
    if interface == "slcan":
        return can.Bus(interface="slcan", channel=its["channel"], sleep_after_open=0)
    bus = can.Bus(interface="virtual", channel=its["channel"])
    bus.send(can.Message(arbitration_id=0x80, is_extended_id=False, data=bytes.fromhex("ad40010000000000")))
    return bus


def listen_can(url, *, near=0):
    """Everything until the device has said three times that it ends; the first counter is within 128 of `near`."""
    bus = open_bus(url)
    try:
        return heard_on(bus, options(url)["dbc"], near=near)
    finally:
        with contextlib.suppress(can.CanError):  # an slcan client says goodbye to a device that may have gone
            bus.shutdown()


def heard_on(bus, dbc, *, until_silent_s=None, heard=None, near=0):
    database, trackers, n_ends = cantools.database.load_file(dbc), {"near": near}, 0
    heard = Heard() if heard is None else heard
    while n_ends < 3:
        message = bus.recv(until_silent_s or PATIENCE_S)
        if message is None:
            assert until_silent_s, "the device fell silent"
            break
        if message.is_error_frame:
            heard.n_error_frames += 1
        elif not 0x100 <= message.arbitration_id < 0x200:
            heard.n_foreign += 1
        else:
            n_ends += take_message(heard, trackers, database, message)
    return heard


def take_message(heard, trackers, database, message):
    """One frame; returns whether it says that the device has ended."""
    data = bytes(message.data)
    crc = 0xFFFF
    for byte in message.arbitration_id.to_bytes(4, "little") + data[2:]:  # CRC-CCITT, bit by bit
        crc ^= byte << 8
        for _ in range(8):
            crc = ((crc << 1) ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    if crc != int.from_bytes(data[:2], "little"):
        heard.n_bad += 1
        return False
    decoded = database.decode_message(message.arbitration_id, data, scaling=False, decode_choices=False)
    if message.arbitration_id == 0x100:
        trackers["stream"] = decoded["stream"]
        if decoded["state"] == 2:
            heard.ends.append((decoded["stream"], decoded["n_samples"]))
        return decoded["state"] == 2
    group = message.arbitration_id - 0x101
    if "n_samples_in_frame" in decoded:
        take_fd(heard, trackers["stream"], group, decoded)
        return False
    low = decoded["sample_counter_0"] | decoded["sample_counter_3"] << 3
    known = trackers.get(group, trackers["near"])  # the tests never lose 128 frames in a row
    counter = known + (low - known + 128) % 256 - 128
    trackers[group] = max(counter, known)
    for bit in (8, 16, 24):
        if f"sample_counter_{bit}" in decoded:
            assert decoded[f"sample_counter_{bit}"] == counter >> bit & 0xFF
    heard.n_overrun += decoded.get("device_flags", 0) & 1
    counts = [value for name, value in decoded.items() if not name.startswith(("crc", "sample_", "device_"))]
    heard.samples.append((trackers["stream"], group, counter, np.array([counts])))
    return False


def take_fd(heard, stream, group, decoded):
    names = list(dict.fromkeys(name.partition("__")[0] for name in decoded if "__" in name))
    n = decoded["n_samples_in_frame"]
    counts = [[decoded[f"{name}__{k}"] for name in names] for k in range(n)]
    heard.samples.append((stream, group, decoded["sample_counter_0"], np.array(counts)))


CHANNELS = ("force_cell_1", "force_cell_2", "acceleration_roof_1")
LOST = slice(500, 540)
MISSING = -32768


def write_recording(path, n_samples=1500, rate_hz=500.0, counts=None):
    """A recording of three 16-bit channels: 40 samples lost on all of them, sample 100 on one."""
    if counts is None:
        counts = np.random.default_rng(5).integers(-30000, 30000, (n_samples, 3)).astype(np.int16)
        counts[LOST] = MISSING
        counts[100, 1] = MISSING
    units = {"force": "N", "acceleration": "m s-2"}
    with netCDF4.Dataset(path, "w") as file:
        file.createDimension("time", len(counts))
        file.createVariable("time", "f8", ("time",))[:] = np.arange(len(counts)) / rate_hz
        for k, name in enumerate(CHANNELS):
            variable = file.createVariable(name, "i2", ("time",), fill_value=np.int16(MISSING))
            variable.set_auto_maskandscale(False)
            quantity = name.partition("_")[0]
            variable.setncatts({"quantity": quantity, "units": units[quantity], "scale_factor": 0.001})
            variable.setncatts({"range_min": -30.0, "range_max": 30.0})
            variable[:] = counts[:, k]
        flags = (counts == MISSING).any(axis=1).astype(np.uint8)
        file.createVariable("quality", "u1", ("time",))[:] = flags
        file.setncatts(
            {
                "sloshlab_format": "1",
                "run_id": "played",
                "experiment": "other",
                "configuration": "empty",
                "rig": "rig.toml",
                "sampling_rate_hz": rate_hz,
                "start_time_utc": "2026-01-12T09:00:00Z",
            }
        )
    return counts
