"""Recordings as sources: the counts that are stored, floats to 30 bits of full scale, in real time or at once."""

import subprocess
import sys

import netCDF4
import numpy as np
import pytest
from played_clocks import SteppedClock

from acquisition.sources import Block, End, parse_url
from acquisition.sources.file_source import FileSource
from acquisition.sources.stored_counts import MISSING_COUNT, StoredCounts
from sloshlab.errors import RecordingError, SourceError
from sloshlab.recording import read_recording

RATE_HZ = 100.0
GLOBAL = {
    "sloshlab_format": "1",
    "run_id": "made",
    "experiment": "other",
    "configuration": "empty",
    "rig": "rig.toml",
    "sampling_rate_hz": RATE_HZ,
    "start_time_utc": "2026-01-31T12:00:00Z",
}


def write(path, variables, *, time=None, chunk=None, attributes=GLOBAL):
    """Write a netCDF file by hand: name → (stored values, attributes)."""
    n_samples = len(next(iter(variables.values()))[0])
    with netCDF4.Dataset(path, "w") as file:
        file.setncatts(attributes)
        file.createDimension("time", n_samples)
        its_time = file.createVariable("time", "f8", ("time",))
        its_time[:] = 2.5 + np.arange(n_samples) / RATE_HZ if time is None else time
        for name, (values, described) in variables.items():
            described = dict(described)
            variable = file.createVariable(
                name,
                values.dtype,
                ("time",),
                fill_value=described.pop("_FillValue", None),
                chunksizes=None if chunk is None else (chunk,),
            )
            variable.set_auto_maskandscale(False)
            variable.setncatts(described)
            variable[:] = values
    return path


def force(**more):
    return {"units": "N", "quantity": "force", **more}


def opened(path, query="", clock=None):
    clock = clock or SteppedClock()
    return FileSource(parse_url(f"file:{path}{query}"), **clock.arguments())


def everything(source):
    """All counts that a started source delivers, and its End."""
    source.start()
    blocks, position = [], 0
    for _ in range(100_000):
        for delivery in source.read(1.0):
            if isinstance(delivery, End):
                return np.concatenate(blocks), delivery
            assert isinstance(delivery, Block)
            assert (delivery.group, delivery.counter) == (0, position)
            assert delivery.counts.dtype == np.int32
            position += len(delivery.counts)
            blocks.append(delivery.counts)
    raise AssertionError("no end")


@pytest.mark.parametrize("dtype", ["i1", "u1", "i2", "u2", "i4"])
@pytest.mark.parametrize("chunk", [None, 7, 100_000])
def test_stored_integers_are_delivered_as_they_are(tmp_path, dtype, chunk):
    limits = np.iinfo(dtype)
    stored = np.random.default_rng(3).integers(limits.min, limits.max, 100_000, dtype=dtype, endpoint=True)
    stored[:2] = limits.min, limits.max
    path = write(tmp_path / "run.nc", {"force_a": (stored, force(scale_factor=0.5, add_offset=-3.0))}, chunk=chunk)
    with opened(path) as source:
        channel = source.info.channels[0]
        counts, end = everything(source)
    np.testing.assert_array_equal(counts[:, 0], stored)
    assert end.n_samples == 100_000
    assert (channel.scale_factor, channel.add_offset, channel.missing_count) == (0.5, -3.0, None)
    assert -(2 ** (channel.bits - 1)) <= limits.min
    assert limits.max < 2 ** (channel.bits - 1)


def test_unsigned_counts_of_32_bits_move_by_half_their_range(tmp_path):
    stored = np.array([0, 1, 2**31, 2**32 - 1, 7], dtype=np.uint32)
    path = write(tmp_path / "run.nc", {"force_a": (stored, force(scale_factor=0.25, _FillValue=np.uint32(7)))})
    with opened(path) as source:
        channel = source.info.channels[0]
        counts, _ = everything(source)
    # values by the definition in the recording format: scale · count + offset
    values = channel.scale_factor * counts[:4, 0].astype(float) + channel.add_offset
    np.testing.assert_array_equal(values, [0.0, 0.25, 2.0**29, (2.0**32 - 1) / 4])
    assert counts[4, 0] == channel.missing_count


