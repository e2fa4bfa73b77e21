"""What a journal becomes: types on disk, flags, several devices, refusals."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from journals import (
    ACCELERATION,
    ATTRIBUTES,
    FORCE,
    RATE_HZ,
    STREAM,
    Made,
    block,
    blocks,
    device,
    ended,
    made,
    write,
)

from acquisition.recorder.assembly import AssemblyOptions, assemble
from acquisition.recorder.journal import JournalWriter, read_journal
from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block, Delivery, End, Trouble, TroubleKind
from acquisition.sources.interface import SourceInfo
from pipelines.recording.recover import recover
from sloshlab.errors import InputError, JournalError, RecordingError
from sloshlab.recording import CLIPPED, LOST, OUT_OF_ORDER, STUCK, read_recording

WIDE = Channel("force_cell_1", "force", "N", 24, 1e-4)


def of_counts(tmp_path: Path, counts: np.ndarray, *channels: Channel, n_lost: int = 16) -> Made:
    """A recording of these counts, the first `n_lost` of which never arrived."""
    sent = [block(n_lost, len(counts), counts=counts[n_lost:].astype(np.int32)), End(STREAM, len(counts))]
    return made(tmp_path, sent, device(*channels))


def moving(n: int, n_channels: int = 2, seed: int = 0) -> np.ndarray:
    """An 8 Hz motion of some hundred counts with a little noise."""
    noise = np.random.default_rng(seed).normal(0, 0.6, (n, n_channels))
    sine = np.sin(2 * np.pi * 8 * np.arange(n) / RATE_HZ)[:, None]
    return np.round(500 * sine + noise).astype(np.int32)


# types on disk


def test_sixteen_bits_stay_sixteen_bits(tmp_path: Path) -> None:
    result = of_counts(tmp_path, np.array([[-32767, 32767]] * 40), FORCE, ACCELERATION)
    assert result.raw["force_cell_1"].dtype == np.int16
    assert result.raw["force_cell_1"][20] == -32767
    assert result.raw["acceleration_roof_1"][20] == 32767
    assert result.recording["force_cell_1"].values[20] == -32767 * 0.5


def test_a_lowest_count_that_was_measured_is_not_taken_for_lost(tmp_path: Path) -> None:
    result = of_counts(tmp_path, np.array([[-32768, 1]] * 40), FORCE, ACCELERATION)
    assert result.raw["force_cell_1"].dtype == np.int32
    assert result.raw["force_cell_1"][0] == -(2**31)
    assert result.recording["force_cell_1"].values[20] == -32768 * 0.5
    assert np.isnan(result.recording["force_cell_1"].values[0])
    assert result.raw["acceleration_roof_1"].dtype == np.int16


def test_thirty_two_bits_with_the_lowest_count_become_sixty_four(tmp_path: Path) -> None:
    counts = np.array([[-(2**31)], [2**31 - 1]] * 20)
    result = of_counts(tmp_path, counts, replace(WIDE, bits=32))
    assert result.raw["force_cell_1"].dtype == np.int64
    assert result.recording["force_cell_1"].values[20] == pytest.approx(-(2**31) * 1e-4)


def test_twenty_four_bits_are_stored_in_thirty_two(tmp_path: Path) -> None:
    result = of_counts(tmp_path, np.array([[-(2**23)], [2**23 - 1]] * 20), WIDE)
    assert result.raw["force_cell_1"].dtype == np.int32
    assert result.recording["force_cell_1"].values[21] == (2**23 - 1) * 1e-4


def test_the_count_for_no_reading_is_the_fill_value_and_lost(tmp_path: Path) -> None:
    counts = moving(640, 1)
    counts[100:110] = 9999
    result = of_counts(tmp_path, counts, replace(FORCE, missing_count=9999))
    assert (result.raw["force_cell_1"][100:110] == 9999).all()
    assert (result.raw["force_cell_1"][:16] == 9999).all()
    np.testing.assert_array_equal(np.flatnonzero(result.quality & LOST), [*range(16), *range(100, 110)])
    assert "10 samples without a reading" in result.flags
    assert result.summary.n_lost == {"force_cell_1": 26}


def test_scaling_and_attributes_are_the_channel_s(tmp_path: Path) -> None:
    channel = replace(
        FORCE, add_offset=-3.0, block_from="shaker", block_to="tank", noise_std=0.1, sensor_serial="A7"
    )
    result = of_counts(tmp_path, np.full((40, 1), 7), channel)
    assert result.recording["force_cell_1"].values[30] == 0.5 * 7 - 3.0
    attributes = result.recording["force_cell_1"].attrs
    assert (attributes["block_from"], attributes["range_max"], attributes["sensor_serial"]) == (
        "shaker",
        1e4,
        "A7",
    )
    assert result.summary.record["devices"][0]["sensor_serials"] == {"force_cell_1": "A7"}


# flags


@pytest.mark.parametrize("scale", [0.5, -0.5])
def test_samples_at_the_limits_are_clipped(scale: float, tmp_path: Path) -> None:
    channel = replace(FORCE, scale_factor=scale, range_min=-100.0, range_max=150.0)
    counts = moving(640, 1) // 10
    sign = 1 if scale > 0 else -1
    counts[200], counts[201], counts[202] = 300 * sign, 299 * sign, -200 * sign
    result = of_counts(tmp_path, counts, channel)
    np.testing.assert_array_equal(np.flatnonzero(result.quality & CLIPPED), [200, 202])
    assert "2 samples clipped" in result.flags


def test_a_sensor_that_stops_moving_is_stuck(tmp_path: Path) -> None:
    counts = moving(5120)
    counts[2000:2300, 0] = counts[2000, 0]
    result = of_counts(tmp_path, counts, FORCE, ACCELERATION, n_lost=0)
    stuck = np.flatnonzero(result.quality & STUCK)
    # a neighbour may happen to have the same count
    assert set(range(2000, 2300)) <= set(stuck) <= set(range(1998, 2302))
    assert "force_cell_1: stuck for 30" in result.flags
    assert "acceleration_roof_1" not in result.flags
    assert not np.isnan(result.recording["force_cell_1"].values).any()


def test_a_sensor_that_is_dead_throughout_is_stuck(tmp_path: Path) -> None:
    counts = moving(5120)
    counts[:, 1] = 3
    result = of_counts(tmp_path, counts, FORCE, ACCELERATION, n_lost=0)
    assert (result.quality == STUCK).all()
    assert "acceleration_roof_1: stuck for 5120 samples" in result.flags


@pytest.mark.parametrize("case", ["all rest", "too short", "slow and coarse", "clipped"])
def test_what_may_be_constant_is_not_stuck(case: str, tmp_path: Path) -> None:
    counts = moving(5120)
    channel = FORCE
    if case == "all rest":
        counts[1000:3000] = counts[1000]
    elif case == "too short":
        counts[1000:1120, 0] = counts[1000, 0]
    elif case == "slow and coarse":
        counts[:, 0] = np.round(counts[:, 1] / 400)
        counts[1000:3000, 1] = counts[1000:3000, 1] // 10
        counts[1000:3000, 0] = 0
    else:
        channel = replace(FORCE, range_max=150.0)
        counts[1000:1300, 0] = 300
    result = of_counts(tmp_path, counts, channel, ACCELERATION, n_lost=0)
    assert not (result.quality & STUCK).any()


def channels_of(recording: netCDF4.Dataset) -> list[Channel]:
    found = []
    for name, variable in recording.variables.items():
        if name not in ("time", "quality"):
            own = {key: variable.getncattr(key) for key in variable.ncattrs()}
            fill = int(own.pop("_FillValue"))
            own = {key: value if isinstance(value, str) else float(value) for key, value in own.items()}
            found.append(Channel(name=name, bits=16, missing_count=fill, **own))
    return found


@pytest.mark.slow
def test_real_recordings_come_back_bit_exact_without_a_false_alarm(repository: Path, tmp_path: Path) -> None:
    runs = sorted((repository / "raw_data" / "shaker").glob("*.nc"))
    assert len(runs) == 36
    for run in runs:
        with netCDF4.Dataset(run) as source:
            source.set_auto_maskandscale(False)
            channels = channels_of(source)
            counts = np.stack([source[channel.name][:] for channel in channels], axis=1).astype(np.int32)
            attributes = {key: source.getncattr(key) for key in source.ncattrs()}
        plain = {
            key: value.item() if isinstance(value, np.generic) else value for key, value in attributes.items()
        }
        sent = [
            block(k, min(k + 512, len(counts)), counts=counts[k : k + 512]) for k in range(0, len(counts), 512)
        ]
        result = made(tmp_path, ended(sent, len(counts)), device(*channels), attributes=plain)
        direct = read_recording(run)
        for channel in channels:
            np.testing.assert_array_equal(result.recording[channel.name].values, direct[channel.name].values)
            assert result.recording[channel.name].attrs == direct[channel.name].attrs
        np.testing.assert_array_equal(result.recording.time.values, direct.time.values)
        assert not (result.quality & (STUCK | OUT_OF_ORDER)).any(), run.name
        assert "stuck" not in result.flags
        assert "disagrees" not in result.flags, run.name
        assert {**result.recording.attrs, **direct.attrs} == result.recording.attrs


# attributes


def test_metadata_of_the_journal_become_attributes_and_options_win(tmp_path: Path) -> None:
    more = {"acceleration_g": 3.0, "start_time_utc": "2026-01-12T09:00:00Z"}
    result = made(tmp_path, ended(blocks(320), 320), attributes=more)
    assert result.recording.attrs["acceleration_g"] == 3.0
    assert result.recording.attrs["run_id"] == "run"
    options = AssemblyOptions(attributes={"run_id": "other", "experiment": "other", "configuration": "empty"})
    result = made(tmp_path, ended(blocks(320), 320), attributes=more, options=options)
    assert (result.recording.attrs["run_id"], result.recording.attrs["configuration"]) == ("other", "empty")
    assert result.recording.attrs["acceleration_g"] == 3.0


def test_the_start_is_that_of_the_first_sample(tmp_path: Path) -> None:
    result = made(tmp_path, ended(blocks(320), 320))
    # the first block of 16 samples was read 1 ms after its last sample: its first was taken 15 steps before
    assert result.recording.attrs["start_time_utc"] == "2026-09-21T14:13:20.003Z"


def test_acquisition_says_what_happened_as_json(tmp_path: Path) -> None:
    trouble = Trouble(TroubleKind.OVERRUN, "3 bytes", 1, 10**12)
    result = made(tmp_path, ended([*blocks(320)[:9], trouble, *blocks(320)[10:]], 320))
    record = json.loads(result.recording.attrs["acquisition"])
    assert record["devices"][0]["device"] == "daq"
    assert record["losses"]["rows"] == [[0, 0, 144, 16, 144]]
    assert record["losses"]["n_samples"] == 16
    assert record["troubles"]["counts"] == {"OVERRUN": 1}
    assert record["clocks"]["daq"][0]["status"] == "fitted"
    assert "says that it lost data" in result.flags
    assert record == result.summary.record


def test_more_than_a_thousand_gaps_are_counted(tmp_path: Path) -> None:
    sent = [block(k, k + 4) for k in range(0, 4 * 2400, 8)]
    result = made(tmp_path, ended(sent, 4 * 2400))
    losses = json.loads(result.recording.attrs["acquisition"])["losses"]
    assert len(losses["rows"]) == 1000
    assert losses["n_gaps"] == 1200
    assert losses["n_samples"] == 4800


# several devices


def second(
    counts: np.ndarray, first: int = 0, rate_hz: float = RATE_HZ, ticks_hz: float = 0.0
) -> list[tuple[int, Delivery]]:
    sent = []
    for k in range(0, len(counts), 16):
        ns = 5_000_000_000_000 + round(((first + k + 16) / rate_hz + 2e-3) * 1e9)
        ticks = round((first + k) / rate_hz * ticks_hz) if ticks_hz else None
        part = counts[k : k + 16].astype(np.int32)
        sent.append((1, Block(0, 5, first + k, part, ticks, ns, 10**18)))
    return sent


def test_a_common_trigger_leaves_all_counts_untouched(tmp_path: Path) -> None:
    counts = np.arange(336)[:, None]
    infos = device(FORCE), device(ACCELERATION, name="can")
    own = [(0, block(k, k + 16, counts=counts[k : k + 16].astype(np.int32))) for k in range(0, 320, 16)]
    options = AssemblyOptions(align="counter")
    result = made(
        tmp_path, [*own, (0, End(STREAM, 320)), *second(counts + 7), (1, End(5, 336))], *infos, options=options
    )
    np.testing.assert_array_equal(result.raw["acceleration_roof_1"], np.arange(336) + 7)
    # the first device ended 16 samples earlier
    np.testing.assert_array_equal(result.raw["force_cell_1"][:320], np.arange(320))
    assert (result.raw["force_cell_1"][320:] == -32768).all()
    assert (result.quality[320:] == LOST).all()
    assert "counts_acceleration_roof_1" not in result.raw


def test_a_common_trigger_needs_one_rate(tmp_path: Path) -> None:
    infos = device(FORCE), device(ACCELERATION, name="can", rate_hz=500.0)
    sent = [(0, block(0, 320, n_channels=1)), *second(np.arange(320)[:, None])]
    with pytest.raises(InputError, match="equal sampling rates"):
        made(tmp_path, sent, *infos, options=AssemblyOptions(align="counter"))


def test_synchronised_device_clocks_place_the_samples(tmp_path: Path) -> None:
    # the second device runs at 640 Hz and begins 0.125 s before the first, on a common clock of 1 MHz
    n, rate_hz = 6400, 640.0
    wave = 1000 * np.sin(2 * np.pi * 7 * (np.arange(n) / rate_hz))
    infos = (
        device(FORCE, clock_hz=1e6),
        device(replace(ACCELERATION, bits=24), name="can", rate_hz=rate_hz, clock_hz=1e6),
    )
    own = [
        (0, block(k, k + 16, n_channels=1, ticks=round((k / RATE_HZ + 0.125) * 1e6), late_s=0.3))
        for k in range(0, 4096, 16)
    ]
    options = AssemblyOptions(align="device")
    sent = [
        *own,
        (0, End(STREAM, 4096)),
        *second(np.round(wave)[:, None], rate_hz=rate_hz, ticks_hz=1e6),
        (1, End(5, n)),
    ]
    result = made(tmp_path, sent, *infos, options=options)
    counts = result.recording["counts_acceleration_roof_1"]
    assert counts.attrs["first_sample_s"] == pytest.approx(-0.125, abs=1e-6)
    assert counts.attrs["sample_step_s"] == pytest.approx(1 / rate_hz, rel=1e-7)
    values = result.recording["acceleration_roof_1"].values
    truth = 250 * np.sin(2 * np.pi * 7 * (result.recording.time.values + 0.125))
    # 24 samples of the slower rate to each side; rounded to counts of 0.25
    assert np.nanmax(np.abs(values - truth)) < 0.2
    assert np.isnan(values).sum() == 0
    np.testing.assert_array_equal(counts.values, np.round(wave))


def test_device_clocks_that_are_absent_are_refused(tmp_path: Path) -> None:
    infos = device(FORCE), device(ACCELERATION, name="can")
    sent = [(0, block(0, 320, n_channels=1)), *second(np.arange(320)[:, None])]
    with pytest.raises(InputError, match="no device clock"):
        made(tmp_path, sent, *infos, options=AssemblyOptions(align="device"))


def test_a_faster_device_is_aligned_by_its_signals(tmp_path: Path) -> None:
    def sweep(t: np.ndarray) -> np.ndarray:
        return np.round(8000 * np.sin(2 * np.pi * (5 * t + 0.375 * t**2)))

    roof = replace(ACCELERATION, name="acceleration_roof_2")
    infos = device(ACCELERATION), device(roof, name="can", rate_hz=5120.0)
    counts = sweep(np.arange(10240) / RATE_HZ)[:, None].astype(np.int32)
    own = [(0, block(k, k + 16, counts=counts[k : k + 16])) for k in range(0, 10240, 16)]
    other = second(sweep(np.arange(102400) / 5120.0)[:, None], rate_hz=5120.0)
    pairs = AssemblyOptions(redundant=(("acceleration_roof_2", "acceleration_roof_1"),))
    result = made(tmp_path, [*own, *other], *infos, options=pairs)
    stated = result.recording["counts_acceleration_roof_2"].attrs
    # both sampled at t = 0, though one is read 1 ms after its last sample and the other 2 ms
    assert result.summary.record["alignment"]["can"]["method"] == "signals"
    assert abs(stated["first_sample_s"]) < 5e-6
    values = result.recording["acceleration_roof_2"].values
    np.testing.assert_allclose(values[100:-100], counts[100:-100, 0] * 0.25, atol=2.0)


def test_lost_samples_of_a_resampled_device_are_lost_in_its_channels_only(tmp_path: Path) -> None:
    infos = device(FORCE), device(ACCELERATION, name="can")
    own = [(0, block(k, k + 16, n_channels=1)) for k in range(0, 5120, 16)]
    other = second(moving(5120, 1))
    del other[100]
    result = made(tmp_path, [*own, (0, End(STREAM, 5120)), *other, (1, End(5, 5120))], *infos)
    values = result.recording["acceleration_roof_1"].values
    lost = np.flatnonzero(np.isnan(values[500:4500])) + 500
    # 16 samples and the 24 to each side whose kernels reach them
    assert 16 <= lost.size <= 16 + 2 * 24
    assert set(range(1604, 1612)) <= set(lost)
    assert (result.quality[lost] & LOST).all()
    assert not np.isnan(result.recording["force_cell_1"].values).any()
    np.testing.assert_array_equal(np.flatnonzero(result.raw["quality_can"] & LOST), np.arange(1600, 1616))


def test_equal_names_of_two_devices_are_told_apart(tmp_path: Path) -> None:
    infos = device(FORCE), device(FORCE, name="can 2")
    own = [(0, block(k, k + 16, n_channels=1)) for k in range(0, 320, 16)]
    options = AssemblyOptions(align="counter")
    result = made(tmp_path, [*own, *second(np.arange(320)[:, None] * 2)], *infos, options=options)
    np.testing.assert_array_equal(result.raw["force_cell_1_can_2"], np.arange(320) * 2)


def test_a_silent_device_costs_only_itself(tmp_path: Path) -> None:
    infos = device(FORCE, name="silent"), device(ACCELERATION, name="can")
    result = made(tmp_path, second(np.arange(320)[:, None]), *infos)
    np.testing.assert_array_equal(result.raw["acceleration_roof_1"], np.arange(320))
    assert "silent: not one sample arrived" in result.flags


@pytest.mark.parametrize(("gain", "doubts"), [(1.0, False), (0.5, True), (-1.0, True)])
def test_accelerometers_of_a_rigid_tank_that_disagree_are_doubted(
    gain: float, doubts: bool, tmp_path: Path
) -> None:
    counts = moving(10240)
    counts[:, 1] = np.round(gain * counts[:, 1])
    channels = (ACCELERATION, replace(ACCELERATION, name="acceleration_roof_2"))
    sent = [block(0, 10240, counts=counts), End(STREAM, 10240)]
    result = made(tmp_path, sent, device(*channels), attributes={"experiment": "shaker_sweep"})
    assert ("sensor swapped or gain wrong?" in result.flags) is doubts


def test_accelerometers_at_rest_are_not_compared(tmp_path: Path) -> None:
    counts = np.random.default_rng(0).integers(-1, 2, (10240, 2))
    channels = (ACCELERATION, replace(ACCELERATION, name="acceleration_roof_2"))
    sent = [block(0, 10240, counts=counts.astype(np.int32)), End(STREAM, 10240)]
    result = made(tmp_path, sent, device(*channels), attributes={"experiment": "shaker_sweep"})
    assert result.flags == ""


# refusals


def test_a_gap_that_no_reader_would_take_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    far = Block(0, STREAM, 2**50, np.zeros((16, 2), np.int32), None, 10**15, 10**18)
    sent = [*blocks(320), far]
    with pytest.raises(RecordingError, match=r"longest gap is \d+ samples of daq from counter 320"):
        made(tmp_path, sent)
    assert not (tmp_path / "run.nc").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["run.journal"]


def test_a_journal_without_samples_is_refused(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match="at least two samples"):
        made(tmp_path, [End(STREAM, 0)])


@pytest.mark.parametrize("channel", [replace(FORCE, units="m"), replace(FORCE, quantity="pressure")])
def test_channels_that_are_none_are_refused_before_writing(channel: Channel, tmp_path: Path) -> None:
    with pytest.raises(RecordingError):
        made(tmp_path, ended(blocks(320, n_channels=1), 320), device(channel))
    assert not (tmp_path / "run.nc").exists()


def test_names_that_could_leave_the_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match="letters, digits and underscores"):
        made(tmp_path, ended(blocks(320, n_channels=1), 320), device(replace(FORCE, name="force_/etc/passwd")))


def test_an_unknown_alignment_is_refused(tmp_path: Path) -> None:
    options = AssemblyOptions(align="guess")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="host, device, counter"):
        made(tmp_path, ended(blocks(320), 320), options=options)


def test_a_failed_assembly_leaves_the_old_recording(tmp_path: Path) -> None:
    made(tmp_path, ended(blocks(320), 320))
    before = (tmp_path / "run.nc").read_bytes()
    with pytest.raises(JournalError):
        made(tmp_path, [End(STREAM, 0)])
    assert (tmp_path / "run.nc").read_bytes() == before


# recovery


@pytest.fixture
def cut_short(tmp_path: Path) -> Path:
    info: SourceInfo = device()
    write(tmp_path / "run.journal", [info], [(0, block) for block in blocks(320)], is_closed=False)
    with (tmp_path / "run.journal").open("ab") as file:
        file.write(b"half a block")
    return tmp_path / "run.journal"


def test_recovery_keeps_everything_and_says_what_was_left_out(cut_short: Path, tmp_path: Path) -> None:
    content = cut_short.read_bytes()
    summary = recover(cut_short, tmp_path / "run.nc", overwrite=False)
    assert cut_short.read_bytes() == content
    with netCDF4.Dataset(tmp_path / "run.nc") as recovered:
        recovered.set_auto_maskandscale(False)
        np.testing.assert_array_equal(recovered["force_cell_1"][:], np.arange(320))
    assert "left out: 12 bytes" in "\n".join(summary["lines"])
    assert "not closed" in summary["lines"][0]
    assert any("did not close" in flag for flag in summary["flags"])
    assert summary["report"]["journal"]["n_bytes_left_out"] == 12
    json.dumps(summary)


def test_recovery_of_a_closed_journal_has_no_flag(tmp_path: Path) -> None:
    write(tmp_path / "run.journal", [device()], [(0, delivery) for delivery in ended(blocks(320), 320)])
    summary = recover(tmp_path / "run.journal", tmp_path / "run.nc", overwrite=False)
    assert summary["flags"] == []
    assert "closed by the recorder" in summary["lines"][0]


def test_recovery_overwrites_only_when_told(cut_short: Path, tmp_path: Path) -> None:
    (tmp_path / "run.nc").write_bytes(b"precious")
    with pytest.raises(InputError, match="there already"):
        recover(cut_short, tmp_path / "run.nc", overwrite=False)
    assert (tmp_path / "run.nc").read_bytes() == b"precious"
    recover(cut_short, tmp_path / "run.nc", overwrite=True)
    assert read_recording(tmp_path / "run.nc").sizes["time"] == 320


def two_devices_that_were_to_have_one_trigger(folder: Path) -> Path:
    """The journal of two accelerometers of one motion at 512 Hz and 640 Hz, recorded by counter."""
    roof = replace(ACCELERATION, name="acceleration_roof_2")
    sent: list[tuple[int, Delivery]] = []
    for source, rate_hz in enumerate((RATE_HZ, 640.0)):
        counts = np.round(8000 * np.sin(2 * np.pi * 0.5 * np.arange(0, 20, 1 / rate_hz) ** 2))[:, None]
        sent += [(source, delivery) for _, delivery in second(counts, rate_hz=rate_hz)]
    journal = JournalWriter(
        folder / "two.journal",
        {"attributes": ATTRIBUTES, "align": "counter"},
        [device(ACCELERATION), device(roof, name="can", rate_hz=640.0)],
    )
    for source, delivery in sent:
        journal.append(source, delivery)
    journal.close()
    return folder / "two.journal"


def test_a_journal_that_cannot_be_aligned_as_recorded_is_recovered_in_another_way(tmp_path: Path) -> None:
    journal = two_devices_that_were_to_have_one_trigger(tmp_path)
    with pytest.raises(InputError, match="--align host"):
        recover(journal, tmp_path / "run.nc")
    assert not (tmp_path / "run.nc").exists()
    summary = recover(journal, tmp_path / "run.nc", align="host")
    assert summary["report"]["alignment"]["can"]["method"] == "host"
    redundant = ("acceleration_roof_1:acceleration_roof_2",)
    summary = recover(journal, tmp_path / "run.nc", overwrite=True, align="host", redundant=redundant)
    assert summary["report"]["alignment"]["can"]["method"] == "signals"
    assert abs(summary["report"]["alignment"]["can"]["start_s"]) < 1e-5


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"align": "guess"}, "--align"),
        ({"redundant": ("a",)}, "--redundant"),
        ({"align": "host", "redundant": ("acceleration_roof_1:none",)}, "one of another"),
    ],
)
def test_recovery_refuses_what_recording_refuses(tmp_path: Path, options: dict, message: str) -> None:
    journal = two_devices_that_were_to_have_one_trigger(tmp_path)
    with pytest.raises(InputError, match=message):
        recover(journal, tmp_path / "run.nc", **options)
    assert [path.name for path in tmp_path.iterdir()] == ["two.journal"]


def test_recovery_never_replaces_the_journal(cut_short: Path) -> None:
    content = cut_short.read_bytes()
    with pytest.raises(InputError, match="another name"):
        recover(cut_short, cut_short, overwrite=True)
    assert cut_short.read_bytes() == content


def test_memory_does_not_grow_with_the_stretches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Small stretches give the same file as one large one: nothing depends on where they end."""
    counts = moving(5120)
    counts[2000:2300, 0] = counts[2000, 0]
    sent: list[Delivery] = [block(k, k + 48, counts=counts[k : k + 48]) for k in range(0, 5088, 48)]
    sent[9], sent[10] = sent[10], sent[9]
    del sent[40]
    whole = made(tmp_path, ended(sent, 5088))
    monkeypatch.setattr("acquisition.recorder.sample_writing.VALUES_AT_ONCE", 64)
    monkeypatch.setattr("acquisition.recorder.assembly.samples_at_once", lambda _n: 100)
    pieces = made(tmp_path, ended(sent, 5088))
    for name, values in whole.raw.items():
        np.testing.assert_array_equal(pieces.raw[name], values, err_msg=name)
    assert pieces.summary.record == whole.summary.record


def test_the_journal_is_only_read(tmp_path: Path) -> None:
    write(tmp_path / "run.journal", [device()], [(0, delivery) for delivery in ended(blocks(320), 320)])
    (tmp_path / "run.journal").chmod(0o444)
    with read_journal(tmp_path / "run.journal") as journal:
        assert assemble(journal, tmp_path / "deep" / "run.nc").n_samples == 320


def test_whoever_watches_sees_the_end_come(tmp_path: Path) -> None:
    n = 5_000_000
    write(tmp_path / "long.journal", [device()], [(0, block(0, n, counts=np.zeros((n, 2), np.int32)))])
    seen: list[tuple[int, int]] = []
    with read_journal(tmp_path / "long.journal") as journal:
        assemble(journal, tmp_path / "watched.nc", watch=lambda n_done, n_all: seen.append((n_done, n_all)))
    assert seen == sorted(seen)
    assert {n_all for _, n_all in seen} == {2 * n}
    assert seen[-1] == (2 * n, 2 * n)
    assert len(seen) > 4
