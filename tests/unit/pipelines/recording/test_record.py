"""Recording as a whole: what stands in the file, what is refused beforehand, what stays after trouble."""

from __future__ import annotations

import contextlib
import errno
import functools
import signal
import threading
import time
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest

import pipelines.recording.record
from acquisition.recorder.journal import JournalWriter, read_journal
from acquisition.recorder.status import NobodyWatching, RecorderStatus
from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block, Delivery, End
from acquisition.sources.interface import Source, SourceInfo
from pipelines.recording.record import RecordSettings, record
from pipelines.recording.recover import recover
from pipelines.recording.run_attributes import checked_run_attributes
from sloshlab.errors import (
    InputError,
    JournalError,
    RecordingError,
    RecordingInterruptedError,
    RigError,
    SourceError,
)

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
N_SAMPLES = 500


def true_counts(counter: int, n_samples: int) -> np.ndarray:
    samples = np.arange(counter, counter + n_samples)[:, np.newaxis]
    return ((samples * 37 + 11 * np.arange(2)) % 4001 - 2000).astype(np.int32)


class FakeSource(Source):
    """Two force channels at 1 kHz; deliveries, or an error, one per read."""

    def __init__(
        self,
        url: str,
        steps: Sequence[Any] = (),
        on_open: Callable[[], None] | None = None,
        rate_hz: float = 1000.0,
        clock_hz: float | None = None,
    ) -> None:
        self.url, self._steps, self._on_open = url, iter(steps), on_open
        device = url.partition(":")[2]
        channels = tuple(Channel(f"force_{device}_{k}", "force", "N", 16, 0.01) for k in range(2))
        self._info = SourceInfo(device, url, rate_hz, channels, ((0, 1),), clock_hz)
        self.n_opened = self.n_closed = self.n_started = 0

    def open(self) -> None:
        self.n_opened += 1
        if self._on_open:
            self._on_open()

    @property
    def info(self) -> SourceInfo:
        return self._info

    def start(self) -> None:
        self.n_started += 1

    def read(self, timeout_s: float) -> Sequence[Delivery]:
        step = next(self._steps, ())
        if isinstance(step, BaseException):
            raise step
        return step

    def close(self) -> None:
        self.n_closed += 1


def block(counter: int, n_samples: int = 10) -> Block:
    now = 10**12 + counter * 1_000_000
    return Block(0, 1, counter, true_counts(counter, n_samples), None, now, 10**18 + now)


