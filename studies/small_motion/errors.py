"""Errors of networks by the strength of the motion and by its zero crossings, with errors of their own.

Forces are compared up to `BAND_HZ`, beyond the fundamental and below the splashes. Two computations of one motion
from two starts of the liquid say what the motion does not decide.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.reduced_order_model.amplitude_weights import local_amplitude
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from studies.small_motion.campaign import MODEL_RATE_HZ
from studies.small_motion.motion import LEVELS_G, stages
from studies.small_motion.networks import N_DELAYS, Predictor
from studies.small_motion.windows import lacks_crossing

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Sums = dict[str, FloatArray]
"""Sums over the samples of each block, shape (n_blocks,), or (n_networks, n_blocks)."""

BAND_HZ: Final = 30.0
CLASSES_G: Final = ((0.0, 0.25), (0.25, 0.5), (0.5, 1.0), (1.0, 2.0), (2.0, 3.0), (3.0, 9.0))
FINE_G: Final = np.geomspace(0.1, 6.0, 19)
"""Within a bin motions with and without a zero crossing are equally strong."""
BEGINNING_S: Final = 2.0
"""Of a run, which does not count: the liquid was at rest."""
BLOCK_S: Final = 3.0
FEWEST_S: Final = 2.0
"""Of a class of amplitude that is told."""
HISTORY_S: Final = 0.4
CHANGED: Final = 1.3
STAGE_BLOCK_S: Final = 1.0
RATIOS: Final = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 3.0)
"""Constant velocity over the amplitude of the fast one."""


@dataclass(frozen=True)
class Measured:
    """A number and its standard error.

    Attributes
    ----------
    value, error : float
    """

    value: float
    error: float

    def as_list(self) -> list[float]:
        """For a file."""
        return [round(self.value, 5), round(self.error, 5)]


def in_band(force_n: FloatArray) -> FloatArray:
    """A force at the rate of the models up to `BAND_HZ`, without delay; zero where it is not known."""
    sections = butter(4, BAND_HZ, fs=MODEL_RATE_HZ, output="sos")
    return np.asarray(sosfiltfilt(sections, np.nan_to_num(force_n)), np.float64)


@dataclass(frozen=True)
class Judged:
    """A motion, what two liquids said of it, and what networks say.

    Attributes
    ----------
    velocity_m_per_s, acceleration_g : ndarray, shape (n,)
    truths_n : ndarray, shape (n_liquids, n)
        One computation or recording, or two from two starts.
    networks_n : ndarray, shape (n_networks, n)
    counts : ndarray of bool, shape (n,)
        Samples that count.
    """

    velocity_m_per_s: FloatArray
    acceleration_g: FloatArray
    truths_n: FloatArray
    networks_n: FloatArray
    counts: BoolArray

    @classmethod
    def of(
        cls,
        truths: Sequence[LiquidSignals],
        networks: Sequence[Predictor],
        offset_m_per_s: FloatArray | float = 0.0,
    ) -> Judged:
        """Simulate a motion with networks.

        Parameters
        ----------
        truths : sequence of LiquidSignals
            Of one motion.
        networks : sequence of Predictor
        offset_m_per_s : ndarray or float
            Added to the velocity that the networks see: slow enough not to matter to the liquid.
        """
        first = truths[0]
        n = min(signals.velocity_m_per_s.size for signals in truths)
        velocity = first.velocity_m_per_s[:n]
        said = np.stack([network.simulate(velocity + offset_m_per_s) for network in networks])
        forces = np.stack([signals.dynamic_force_n[:n] for signals in truths])
        counts = np.isfinite(said).all(axis=0) & np.isfinite(forces).all(axis=0) & np.isfinite(velocity)
        counts &= np.arange(n) >= BEGINNING_S * MODEL_RATE_HZ
        return cls(
            np.nan_to_num(velocity),
            np.nan_to_num(first.acceleration_m_per_s2[:n]) / GRAVITY_M_PER_S2,
            np.stack([in_band(force) for force in forces]),
            np.stack([in_band(force) for force in said]),
            counts,
        )

    @property
    def amplitude_g(self) -> FloatArray:
        """Local amplitude of what a network sees."""
        return local_amplitude(self.acceleration_g, N_DELAYS)

    def sums(self, chosen: BoolArray, block_s: float = BLOCK_S) -> Sums:
        """Sums over the samples that are chosen and count, block by block.

        Parameters
        ----------
        chosen : ndarray of bool, shape (n,)
        block_s : float
        """
        use = chosen & self.counts
        block = np.arange(use.size) // round(block_s * MODEL_RATE_HZ)
        mean = self.truths_n.mean(axis=0)
        squared = np.mean((self.networks_n[:, None] - self.truths_n[None]) ** 2, axis=1)
        # the difference of two computations has twice the variance of what the motion does not decide
        undecided = self.truths_n.var(axis=0, ddof=1) if len(self.truths_n) > 1 else np.zeros(use.size)
        quantities = {
            "n": np.ones(use.size),
            "force": np.mean(self.truths_n**2, axis=0),
            "undecided": undecided,
            "squared_velocity": self.velocity_m_per_s**2,
            "work": -mean * self.velocity_m_per_s,
            "error": squared,
            "said_work": -self.networks_n * self.velocity_m_per_s,
        }
        return {name: _by_block(values, use, block) for name, values in quantities.items()}


def _by_block(values: FloatArray, use: BoolArray, block: NDArray[np.int64]) -> FloatArray:
    rows = np.atleast_2d(values)
    sums = [np.bincount(block[use], row[use], minlength=int(block[-1]) + 1) for row in rows]
    found = np.asarray(np.stack(sums), np.float64)
    return found if values.ndim == 2 else np.asarray(found[0])


def joined(parts: Sequence[Sums]) -> Sums:
    """Blocks of several runs behind each other."""
    return {name: np.concatenate([part[name] for part in parts], axis=-1) for name in parts[0]}


Statistic = Callable[[Mapping[str, Any]], Any]
"""From sums over all blocks, those of networks of shape (n_networks,), a number for each network, or one."""


def estimated(sums: Sums, statistic: Statistic) -> Measured:
    """Mean of a statistic over networks, and its error: blocks left out in turn, and scatter of the networks.

    Parameters
    ----------
    sums : dict
    statistic : callable
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        totals = {name: values.sum(axis=-1) for name, values in sums.items()}
        by_network = np.atleast_1d(statistic(totals))
        used = np.flatnonzero(sums["n"] > 0)
        left = np.array(
            [
                np.mean(statistic({name: totals[name] - values[..., k] for name, values in sums.items()}))
                for k in used
            ]
        )
    if used.size < 2:
        return Measured(float(np.mean(by_network)), float("nan"))
    # jackknife (Quenouille 1956; Tukey 1958)
    squared = (used.size - 1) / used.size * np.sum((left - left.mean()) ** 2)
    if by_network.size > 1:
        squared += np.var(by_network, ddof=1) / by_network.size
    return Measured(float(np.mean(by_network)), float(np.sqrt(squared)))


