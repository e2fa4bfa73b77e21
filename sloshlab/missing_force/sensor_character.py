"""Character of the error of a sensor that contradicts the others: gain, rate, trend, mains, clock, clipping, …"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.identification.observations import Observation
from sloshlab.missing_force.latent_force import RunForces
from sloshlab.missing_physics.evidence import (
    CLOCK_DRIFT,
    FOLLOWS_OTHER_CHANNEL,
    MAINS_LINE,
    PROPORTIONAL_TO_INTEGRAL,
    PROPORTIONAL_TO_RATE,
    PROPORTIONAL_TO_READING,
    SATURATING,
    SINGLE_CHANNEL,
    TREND,
)
from sloshlab.recording import channels

FloatArray = NDArray[np.float64]
_N_PARTS: Final = 8
"""Stretches of a run that are resampled as wholes (block bootstrap)."""
_N_DRAWS: Final = 120
_LEAST_SHARE: Final = 0.3
"""Of the variance of the error that a form must explain to hold."""
_SHARE_MARGIN: Final = 0.1
"""Below the best form, within which a form may hold, too."""
_MAINS_HZ: Final = (50.0, 60.0)


@dataclass(frozen=True)
class SensorAnswer:
    """How much of a sensor's error one form explains, alone.

    Attributes
    ----------
    term : str
        Of `evidence.SENSOR_TERMS`.
    share, low, high : float
        Of its variance, with the 90 % interval.
    holds : bool or None
        None where it is open.
    """

    term: str
    share: float
    low: float
    high: float
    holds: bool | None


def sensor_character(
    runs: Sequence[Sequence[Observation]], found: Sequence[RunForces], channel: str, seed: int = 0
) -> tuple[SensorAnswer, ...]:
    """Regress the error of a channel on the forms that faults of sensors have.

    Parameters
    ----------
    runs : sequence of sequences of Observation
        Per run.
    found : sequence of RunForces
        Of the same runs, the channel left out.
    channel : str
    seed : int
        Of the draws for intervals.
    """
    parts: dict[str, list[tuple[float, float]]] = {}
    for observed, forces in zip(runs, found, strict=True):
        observation = next((each for each in observed if each.channel == channel), None)
        if observation is None or channel not in forces.left:
            continue
        error = forces.left[channel]
        for term, columns in _forms(observation, error).items():
            parts.setdefault(term, []).extend(_explained(error, columns))
    generator = np.random.default_rng(seed)
    shares = {term: _share(table, generator) for term, table in parts.items()}
    if not shares:
        return ()
    top = max(share for share, _, _ in shares.values())
    answers = [SensorAnswer(SINGLE_CHANNEL, 1.0, 1.0, 1.0, True)]
    for term, (share, low, high) in sorted(shares.items(), key=lambda item: -item[1][0]):
        holds = None
        if low > _LEAST_SHARE and share > top - _SHARE_MARGIN:
            holds = True
        elif high < top - _SHARE_MARGIN or high < _SHARE_MARGIN:
            holds = False
        answers.append(SensorAnswer(term, share, low, high, holds))
    return tuple(answers)


def decided_terms(answers: Sequence[SensorAnswer]) -> dict[str, bool]:
    """Terms that hold, and that do not."""
    return {answer.term: answer.holds for answer in answers if answer.holds is not None}


def _forms(observation: Observation, error: FloatArray) -> Mapping[str, FloatArray]:
    """Features of each form, shape (n, k) each."""
    recording = observation.run.recording
    rate = observation.run.attributes.sampling_rate_hz
    reading = np.nan_to_num(np.asarray(recording[observation.channel].values, np.float64))
    # What the other sensors say, not what this one reads: a regression on a faulty reading is biased towards its
    # fault.
    truth = reading - error
    truth = truth - (0.0 if observation.keeps_mean else truth.mean())
    time = np.arange(truth.size) / rate
    time = time - time.mean()
    slope = np.gradient(truth) * rate
    integral = np.cumsum(truth - truth.mean()) / rate
    # An integral drifts by what the zero of the reading is off; the trend is a form of its own.
    integral = integral - np.polyval(np.polyfit(time, integral, 1), time)
    # A sensor that clips reads its limit as its largest value.
    limit = float(np.abs(reading).max())
    lines = [part for line in _MAINS_HZ if line < 0.5 * rate for part in _line(line, time)]
    forms = {
        PROPORTIONAL_TO_READING: truth[:, None],
        PROPORTIONAL_TO_RATE: slope[:, None],
        PROPORTIONAL_TO_INTEGRAL: integral[:, None],
        TREND: np.stack([np.ones_like(time), time], axis=1),
        CLOCK_DRIFT: (time * slope)[:, None],
        SATURATING: (truth - np.clip(truth, -limit, limit))[:, None],
    }
    if lines:
        forms[MAINS_LINE] = np.stack(lines, axis=1)
    others = [
        np.nan_to_num(np.asarray(recording[name].values, np.float64))
        for name in channels(recording)
        if name != observation.channel
        and recording[name].attrs.get("quantity") != recording[observation.channel].attrs["quantity"]
    ]
    if others:
        forms[FOLLOWS_OTHER_CHANNEL] = np.stack([other - other.mean() for other in others], axis=1)
    return forms


def _line(frequency_hz: float, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    phase = 2 * np.pi * frequency_hz * time
    return np.cos(phase), np.sin(phase)


def _explained(error: FloatArray, columns: FloatArray) -> list[tuple[float, float]]:
    """Per part of a run: what one fit to the whole run leaves, and what there was."""
    size = np.sqrt(np.mean(columns**2, axis=0))
    used = columns[:, size > 0] / size[size > 0]
    rest = error
    if used.shape[1]:
        rest = error - used @ np.linalg.lstsq(used, error, rcond=None)[0]
    pieces = np.array_split(np.arange(error.size), _N_PARTS)
    return [(float((rest[piece] ** 2).sum()), float((error[piece] ** 2).sum())) for piece in pieces]


def _share(table: Sequence[tuple[float, float]], generator: np.random.Generator) -> tuple[float, float, float]:
    sums = np.array(table)

    def share(rows: NDArray[np.int64]) -> float:
        left, whole = sums[rows].sum(axis=0)
        return float(1 - left / max(whole, 1e-300))

    n = sums.shape[0]
    value = share(np.arange(n))
    low, high = np.quantile(
        [share(np.asarray(generator.integers(0, n, n))) for _ in range(_N_DRAWS)], (0.05, 0.95)
    )
    return value, float(min(low, value)), float(max(high, value))
