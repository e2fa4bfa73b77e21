"""What a driver lost, from the port to the recording: journal, flags and missing samples."""

from __future__ import annotations

import struct
import sys
import threading
from pathlib import Path

import netCDF4
import numpy as np
import pytest

from acquisition.recorder.journal import read_journal
from acquisition.samples.delivery import TroubleKind
from pipelines.recording.record import RecordSettings, record
from pipelines.recording.replay import ReplaySettings, replay
from sloshlab.recording import LOST

fcntl = pytest.importorskip("fcntl", reason="counters of Linux")
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="counters of Linux")

PATIENCE_S = 60.0
RIG = Path(__file__).parents[2] / "raw_data" / "shaker" / "rig_fill_0.50.toml"
TIOCGICOUNT = 0x545D
OVERRUN, BUFFER_OVERRUN = 7, 10


class Driver:
    """The one system call that a pseudo-terminal has no answer to: a port that loses more at every look."""

    def __init__(self) -> None:
        self.n_asked, self._real = 0, fcntl.ioctl

    def ioctl(self, descriptor: int, request: int, argument: object = 0, *more: object) -> object:
        if request != TIOCGICOUNT:
            return self._real(descriptor, request, argument, *more)
        self.n_asked += 1
        counts = [0] * 20
        counts[OVERRUN], counts[BUFFER_OVERRUN] = 1000 + 2 * self.n_asked, 500
        return struct.pack("<20i", *counts)


def test_what_the_driver_lost_is_in_journal_flags_and_quality(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver, ready = Driver(), threading.Event()
    monkeypatch.setattr("fcntl.ioctl", driver.ioctl)
    (tmp_path / "faults.toml").write_text("[drop]\nat_counters = [50]\n")
    device = ReplaySettings(
        source="pattern:channels=2&sampling_rate_hz=500&duration_s=2",
        urls=[f"serial:{tmp_path / 'tty'}"],
        faults=[tmp_path / "faults.toml"],
        samples_per_frame=10,
        speed="max",
    )
    playing = threading.Thread(target=replay, args=(device,), kwargs={"announce": lambda line: ready.set()})
    playing.start()
    assert ready.wait(PATIENCE_S)
    settings = RecordSettings(tuple(device.urls), RIG, tmp_path / "run.nc", keep_journal=True)
    summary = record(settings)
    playing.join(PATIENCE_S)
    # two more at each look after the first, which sees what had been lost before
    n_lost = 2 * (driver.n_asked - 1)
    assert n_lost > 0
    assert f"{n_lost} × {TroubleKind.OVERRUN.value}" in summary["flags"]
    with read_journal(tmp_path / "run.journal") as journal:
        assert journal.trouble_counts == {(0, "OVERRUN"): n_lost}
        assert "overruns of the port" in journal.troubles[0][1].detail
    with netCDF4.Dataset(tmp_path / "run.nc") as file:
        assert np.flatnonzero(np.asarray(file["quality"][:]) & LOST).tolist() == list(range(50, 60))
