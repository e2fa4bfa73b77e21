"""How strongly an effect shows: what remains after the baseline was retuned, over the noise floor.

The floor of a channel is what two runs of one test differ by, over √2, plus the sensor's noise. What an effect
changes is projected on what retuning could change instead – the baseline's parameters, gains, releases, offsets
and mode shapes, each as far from the belief as a careful diagnosis regards as possible – and the remainder's RMS
over the floor, in the channel where it is largest, is the strength. Retuning is linear about a baseline; where it
goes far, the baseline is linearised there again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.optimize import lsq_linear

from sealed_trial.case_signals import Laboratory
from sealed_trial.hidden_physics.effect import Signals
from sealed_trial.laboratory.hidden_rig import FREQUENCY_TOLERANCE, GAIN_TOLERANCE, HiddenRig
from sealed_trial.laboratory.sensors import Sensor

FloatArray = npt.NDArray[np.float64]

STILL_POSSIBLE: Final = 1.25
"""Tolerances about the belief within which a careful diagnosis regards a value as possible."""
RELEASE_TOLERANCE: Final = 0.03
"""Of the size of a release; recordings state none."""
OFFSET_TOLERANCE: Final = 0.01
"""Zero of a displacement, of the largest reading."""
SHAPE_TOLERANCE: Final = 0.02
"""Of a mode between root and tip, of its value at the tip."""

_STEP = 0.2
_THINNED = 3
_LEAST_DAMPING, _MOST_DAMPING = 0.05, 7.0
# changes of a factor up to which a baseline serves: taken as linear to 0.4 % of a frequency, a rocking base that
# retuning hides to 0.7 noise floors looked like 20
_STAYS_LINEAR, _STAYS_LINEAR_IN_FREQUENCY = 0.2, 0.001
_RELINEARISED_AT_ONCE, _SCANNED = 3, 13
_MOST_BASELINES: Final = {"sdof": 7, "beam": 5, "shaker": 4}
"""Of an effect; a beam's are costly."""
_HIDDEN, _WORTHWHILE = 0.25, 0.9
STRENGTH_TOLERANCE: Final = 0.08
"""Of the logarithm of a strength."""
LEAST_STRENGTH: Final = 1e-9
"""So that every strength has a logarithm."""
QUICK = 1e-8
"""Tolerance of the integrator where only the size of an effect matters."""

ONLY_DAMPING = ("viscous_damping", "structural_damping", "unknown")
"""Effects that damping beyond its tolerance would hide by definition."""


@dataclass(frozen=True, eq=False)
class _Direction:
    """What a unit of retuning changes, and how far it may go about this baseline."""

    name: str
    column: FloatArray
    least: float
    most: float


@dataclass(frozen=True, eq=False)
class _Baseline:
    """Signals of a rig, stacked, and its directions with their columns factored."""

    rig: HiddenRig
    reference: FloatArray
    directions: tuple[_Direction, ...]
    orthogonal: FloatArray
    triangle: FloatArray


@dataclass(frozen=True, eq=False)
class _Retuned:
    """What remains of a change about a baseline, and the rig that hides the rest."""

    strength: float
    rig: HiddenRig
    is_near: bool