def test_the_fill_value_is_the_missing_count_and_attributes_are_kept(tmp_path):
    described = force(
        units="kN", scale_factor=2.0, _FillValue=np.int16(-32768), range_min=-5.0, range_max=6.0, noise_std=0.1,
        x_m=0.2, block_from="shaker", block_to="tank", sensor_serial="A-7",
    )  # fmt: skip
    path = write(tmp_path / "run.nc", {"force_a": (np.array([1, -32768, 3], np.int16), described)})
    with opened(path) as source:
        (channel,) = source.info.channels
        counts, _ = everything(source)
        assert source.info.device == "run"
        assert source.info.sampling_rate_hz == RATE_HZ
        assert source.info.groups == ((0,),)
    assert counts[:, 0].tolist() == [1, -32768, 3]
    assert (channel.name, channel.quantity, channel.units, channel.bits) == ("force_a", "force", "kN", 16)
    assert (channel.scale_factor, channel.missing_count) == (2.0, -32768)
    assert (channel.range_min, channel.range_max, channel.noise_std, channel.x_m) == (-5.0, 6.0, 0.1, 0.2)
    assert (channel.block_from, channel.block_to, channel.sensor_serial) == ("shaker", "tank", "A-7")


@pytest.mark.parametrize(
    ("fill", "expected"), [(-9.0, -9), (0.5, None), (70_000.0, None), (1e30, None), (np.nan, None), (np.inf, None)]
)
def test_a_missing_value_that_no_count_can_be_marks_none(tmp_path, fill, expected):
    stored = np.array([0, -9, 1, 4464], np.int16)
    path = write(tmp_path / "run.nc", {"force_a": (stored, force(missing_value=fill))})
    with opened(path) as source:
        assert source.info.channels[0].missing_count == expected
        counts, _ = everything(source)
    assert counts[:, 0].tolist() == stored.tolist()


@pytest.mark.parametrize("full_scale", [1.0, 20.0, 1023.9, 1e-12, 3e30])
def test_floats_keep_thirty_bits_of_the_full_scale(tmp_path, full_scale):
    values = np.random.default_rng(8).uniform(-full_scale, full_scale, 70_000)
    values[5] = np.nan
    values[9] = -full_scale
    path = write(tmp_path / "run.nc", {"force_a": (values, force())})
    with opened(path) as source:
        (channel,) = source.info.channels
        counts, _ = everything(source)
    assert (channel.bits, channel.add_offset, channel.missing_count) == (32, 0.0, MISSING_COUNT)
    assert counts[5, 0] == MISSING_COUNT
    error = np.delete(counts[:, 0] * channel.scale_factor - values, 5)
    assert np.abs(error).max() <= full_scale * 2.0**-30
    assert np.log2(channel.scale_factor) == np.round(np.log2(channel.scale_factor))
    assert 2.0**29 <= full_scale / channel.scale_factor <= 2.0**30


def test_float32_is_exact_down_to_a_64th_of_the_full_scale(tmp_path):
    values = np.random.default_rng(8).uniform(1 / 64, 1, 50_000).astype(np.float32)
    path = write(tmp_path / "run.nc", {"force_a": (values, force(range_max=1.0))})
    with opened(path) as source:
        (channel,) = source.info.channels
        counts, _ = everything(source)
    np.testing.assert_array_equal(counts[:, 0] * channel.scale_factor, values.astype(float))


def test_the_range_counts_for_the_full_scale_of_floats_and_their_scaling_is_applied(tmp_path):
    described = force(range_max=1024.0, scale_factor=2.0, add_offset=1.0, _FillValue=-9.0)
    path = write(tmp_path / "run.nc", {"force_a": (np.array([0.5, -9.0, 3.0]), described)})
    with opened(path) as source:
        (channel,) = source.info.channels
        counts, _ = everything(source)
    assert channel.scale_factor == 2.0**-20
    assert counts[:, 0].tolist() == [2 * 2**20, MISSING_COUNT, 7 * 2**20]


def test_a_channel_of_nothing_but_zeros_or_lost_samples_can_be_played(tmp_path):
    path = write(
        tmp_path / "run.nc", {"force_a": (np.zeros(4), force()), "force_b": (np.full(4, np.nan), force())}
    )
    with opened(path) as source:
        counts, _ = everything(source)
    assert counts.tolist() == [[0, MISSING_COUNT]] * 4


