"""Judges a recording sample by sample: right, flagged, or silently wrong."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
from matrix_recordings import NAMES
from numpy.typing import NDArray

LOST, CLIPPED, OUT_OF_ORDER, STUCK = 1, 2, 8, 16
"""Flags as the recording format has them."""

REMOVED_BY = ("drop", "corrupt", "overrun", "disconnect", "unheard")
"""Faults after which a sample cannot arrive."""


@dataclass(frozen=True)
class Recorded:
    """What one recording is judged by.

    Attributes
    ----------
    path : Path
        The recording.
    summary : dict
        What `sloshlab record --json` said last.
    device : dict
        What the device says that it did.
    bases : sequence of int
        Counter of the truth's sample 0 in each stream; negative after a restart.
    groups : sequence of sequence of str
        Channels that travel in one frame.
    expected, tolerance : ndarray, shape (n_samples, n_channels)
        Counts that are right, and how far off they may be.
    told : str or None
        Words in the flags of the summary that say of all samples that something is wrong with them.
    """

    path: Path
    summary: dict[str, Any]
    device: dict[str, Any]
    bases: Sequence[int]
    groups: Sequence[Sequence[str]]
    expected: NDArray[np.float64]
    tolerance: NDArray[np.float64]
    told: str | None = None


@dataclass
class Verdict:
    """Readings – one sample of one channel – by what became of them.

    Attributes
    ----------
    n_readings : int
        That the device took, or would have taken with its plug in; the sum of the following four.
    n_right, n_lost, n_flagged, n_wrong : int
        Right; missing and said so; wrong and said so; wrong or missing without a word.
    n_invented : int
        Readings in the file where the device never took or never sent one.
    n_given_up : int
        Of the lost ones those that were sent.
    n_late : int
        Rows flagged as out of order.
    n_not_shown : int
        Samples without a place in the file: they fell into a gap between two streams.
    flags : list of str
        Of the summary.
    complaints : list of str
        What else is not as it must be.
    """

    n_readings: int
    n_right: int = 0
    n_lost: int = 0
    n_flagged: int = 0
    n_wrong: int = 0
    n_invented: int = 0
    n_given_up: int = 0
    n_late: int = 0
    n_not_shown: int = 0
    flags: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)


def verdict(run: Recorded) -> Verdict:
    """Judge a recording."""
    counts, is_lost, quality = _file(run.path)
    sample_of_row = _samples_of_rows(run, len(quality))
    n_samples = len(run.expected)
    found = Verdict(run.expected.size, flags=run.summary["flags"])
    inside = (sample_of_row >= 0) & (sample_of_row < n_samples)
    found.n_invented = int((~is_lost[~inside]).sum())
    rows, samples = np.flatnonzero(inside), sample_of_row[inside]
    if len(np.unique(samples)) < len(samples):
        found.complaints.append("one sample has two places")
    lost = np.ones(run.expected.shape, np.bool_)
    lost[samples] = is_lost[rows]
    is_said = np.zeros(run.expected.shape, np.bool_)
    is_said[samples] = (quality[rows] & LOST > 0)[:, None]
    removed = _removed(run)
    is_shown = np.zeros(n_samples, np.bool_)
    is_shown[samples] = True
    found.n_not_shown = int((~is_shown).sum())
    # between two streams no row is any certain sample; the summary must say so
    is_said[~is_shown] = any("restarted at" in flag for flag in found.flags)
    off = np.zeros(run.expected.shape, np.bool_)
    off[samples] = np.abs(counts[rows] - run.expected[samples]) > run.tolerance[samples]
    off &= ~lost
    is_marked = np.zeros(n_samples, np.bool_)
    marks = CLIPPED | STUCK
    if any("out of order on a line that damages frames" in flag for flag in found.flags):
        marks |= OUT_OF_ORDER
    is_marked[samples] = quality[rows] & marks > 0
    is_told = run.told is not None and any(run.told in flag for flag in found.flags)
    marked = is_marked[:, None] | is_told
    found.n_right = int((~lost & ~off).sum())
    found.n_lost = int((lost & is_said).sum())
    found.n_flagged = int((off & marked).sum())
    found.n_wrong = int((off & ~marked).sum() + (lost & ~is_said).sum())
    found.n_invented += int((removed & ~lost).sum())
    found.n_given_up = int((lost & ~removed).sum())
    found.n_late = int((quality & OUT_OF_ORDER > 0).sum())
    _check_flags_against_file(found, is_lost, quality)
    _check_marks(run, found, off, quality[rows], samples)
    _check_summary(run, found, is_lost)
    return found


def _file(path: Path) -> tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.uint8]]:
    with netCDF4.Dataset(path) as file:
        file.set_auto_maskandscale(False)
        columns = [file.variables[name] for name in NAMES]
        counts = np.stack([np.asarray(column[:]).astype(np.int64) for column in columns], axis=1)
        fills = np.array([int(column.getncattr("_FillValue")) for column in columns])
        quality = np.asarray(file.variables["quality"][:])
    return counts, counts == fills, quality


def _samples_of_rows(run: Recorded, n_rows: int) -> NDArray[np.int64]:
    """Number of the truth's sample that each row shows; −1 between two streams."""
    found = np.full(n_rows, -1, np.int64)
    (streams,) = run.summary["report"]["clocks"].values()
    assert len(streams) == len(run.bases), f"{len(streams)} streams, {len(run.bases)} expected"
    for stream, base in zip(streams, run.bases, strict=True):
        start, n = stream["first_index"], stream["n_samples"]
        assert (found[start : start + n] == -1).all(), "two streams in one place"
        found[start : start + n] = stream["first_counter"] - base + np.arange(n)
    return found