class NoiseFloor:
    """Floors of all channels and the baselines about which a laboratory can be retuned.

    Parameters
    ----------
    laboratory : Laboratory
    plain : sequence of dict
        Its signals without anything hidden.
    sensors : dict
    """

    def __init__(self, laboratory: Laboratory, plain: Sequence[Signals], sensors: dict[str, Sensor]) -> None:
        self._laboratory, self._sensors = laboratory, sensors
        self.floor = {name: self._floor_of(name, plain) for name in plain[0]}
        self._baselines = [self._linearised(laboratory, plain)]
        self._frequencies: dict[str, list[tuple[float, FloatArray]]] = {}

    def start_anew(self) -> None:
        """Forget where baselines were linearised again, for another effect."""
        del self._baselines[1:]

    def _floor_of(self, name: str, plain: Sequence[Signals]) -> float:
        runs = self._laboratory.plan.runs
        scatter = []
        for i, first in enumerate(runs):
            for j in range(i + 1, len(runs)):
                if runs[j].test == first.test:
                    scatter.append(np.mean((plain[i][name] - plain[j][name]) ** 2) / 2)
        return float(np.sqrt((np.mean(scatter) if scatter else 0.0) + self._sensors[name].noise ** 2))

    def _stacked(self, runs: Sequence[Signals]) -> FloatArray:
        """All channels over their floors, thinned, without the instant of a release: one sample shows nothing."""
        every = slice(_THINNED, None, _THINNED)
        return np.concatenate([run[name][every] / floor for name, floor in self.floor.items() for run in runs])

    def _linearised(self, laboratory: Laboratory, signals: Sequence[Signals]) -> _Baseline:
        directions = (*self._of_rig(laboratory, signals), *self._of_readings(laboratory, signals))
        orthogonal, triangle = np.linalg.qr(np.stack([direction.column for direction in directions], axis=1))
        directions = tuple(replace(direction, column=np.empty(0)) for direction in directions)
        return _Baseline(laboratory.rig, self._stacked(signals), directions, orthogonal, triangle)

    def _of_rig(self, laboratory: Laboratory, signals: Sequence[Signals]) -> Iterator[_Direction]:
        """Per unit of relative change of the rig's factors, which the laboratory believes to be 1."""
        reference = self._stacked(signals)
        for name, tolerance in laboratory.rig.tunable.items():
            step = tolerance * _STEP
            changed = replace(laboratory, rig=laboratory.rig.with_factor(name, 1 + step))
            column = (self._stacked(changed.signals(relative_tolerance=QUICK)) - reference) / step
            yield _Direction(name, column, *_about_belief(tolerance, laboratory.rig.factor(name)))

    def _of_readings(self, laboratory: Laboratory, signals: Sequence[Signals]) -> Iterator[_Direction]:
        """Gains, sizes of releases, zeros of displacements, and shapes of modes along a beam."""
        for name in self.floor:
            only = [{name: run[name]} for run in signals]
            limits = _about_belief(GAIN_TOLERANCE, self._sensors[name].gain)
            yield _Direction(f"gain {name}", self._column(only, signals), *limits)
        for k, (plan, run) in enumerate(zip(laboratory.plan.runs, signals, strict=True)):
            before: list[Signals] = [{}] * k
            if plan.motion == "free":
                limits = _about_belief(RELEASE_TOLERANCE, 1.0)
                yield _Direction(f"release {k}", self._column([*before, run], signals), *limits)
            for name in run:
                if name.startswith("displacement"):
                    zero = {name: np.full_like(run[name], np.abs(run[name]).max())}
                    limits = _about_zero(OFFSET_TOLERANCE)
                    yield _Direction(f"offset {name} {k}", self._column([*before, zero], signals), *limits)
        for mode, motions in enumerate(_motions_of_modes(laboratory.rig, signals)):
            for name in self.floor:
                if name.startswith("acceleration_beam"):
                    only = [{name: motion} for motion in motions]
                    limits = _about_zero(SHAPE_TOLERANCE)
                    yield _Direction(f"shape {mode + 1} {name}", self._column(only, signals), *limits)

    def _column(self, parts: Sequence[Signals], signals: Sequence[Signals]) -> FloatArray:
        """Stacked, with zeros for every channel and run that is not in the parts."""
        padded = [*parts, *([{}] * (len(signals) - len(parts)))]
        return self._stacked(
            [
                {name: part.get(name, np.zeros_like(values)) for name, values in run.items()}
                for part, run in zip(padded, signals, strict=True)
            ]
        )

    def strength(self, changed: Sequence[Signals], *, damping_is_known: bool) -> float:
        """Largest remainder of any channel over its floor.

        Parameters
        ----------
        changed : sequence of dict
            Signals with the effect.
        damping_is_known : bool
            Whether damping may be retuned within its tolerance only.
        """
        target = self._stacked(changed)
        best = min(
            (self._retuned(baseline, target, damping_is_known) for baseline in self._baselines),
            key=lambda retuned: retuned.strength,
        )
        if not best.is_near and best.strength > _HIDDEN:
            best = self._relinearised(target, best, damping_is_known)
        return best.strength

    def _relinearised(self, target: FloatArray, best: _Retuned, damping_is_known: bool) -> _Retuned:
        """Less remains about a baseline with a frequency like that of the changed signals, and about its like."""
        following = self._nearest_frequencies(target)
        for _ in range(_RELINEARISED_AT_ONCE):
            rig = following or best.rig
            if len(self._baselines) == _MOST_BASELINES[rig.kind] or (best.is_near and following is None):
                break
            laboratory = replace(self._laboratory, rig=rig)
            self._baselines.append(self._linearised(laboratory, laboratory.signals(relative_tolerance=QUICK)))
            retuned = self._retuned(self._baselines[-1], target, damping_is_known)
            if following is None and retuned.strength > _WORTHWHILE * best.strength:
                return min(best, retuned, key=lambda retuning: retuning.strength)
            best, following = min(best, retuned, key=lambda retuning: retuning.strength), None
        return best

    def _nearest_frequencies(self, target: FloatArray) -> HiddenRig | None:
        """The rig with the possible frequency of every mode whose signals are nearest, where it has modes.

        From elsewhere no step finds a phase that is off by more than a radian. One mode after the other: what a
        linear rig shows is the sum of its modes.
        """
        rig = self._laboratory.rig
        if rig.kind == "shaker":
            return None
        for name in (factor for factor in rig.tunable if factor.startswith("frequency")):
            if name not in self._frequencies:
                self._frequencies[name] = self._scanned(name)
            change, _ = min(self._frequencies[name], key=lambda known: float(np.sum((target - known[1]) ** 2)))
            rig = rig.with_factor(name, 1 + change)
        return None if any(baseline.rig.factors == rig.factors for baseline in self._baselines) else rig

    def _scanned(self, name: str) -> list[tuple[float, FloatArray]]:
        """Possible changes of a factor of the rig, and the signals with each."""
        rig, found = self._laboratory.rig, []
        for change in np.linspace(*_about_belief(FREQUENCY_TOLERANCE, rig.factor(name)), _SCANNED):
            other = replace(self._laboratory, rig=rig.with_factor(name, 1 + change))
            found.append((float(change), self._stacked(other.signals(relative_tolerance=QUICK))))
        return found

    def _retuned(self, baseline: _Baseline, target: FloatArray, damping_is_known: bool) -> _Retuned:
        difference = target - baseline.reference
        lower, upper = [], []
        for direction in baseline.directions:
            free = "damping" in direction.name and not damping_is_known
            ratio = self._laboratory.rig.factor(direction.name) / baseline.rig.factor(direction.name)
            lower.append(_LEAST_DAMPING * ratio - 1 if free else direction.least)
            upper.append(_MOST_DAMPING * ratio - 1 if free else direction.most)
        fit = lsq_linear(
            baseline.triangle,
            baseline.orthogonal.T @ difference,
            (lower, upper),
            method="bvls",
            max_iter=10 * len(lower),
        )
        remainder = difference - baseline.orthogonal @ (baseline.triangle @ fit.x)
        of_channels = remainder.reshape(len(self.floor), -1)
        rig, is_near = baseline.rig, True
        for direction, change in zip(baseline.directions, fit.x, strict=True):
            if direction.name in rig.tunable:
                rig = rig.with_factor(direction.name, 1 + change)
                linear = _STAYS_LINEAR_IN_FREQUENCY if direction.name.startswith("frequency") else _STAYS_LINEAR
                is_near = is_near and abs(change) < linear
        return _Retuned(float(np.sqrt((of_channels**2).mean(axis=1)).max()), rig, is_near)