def relative_error(sums: Mapping[str, Any]) -> Any:
    """RMS error over RMS force."""
    return np.sqrt(sums["error"] / sums["force"])


def floor(sums: Mapping[str, Any]) -> Any:
    """What the motion does not decide, RMS over RMS force."""
    return np.sqrt(sums["undecided"] / sums["force"])


def excess(sums: Mapping[str, Any]) -> Any:
    """RMS error beyond what the motion does not decide, over RMS force; negative where it is below."""
    squared = (sums["error"] - sums["undecided"]) / sums["force"]
    return np.sign(squared) * np.sqrt(np.abs(squared))


def work_ratio(sums: Mapping[str, Any]) -> Any:
    """Dissipated work of the network over that of the liquid."""
    return sums["said_work"] / sums["work"]


STATISTICS: Final[dict[str, Statistic]] = {
    "error": relative_error,
    "floor": floor,
    "excess": excess,
    "work": work_ratio,
}


def by_amplitude(runs: Sequence[Judged]) -> dict[str, dict[str, list[float]]]:
    """Statistics in each class of local amplitude, over all runs."""
    found = {}
    for low, high in CLASSES_G:
        parts = [run.sums((run.amplitude_g >= low) & (run.amplitude_g < high)) for run in runs]
        sums = joined(parts)
        if sums["n"].sum() < FEWEST_S * MODEL_RATE_HZ:
            continue
        found[f"{low:g}–{high:g}"] = {
            "seconds": [round(float(sums["n"].sum()) / MODEL_RATE_HZ, 1), 0.0],
            "rms_n": [round(float(np.sqrt(sums["force"].sum() / sums["n"].sum())), 4), 0.0],
            **{name: estimated(sums, statistic).as_list() for name, statistic in STATISTICS.items()},
        }
    return found


