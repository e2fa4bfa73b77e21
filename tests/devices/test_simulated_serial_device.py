"""The simulated serial device, read by a host that knows only the documented bytes."""

import os
import socket
import time
from queue import Queue

import numpy as np
import pytest
from independent_host import (
    LOST,
    MISSING,
    SEND_CALIBRATION,
    START,
    STOP,
    Heard,
    command,
    listen_serial,
    open_port,
    playing,
    take_frame,
    target,
    write_recording,
)

from sloshlab.errors import InputError, SourceError


@pytest.fixture
def recording(tmp_path):
    path = tmp_path / "run.nc"
    return path, write_recording(path)


@pytest.fixture(params=["terminal", "socket"])
def url(request, tmp_path):
    return f"serial:{tmp_path / 'tty'}" if request.param == "terminal" else "serial:socket://127.0.0.1:0"


def test_every_stored_count_arrives_at_its_counter_and_lost_samples_are_jumped_over(recording, url):
    path, counts = recording
    with playing(path, url) as (ready, summary):
        heard = listen_serial(ready[0])
    expected = {k: row for k, row in enumerate(counts.tolist()) if not LOST.start <= k < LOST.stop}
    assert heard.counts_by_counter() == expected
    assert heard.counts_by_counter()[100][1] == MISSING
    assert heard.n_bad == heard.n_overrun == 0
    (stream, _, _, _), *_ = heard.samples
    assert heard.ends[0] == (stream, 1500)
    assert summary["devices"]["device_1"]["samples_taken"] == 1460
    assert summary["devices"]["device_1"]["samples_sent"] == 1460


def test_the_calibration_says_what_the_recording_says(recording, url):
    with playing(recording[0], f"{url}?device=daq") as (ready, _):
        heard = listen_serial(ready[0])
    assert heard.calibrations[0]["device"] == "daq"
    assert heard.calibrations[0]["sampling_rate_hz"] == 500.0
    assert heard.calibrations[0]["channels"][2] == {
        "name": "acceleration_roof_1",
        "quantity": "acceleration",
        "units": "m s-2",
        "scale_factor": 0.001,
        "missing_count": -32768,
        "range_min": -30.0,
        "range_max": 30.0,
    }
    assert len(heard.calibrations) >= 1 + 3  # on request and once per second of 3 s


def test_the_device_clock_runs_with_the_counter(recording, url):
    with playing(recording[0], url) as (ready, _):
        heard = listen_serial(ready[0])
    rate_hz = heard.calibrations[0]["clock_hz"] / 500.0
    assert all(ticks == counter * rate_hz for _, counter, ticks in heard.ticks)


def test_nothing_but_calibrations_comes_before_the_start(recording, url):
    with playing(recording[0], url) as (ready, _):
        with open_port(ready[0]) as port:
            port.write(command(SEND_CALIBRATION))
            data = b""
            while b"\0" not in data:
                data += port.read(1)
            port.timeout = 0.3
            assert port.read(1) == b""
        heard = listen_serial(ready[0])  # the next host finds the device still waiting
    assert min(heard.counts_by_counter()) == 0


def test_stop_ends_the_stream_where_it_is(url):
    with playing("pattern:channels=2&sampling_rate_hz=1000&duration_s=600", url, speed="1") as (ready, summary):
        heard = listen_serial(ready[0], n_samples=200)
    n_samples = heard.ends[0][1]
    assert 200 <= n_samples < 600_000
    assert sorted(heard.counts_by_counter()) == list(range(n_samples))
    assert summary["devices"]["device_1"]["host_gone"] is False


def test_the_pattern_is_splitmix64_of_sample_and_channel(url):
    def count(sample, channel):
        z = (256 * sample + channel + 0x9E3779B97F4A7C15) % 2**64
        z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 % 2**64
        z = (z ^ z >> 27) * 0x94D049BB133111EB % 2**64
        upper = (z ^ z >> 31) >> 40
        return upper - 2**24 if upper >= 2**23 else upper

    with playing("pattern:channels=3&sampling_rate_hz=1000&bits=24&duration_s=0.5", url) as (ready, _):
        heard = listen_serial(ready[0])
    assert heard.counts_by_counter() == {s: [count(s, c) for c in range(3)] for s in range(500)}


def test_a_looped_recording_goes_on_with_its_counter(recording, url):
    path, counts = recording
    with playing(path, url, loop_duration_s=7.0, channels=["force_cell_2"]) as (ready, _):
        heard = listen_serial(ready[0])
    found = heard.counts_by_counter()
    assert heard.ends[0][1] == 3500
    assert found == {k: [int(counts[k % 1500, 1])] for k in range(3500) if counts[k % 1500, 1] != MISSING}


def test_frames_hold_as_many_samples_as_told(recording, url):
    with playing(recording[0], url, samples_per_frame=7) as (ready, _):
        heard = listen_serial(ready[0])
    assert max(len(counts) for *_, counts in heard.samples) == 7


def test_in_real_time_nothing_comes_before_it_is_taken(url):
    # whatever the load of the machine: sample k may be late, never early
    with playing("pattern:channels=1&sampling_rate_hz=200&duration_s=1.5", url, speed="1") as (ready, _):
        began = time.monotonic()
        heard = listen_serial(ready[0])
        assert time.monotonic() - began >= 1.5
    assert len(heard.counts_by_counter()) == 300