def _about_belief(tolerance: float, factor: float) -> tuple[float, float]:
    """Relative changes of a factor that lead no further from 1 than is possible."""
    reach = STILL_POSSIBLE * tolerance
    return (1 - reach) / factor - 1, (1 + reach) / factor - 1


def _about_zero(tolerance: float) -> tuple[float, float]:
    return -STILL_POSSIBLE * tolerance, STILL_POSSIBLE * tolerance


def _motions_of_modes(rig: HiddenRig, signals: Sequence[Signals]) -> list[list[FloatArray]]:
    """Acceleration of every mode of a beam in every run, from the accelerometers."""
    if rig.beam is None:
        return []
    names = ("acceleration_beam_1", "acceleration_beam_2", "acceleration_beam_3", "acceleration_tip")
    inverse = np.linalg.pinv(rig.shapes_at_places(rig.n_modes))
    runs = [inverse @ np.stack([run[name] - run["acceleration_root"] for name in names]) for run in signals]
    return [[run[mode] for run in runs] for mode in range(rig.n_modes)]


def magnitude_for(
    strength_of: Callable[[float], float], wanted: float, least: float, most: float, *, first: float = 1.0
) -> tuple[float, float]:
    """Magnitude with a wanted strength and the strength reached, by secants on logarithmic axes.

    Where the bounds of the magnitude do not reach it, the nearer bound.
    """
    known: list[tuple[float, float]] = []
    magnitude = float(np.clip(first, least, most))
    for _ in range(9):
        reached = max(strength_of(magnitude), LEAST_STRENGTH)
        known.append((magnitude, reached))
        if abs(np.log(reached / wanted)) < STRENGTH_TOLERANCE:
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