def test_every_sample_of_a_campaign_run_equals_what_the_reader_reads(repository):
    path = repository / "raw_data" / "shaker" / "fill_0.25_sweep_3.00g.nc"
    recording = read_recording(path)
    with opened(path) as source:
        counts, end = everything(source)
        channels = source.info.channels
    assert end.n_samples == recording.sizes["time"] == len(counts)
    for channel, its_counts in zip(channels, counts.T, strict=True):
        values = np.where(its_counts == channel.missing_count, np.nan, its_counts * channel.scale_factor)
        # the reader keeps 16-bit counts as float32
        np.testing.assert_allclose(values, recording[channel.name].values, rtol=2.0**-22)
    assert (counts == -32768).sum() == 70 * 5


def test_chosen_channels_come_in_the_order_of_the_choice(tmp_path):
    variables = {f"force_{name}": (np.full(3, number, np.int16), force()) for number, name in enumerate("abc")}
    path = write(tmp_path / "run.nc", variables)
    with opened(path, "?channels=force_c,force_a") as source:
        counts, _ = everything(source)
        assert [channel.name for channel in source.info.channels] == ["force_c", "force_a"]
    assert counts.tolist() == [[2, 0]] * 3


def test_quality_and_foreign_variables_are_no_channels(tmp_path):
    variables = {"force_a": (np.zeros(3, np.int16), force()), "quality": (np.zeros(3, np.uint8), {})}
    path = write(tmp_path / "run.nc", {**variables, "temperature": (np.zeros(3), {})})
    with opened(path) as source:
        assert [channel.name for channel in source.info.channels] == ["force_a"]


def ramp(path, n_samples=1000):
    return write(path, {"force_a": (np.arange(n_samples, dtype=np.int32), force())})


def test_at_once_needs_no_sleep(tmp_path):
    clock = SteppedClock()
    with opened(ramp(tmp_path / "run.nc"), clock=clock) as source:
        counts, _ = everything(source)
    assert counts[:, 0].tolist() == list(range(1000))
    assert clock.slept_s == []


@pytest.mark.parametrize(("query", "speed"), [("?real_time=yes", 1.0), ("?speed=0.5", 0.5), ("?speed=40", 40.0)])
def test_in_real_time_no_sample_comes_before_its_time(tmp_path, query, speed):
    clock = SteppedClock()
    with opened(ramp(tmp_path / "run.nc"), query, clock) as source:
        source.start()
        begun_ns = clock.now_ns
        received = []
        for _ in range(2000):
            if len(received) == 1000:
                break
            for block in source.read(0.5):
                played_s = (clock.now_ns - begun_ns) * 1e-9 * speed
                assert block.counter == len(received)
                received += block.counts[:, 0].tolist()
                # sample k is due k steps after the start; the clock has whole nanoseconds
                assert (len(received) - 1) / RATE_HZ <= played_s + 1e-8 * speed
                assert played_s < (len(received) + 1) / RATE_HZ
    assert received == list(range(1000))
    assert clock.now_ns - begun_ns == pytest.approx(9.99e9 / speed, rel=1e-6)
    # samples come in pieces of 20 ms, or one by one where they are farther apart: no more waking than that
    assert len(clock.slept_s) <= min(999, 9.99 / speed / 0.02 * 1.02 + 2)


def test_a_read_waits_no_longer_than_its_timeout(tmp_path):
    clock = SteppedClock()
    with opened(ramp(tmp_path / "run.nc"), "?speed=0.01", clock) as source:
        assert source.read(0.25) == ()
        assert clock.slept_s == [0.25]
        source.start()
        assert [len(block.counts) for block in source.read(0.25)] == [1]
        assert source.read(0.25) == ()
        assert clock.slept_s == [0.25, 0.25]


def test_the_end_comes_once_and_then_nothing(tmp_path):
    clock = SteppedClock()
    with opened(ramp(tmp_path / "run.nc"), clock=clock) as source:
        _, end = everything(source)
        assert end == End(stream=1, n_samples=1000)
        assert source.read(0.3) == ()
        assert clock.slept_s == [0.3]


def test_before_open_and_after_close_there_is_only_an_error(tmp_path):
    source = opened(ramp(tmp_path / "run.nc"))
    for _ in range(2):
        for attempt in (lambda: source.info, source.start, lambda: source.read(0.0)):
            with pytest.raises(SourceError, match="not open; remedy: open it first"):
                attempt()
        source.open()
        source.close()
        source.close()