def gains(runs: Sequence[Judged], reference: Sequence[Judged]) -> dict[str, list[float]]:
    """ln of the error over that of other networks in the same samples, start by start, in each class of amplitude.

    Parameters
    ----------
    runs, reference : sequence of Judged
        The same motions with as many networks.
    """
    found = {}
    for low, high in CLASSES_G:
        parts, others = (
            joined([run.sums((run.amplitude_g >= low) & (run.amplitude_g < high)) for run in group])
            for group in (runs, reference)
        )
        if parts["n"].sum() < FEWEST_S * MODEL_RATE_HZ:
            continue
        both = {"n": parts["n"], "error": parts["error"], "other": others["error"]}
        estimate = estimated(both, lambda sums: np.log(sums["error"] / sums["other"]) / 2)
        found[f"{low:g}–{high:g}"] = estimate.as_list()
    return found


def crossing_ratio(runs: Sequence[Judged], signal: str, what: str = "error") -> Measured:
    """Mean square error without a zero crossing over that with one, at the same local amplitude.

    Parameters
    ----------
    runs : sequence of Judged
    signal : {"velocity", "acceleration"}
        Whose half waves cross zero or not.
    what : {"error", "undecided", "force"}
        What is compared; "error" is of the networks.
    """
    without, with_crossing = [], []
    for low, high in itertools.pairwise(FINE_G):
        pair = []
        for lacks in (True, False):
            parts = []
            for run in runs:
                values = run.velocity_m_per_s if signal == "velocity" else run.acceleration_g
                chosen = (run.amplitude_g >= low) & (run.amplitude_g < high) & (lacks_crossing(values) == lacks)
                parts.append(run.sums(chosen))
            pair.append(joined(parts))
        without.append(pair[0])
        with_crossing.append(pair[1])
    stacked = {
        "n": np.sum([each["n"] for each in without], axis=0),
        "without_n": np.stack([each["n"] for each in without]),
        "with_n": np.stack([each["n"] for each in with_crossing]),
        "without": np.stack([np.atleast_2d(each[what]) for each in without]),
        "with": np.stack([np.atleast_2d(each[what]) for each in with_crossing]),
    }

    def ratio(sums: Mapping[str, Any]) -> Any:
        known = (sums["without_n"] > 0) & (sums["with_n"] > 0)
        # what motions with a crossing would make of as many samples of each strength
        expected = sums["without_n"][known, None] * sums["with"][known] / sums["with_n"][known, None]
        return sums["without"][known].sum(axis=0) / expected.sum(axis=0)

    return estimated(stacked, ratio)


def share_without_crossing(runs: Sequence[Judged], signal: str) -> float:
    """Share of the samples whose half wave does not cross zero."""
    lacking = total = 0
    for run in runs:
        values = run.velocity_m_per_s if signal == "velocity" else run.acceleration_g
        lacking += int(np.sum(lacks_crossing(values) & run.counts))
        total += int(run.counts.sum())
    return lacking / total


def step_at_g(runs: Sequence[Judged], what: str = "error") -> Measured:
    """Natural logarithm of the error at 1 … 1.25 g over that at 0.8 … 1 g, less the mean of both steps beside.

    Parameters
    ----------
    runs : sequence of Judged
    what : {"error", "undecided"}
        Of the networks, or of what the motion does not decide.

    Notes
    -----
    Classes of equal ratio: 0.64, 0.8, 1, 1.25, 1.56 g. Below 1 g the total acceleration does not cross zero.
    """
    edges = 1.25 ** np.arange(-3.0, 4.0)
    classes = []
    for low, high in itertools.pairwise(edges):
        classes.append(joined([run.sums((run.amplitude_g >= low) & (run.amplitude_g < high)) for run in runs]))
    stacked = {
        "n": np.sum([each["n"] for each in classes], axis=0),
        "error": np.stack([np.atleast_2d(each[what]) for each in classes]),
        "force": np.stack([each["force"] for each in classes]),
    }

    def step(sums: Mapping[str, Any]) -> Any:
        logarithm = np.log(sums["error"] / sums["force"][:, None]) / 2
        steps = np.diff(logarithm, axis=0)
        return steps[2] - (steps[1] + steps[3]) / 2

    return estimated(stacked, step)


