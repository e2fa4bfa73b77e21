"""How strongly an effect shows: what remains after the baseline was retuned, over the noise floor.

The floor of a channel is what two runs of one test differ by, over √2, plus the sensor's noise. What an effect
changes is projected on what retuning could change instead – the baseline's parameters, gains within calibration –
and the remainder's RMS over the floor, in the channel where it is largest, is the strength.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
from scipy.optimize import lsq_linear

from sealed_trial.case_signals import Laboratory
from sealed_trial.hidden_physics.effect import Signals
from sealed_trial.laboratory.hidden_rig import GAIN_TOLERANCE
from sealed_trial.laboratory.sensors import Sensor

FloatArray = npt.NDArray[np.float64]

_STEP = 0.2
_THINNED = 3
_DEEPEST_DAMPING, _HIGHEST_DAMPING = -0.95, 6.0
QUICK = 1e-7
"""Tolerance of the integrator where only the size of an effect matters."""

ONLY_DAMPING = ("viscous_damping", "structural_damping", "unknown")
"""Effects that damping beyond its tolerance would hide by definition."""


class NoiseFloor:
    """Floors of all channels and the directions in which a baseline can be retuned.

    Parameters
    ----------
    laboratory : Laboratory
    plain : sequence of dict
        Its signals without anything hidden.
    sensors : dict
    """

    def __init__(self, laboratory: Laboratory, plain: Sequence[Signals], sensors: dict[str, Sensor]) -> None:
        self._laboratory, self._plain = laboratory, plain
        self.floor = {name: self._floor_of(name, sensors) for name in plain[0]}
        columns, self._limits = self._directions()
        self._orthogonal, self._triangle = np.linalg.qr(columns)

    def _floor_of(self, name: str, sensors: dict[str, Sensor]) -> float:
        runs = self._laboratory.plan.runs
        scatter = []
        for i, first in enumerate(runs):
            for j in range(i + 1, len(runs)):
                if runs[j].test == first.test:
                    scatter.append(np.mean((self._plain[i][name] - self._plain[j][name]) ** 2) / 2)
        return float(np.sqrt((np.mean(scatter) if scatter else 0.0) + sensors[name].noise ** 2))

    def _stacked(self, runs: Sequence[Signals]) -> FloatArray:
        return np.concatenate(
            [run[name][::_THINNED] / floor for name, floor in self.floor.items() for run in runs]
        )

    def _directions(self) -> tuple[FloatArray, list[tuple[str, float]]]:
        """Columns per unit of relative change, and the name and tolerance of each."""
        reference = self._stacked(self._plain)
        columns, limits = [], []
        for name, tolerance in self._laboratory.rig.tunable.items():
            step = tolerance * _STEP
            changed = Laboratory(
                self._laboratory.rig.with_factor(name, 1 + step), self._laboratory.plan, self._laboratory.seed
            )
            columns.append((self._stacked(changed.signals(relative_tolerance=QUICK)) - reference) / step)
            limits.append((name, tolerance))
        for name in self.floor:
            only = [
                {key: values if key == name else 0 * values for key, values in run.items()} for run in self._plain
            ]
            columns.append(self._stacked(only))
            limits.append((f"gain {name}", GAIN_TOLERANCE))
        return np.stack(columns, axis=1), limits

    def strength(self, changed: Sequence[Signals], *, damping_is_known: bool) -> float:
        """Largest remainder of any channel over its floor.

        Parameters
        ----------
        changed : sequence of dict
            Signals with the effect.
        damping_is_known : bool
            Whether damping may be retuned within its tolerance only.
        """
        difference = self._stacked(changed) - self._stacked(self._plain)
        lower, upper = [], []
        for name, tolerance in self._limits:
            free = "damping" in name and not damping_is_known
            lower.append(_DEEPEST_DAMPING if free else -tolerance)
            upper.append(_HIGHEST_DAMPING if free else tolerance)
        fit = lsq_linear(self._triangle, self._orthogonal.T @ difference, (lower, upper), method="bvls")
        remainder = difference - self._orthogonal @ (self._triangle @ fit.x)
        per_channel = remainder.size // len(self.floor)
        return float(np.sqrt((remainder.reshape(len(self.floor), per_channel) ** 2).mean(axis=1)).max())


def magnitude_for(
    strength_of: Callable[[float], float], wanted: float, least: float, most: float, *, tolerance: float = 0.08
) -> tuple[float, float]:
    """Magnitude with a wanted strength and the strength reached, by secants on logarithmic axes.

    Where the bounds of the magnitude do not reach it, the nearer bound.
    """
    known: list[tuple[float, float]] = []
    magnitude = float(np.clip(1.0, least, most))
    for _ in range(9):
        reached = max(strength_of(magnitude), 1e-9)
        known.append((magnitude, reached))
        if abs(np.log(reached / wanted)) < tolerance:
            break
        below = max((k for k in known if k[1] < wanted), default=None)
        above = min((k for k in known if k[1] >= wanted), default=None)
        if below is not None and above is not None:
            share = np.log(wanted / below[1]) / np.log(above[1] / below[1])
            proposal = below[0] * (above[0] / below[0]) ** float(np.clip(share, 0.1, 0.9))
        else:
            proposal = magnitude * float(np.clip(wanted / reached, 1 / 30, 30))
        proposal = float(np.clip(proposal, least, most))
        if abs(np.log(proposal / magnitude)) < 1e-3:
            break
        magnitude = proposal
    return min(known, key=lambda k: abs(np.log(k[1] / wanted)))