@pytest.mark.parametrize(
    ("query", "said"),
    [
        ("?channels=force_b", "channels: got 'force_b'; allowed: 1 … 256 of force_a"),
        ("?channels=force_a,force_a", "each once"),
        ("?channels=time", "channels: got 'time'"),
        ("?speed=0", "speed: got '0'"),
        ("?speed=2&real_time=no", "real_time=yes beside it"),
        ("?colour=red", "colour: got 'red'; allowed: options channels, device, real_time, speed"),
    ],
)
def test_options_that_cannot_be_used_are_one_line(tmp_path, query, said):
    with pytest.raises(SourceError, match=said) as caught, opened(ramp(tmp_path / "run.nc"), query):
        pass
    assert "\n" not in str(caught.value)


def damaged(path, kind):
    """A file that no source may play."""
    values, time, attributes = np.arange(50, dtype=np.int16), None, dict(GLOBAL)
    described = force()
    if kind == "no file":
        return path
    if kind == "text":
        path.write_text("time,force\n")
        return path
    if kind == "infinite":
        values = np.array([0.0, np.inf])
    if kind == "no units":
        del described["units"]
    if kind == "wrong units":
        described["units"] = "m"
    if kind == "wrong name":
        described["quantity"] = "voltage"
    if kind == "scale":
        described["scale_factor"] = 0.0
    if kind == "time":
        time = np.arange(50) / RATE_HZ + np.where(np.arange(50) > 30, 1e-3, 0.0)
    if kind == "no rate":
        del attributes["sampling_rate_hz"]
    if kind == "rate":
        attributes["sampling_rate_hz"], time = 2e7, np.arange(50) / 2e7
    write(path, {"force_a": (values, described)}, time=time, attributes=attributes)
    if kind == "cut":
        content = path.read_bytes()
        path.write_bytes(content[: len(content) // 2])
    return path


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("no file", "no such file"),
        ("text", "got a file that begins with"),
        ("cut", "cannot be read"),
        ("infinite", "infinite values"),
        ("no units", "attribute units: got nothing"),
        ("wrong units", "units of a force: got 'm'"),
        ("wrong name", "quantity: got 'voltage'"),
        ("scale", "scale_factor 0"),
        ("time", "steps that differ"),
        ("no rate", "attribute sampling_rate_hz: got nothing"),
        ("rate", "2e\\+07 Hz"),
    ],
)
def test_what_is_no_recording_is_one_line(tmp_path, kind, said):
    source = opened(damaged(tmp_path / "run.nc", kind))
    with pytest.raises(SourceError, match=said) as caught:
        source.open()
    assert "\n" not in str(caught.value)
    source.close()


def test_chunks_that_would_swamp_memory_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("acquisition.sources.stored_counts._LARGEST_STORAGE_CHUNK", 499)
    path = write(tmp_path / "run.nc", {"force_a": (np.zeros(1000, np.int16), force())}, chunk=500)
    with pytest.raises(RecordingError, match="got 500 samples of 1 channels; allowed: ≤ 499"):
        StoredCounts(path)


def test_damage_that_reading_meets_is_one_line(tmp_path):
    values = np.random.default_rng(1).integers(-1000, 1000, 200_000, dtype=np.int16)
    path = tmp_path / "run.nc"
    with netCDF4.Dataset(path, "w") as file:
        file.setncatts(GLOBAL)
        file.createDimension("time", values.size)
        file.createVariable("time", "f8", ("time",))[:] = np.arange(values.size) / RATE_HZ
        variable = file.createVariable(
            "force_a", "i2", ("time",), zlib=True, fletcher32=True, chunksizes=(50_000,)
        )
        variable.setncatts(force())
        variable[:] = values
    content = bytearray(path.read_bytes())
    middle = len(content) - 1000
    content[middle : middle + 64] = bytes(64)
    path.write_bytes(content)
    with opened(path) as source, pytest.raises(SourceError, match="cannot be read"):
        everything(source)


READ_AT_ONCE = """
import sys, threading
from acquisition.sources.stored_counts import StoredCounts

def read(path):
    for _ in range(200):
        with StoredCounts(path) as stored:
            for start in range(0, stored.n_samples, 1000):
                stored.counts(start, min(start + 1000, stored.n_samples))

threads = [threading.Thread(target=read, args=(path,)) for path in sys.argv[1:]]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
print("read")
"""


@pytest.mark.slow
def test_several_recordings_are_read_at_once_in_threads(tmp_path):
    values = np.arange(20_000, dtype=np.int16)
    paths = [write(tmp_path / f"{k}.nc", {"force_1": (values, force())}, chunk=1000) for k in range(4)]
    done = subprocess.run([sys.executable, "-c", READ_AT_ONCE, *map(str, paths)], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "read\n"), done.stderr