def by_history(runs: Sequence[Judged]) -> dict[str, dict[str, list[float]]]:
    """Damping coefficients [N s/m] of liquid and networks where the local amplitude is 0.5 … 1 g, by what it was.

    Parameters
    ----------
    runs : sequence of Judged

    Returns
    -------
    dict
        For motion that is by `CHANGED` smaller, as large, or larger than `HISTORY_S` before.
    """
    lag = round(HISTORY_S * MODEL_RATE_HZ)
    found = {}
    ranges = {"falling": (0.0, 1 / CHANGED), "steady": (1 / CHANGED, CHANGED), "growing": (CHANGED, np.inf)}
    for name, (low, high) in ranges.items():
        parts = []
        for run in runs:
            before = np.concatenate([np.full(lag, np.nan), run.amplitude_g[:-lag]])
            ratio = run.amplitude_g / np.maximum(before, 1e-6)
            small = (run.amplitude_g >= 0.5) & (run.amplitude_g < 1.0)
            parts.append(run.sums(small & (ratio >= low) & (ratio < high)))
        sums = joined(parts)
        found[name] = {
            "seconds": [round(float(sums["n"].sum()) / MODEL_RATE_HZ, 1), 0.0],
            "liquid": estimated(sums, lambda totals: totals["work"] / totals["squared_velocity"]).as_list(),
            "network": estimated(sums, lambda totals: totals["said_work"] / totals["squared_velocity"]).as_list(),
            "error": estimated(sums, relative_error).as_list(),
        }
    return found


def carried_stages(run: Judged) -> dict[str, dict[str, Any]]:
    """Statistics at each level of the carried motion, alone and on the slow motion."""
    level, is_carried = stages(MODEL_RATE_HZ, run.counts.size)
    found = {}
    for level_g in LEVELS_G:
        at = {
            name: run.sums((level == level_g) & (is_carried == on), STAGE_BLOCK_S)
            for name, on in (("alone", False), ("carried", True))
        }
        found[f"{level_g:g}"] = {
            **{
                name: {key: estimated(sums, statistic).as_list() for key, statistic in STATISTICS.items()}
                for name, sums in at.items()
            },
            "change": _change(at["carried"], at["alone"]).as_list(),
        }
    return found


def _change(now: Sums, before: Sums) -> Measured:
    """ln of the error now over the error before."""
    first, second = (
        estimated(sums, lambda totals: np.log(totals["error"] / totals["force"]) / 2) for sums in (now, before)
    )
    return Measured(first.value - second.value, float(np.hypot(first.error, second.error)))


def offset_errors(
    truths: Sequence[LiquidSignals], networks: Sequence[Predictor]
) -> dict[str, dict[str, list[float]]]:
    """Error at each level of the carried motion alone over a constant velocity that only the networks see."""
    level, is_carried = stages(MODEL_RATE_HZ, truths[0].velocity_m_per_s.size)
    velocity = np.nan_to_num(truths[0].velocity_m_per_s)
    found: dict[str, dict[str, list[float]]] = {}
    for level_g in LEVELS_G:
        here = (level == level_g) & ~is_carried
        amplitude = float(np.sqrt(2) * np.std(velocity[here]))
        at_level = {}
        for ratio in RATIOS:
            judged = Judged.of(truths, networks, ratio * amplitude)
            sums = judged.sums(here[: judged.counts.size], STAGE_BLOCK_S)
            at_level[f"{ratio:g}"] = estimated(sums, relative_error).as_list()
        found[f"{level_g:g}"] = at_level
    return found