def test_two_devices_begin_together(tmp_path):
    urls = [f"serial:{tmp_path / 'one'}?device=one", "serial:socket://127.0.0.1:0?device=two"]
    pattern = "pattern:channels=1&sampling_rate_hz=100&duration_s=1"
    with playing(pattern, *urls) as (ready, _), open_port(ready[0]) as port:
        port.write(command(START))
        port.timeout = 0.3
        assert port.read(1) == b""  # the other device has not been started
        heard = listen_serial(ready[1])
        assert port.read(1) != b""
        port.write(command(STOP))
    assert len(heard.counts_by_counter()) == 100


def test_who_starts_one_of_two_devices_is_told_of_the_other(tmp_path, monkeypatch):
    monkeypatch.setattr("pipelines.recording.replay._PATIENCE_S", 0.0)
    reminded = Queue()
    urls = [f"serial:{tmp_path / 'one'}?device=one", "serial:socket://127.0.0.1:0?device=two"]
    pattern = "pattern:channels=1&sampling_rate_hz=100&duration_s=1"
    with playing(pattern, *urls, remind=reminded.put) as (ready, _), open_port(ready[0]) as port:
        port.write(command(START))
        assert reminded.get(timeout=30) == "waiting: two for 1 of 1 hosts; Ctrl-C ends"
        assert listen_serial(ready[1]).ends
        port.write(command(STOP))
    assert reminded.empty()


def test_the_terminal_is_raw_and_leaves_nothing_behind(recording, tmp_path):
    # far more than a terminal buffers, so that the device is not done when the first host goes
    pattern = "pattern:channels=3&sampling_rate_hz=500&bits=16&duration_s=400"
    with playing(pattern, f"serial:{tmp_path / 'tty'}") as (ready, _):
        slave = os.open(target(ready[0]), os.O_RDWR | os.O_NOCTTY)  # as it comes, without setting anything
        os.write(slave, command(START))
        data = b""
        while len(data) < 5000:
            data += os.read(slave, 4096)
        os.close(slave)
        early, heard = Heard(), listen_serial(ready[0])
    for run in data.split(b"\0")[:-1]:  # any byte that the terminal changed would break a checksum
        take_frame(early, run)
    assert early.samples
    assert early.n_bad == 0
    assert heard.ends
    assert not os.path.lexists(tmp_path / "tty")


def test_a_path_that_is_taken_is_refused_and_a_dangling_link_is_not(recording, tmp_path):
    taken, dangling = tmp_path / "taken", tmp_path / "dangling"
    taken.write_text("mine")
    with pytest.raises(SourceError, match="taken"), playing(recording[0], f"serial:{taken}"):
        pass
    assert taken.read_text() == "mine"
    dangling.symlink_to(tmp_path / "nowhere")
    with playing(recording[0], f"serial:{dangling}") as (ready, _):
        assert listen_serial(ready[0]).ends


@pytest.mark.parametrize("host", ["0.0.0.0", "192.0.2.7", ""])
def test_only_loopback_is_listened_on_without_being_told(recording, host):
    with (
        pytest.raises(SourceError, match="--expose"),
        playing(recording[0], f"serial:socket://{host}:0"),
    ):
        pass


def test_a_second_host_is_turned_away_and_the_first_one_is_not_disturbed(recording):
    with playing(recording[0], "serial:socket://127.0.0.1:0") as (ready, _):
        host, port = target(ready[0]).removeprefix("socket://").split(":")
        with open_port(ready[0]) as first:
            first.write(command(SEND_CALIBRATION))
            assert first.read(1)
            with socket.create_connection((host, int(port)), timeout=30) as second:
                assert second.recv(100) == b""
            first.write(command(STOP))  # before the start it means nothing
        assert listen_serial(ready[0]).ends


def test_noise_from_a_hostile_host_does_no_harm(recording, url):
    noise = np.random.default_rng(1)
    with playing(recording[0], url) as (ready, _):
        for length in (1, 100, 70_000, 300_000):
            with open_port(ready[0]) as port:
                port.write(noise.integers(0, 256, length, dtype=np.uint8).tobytes() + b"\0")
        heard = listen_serial(ready[0])
    assert len(heard.counts_by_counter()) == 1460


def test_many_connections_do_no_harm(recording):
    with playing(recording[0], "serial:socket://127.0.0.1:0") as (ready, _):
        host, port = target(ready[0]).removeprefix("socket://").split(":")
        for _ in range(300):
            socket.create_connection((host, int(port)), timeout=30).close()
        until = time.monotonic() + 30
        while time.monotonic() < until:
            heard = listen_serial(ready[0])
            if heard.ends:
                break
    assert len(heard.counts_by_counter()) == 1460


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"speed": "fast"}, "--speed"),
        ({"samples_per_frame": 0}, "--samples-per-frame"),
        ({"channels": ["a", "b"]}, "--channels"),
        ({"channels": ["force_cell_9"]}, "force_cell_9"),
        ({"loop_duration_s": -1.0}, "--loop-duration"),
        ({"wait_clients": 0}, "--wait-clients"),
        ({"wait_clients": 2}, "--wait-clients.*socketcand"),
        ({"wait_clients": 9}, "--wait-clients.* 1 … 8"),
    ],
)
def test_wrong_settings_are_refused_in_one_line(recording, tmp_path, settings, message):
    with (
        pytest.raises(InputError, match=message) as raised,
        playing(recording[0], f"serial:{tmp_path / 'tty'}", **settings),
    ):
        pass
    assert "\n" not in str(raised.value)
    assert not os.path.lexists(tmp_path / "tty")