def complete() -> list[Any]:
    return [[block(10 * k)] for k in range(N_SAMPLES // 10)] + [[End(1, N_SAMPLES)]]


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder for the recording, with a rig beside it."""
    (tmp_path / "rig.toml").write_text(RIG, encoding="utf-8")
    return tmp_path / "out"


def settings_for(place: Path, *urls: str, **options: Any) -> RecordSettings:
    return RecordSettings(urls or ("fake:a",), place.parent / "rig.toml", place / "run.nc", **options)


def opening(*sources: FakeSource) -> Callable[[str], Source]:
    return {source.url: source for source in sources}.__getitem__


def stored_counts(path: Path, device: str = "a") -> np.ndarray:
    with netCDF4.Dataset(path) as file:
        file.set_auto_maskandscale(False)
        return np.column_stack([np.asarray(file[f"force_{device}_{k}"][:]) for k in range(2)])


def test_a_recording_holds_every_count_and_says_what_it_is(place: Path) -> None:
    given = ("experiment=shaker_sweep", "repeat=2", "acceleration_g=3.0", "operator=Ö. 7")
    summary = record(settings_for(place, attributes=given), open_source=opening(FakeSource("fake:a", complete())))
    assert summary["flags"] == []
    assert summary["reason"] == "end"
    assert [source["n_samples"] for source in summary["sources"]] == [N_SAMPLES]
    assert np.array_equal(stored_counts(place / "run.nc"), true_counts(0, N_SAMPLES))
    with netCDF4.Dataset(place / "run.nc") as file:
        assert (file.run_id, file.experiment, file.configuration) == ("run", "shaker_sweep", "sloshing")
        assert (file.rig, file.operator, file.sampling_rate_hz) == ("rig.toml", "Ö. 7", 1000.0)
        assert (int(file.repeat), float(file.acceleration_g)) == (2, 3.0)
    assert [path.name for path in place.iterdir()] == ["run.nc"]


def test_the_journal_may_stay(place: Path) -> None:
    summary = record(settings_for(place, keep_journal=True), open_source=opening(FakeSource("fake:a", complete())))
    assert summary["journal"] == str(place / "run.journal")
    with read_journal(place / "run.journal") as journal:
        assert journal.closed_cleanly
        assert journal.metadata["attributes"]["run_id"] == "run"


def test_a_source_that_dies_is_a_flag_and_the_rest_is_there(place: Path) -> None:
    dying = FakeSource("fake:b", [[block(0, 100)], SourceError("fake:b", got="an unplugged cable")])
    sources = opening(FakeSource("fake:a", complete()), dying)
    summary = record(settings_for(place, "fake:a", "fake:b", align="counter"), open_source=sources)
    assert any("unplugged cable" in flag for flag in summary["flags"])
    assert np.array_equal(stored_counts(place / "run.nc"), true_counts(0, N_SAMPLES))
    assert np.array_equal(stored_counts(place / "run.nc", "b")[:100], true_counts(0, 100))
    assert summary["sources"][1]["state"] == "failed"


def test_a_lost_block_is_a_flag(place: Path) -> None:
    steps = complete()
    del steps[20]
    summary = record(settings_for(place), open_source=opening(FakeSource("fake:a", steps)))
    assert any("10 samples lost" in flag for flag in summary["flags"])
    with netCDF4.Dataset(place / "run.nc") as file:
        assert np.flatnonzero(np.asarray(file["quality"][:]) & 1).tolist() == list(range(200, 210))


@pytest.mark.parametrize("problem", [SourceError("fake:b", got="nobody"), KeyboardInterrupt()])
def test_nothing_is_left_when_a_source_cannot_be_opened(place: Path, problem: BaseException) -> None:
    def fail() -> None:
        raise problem

    first, second = FakeSource("fake:a", complete()), FakeSource("fake:b", on_open=fail)
    with pytest.raises(type(problem)):
        record(settings_for(place, "fake:a", "fake:b"), open_source=opening(first, second))
    assert not place.exists()
    assert first.n_closed >= 1
    assert second.n_closed >= 1


def test_sources_without_a_sample_leave_one_error_and_no_file(place: Path) -> None:
    source = FakeSource("fake:a", [SourceError("fake:a", got="an unplugged cable")])
    with pytest.raises(SourceError, match="unplugged cable"):
        record(settings_for(place), open_source=opening(source))
    with pytest.raises(SourceError, match="not one sample"):
        record(settings_for(place), open_source=opening(FakeSource("fake:a", [[End(1, 0)]])))
    assert list(place.iterdir()) == []


def never(url: str) -> Source:
    raise AssertionError(f"{url} was opened")


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"duration_s": 0.0}, InputError, "--duration"),
        ({"duration_s": float("nan")}, InputError, "--duration"),
        ({"align": "guess"}, InputError, "--align"),
        ({"redundant": ("a",)}, InputError, "--redundant"),
        ({"redundant": ("a:a",)}, InputError, "--redundant"),
        ({"attributes": ("repeat",)}, InputError, "KEY=VALUE"),
        ({"attributes": ("repeat=often",)}, RecordingError, "repeat"),
        ({"attributes": ("experiment=party",)}, RecordingError, "experiment"),
        ({"attributes": ("bad name=1",)}, InputError, "bad name"),
        ({"attributes": ("sloshlab_format=2",)}, RecordingError, "sloshlab_format"),
        ({"run": Path("nowhere.toml")}, InputError, "nowhere.toml"),
        ({"rig": Path("nowhere.toml")}, RigError, "nowhere.toml"),
        ({"sources": ()}, InputError, "0 sources"),
        ({"sources": ("fake:a", "fake:a")}, InputError, "same source twice"),
        ({"output": Path("run.journal")}, InputError, "suffix of journals"),
    ],
)
def test_refused_before_a_device_is_touched(place: Path, options: dict, error: type, message: str) -> None:
    known = {"sources": ("fake:a",), "rig": place.parent / "rig.toml", "output": place / "run.nc"}
    with pytest.raises(error, match=message):
        record(RecordSettings(**{**known, **options}), open_source=never)


@pytest.mark.parametrize(
    ("options", "second", "message"),
    [
        (
            {"align": "counter"},
            {"rate_hz": 999.0},
            "alignment by counter of b: got 999 Hz beside 1000 Hz.*--align",
        ),
        ({"align": "device"}, {"clock_hz": None}, "alignment by device clock of b: got no device clock.*--align"),
        ({"redundant": ("force_a_0:force_b_9",)}, {}, "force_a_0:force_b_9.*force_a_0, force_a_1"),
        ({"redundant": ("force_b_0:force_b_1",)}, {}, "one of another"),
    ],
)
def test_what_cannot_be_aligned_is_refused_before_a_device_starts(
    place: Path, options: dict, second: dict, message: str
) -> None:
    sources = [
        FakeSource("fake:a", complete(), clock_hz=1e6),
        FakeSource("fake:b", complete(), **{"clock_hz": 1e6, **second}),
    ]
    with pytest.raises(InputError, match=message) as error:
        record(settings_for(place, "fake:a", "fake:b", **options), open_source=opening(*sources))
    assert "\n" not in str(error.value)
    assert [source.n_started for source in sources] == [0, 0]
    assert all(source.n_closed for source in sources)
    assert not place.exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"units": "m"}, "force_b_0: units of a force: got 'm'"),
        ({"units": ""}, "force_b_0: units of a force: got ''"),
        ({"quantity": "pressure"}, "force_b_0.*pressure"),
        ({"name": "force/b"}, "force/b.*letters, digits"),
    ],
)
def test_channels_that_no_recording_can_hold_are_refused_before_a_device_starts(
    place: Path, change: dict, message: str
) -> None:
    sources = [FakeSource("fake:a", complete()), FakeSource("fake:b", complete())]
    first, second = sources[1].info.channels
    sources[1]._info = replace(sources[1].info, channels=(replace(first, **change), second))
    with pytest.raises(InputError, match=message) as error:
        record(settings_for(place, "fake:a", "fake:b"), open_source=opening(*sources))
    assert "\n" not in str(error.value)
    assert [source.n_started for source in sources] == [0, 0]
    assert not place.exists()


def test_a_duration_that_no_reader_takes_is_refused_before_a_device_starts(place: Path) -> None:
    # two channels, time and quality at 1 kHz, eight bytes each: 6 GiB are 201 326.6 s, of which 2 % are kept back
    source = FakeSource("fake:a", complete())
    with pytest.raises(InputError, match=r"--duration: got 201000 s; allowed: ≤ 197300 s.*several recordings"):
        record(settings_for(place, duration_s=201_000.0), open_source=opening(source))
    assert source.n_started == 0
    assert not place.exists()
    record(settings_for(place, duration_s=197_300.0), open_source=opening(FakeSource("fake:a", complete())))


def test_a_recording_ends_before_no_reader_takes_it(place: Path, monkeypatch) -> None:
    """A device without an end, and room for 30 s: 30 000 samples of time and quality and two channels."""
    room = int(30_000 * 4 * 8 / 0.98)
    monkeypatch.setattr("acquisition.recorder.longest_recording.MAXIMUM_DECODED_BYTES", room)

    def endless() -> Iterator[list[Block]]:
        for k in range(10**9):
            yield [block(1000 * k, 1000)]
            time.sleep(0.001)

    summary = record(settings_for(place), open_source=opening(FakeSource("fake:a", endless())))
    assert summary["reason"] == "too_long"
    assert any("could not be read" in flag for flag in summary["flags"])
    n_samples = summary["report"]["n_samples"]
    assert n_samples >= 30_000
    assert np.array_equal(stored_counts(place / "run.nc"), true_counts(0, n_samples))


@pytest.mark.parametrize("pair", ["force_a_0:force_b_1", "force_b_1:force_a_0"])
def test_a_pair_may_be_named_in_either_order(place: Path, pair: str) -> None:
    sources = opening(FakeSource("fake:a", complete()), FakeSource("fake:b", complete()))
    record(settings_for(place, "fake:a", "fake:b", redundant=(pair,), align="counter"), open_source=sources)
    assert np.array_equal(stored_counts(place / "run.nc", "b"), true_counts(0, N_SAMPLES))


@pytest.mark.parametrize("name", ["run.nc", "run.journal"])
def test_what_is_there_stays_unless_it_may_go(place: Path, name: str) -> None:
    place.mkdir()
    (place / name).write_bytes(b"of yesterday")
    with pytest.raises((InputError, JournalError), match="recover" if name == "run.journal" else "--overwrite"):
        record(settings_for(place), open_source=never)
    assert (place / name).read_bytes() == b"of yesterday"
    record(settings_for(place, overwrite=True), open_source=opening(FakeSource("fake:a", complete())))
    assert [path.name for path in place.iterdir()] == ["run.nc"]


def test_a_file_where_a_folder_should_be_is_refused(place: Path) -> None:
    place.write_bytes(b"")
    with pytest.raises(InputError, match="which is a file; allowed: a folder"):
        record(settings_for(place), open_source=never)


class Interrupting(NobodyWatching):
    """Sends a signal when some samples have come."""

    def __init__(self, number: int) -> None:
        self._number = number

    def status(self, status: RecorderStatus) -> None:
        if status.sources[0].n_samples and not status.is_stopping:
            signal.raise_signal(self._number)


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_ends_the_recording_and_keeps_all(place: Path, name: str) -> None:
    number = getattr(signal, name)
    n_delivered = 0

    def endless() -> Iterator[list[Block]]:
        nonlocal n_delivered
        while True:
            n_delivered += 10
            yield [block(n_delivered - 10)]
            time.sleep(0.001)

    before = signal.getsignal(number)
    summary = record(
        settings_for(place), Interrupting(number), open_source=opening(FakeSource("fake:a", endless()))
    )
    assert signal.getsignal(number) is before
    assert summary["reason"] == "requested"
    assert summary["flags"] == []
    assert np.array_equal(stored_counts(place / "run.nc"), true_counts(0, n_delivered))


def test_an_interrupt_before_the_first_sample_leaves_nothing(place: Path, monkeypatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(pipelines.recording.record, "Recorder", interrupted)
    with pytest.raises(KeyboardInterrupt):
        record(settings_for(place), open_source=opening(FakeSource("fake:a")))
    assert list(place.iterdir()) == []


class FullDisk:
    def __init__(self, path: Path, _: bool) -> None:
        self._file, self._free = path.open("xb", buffering=0), 3000

    def write(self, data: bytes | memoryview, /) -> int:
        if not self._free:
            raise OSError(errno.ENOSPC, "No space left on device")
        n_bytes = self._file.write(bytes(data[: self._free]))
        self._free -= n_bytes
        return n_bytes

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


def test_a_full_disk_leaves_the_journal_and_says_how_to_go_on(place: Path, monkeypatch) -> None:
    monkeypatch.setattr(
        pipelines.recording.record, "JournalWriter", functools.partial(JournalWriter, open_file=FullDisk)
    )
    # every second counter, so that nothing is joined and some blocks are complete
    steps = [[block(20 * k)] for k in range(500)]
    with pytest.raises(
        JournalError, match=r"No space left on device.*sloshlab recover .*run\.journal -o "
    ) as error:
        record(settings_for(place), open_source=opening(FakeSource("fake:a", steps)))
    assert "\n" not in str(error.value)
    assert [path.name for path in place.iterdir()] == ["run.journal"]
    with read_journal(place / "run.journal") as journal:
        assert len(journal.entries[0, 0]) > 3


@pytest.mark.parametrize(
    ("problem", "error", "message"),
    [
        (KeyboardInterrupt(), RecordingInterruptedError, "interrupted before"),
        (JournalError("assembly"), JournalError, "^assembly; "),
    ],
)
def test_the_journal_stays_when_the_recording_cannot_be_written(
    place: Path, monkeypatch, problem, error, message
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise problem

    monkeypatch.setattr(pipelines.recording.record, "assemble", fail)
    recovery = rf"{message}.*every sample is in .*run\.journal; .*sloshlab recover .*run\.journal -o .*run\.nc$"
    with pytest.raises(error, match=recovery):
        record(settings_for(place), open_source=opening(FakeSource("fake:a", complete())))
    with read_journal(place / "run.journal") as journal:
        assert journal.closed_cleanly
        assert int(journal.entries[0, 0].n_samples.sum()) == N_SAMPLES


def compressed_streams(data: bytes) -> Iterator[tuple[int, int]]:
    """Length and place of the zlib streams in a file."""
    for start in (k for k in range(len(data)) if data[k] == 0x78):
        stream = zlib.decompressobj()
        with contextlib.suppress(zlib.error):
            stream.decompress(data[start:])
            if stream.eof:
                yield len(data) - start - len(stream.unused_data), start


def test_a_recording_that_cannot_be_read_back_keeps_the_journal(place: Path, monkeypatch) -> None:
    original = pipelines.recording.record.assemble

    def damaging(journal, output: Path, **more):
        summary = original(journal, output, **more)
        data = bytearray(output.read_bytes())
        length, start = max(compressed_streams(bytes(data)))
        data[start + length // 2] ^= 0xFF
        output.write_bytes(data)
        return summary

    monkeypatch.setattr(pipelines.recording.record, "assemble", damaging)
    # the damaged recording is in the way of the recovered one
    with pytest.raises(JournalError, match=r"cannot be read back.*sloshlab recover .* --overwrite$"):
        record(settings_for(place), open_source=opening(FakeSource("fake:a", complete())))
    assert (place / "run.journal").exists()


def test_a_stated_rate_must_be_that_of_the_device(place: Path) -> None:
    with pytest.raises(InputError, match="sampling_rate_hz"):
        record(
            settings_for(place, attributes=("sampling_rate_hz=999",)),
            open_source=opening(FakeSource("fake:a", complete())),
        )
    record(
        settings_for(place, attributes=("sampling_rate_hz=1000",)),
        open_source=opening(FakeSource("fake:a", complete())),
    )


def test_attributes_are_taken_from_table_and_command(tmp_path: Path) -> None:
    table = tmp_path / "run.toml"
    table.write_text('[run]\nrepeat = 3\nrun_id = "7"\nacceleration_g = 1\n[other]\nx = 1\n', encoding="utf-8")
    given = ["acceleration_g=2.5", "run_id=12", "temperature_c=21", "comment=1e5 m", "flag=nan"]
    assert checked_run_attributes(Path("a.nc"), Path("r/rig.toml"), table, given) == {
        "run_id": "12",
        "experiment": "other",
        "configuration": "sloshing",
        "rig": "rig.toml",
        "repeat": 3,
        "acceleration_g": 2.5,
        "temperature_c": 21,
        "comment": "1e5 m",
        "flag": "nan",
    }


@pytest.mark.parametrize(
    "text", ["a = [1]", "a = true", "a = {b = 1}", "run = 3", "a =", "a = 99999999999999999999"]
)
def test_tables_that_cannot_be_attributes_are_refused(tmp_path: Path, text: str) -> None:
    table = tmp_path / "run.toml"
    table.write_text(text, encoding="utf-8")
    with pytest.raises(InputError):
        checked_run_attributes(Path("a.nc"), Path("rig.toml"), table, [])


def second_recorder(place: Path, said: list[str], **options: Any) -> None:
    """Another recorder that is to write the same recording: what it is told."""
    try:
        record(settings_for(place, **options), open_source=opening(FakeSource("fake:a", complete())))
    except JournalError as error:
        said.append(str(error))
    else:
        said.append("recorded")


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_second_recorder_never_takes_a_live_journal(place: Path, monkeypatch, overwrite: bool) -> None:
    """Neither while the first records nor while it makes its recording of the journal."""
    said: list[str] = []
    original = pipelines.recording.record.assemble

    def recording() -> Iterator[list[Delivery]]:
        for number, deliveries in enumerate(complete()):
            if number == 20:
                second_recorder(place, said, overwrite=overwrite)
            yield deliveries

    def assembling(*arguments: Any, **more: Any) -> Any:
        second_recorder(place, said, overwrite=overwrite)
        return original(*arguments, **more)

    monkeypatch.setattr(pipelines.recording.record, "assemble", assembling)
    summary = record(settings_for(place), open_source=opening(FakeSource("fake:a", recording())))
    assert len(said) == 2
    assert all("got the journal of a recorder that is running" in text for text in said)
    assert not any("cut short" in text or "--overwrite" in text for text in said)
    assert summary["flags"] == []
    assert np.array_equal(stored_counts(place / "run.nc"), true_counts(0, N_SAMPLES))
    assert [path.name for path in place.iterdir()] == ["run.nc"]


def test_of_two_recorders_that_start_at_once_one_records(place: Path) -> None:
    for _ in range(20):
        said: list[str] = []
        at_once = threading.Barrier(2)

        def start(said: list[str] = said, at_once: threading.Barrier = at_once) -> None:
            source = FakeSource("fake:a", complete(), on_open=at_once.wait)
            try:
                record(settings_for(place, overwrite=True), open_source=opening(source))
            except JournalError as error:
                said.append(str(error))
            else:
                said.append("recorded")

        threads = [threading.Thread(target=start) for _ in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        # the second may also come when the first is done
        assert said.count("recorded") >= 1
        assert all(text == "recorded" or "a recorder that is running" in text for text in said), said
        assert np.array_equal(stored_counts(place / "run.nc"), true_counts(0, N_SAMPLES))
        assert [path.name for path in place.iterdir()] == ["run.nc"]


@pytest.mark.parametrize("name", ["run.nc", "run.journal"])
@pytest.mark.parametrize("linked", ["symbolic", "hard", "dangling"])
def test_overwriting_never_writes_through_a_link(place: Path, name: str, linked: str) -> None:
    place.mkdir()
    precious = place.parent / "precious"
    if linked != "dangling":
        precious.write_bytes(b"of yesterday")
    (place / name).hardlink_to(precious) if linked == "hard" else (place / name).symlink_to(precious)
    if linked != "dangling" or name == "run.journal":
        with pytest.raises((InputError, JournalError), match="--overwrite"):
            record(settings_for(place), open_source=never)
    record(
        settings_for(place, overwrite=True, keep_journal=True),
        open_source=opening(FakeSource("fake:a", complete())),
    )
    assert precious.exists() == (linked != "dangling")
    assert not precious.exists() or precious.read_bytes() == b"of yesterday"
    assert not any(path.is_symlink() for path in place.iterdir())
    assert np.array_equal(stored_counts(place / "run.nc"), true_counts(0, N_SAMPLES))


def test_a_journal_that_somebody_removes_is_not_claimed_to_be_there(place: Path) -> None:
    def recording() -> Iterator[list[Delivery]]:
        yield from complete()[:20]
        (place / "run.journal").unlink()

    with pytest.raises(JournalError, match="removed by somebody else") as error:
        record(settings_for(place, duration_s=0.2), open_source=opening(FakeSource("fake:a", recording())))
    assert "every sample is in" not in str(error.value)
    assert "sloshlab recover" not in str(error.value)


def test_a_live_journal_can_be_recovered_into_another_file(place: Path) -> None:
    """The recorder goes on undisturbed, and the summary says that it does."""
    found: dict[str, Any] = {}

    def recording() -> Iterator[list[Delivery]]:
        for number, deliveries in enumerate(complete()):
            if number == 40:
                # what is joined reaches the journal after a quarter of a second
                time.sleep(0.6)
                yield []
                time.sleep(0.2)
                with pytest.raises(InputError, match="which still runs, will write it"):
                    recover(place / "run.journal", place / "run.nc")
                found.update(recover(place / "run.journal", place / "so_far.nc"))
            yield deliveries

    summary = record(settings_for(place), open_source=opening(FakeSource("fake:a", recording())))
    assert "its recorder still runs" in found["lines"][0]
    assert "the recorder still runs" in found["flags"][0]
    assert np.array_equal(stored_counts(place / "so_far.nc"), true_counts(0, 400))
    assert summary["flags"] == []
    assert np.array_equal(stored_counts(place / "run.nc"), true_counts(0, N_SAMPLES))
