"""Lost samples: where they are, and which samples may be used.

A sample of a channel is lost where its value is NaN. Where `quality` says "lost" but no channel is
NaN, it is not known which value is wrong, and all channels are taken as lost there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from numba import njit

from sloshlab.errors import AnalysisError
from sloshlab.out_of_core import blocks, empty, release
from sloshlab.recording import LOST, channels

BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Gap:
    """A run of lost samples.

    Attributes
    ----------
    start_s, stop_s : float
        Times of the first and the last lost sample.
    n_samples : int
        Number of lost samples.
    """

    start_s: float
    stop_s: float
    n_samples: int


def sampling_step_s(data: xr.Dataset | xr.DataArray) -> float:
    """Mean step of the (uniform) time coordinate [s].

    Raises
    ------
    AnalysisError
        If there are fewer than two samples.
    """
    time = data["time"].values
    if time.size < 2:
        raise AnalysisError("number of samples", got=str(time.size), allowed="≥ 2", remedy="record again")
    # over the whole length: single differences of a long time coordinate have lost digits
    return float((time[-1] - time[0]) / (time.size - 1))


def sample_is_usable(recording: xr.Dataset, names: Sequence[str] | None = None) -> BoolArray:
    """True where every named channel has a value that was really measured.

    Parameters
    ----------
    recording : xarray.Dataset
        A recording; `quality(time)` is used where present.
    names : sequence of str, optional
        Channels to ask for; all channels if not given. A sample lost in one channel only does not
        cost the others.

    Returns
    -------
    ndarray of bool, shape (n_samples,)

    Raises
    ------
    AnalysisError
        If a named channel is not in the recording.
    """
    usable: BoolArray = empty(recording.sizes["time"], np.bool_)
    for part, of_part in _usable_blocks(recording, names):
        usable[part] = of_part
        release(usable[part])
    return usable


def _usable_blocks(recording: xr.Dataset, names: Sequence[str] | None) -> Iterator[tuple[slice, BoolArray]]:
    """Blocks of samples, and which of them may be used."""
    everything = channels(recording)
    wanted = everything if names is None else list(names)
    require_channels(recording, wanted)
    values = {name: recording[name].values for name in {*everything, *wanted}}
    flags = recording["quality"].values if "quality" in recording else np.zeros(0, np.uint8)
    for part in blocks(recording.sizes["time"], *values.values(), *([flags] if flags.size else [])):
        usable = np.ones(part.stop - part.start, dtype=np.bool_)
        for name in wanted:
            mark_nan(values[name][part], usable)
        # all channels are looked at here, also when few were asked for: a flag belongs to the sample, not to a
        # channel
        usable[_flagged_without_nan(flags[part], [values[name][part] for name in everything])] = False
        yield part, usable


def gaps(recording: xr.Dataset, names: Sequence[str] | None = None) -> tuple[Gap, ...]:
    """Runs of samples that are lost in at least one of the named channels, in order of time."""
    time, found = recording["time"].values, list[list[int]]()
    for part, usable in _usable_blocks(recording, names):
        for start, stop in (part.start + run_bounds(usable, False)).tolist():
            # what reaches the end of a block goes on in the next
            if found and found[-1][1] == start:
                found[-1][1] = stop
            else:
                found.append([start, stop])
    return tuple(Gap(float(time[start]), float(time[stop - 1]), stop - start) for start, stop in found)


def runs(mask: BoolArray, value: bool) -> list[tuple[int, int]]:
    """(start, stop) of the stretches where `mask` equals `value`, stop exclusive.

    Examples
    --------
    >>> runs(np.array([True, False, False, True]), False)
    [(1, 3)]
    """
    return [(start, stop) for start, stop in run_bounds(mask, value).tolist()]


def run_bounds(mask: BoolArray, value: bool) -> npt.NDArray[np.int64]:
    """The same as an array, shape (n, 2): thousands of them cost no Python object each.

    Examples
    --------
    >>> run_bounds(np.array([True, False, False, True]), True).tolist()
    [[0, 1], [3, 4]]
    """
    is_value = np.zeros(mask.size + 2, dtype=np.bool_)
    is_value[1:-1] = mask if value else ~mask
    return np.flatnonzero(is_value[1:] != is_value[:-1]).reshape(-1, 2)


def longest_whole_stretch(usable: BoolArray) -> slice:
    """The longest stretch of usable samples, the first of several; empty if there is none.

    Examples
    --------
    >>> longest_whole_stretch(np.array([True, False, True, True]))
    slice(2, 4, None)
    """
    return slice(*max(runs(usable, True), key=lambda stretch: stretch[1] - stretch[0], default=(0, 0)))


def require_channels(recording: xr.Dataset, names: Sequence[str]) -> None:
    """Refuse to go on when a channel is missing, naming it and those there are."""
    missing = [name for name in names if name not in recording.data_vars]
    if missing:
        raise AnalysisError(
            f"channel {', '.join(missing)}",
            got="not in the recording",
            allowed=", ".join(channels(recording)) or "none is there",
            remedy="correct the name, or the channel map of the import",
        )


def _flagged_without_nan(flags: npt.NDArray[np.uint8], values: Sequence[npt.NDArray[np.floating]]) -> Any:
    """Indices flagged as lost where no channel is NaN."""
    flagged = np.flatnonzero(flags & LOST)
    # what some channel explains by its NaN costs that channel only
    for of_channel in values:
        if flagged.size == 0:
            break
        flagged = flagged[~np.isnan(of_channel[flagged])]
    return flagged


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def mark_nan(values: npt.NDArray[np.float64], usable: BoolArray) -> None:
    """Set `usable` to False where `values` is NaN; one pass, nothing allocated."""
    for i in range(values.size):
        # true for NaN only; no array of flags is made
        if values[i] != values[i]:
            usable[i] = False