def _removed(run: Recorded) -> NDArray[np.bool_]:
    """Readings that a fault kept from arriving, as the device says."""
    removed = np.zeros(run.expected.shape, np.bool_)
    (streams,) = run.summary["report"]["clocks"].values()
    base_of = {stream["stream"] % 256: base for stream, base in zip(streams, run.bases, strict=True)}
    assert run.device["places_left_out"] == 0
    for place in run.device["places"]:
        if place["fault"] in REMOVED_BY:
            first = place["counter"] - base_of[place["stream"]]
            columns = [NAMES.index(name) for name in run.groups[place["group"]]]
            removed[first : first + place["n_samples"], columns] = True
    return removed


def _check_flags_against_file(found: Verdict, is_lost: NDArray[np.bool_], quality: NDArray[np.uint8]) -> None:
    said, is_so = quality & LOST > 0, is_lost.any(axis=1)
    if (is_so & ~said).any():
        found.complaints.append(f"{int((is_so & ~said).sum())} rows with lost readings are not flagged")
    if (said & ~is_so).any():
        found.complaints.append(f"{int((said & ~is_so).sum())} rows are flagged as lost without cause")


def _check_marks(
    run: Recorded, found: Verdict, off: NDArray[np.bool_], quality: NDArray[np.uint8], samples: NDArray[np.int64]
) -> None:
    """Marks stand where something is wrong, or where a sensor that is stuck has the count that it would have."""
    wrong = np.flatnonzero(off.any(axis=1))
    column = int(off.any(axis=0).argmax())
    for bit, name in ((CLIPPED, "clipped"), (STUCK, "stuck")):
        said = samples[quality & bit > 0]
        if not len(said):
            continue
        beside = [range(said.min(), wrong.min()), range(wrong.max() + 1, said.max() + 1)] if len(wrong) else []
        if not beside or any(len(np.unique(run.expected[part, column])) > 1 for part in beside):
            found.complaints.append(f"samples {said.min()} … {said.max()} are flagged as {name} without cause")
    if found.n_late and not {"reorder", "corrupt"} & set(run.device):
        found.complaints.append(f"{found.n_late} samples are flagged as out of order without cause")


def _check_summary(run: Recorded, found: Verdict, is_lost: NDArray[np.bool_]) -> None:
    report = run.summary["report"]
    in_file = {name: int(is_lost[:, column].sum()) for column, name in enumerate(NAMES)}
    if report["n_lost"] != in_file:
        found.complaints.append(f"the summary says {json.dumps(report['n_lost'])}, the file {json.dumps(in_file)}")
    by_group = sum(in_file[group[0]] for group in run.groups)
    if report["losses"]["n_samples"] != by_group:
        found.complaints.append(f"losses of {report['losses']['n_samples']} samples, {by_group} in the file")
    if run.summary["reason"] != "end":
        found.complaints.append(f"the recording ended with {run.summary['reason']!r}")
