"""Sustained recording on one machine: device and recorder in two processes, nothing lost.

``python -m tests.benchmarks.sustained serial --duration 600`` plays a test pattern in real time, records
it, computes the pattern again and compares. It prints throughput, the share of one core that each
process took while samples came, and the latency from a sample to the disk. It ends with 1 if a sample
is lost or wrong, or the recorder takes more than its share. With ``--page`` the live page is open in a browser, or
in a program that takes all of it where there is no browser.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

RECORDER_SHARE_AIM = 0.60
RIG = """
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.61
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
"""
_POLL_S = 0.005
_BLOCK = 1 << 18
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True)
class Load:
    """What is played; `frames_per_s` counts CAN frames."""

    url: str
    n_channels: int
    sampling_rate_hz: int
    bits: int
    frames_per_s: int = 0

    @property
    def bytes_per_s(self) -> float:
        """Of counts."""
        return self.n_channels * self.sampling_rate_hz * self.bits / 8


LOADS = {
    "serial": Load("serial:{folder}/tty", 8, 51200, 24),
    "socketcand": Load("can:socketcand?host=127.0.0.1&port=0&channel=can0&dbc={folder}/d.dbc", 4, 4000, 16, 8000),
    "slcan": Load("can:slcan?channel={folder}/tty&dbc={folder}/d.dbc", 2, 5000, 16, 5000),
}


def main() -> None:
    """Run one transport and say how it went."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("transport", choices=[*LOADS])
    parser.add_argument("--duration", type=float, default=600.0, help="seconds")
    parser.add_argument("--page", action="store_true", help="with the live page open")
    given = parser.parse_args()
    figures = sustained(LOADS[given.transport], given.duration, has_page=given.page)
    for name, value in figures.items():
        print(f"{given.transport:<11}{name:<44}{value}")
    is_good = (
        figures["samples wrong or lost"] == 0 and figures["recorder, share of one core"] <= RECORDER_SHARE_AIM
    )
    sys.exit(0 if is_good else 1)


def sustained(load: Load, duration_s: float, *, has_page: bool = False) -> dict[str, float | int | str]:
    """Play, record, compare; figures by name, those of the live page among them if it is open."""
    with tempfile.TemporaryDirectory(prefix="sloshlab_") as name:
        folder = Path(name)
        (folder / "rig.toml").write_text(RIG)
        with _device(load, duration_s, folder) as (device, url):
            observed = _recorded(url, device, folder, has_page)
        wrong, expected_hash, found_hash = compared(folder / "run.nc", load, duration_s)
        latency_s = _latency_s(folder / "run.journal", observed, load.sampling_rate_hz)
    return {
        "samples per channel": round(duration_s * load.sampling_rate_hz),
        "samples wrong or lost": wrong,
        "hash expected": expected_hash[:16],
        "hash recorded": found_hash[:16],
        "counts [MB/s]": round(load.bytes_per_s / 1e6, 3),
        "CAN frames [1/s]": load.frames_per_s,
        "recorder, share of one core": round(observed.share("recorder"), 3),
        "device, share of one core": round(observed.share("device"), 3),
        "recorder, peak memory [MB]": round(observed.peak_bytes / 1e6),
        "sample to disk, median [s]": round(float(np.median(latency_s)), 3),
        "sample to disk, 99 % [s]": round(float(np.quantile(latency_s, 0.99)), 3),
        "sample to disk, longest [s]": round(float(latency_s.max()), 3),
        "from the last sample to the recording [s]": round(observed.finish_s, 2),
        **(observed.page_figures() if has_page else {}),
    }


def _command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "pipelines.command_line", *arguments]


