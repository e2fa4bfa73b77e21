"""Where channels of runs are missed over time and frequency, linked to the time histories of the same page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pipelines.report.interactive.packed import packed

FloatArray = npt.NDArray[np.float64]
_MOST_CELLS: Final = 6000
"""Of one channel: more are smaller than what a finger or a mouse can point at."""
_N_STRETCHES: Final = 8


@dataclass(frozen=True, eq=False)
class MissedChannel:
    """One channel of one run.

    Attributes
    ----------
    name : str
    time_s : ndarray, shape (n_blocks,)
        Middles of the blocks, evenly spaced.
    frequency_hz : ndarray, shape (n_bands,)
        Middles of the bands, evenly spaced from half a band.
    misfit : tuple of ndarray, shape (n_blocks, n_bands)
        One per model; what is drawn is its logarithm.
    """

    name: str
    time_s: FloatArray
    frequency_hz: FloatArray
    misfit: tuple[FloatArray, ...]

    def plain(self) -> dict[str, Any]:
        """As JSON has it; of many blocks, neighbours as the largest of them."""
        n_blocks, n_bands = self.misfit[0].shape
        width = max(1, -(-n_blocks * n_bands // _MOST_CELLS))
        step_s = float(np.diff(self.time_s).mean()) if n_blocks > 1 else 1.0
        merged = [merged_blocks(misfit, width) for misfit in self.misfit]
        worst = np.argsort(-merged[0].sum(axis=1), kind="stable")[:_N_STRETCHES]
        return {
            "name": self.name,
            "start": float(self.time_s[0]) - 0.5 * step_s,
            "interval": width * step_s,
            "band": 2 * float(self.frequency_hz[0]),
            "blocks": merged[0].shape[0],
            "models": [packed(drawn(misfit).T) for misfit in merged],
            "stretches": [int(block) for block in worst if merged[0][block].sum() > 0],
        }


@dataclass(frozen=True, eq=False)
class MissedRun:
    """Channels of one run; `group` is what it was used for."""

    name: str
    group: str
    channels: tuple[MissedChannel, ...]


@dataclass(frozen=True, eq=False)
class MisfitMap:
    """Maps of chosen runs, channels and models; a cell chooses run, channel and stretch of other histories.

    Attributes
    ----------
    title, label : str
        Of the figure and of its colours.
    models : tuple of str
    runs : tuple of MissedRun
    colours : tuple of str
        From nothing missed to the most.
    histories : str
        Name of the figure of the same page whose runs and channels have these names.
    caption : str
    """

    title: str
    label: str
    models: tuple[str, ...]
    runs: tuple[MissedRun, ...]
    colours: tuple[str, ...]
    histories: str
    caption: str

    def plain(self) -> dict[str, Any]:
        """As JSON has it."""
        every = [drawn(misfit) for run in self.runs for channel in run.channels for misfit in channel.misfit]
        return {
            "kind": "misfit",
            "title": self.title,
            "label": self.label,
            "models": list(self.models),
            "runs": [
                {"name": run.name, "group": run.group, "channels": [each.plain() for each in run.channels]}
                for run in self.runs
            ],
            "colours": list(self.colours),
            "high": max([0.1, *(float(values.max(initial=0.0)) for values in every)]),
            "histories": self.histories,
        }


def drawn(misfit: FloatArray) -> FloatArray:
    """What the colours mean: log₁₀(1 + misfit)."""
    return np.asarray(np.log10(1 + misfit))


def merged_blocks(misfit: FloatArray, width: int) -> FloatArray:
    """The largest of every `width` blocks, shape (ceil(n_blocks / width), n_bands).

    Examples
    --------
    >>> merged_blocks(np.array([[1.0], [3.0], [2.0]]), 2).tolist()
    [[3.0], [2.0]]
    """
    if not misfit.shape[0]:
        return misfit
    return np.asarray(np.maximum.reduceat(misfit, np.arange(0, misfit.shape[0], width), axis=0))
