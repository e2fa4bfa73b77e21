"""Recordings that begin at a trigger, and marks in them: what stands in the file, and after a crash, too."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest

from acquisition.recorder.journal import read_journal
from acquisition.recorder.listener import NobodyListening
from acquisition.recorder.mark import MOST_MARKS
from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block, Delivery, End
from acquisition.sources.interface import Source, SourceInfo
from pipelines.recording.record import RecordSettings, record
from pipelines.recording.recover import recover
from sloshlab.errors import InputError, SourceError
from sloshlab.recording import read_recording

RIG = """
[tank]
height_m = 0.03
length_m = 0.1
width_m = 0.1
dry_mass_kg = 0.6
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
"""
RATE_HZ = 1000.0
N_SAMPLES = 3000


def true_counts(counter: int, n_samples: int) -> np.ndarray:
    """Channel 0 rises by one a sample, channel 1 is anything."""
    samples = np.arange(counter, counter + n_samples)[:, np.newaxis]
    return np.hstack([samples, samples * 37 % 4001 - 2000]).astype(np.int32)


def block(counter: int, n_samples: int = 10) -> Block:
    now_ns = 10**12 + (counter + n_samples) * 1_000_000
    return Block(0, 1, counter, true_counts(counter, n_samples), None, now_ns, 10**18 + now_ns)


class RisingSource(Source):
    """Samples one after the other; a step may also be something to call."""

    def __init__(self, steps: Sequence[Any], device: str = "a") -> None:
        self.url, self._steps = f"fake:{device}", iter(steps)
        channels = tuple(Channel(f"force_{device}_{k}", "force", "N", 16, 0.01) for k in range(2))
        self._info = SourceInfo(device, self.url, RATE_HZ, channels, ((0, 1),))

    def open(self) -> None: ...

    @property
    def info(self) -> SourceInfo:
        return self._info

    def read(self, timeout_s: float) -> Sequence[Delivery]:
        step = next(self._steps, ())
        return step() if callable(step) else step

    def close(self) -> None: ...


def steps(begin: int = 0, stop: int = N_SAMPLES) -> list[Any]:
    return [[block(counter)] for counter in range(begin, stop, 10)] + [[End(1, stop)]]


@pytest.fixture
def place(tmp_path: Path) -> Path:
    (tmp_path / "rig.toml").write_text(RIG, encoding="utf-8")
    return tmp_path


def recorded(place: Path, sources: Sequence[Source], listener: Any = None, **options: Any) -> dict[str, Any]:
    settings = RecordSettings(
        tuple(source.url for source in sources), place / "rig.toml", place / "run.nc", **options
    )
    opening: Callable[[str], Source] = {source.url: source for source in sources}.__getitem__
    return record(settings, listener=listener, open_source=opening)


def stored(place: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
    """Times, counts of the first device, flags and what the recorder says of them."""
    with netCDF4.Dataset(place / "run.nc") as file:
        file.set_auto_maskandscale(False)
        counts = np.column_stack([file["force_a_0"][:], file["force_a_1"][:]])
        return file["time"][:], counts, file["quality"][:], json.loads(file.acquisition)


# in Newtons, of a scale of 0.01: count 701 is the first above 7; and a trigger within the first second, of which a
# recording without a trigger would take the samples before for lost
@pytest.mark.parametrize("at", [701, 2345])
def test_a_recording_begins_the_asked_time_before_its_trigger(place: Path, at: int) -> None:
    level = (at - 1) / 100
    summary = recorded(place, [RisingSource(steps())], trigger=(f"force_a_0>{level}",), pre_s=0.25)
    assert summary["flags"] == []
    times, counts, quality, told = stored(place)
    np.testing.assert_array_equal(counts, true_counts(at - 250, N_SAMPLES - at + 250))
    assert not quality.any()
    assert times[250] == 0
    np.testing.assert_allclose(times, (np.arange(len(times)) - 250) / RATE_HZ, rtol=0, atol=1e-12)
    assert told["trigger"]["counter"] == at
    assert told["trigger"]["n_samples_before"] == 250
    # arrivals tell when the sample of the trigger was taken
    with netCDF4.Dataset(place / "run.nc") as file:
        assert (
            file.start_time_utc
            == np.datetime_as_string(np.datetime64(10**18 + 10**12 + (at + 1) * 1_000_000, "ns"), "ms") + "Z"
        )
    assert read_recording(place / "run.nc")["time"].values[250] == 0


def test_a_duration_counts_from_the_trigger(place: Path) -> None:
    source = RisingSource(in_real_time(4000))
    summary = recorded(place, [source], trigger=("force_a_0>10",), pre_s=0.1, duration_s=0.5)
    assert summary["reason"] == "duration"
    times, counts, _, told = stored(place)
    assert told["trigger"]["counter"] == 1001
    assert counts[0, 0] == 901
    # what had arrived by then is kept
    assert 0.5 <= times[-1] + 1 / RATE_HZ < 2.5


def test_a_trigger_too_soon_after_the_start_is_a_flag(place: Path) -> None:
    summary = recorded(place, [RisingSource(steps())], trigger=("force_a_0>0.5",), pre_s=0.2)
    assert summary["flags"] == [
        "only 51 samples before the trigger, of 200 asked for: it came too soon after the start"
    ]
    times, counts, _, _ = stored(place)
    np.testing.assert_array_equal(counts, true_counts(0, N_SAMPLES))
    assert times[51] == 0


def test_samples_lost_before_the_trigger_are_lost_and_counted_from_it(place: Path) -> None:
    everything = steps()
    del everything[65]  # 650 … 659
    summary = recorded(place, [RisingSource(everything)], trigger=("force_a_0>7",), pre_s=0.1)
    times, counts, quality, _ = stored(place)
    np.testing.assert_array_equal(np.flatnonzero(quality), np.arange(650, 660) - 601)
    assert times[100] == 0
    assert counts[0, 0] == 601
    assert any("10 samples lost" in flag for flag in summary["flags"])
    # what is lost before that is none of the recording's
    del everything[10:20]
    assert summary["sources"][0]["n_lost"] == 10


def test_no_event_is_one_line_and_leaves_nothing(place: Path) -> None:
    with pytest.raises(SourceError, match=r"--trigger force_a_0>300: got no event") as refusal:
        recorded(place, [RisingSource(steps())], trigger=("force_a_0>300",))
    assert "\n" not in str(refusal.value)
    assert [path.name for path in place.iterdir()] == ["rig.toml"]


def test_a_channel_of_another_name_is_refused_before_anything_starts(place: Path) -> None:
    with pytest.raises(InputError, match="force_a_0, force_a_1"):
        recorded(place, [RisingSource(steps())], trigger=("force_b_0>300",))
    assert [path.name for path in place.iterdir()] == ["rig.toml"]


def test_a_second_device_begins_before_the_trigger_too(place: Path) -> None:
    together = [RisingSource(steps()), RisingSource(steps(), "b")]
    recorded(place, together, trigger=("force_a_0>20",), pre_s=0.1, align="counter")
    times, counts, _, _ = stored(place)
    assert counts[np.flatnonzero(times == 0)[0], 0] == 2001
    with netCDF4.Dataset(place / "run.nc") as file:
        assert np.isfinite(np.asarray(file["force_b_0"][:], float)).sum() >= 900


class Marking(NobodyListening):
    """Sets marks when a sample has arrived; those of a negative number before any has."""

    def __init__(self, marks: Mapping[int, str]) -> None:
        self._marks = dict(marks)

    def begins(self, infos: Any, metadata: Any, mark: Callable[[str], None]) -> None:
        self._mark = mark
        for number in [at for at in self._marks if at < 0]:
            mark(self._marks.pop(number))

    def delivered(self, source: int, deliveries: Sequence[Delivery]) -> None:
        for delivery in deliveries:
            if isinstance(delivery, Block):
                for counter in [at for at in self._marks if at <= delivery.counter]:
                    self._mark(self._marks.pop(counter))


def in_real_time(n_samples: int) -> list[Any]:
    """Steps that come when their samples are due, by the clock that marks are stamped by."""
    began_ns: list[int] = []

    def due(counter: int) -> Sequence[Delivery]:
        # from the first read on: the computer may be busy before
        began_ns[:] = began_ns or [time.monotonic_ns()]
        at_ns = began_ns[0] + (counter + 10) * 1_000_000
        while time.monotonic_ns() < at_ns:
            time.sleep(0.001)
        return [Block(0, 1, counter, true_counts(counter, 10), None, at_ns, time.time_ns())]

    return [lambda counter=counter: due(counter) for counter in range(0, n_samples, 10)] + [[End(1, n_samples)]]


def marks_of(place: Path) -> list[dict[str, Any]]:
    with netCDF4.Dataset(place / "run.nc") as file:
        return json.loads(file.marks)


def test_a_mark_stands_in_the_recording_at_its_time(place: Path) -> None:
    listener = Marking({500: "impact é", 1200: "", 1300: "x" * 500 + "\n"})
    summary = recorded(place, [RisingSource(in_real_time(1500))], listener)
    assert summary["flags"] == []
    first, second, third = marks_of(place)
    assert (first["text"], second["text"], third["text"]) == ("impact é", "", "x" * 60)
    # set after its sample had arrived; how much later is up to the load of this computer
    assert 0.5 <= first["time_s"] <= second["time_s"] <= third["time_s"] <= 1.5
    assert second["time_s"] >= 1.2
    assert "marks" in read_recording(place / "run.nc").attrs


def test_marks_count_from_the_trigger_and_survive_a_crash(place: Path) -> None:
    listener = Marking({-1: "before", 1200: "after"})
    recorded(
        place, [RisingSource(in_real_time(1500))], listener,
        trigger=("force_a_0>10",), pre_s=0.2, keep_journal=True,
    )  # fmt: skip
    # the recording begins at 0.801 s
    [mark] = marks_of(place)
    assert mark["text"] == "after"
    # by the stamps themselves: the last sample of a block was due when the block says that it had been read
    with read_journal(place / "run.journal") as read:
        entry = read.entries[0, 0][0]
        since_s = (read.marks[1].host_monotonic_ns - entry.host_monotonic_ns) * 1e-9
    due_s = (entry.counter + entry.n_samples - 1 - 1001) / RATE_HZ + since_s
    assert due_s >= 0.199
    assert mark["time_s"] == pytest.approx(due_s, abs=0.002)
    # as after a kill: the last blocks are missing
    journal = place / "run.journal"
    whole = journal.read_bytes()
    (place / "cut.journal").write_bytes(whole[: len(whole) * 19 // 20])
    recover(place / "cut.journal", place / "cut.nc", False)
    with netCDF4.Dataset(place / "cut.nc") as cut:
        assert json.loads(cut.acquisition)["trigger"]["counter"] == 1001
        assert cut["time"][200] == 0
        assert cut["time"][0] == -0.2


def test_a_mark_starts_a_recording(place: Path) -> None:
    listener = Marking({800: "now"})
    recorded(place, [RisingSource(in_real_time(1500))], listener, trigger=("mark",), pre_s=0.3)
    times, counts, quality, told = stored(place)
    at = told["trigger"]["counter"]
    assert at >= 809
    assert counts[np.flatnonzero(times == 0)[0], 0] == at
    assert counts[0, 0] == at - 300
    assert not quality.any()


def test_more_marks_than_a_recording_holds_are_told_and_left_out(place: Path) -> None:
    class Flooding(NobodyListening):
        def begins(self, infos: Any, metadata: Any, mark: Callable[[str], None]) -> None:
            for number in range(MOST_MARKS + 5):
                mark(f"{number} " + "é" * 100)

    recorded(place, [RisingSource(steps())], Flooding(), keep_journal=True)
    with read_journal(place / "run.journal") as journal:
        assert len(journal.marks) == MOST_MARKS
        assert journal.n_bytes_left_out == 0