@contextlib.contextmanager
def _device(load: Load, duration_s: float, folder: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    pattern = (
        f"pattern:channels={load.n_channels}&sampling_rate_hz={load.sampling_rate_hz}"
        f"&bits={load.bits}&duration_s={duration_s:g}"
    )
    command = _command("replay", pattern, "--as", load.url.format(folder=folder))
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            yield process, process.stdout.readline().removeprefix("ready ").strip()
        finally:
            process.kill()


@dataclass
class Observed:
    """What was seen from outside while the recorder ran; times on the monotonic clock [s]."""

    times_s: list[float]
    journal_bytes: list[int]
    cpu: dict[str, list[tuple[float, float]]]
    finish_s: float = 0.0
    peak_bytes: int = 0
    seen: dict[str, Any] = field(default_factory=dict)

    def page_figures(self) -> dict[str, float | int | str]:
        """What the viewer of the live page saw, and what its process cost."""
        return {
            "page, looked at by": self.seen["viewer"],
            "page, messages": self.seen["n_messages"],
            "page, samples not shown": self.seen["n_skipped"],
            "page, share of one core": round(self.share("page"), 3),
        }

    def share(self, process: str) -> float:
        """Processor time over time, while the journal grew."""
        sizes = np.array(self.journal_bytes)
        growing = np.flatnonzero(np.diff(sizes) > 0)
        first, last = self.times_s[growing[0]], self.times_s[growing[-1]]
        inside = [(t, cpu) for t, cpu in self.cpu[process] if first <= t <= last]
        return (inside[-1][1] - inside[0][1]) / (inside[-1][0] - inside[0][0])


def _recorded(url: str, device: subprocess.Popen[str], folder: Path, has_page: bool) -> Observed:
    output, journal = folder / "run.nc", folder / "run.journal"
    command = _command("record", "--source", url, "--rig", str(folder / "rig.toml"), "-o", str(output))
    command += ["--keep-journal", "--json", *(["--page"] if has_page else [])]
    recorder = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert recorder.stdout is not None
    page_url = recorder.stdout.readline().removeprefix("page ").strip() if has_page else ""
    processes = {"recorder": recorder.pid, "device": device.pid}
    if has_page:
        processes["page"] = _page_of(recorder.pid)
    observed = Observed([], [], {name: [] for name in processes})
    with _viewer(page_url, observed) if has_page else contextlib.nullcontext():
        _observe(observed, recorder, processes, journal)
    said = recorder.communicate()[0]
    if recorder.returncode != 0:
        sys.exit(f"the recorder ended with {recorder.returncode}: {said}")
    if has_page and not observed.seen:
        sys.exit("nobody saw the live page")
    summary = json.loads(said.splitlines()[-1])
    assert not summary["flags"]
    grown = np.flatnonzero(np.diff(np.array(observed.journal_bytes)) > 0)
    observed.finish_s = observed.times_s[-1] - observed.times_s[grown[-1]]
    return observed


def _observe(
    observed: Observed, recorder: subprocess.Popen[str], processes: dict[str, int], journal: Path
) -> None:
    """Look at the journal's size and at the processes until the recorder ends."""
    next_cpu = 0.0
    while recorder.poll() is None:
        now = time.monotonic()
        observed.times_s.append(now)
        observed.journal_bytes.append(journal.stat().st_size if journal.exists() else 0)
        if now >= next_cpu:
            next_cpu = now + 0.5
            for name, pid in processes.items():
                with contextlib.suppress(OSError, IndexError):
                    observed.cpu[name].append((now, _cpu_s(pid)))
            with contextlib.suppress(OSError):
                observed.peak_bytes = max(observed.peak_bytes, _resident_bytes(recorder.pid))
        time.sleep(_POLL_S)


def _page_of(pid: int) -> int:
    """The process that serves the live page of a recorder."""
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        if b"page_process" in Path(f"/proc/{child}/cmdline").read_bytes():
            return int(child)
    sys.exit("the recorder has no live page")


@contextlib.contextmanager
def _viewer(url: str, observed: Observed) -> Iterator[None]:
    """Somebody who looks at the page meanwhile."""
    command = [sys.executable, "-m", "tests.benchmarks.page_viewer", url]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as viewer:
        yield
        said = viewer.communicate(timeout=60)[0]
    # a recorder that could not begin says why itself
    observed.seen = json.loads(said.splitlines()[-1]) if said else {}


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS_PER_S


def _resident_bytes(pid: int) -> int:
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def compared(recording: Path, load: Load, duration_s: float) -> tuple[int, str, str]:
    """Samples that are not as the pattern says, and the hashes of both."""
    expected_hash, found_hash, wrong = hashlib.sha256(), hashlib.sha256(), 0
    n_samples = round(duration_s * load.sampling_rate_hz)
    with netCDF4.Dataset(recording) as source:
        source.set_auto_maskandscale(False)
        stored = [source[f"voltage_pattern_{k + 1}"] for k in range(load.n_channels)]
        wrong += abs(len(source.dimensions["time"]) - n_samples) * load.n_channels
        for start in range(0, n_samples, _BLOCK):
            stop = min(start + _BLOCK, n_samples)
            expected = pattern_counts(start, stop, load.n_channels, load.bits)
            found = np.stack([variable[start:stop].astype(np.int64) for variable in stored], axis=1)
            wrong += int((expected[: len(found)] != found).sum())
            expected_hash.update(expected.tobytes())
            found_hash.update(found.tobytes())
    return wrong, expected_hash.hexdigest(), found_hash.hexdigest()


def pattern_counts(start: int, stop: int, n_channels: int, bits: int) -> np.ndarray:
    """The published pattern, written again from its description in docs/simulated_devices.md."""
    rows = np.arange(start, stop, dtype=np.uint64).reshape(-1, 1)
    z = rows * np.uint64(256) + np.arange(n_channels, dtype=np.uint64)
    z = z + np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return z.view(np.int64) >> (64 - bits)


def _latency_s(journal_file: Path, observed: Observed, sampling_rate_hz: float) -> np.ndarray:
    """From a sample to the journal's growth past it, for the last sample of every entry.

    The device's start is not known here: it is put where the quickest entry would have needed no time.
    """
    from acquisition.recorder.journal import read_journal

    with read_journal(journal_file) as journal:
        entries = journal.entries[0, 0]
    last_sample_s = (entries.counter + entries.n_samples) / sampling_rate_hz
    start_s = (entries.host_monotonic_ns / 1e9 - last_sample_s).min()
    end = entries.offset + entries.n_samples * entries.n_channels * entries.bytes_per_count
    reached = np.searchsorted(np.array(observed.journal_bytes), end)
    seen = np.array(observed.times_s)[np.minimum(reached, len(observed.times_s) - 1)]
    return seen - start_s - last_sample_s


if __name__ == "__main__":
    main()
