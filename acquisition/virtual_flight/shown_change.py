"""What a hidden effect shows in the case itself: beyond retuning, and beyond another effect in its place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.optimize import lsq_linear

from acquisition.virtual_flight.described_wing import DescribedWing
from acquisition.virtual_flight.flight_test import FlightPoint
from acquisition.virtual_flight.hidden_physics import HiddenFlight
from acquisition.virtual_flight.recorded_flight import (
    ACCELEROMETER_NOISE,
    FLAP,
    NOISE,
    Laboratory,
    perfect_run,
)

FloatArray = npt.NDArray[np.float64]
_RETUNED: Final = {"bending": 0.16, "torsion": 0.16, "damping": 0.8, "actuator": 0.08}
"""Relative to the belief, as far as retuning may go: four tolerances of a model file."""
_LARGEST_GAIN: Final = 0.0125
"""The same of every sensor: more is a fault."""
_STEPS: Final = {"damping": 0.05}
_STEP: Final = 0.002
"""Of a factor, for differences; a damping shows less."""
_LINEAR: Final = 0.004
"""Change of a stiffness up to which retuning is linear: a fifth of a per cent of a frequency."""
_MOST_LINEARISED: Final = 4
OTHER_STEP: Final = 0.02
"""Relative change of the number of another effect, likewise."""


class ShownChange:
    """One case without its noise: its card, what is done in it, its laboratory.

    Parameters
    ----------
    wing : DescribedWing
    laboratory : Laboratory
    card : sequence of FlightPoint
    seed : sequence of int
        Of what is done.
    """

    def __init__(
        self, wing: DescribedWing, laboratory: Laboratory, card: Sequence[FlightPoint], seed: Sequence[int]
    ) -> None:
        self._wing, self._laboratory, self._seed = wing, laboratory, list(seed)
        self._points = [(number, point) for number, point in enumerate(card, start=1) if point.repeat == 1]
        tests = [(point.kind, point.airspeed_m_per_s, point.level) for point in card]
        # a repeat is simulated once and counts twice
        self._counts = np.array([tests.count(tests[number - 1]) for number, _ in self._points], np.float64)
        channels = [*(name for name, _, _ in wing.accelerometers), FLAP]
        self._noise = {name: NOISE.get(name, ACCELEROMETER_NOISE) for name in channels}
        self._plain = self._about(laboratory)

    def strength(self, hidden: HiddenFlight) -> float:
        """RMS over the noise of what retuning leaves, in the channel and run where that is most."""
        left = self._left(self._runs(hidden, self._laboratory))
        return float(np.sqrt((left**2).mean(axis=-1)).max())

    def told_apart(self, hidden: HiddenFlight, other: Callable[[float], HiddenFlight]) -> float:
        """Expected log-likelihood ratio of an effect against another one that is fitted in its place.

        Parameters
        ----------
        hidden : HiddenFlight
        other : callable
            Relative change of the other effect's number about its nearest → what is then hidden.
        """
        start = self._runs(other(0.0), self._laboratory)
        direction = (self._runs(other(OTHER_STEP), self._laboratory) - start) / OTHER_STEP
        left, _ = self._plain.beyond(self._runs(hidden, self._laboratory) - start, direction)
        return float(0.5 * ((left**2).sum(axis=(1, 2)) * self._counts).sum())

    def _left(self, target: FloatArray) -> FloatArray:
        """What the best laboratory leaves, about which retuning is linear: a frequency off by more is none."""
        about, best = self._plain, None
        for _ in range(_MOST_LINEARISED):
            left, factors = about.beyond(target - about.runs)
            if best is None or float((left**2).sum()) < float((best**2).sum()):
                best = left
            if all(abs(factors[name] - about.laboratory.of(name)) < _LINEAR for name in ("bending", "torsion")):
                break
            about = self._about(Laboratory({**about.laboratory.factors, **factors}))
        assert best is not None
        return best

    def _runs(self, hidden: HiddenFlight, laboratory: Laboratory) -> FloatArray:
        """All compared channels of all tests over their noise, shape (n_tests, n_channels, n)."""
        runs = [
            perfect_run(self._wing, hidden, laboratory, point, [*self._seed, number])
            for number, point in self._points
        ]
        return np.stack([np.stack([run[name] / noise for name, noise in self._noise.items()]) for run in runs])

    def _about(self, laboratory: Laboratory) -> _Retuning:
        """Retuning about a laboratory in which nothing is hidden."""
        plain = self._runs(HiddenFlight(), laboratory)
        rows, here = [], {name: laboratory.of(name) for name in (*_RETUNED, *self._noise)}
        for name in _RETUNED:
            step = _STEPS.get(name, _STEP)
            other = Laboratory({**laboratory.factors, name: here[name] + step})
            rows.append((self._runs(HiddenFlight(), other) - plain).ravel() / step)
        for k in range(len(self._noise)):
            alone = np.zeros(plain.shape)
            alone[:, k] = plain[:, k]
            rows.append(alone.ravel())
        return _Retuning(laboratory, plain, np.stack(rows), here)


@dataclass(frozen=True, eq=False)
class _Retuning:
    """Runs of a laboratory, what a unit of every believed number and gain changes, and where they are."""

    laboratory: Laboratory
    runs: FloatArray
    rows: FloatArray
    here: dict[str, float]

    def beyond(self, change: FloatArray, *directions: FloatArray) -> tuple[FloatArray, dict[str, float]]:
        """What is left of a change when retuning, and directions of any size, have taken their part; factors."""
        rows = np.vstack([self.rows, *(each.ravel()[None] for each in directions)])
        here = np.array(list(self.here.values()))
        most = np.array([_RETUNED.get(name, _LARGEST_GAIN) for name in self.here])
        free = np.full(len(directions), np.inf)
        orthonormal, triangle = np.linalg.qr(rows.T)
        bounds = (np.append(1 - most - here, -free), np.append(1 + most - here, free))
        found = lsq_linear(triangle, orthonormal.T @ change.ravel(), bounds)
        factors = dict(zip(self.here, (here + found.x[: here.size]).tolist(), strict=True))
        return np.asarray((change.ravel() - rows.T @ found.x).reshape(change.shape)), factors
