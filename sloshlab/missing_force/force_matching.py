"""Numbers of a force that matches the missing one along the motion that was recorded.

The force is computed on the recorded motion, without the structure that it would act on: what it does to the
motion is in the recording already. So bounces of a liquid, phases of a wave and the memory of a friction follow
those of the laboratory, where a free-running simulation with other numbers goes its own way; and one costs little.
Forces are compared over the noise of the missing one, which a structure shows best at its resonances.
The force contains the noise of the recorded motion: what matches best is a start of a fit, never a judgement.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Final, TypeGuard

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import orth
from scipy.optimize import differential_evolution, least_squares

from sloshlab.errors import SloshlabError
from sloshlab.identification.diagnosed_model import EXACT
from sloshlab.identification.effort import Effort
from sloshlab.identification.rig_model import steps_per_sample
from sloshlab.missing_force.latent_force import (
    EITHER,
    STRUCTURE,
    TANK,
    LatentForce,
    RunForces,
    along,
    forces_alone,
)
from sloshlab.missing_physics.candidate import Candidate, Numbers
from sloshlab.missing_physics.prior import ParameterPrior
from sloshlab.twin.excitation import Excitation, with_cached_inputs
from sloshlab.twin.lane_preparation import Lane, motions
from sloshlab.twin.lane_vector import N_LANES
from sloshlab.twin.motion import Motion
from sloshlab.twin.status import Status
from sloshlab.twin.twin import Twin

FloatArray = NDArray[np.float64]
_N_REFINED: Final = 3
"""Starts that are refined beside what has evolved."""
_MOST_STEPS: Final = 30
_LEAST_GAIN: Final = 1e-3
"""Of the misfit, relative, at which a refinement ends."""
_POPULATION, _GENERATIONS, _GENERATIONS_OF_AMPLITUDES = 32, 16, 64
"""Of differential evolution: some five hundred forces, and two thousand where amplitudes alone tell them apart."""
_PARTED: Final = 0.5
"""Of the size of a force, by which it differs where bounces part; a smooth one differs by some hundredths."""
_STRETCH_S: Final = 0.5
_LINES_OF_A_CELL: Final = 4
"""Two hertz apart: cells in which amplitudes are compared, as long as the blocks of a short-time spectrum."""
_FEWEST: Final = 5
"""Of a population that evolves."""
_STEP: Final = 1e-3
"""Of a finite difference, relative to a number."""
_EXACTLY: Final = 1e-3
"""Of a force, relative, by which twice its half may miss it."""
_FAILED: Final = 1e3
"""In place of the residual of a force that does not reach its end, over the RMS of the missing one."""


@dataclass(frozen=True)
class Match:
    """Numbers of an effect and how well they match.

    Attributes
    ----------
    misfit : float
        Mean square of what is left, over that of the missing force.
    numbers : dict
        Named as in a fit.
    """

    misfit: float
    numbers: dict[str, float]


class ForceMatching:
    """Missing forces of some runs at one place, and what moves there.

    What a spring, a damper and a mass could do is set aside on both sides: the baseline's own numbers have taken
    their share of it.

    Parameters
    ----------
    forces : sequence of LatentForce
        Of one place, one per run.
    undivided : ShownForces, optional
        What structure and tank lack together in these runs, in which a force of this place shows as well.
    effort : Effort, optional
        That of a search, to which samples of forces are added.

    Attributes
    ----------
    power : float
        Squares of what is missing, in noise variances.
    is_more_than_noise : bool
        Whether they are more than those of noise besides those of noise.
    """

    def __init__(
        self, forces: Sequence[LatentForce], undivided: ShownForces | None = None, effort: Effort | None = None
    ) -> None:
        self._effort, self._n_samples = effort or Effort(), sum(force.force_n.size for force in forces)
        self._drives = [_drive(force) for force in forces]
        self._doubled = [_drive(force, 2.0) for force in forces]
        self._shown = [ShownForces(forces, [forces]), *([] if undivided is None else [undivided])]
        missing = np.concatenate([shown.missing for shown in self._shown])
        self.power = float(missing @ missing)
        self.is_more_than_noise = any(shown.is_more_than_noise for shown in self._shown)
        self._scale = max(float(np.sqrt(np.mean(missing**2))), 1e-300)
        self._missing = missing / self._scale

    def ranked(self, candidate: Candidate, starts: Sequence[Numbers]) -> list[Match]:
        """Starts as they match, the best first; none of what is no force that a motion makes.

        Where sizes scale the force each start has its best multiple; where there are no other numbers the best of
        these is the best match, and no other is given.

        Parameters
        ----------
        candidate : Candidate
        starts : sequence of mapping
            Named as in a fit.
        """
        sound = [start for start in starts if force_alone(candidate, start) is not None]
        if not sound:
            return []
        scales = self._scales(candidate, sound[0])
        ranked = sorted(self._matches(candidate, sound, scales=scales), key=_misfit)
        return ranked[:1] if scales and self._is_linear(candidate) else ranked

    def refined(self, candidate: Candidate, ranked: Sequence[Match]) -> list[Match]:
        """The best of some matches by least squares, the best first.

        Parameters
        ----------
        candidate : Candidate
        ranked : sequence of Match
        """
        best = ranked[:_N_REFINED]
        if self._scales(candidate, best[0].numbers) and self._is_linear(candidate):
            return list(best)
        return sorted([*best, *(self._by_least_squares(candidate, match) for match in best)], key=_misfit)

    def evolved(self, candidate: Candidate, ranked: Sequence[Match]) -> list[Match]:
        """The best of some matches, and of a population that evolves from them, by least squares; the best first.

        Contacts and friction make the misfit rough (differential evolution, Storn and Price 1997,
        doi:10.1023/A:1008202821328). Where bounces part, two motions that are as likely have other phases, and the
        misfit says nothing: what evolves are then the amplitudes of short stretches. Of the population those are
        refined that match best.

        Parameters
        ----------
        candidate : Candidate
        ranked : sequence of Match
        """
        refined = self.refined(candidate, ranked)
        scales = self._scales(candidate, ranked[0].numbers)
        if len(ranked) < _FEWEST or (scales and self._is_linear(candidate)):
            return refined
        best = sorted(self._evolution(candidate, ranked, scales=scales), key=_misfit)[:_N_REFINED]
        return sorted([*refined, *best, *(self._by_least_squares(candidate, each) for each in best)], key=_misfit)

    @staticmethod
    def _is_linear(candidate: Candidate) -> bool:
        """Whether an effect has no numbers but sizes."""
        return {known.name for known in candidate.effect.parameters} <= set(candidate.sizes)

    def compares(self, candidate: Candidate, numbers: Numbers) -> bool:
        """Whether what a force leaves says how good it is: not of one that is linear in the motion.

        What that does is hidden by what is set aside, or by numbers of the baseline that have taken its share.

        Parameters
        ----------
        candidate : Candidate
        numbers : mapping
        """
        twin = force_alone(candidate, numbers)
        if twin is None:
            return False
        for drive, doubled in zip(self._drives, self._doubled, strict=True):
            n_substeps = steps_per_sample(twin, drive.sampling_rate_hz)
            one, two = motions([Lane(twin, each, n_substeps=n_substeps) for each in (drive, doubled)])
            if not (_is_done(one) and _is_done(two)):
                continue
            changes = [each.tank_force_n - each.tank_force_n.mean() for each in (one, two)]
            if np.linalg.norm(changes[1] - 2.0 * changes[0]) > _EXACTLY * np.linalg.norm(two.tank_force_n):
                return True
        return False

    def _scales(self, candidate: Candidate, numbers: Numbers) -> bool:
        """Whether half the sizes of an effect make half its force: not where they set a frequency or a limit."""
        if not candidate.sizes:
            return False
        force, half = self._forces(candidate, [numbers, candidate.sized(numbers, 0.5)])
        if force is None or half is None:
            return False
        return bool(np.linalg.norm(force - 2.0 * half) < _EXACTLY * np.linalg.norm(force))

    def _evolution(self, candidate: Candidate, ranked: Sequence[Match], *, scales: bool) -> list[Match]:
        """The last population."""
        logarithms = _Logarithms(candidate, ranked[0].numbers)
        parts = self._parts(candidate, ranked[0].numbers)

        def matches(x: FloatArray) -> list[Match]:
            return self._matches(candidate, [logarithms.numbers(each) for each in x], scales=scales)

        def misfits(x: FloatArray) -> FloatArray:
            if parts:
                return self._misfits_of_amplitudes(candidate, [logarithms.numbers(each) for each in x.T])
            return np.array([match.misfit for match in matches(x.T)])

        places = np.array([logarithms.of(match.numbers) for match in ranked])
        order = np.argsort(misfits(places.T), kind="stable") if parts else np.arange(len(ranked))
        found = differential_evolution(
            misfits,
            list(zip(logarithms.low, logarithms.high, strict=True)),
            init=places[order[:_POPULATION]],
            maxiter=_GENERATIONS_OF_AMPLITUDES if parts else _GENERATIONS,
            vectorized=True,
            updating="deferred",
            polish=False,
            rng=np.random.default_rng(0),
        )
        return matches(found.population)

    def _parts(self, candidate: Candidate, numbers: Numbers) -> bool:
        """Whether two forces part whose numbers differ by no more than a simulation is exact."""
        other = {name: value * (1.0 + EXACT) for name, value in numbers.items()}
        force, moved = self._forces(candidate, [numbers, other])
        if force is None or moved is None:
            return False
        return bool(np.linalg.norm(moved - force) > _PARTED * np.linalg.norm(force))

    def _misfits_of_amplitudes(self, candidate: Candidate, sets: Sequence[Numbers]) -> FloatArray:
        """Mean square by which amplitudes are missed, over that of the missing force."""
        missing = self._amplitudes(self._missing)
        scale = max(_mean_square(missing), 1e-300)
        return np.array(
            [
                _FAILED**2 if force is None else _mean_square(self._amplitudes(force) - missing) / scale
                for force in self._forces(candidate, sets)
            ]
        )

    def _amplitudes(self, joined: FloatArray) -> FloatArray:
        """Of stretches of all runs, whose phases do not count."""
        whiteners = [whitener for shown in self._shown for whitener in shown.whiteners]
        ends = np.cumsum([whitener.n_values for whitener in whiteners])
        parts = zip(whiteners, np.split(joined, ends[:-1]), strict=True)
        return np.concatenate([whitener.amplitudes(part) for whitener, part in parts])

    def _matches(self, candidate: Candidate, sets: Sequence[Numbers], *, scales: bool) -> list[Match]:
        """How well numbers match, each set with the best multiple of its sizes where these scale the force."""
        found = []
        for numbers, force in zip(sets, self._forces(candidate, sets), strict=True):
            if force is None:
                found.append(Match(_FAILED**2, dict(numbers)))
                continue
            size = float(force @ force)
            factor = float(force @ self._missing) / size if scales and size > 0 else 1.0
            factor = float(np.clip(factor, *_multiples(candidate, numbers))) if factor > 0 else 1.0
            found.append(Match(_mean_square(self._missing - factor * force), candidate.sized(numbers, factor)))
        return found

    def _by_least_squares(self, candidate: Candidate, match: Match) -> Match:
        """Nonlinear least squares from one start."""
        logarithms = _Logarithms(candidate, match.numbers)

        def forces(places: Sequence[FloatArray]) -> list[FloatArray]:
            found = self._forces(candidate, [logarithms.numbers(x) for x in places])
            return [np.full(self._missing.size, _FAILED) if force is None else force for force in found]

        def residual(x: FloatArray) -> FloatArray:
            return forces([x])[0] - self._missing

        def jacobian(x: FloatArray) -> FloatArray:
            at, *moved = forces([x, *(x + step for step in _STEP * np.eye(x.size))])
            return np.column_stack([(each - at) / _STEP for each in moved])

        start, ends = logarithms.of(match.numbers), (logarithms.low, logarithms.high)
        found = least_squares(residual, start, jacobian, ends, max_nfev=_MOST_STEPS, ftol=_LEAST_GAIN)
        return Match(2.0 * float(found.cost) / self._missing.size, logarithms.numbers(found.x))

    def _forces(self, candidate: Candidate, sets: Sequence[Numbers]) -> Iterator[FloatArray | None]:
        """Forces with some sets of numbers, all runs one after the other, over the RMS of the missing one.

        None where there is no such force, or it does not reach the end of a run.
        """
        n = len(self._drives)
        # As many as run side by side: whole runs of some hundred sets together would fill the memory.
        for first in range(0, len(sets), N_LANES):
            twins = [force_alone(candidate, numbers) for numbers in sets[first : first + N_LANES]]
            lanes = [
                Lane(twin, drive, n_substeps=steps_per_sample(twin, drive.sampling_rate_hz))
                for twin in twins
                if twin is not None
                for drive in self._drives
            ]
            self._effort.add(self._n_samples * len(lanes) // n)
            found = iter(motions(lanes))
            for twin in twins:
                yield None if twin is None else self._joined(list(islice(found, n)))

    def _joined(self, found: Sequence[Motion | Exception]) -> FloatArray | None:
        series = []
        for motion in found:
            if not _is_done(motion):
                return None
            series.append(motion.tank_force_n)
        return np.concatenate([shown.compared(series) for shown in self._shown]) / self._scale


class ShownForces:
    """Missing forces of some runs as others are compared with them.

    Parameters
    ----------
    forces : sequence of LatentForce
        One per run.
    moved : sequence of sequences of LatentForce
        Of every place at which the baseline may be off, one per run.

    Attributes
    ----------
    whiteners : list of _Whitener
        One per run.
    missing : ndarray
        Whitened, all runs one after the other, without what a spring, a damper, a mass and a constant force of
        these places could do that are the same in all runs.
    is_more_than_noise : bool
        Whether its squares are more than those of noise besides those of noise.
    """

    def __init__(self, forces: Sequence[LatentForce], moved: Sequence[Sequence[LatentForce]]) -> None:
        self.whiteners = [_Whitener(force) for force in forces]
        of_runs = []
        for whitener, *places in zip(self.whiteners, *moved, strict=True):
            motions = [np.concatenate([place.motion_before, place.motion]) for place in places]
            columns = [*(column for motion in motions for column in motion.T), np.ones(len(motions[0]))]
            of_runs.append(np.stack([whitener.whitened(column) for column in columns], axis=1))
        linear = np.concatenate(of_runs)
        # Both places move alike where the base does not.
        self._linear = orth(linear / np.maximum(np.abs(linear).max(axis=0), 1e-300))
        known = zip(forces, self.whiteners, strict=True)
        self.missing = self._without_linear(
            np.concatenate([whitener.of_regularised(force.force_n) for force, whitener in known])
        )
        noise = sum(whitener.noise for whitener in self.whiteners)
        self.is_more_than_noise = float(self.missing @ self.missing) > 2.0 * noise

    def compared(self, series: Sequence[FloatArray]) -> FloatArray:
        """Forces of all runs as the missing ones are.

        Parameters
        ----------
        series : sequence of ndarray
            From the start of each run.
        """
        of_runs = zip(series, self.whiteners, strict=True)
        return self._without_linear(np.concatenate([whitener.whitened(each) for each, whitener in of_runs]))

    def _without_linear(self, series: FloatArray) -> FloatArray:
        return np.asarray(series - self._linear @ (self._linear.T @ series))


@dataclass(frozen=True)
class Matchings:
    """Where missing forces of structure and tank are told apart.

    Attributes
    ----------
    of : dict of place to ForceMatching
    power : float
        Squares of all that is missing, in noise variances.
    """

    of: dict[str, ForceMatching]
    power: float


def matchings(forces: Sequence[RunForces], effort: Effort | None = None) -> Matchings:
    """Per block, where its missing forces are told apart.

    Where the other block lacks no more than noise, all that both lack is this one's.

    Parameters
    ----------
    forces : sequence of RunForces
    effort : Effort, optional
        That of a search.
    """
    at = {
        # A force that may be either's acts along the motion of the structure.
        STRUCTURE: [own for of_run in forces if (own := of_run.at(STRUCTURE) or of_run.at(EITHER))],
        TANK: [own for of_run in forces if (own := of_run.at(TANK))],
    }
    found = {place: ForceMatching(own, effort=effort) for place, own in at.items() if own}
    lacking = [place for place, each in found.items() if each.is_more_than_noise]
    undivided = [of_run.undivided for of_run in forces if of_run.undivided is not None]
    if len(lacking) < 2 and undivided and len(undivided) == len(forces):
        both = ShownForces(undivided, list(at.values()))
        if both.is_more_than_noise:
            places = lacking or list(at)
            found |= {place: ForceMatching(at[place], both, effort) for place in places}
            return Matchings(found, max(found[place].power for place in places))
    return Matchings(found, sum(found[place].power for place in lacking))


class _Whitener:
    """Spectra of forces of one run over the noise of the missing one, real parts before imaginary ones.

    Squares add up to as many as there are samples for noise that the regularisation leaves whole.

    Parameters
    ----------
    force : LatentForce
    """

    def __init__(self, force: LatentForce) -> None:
        self._kept = slice(len(force.motion_before), len(force.motion_before) + len(force.motion))
        # Lengths of many small factors are transformed many times as fast.
        self._length, self._whole = (next_fast_len(2 * n, real=True) for n in (len(force.motion), self._kept.stop))
        known = (force.kept_share > 0) & (force.noise_power > 0)
        # The noise is that of a whole run, at half as many lines as that has padded samples.
        power = np.where(known, force.noise_power, 1.0) * self._length / (2 * (force.kept_share.size - 1))
        self._weights = _at_lines(np.where(known, 1.0 / np.sqrt(power), 0.0), self._length)
        self._share = _at_lines(np.where(known, force.kept_share, 0.0), self._whole)
        self._stretch = max(round(_STRETCH_S * force.run.attributes.sampling_rate_hz), 2 * _LINES_OF_A_CELL)

    @property
    def noise(self) -> float:
        """Squares that are expected of noise alone."""
        return float(self._kept.stop - self._kept.start) * float(np.mean(self._share**2))

    @property
    def n_values(self) -> int:
        """Of a whitened force."""
        return int(2 * (self._length // 2 + 1))

    def amplitudes(self, whitened: FloatArray) -> FloatArray:
        """Root of the power of a whitened force in cells of time and frequency."""
        real, imaginary = np.split(whitened, 2)
        series = irfft(real + 1j * imaginary, self._length)[: self._kept.stop - self._kept.start]
        n = min(self._stretch, series.size)
        stretches = series[: series.size // n * n].reshape(-1, n) * np.hanning(n)
        power = np.abs(rfft(stretches)) ** 2
        return np.sqrt(np.add.reduceat(power, np.arange(0, power.shape[1], _LINES_OF_A_CELL), axis=1)).ravel()

    def whitened(self, series: FloatArray) -> FloatArray:
        """Of a force as it acts, from the start of the run: what the regularisation took is no misfit."""
        regularised = irfft(self._share * rfft(series[: self._kept.stop], self._whole), self._whole)
        return self.of_regularised(regularised[self._kept])

    def of_regularised(self, series: FloatArray) -> FloatArray:
        """Of one that was regularised as the missing force was, as long as that."""
        spectrum = self._weights * rfft(series, self._length)
        return np.concatenate([spectrum.real, spectrum.imag])


def _at_lines(values: FloatArray, n_samples: int) -> FloatArray:
    """What is given at evenly spaced frequencies at those of a series of so many samples."""
    return np.interp(np.linspace(0.0, 1.0, n_samples // 2 + 1), np.linspace(0.0, 1.0, values.size), values)


def _is_done(motion: Motion | Exception) -> TypeGuard[Motion]:
    return not isinstance(motion, Exception) and motion.ending.status is Status.DONE


def _drive(force: LatentForce, factor: float = 1.0) -> Excitation:
    motion = factor * np.concatenate([force.motion_before, force.motion])
    return with_cached_inputs(along(motion, force.run.attributes.sampling_rate_hz))


def _multiples(candidate: Candidate, numbers: Numbers) -> tuple[float, float]:
    """The smallest and the largest multiple of an effect with all its sizes within their bounds."""
    least, most = 0.0, np.inf
    for parameter in candidate.effect.parameters:
        size = numbers[f"{candidate.key}.{parameter.name}"]
        if parameter.name in candidate.sizes and size != 0:
            ends = sorted(bound / size for bound in candidate.bounds(parameter))
            least, most = max(least, ends[0]), min(most, ends[1])
    return least, max(least, most)


def _within_bounds(candidate: Candidate, numbers: Numbers) -> dict[str, float]:
    """Numbers of an effect as it takes them."""
    found = {}
    for parameter in candidate.effect.parameters:
        low, high = candidate.bounds(parameter)
        found[parameter.name] = float(np.clip(numbers[f"{candidate.key}.{parameter.name}"], low, high))
    return found


def force_alone(candidate: Candidate, numbers: Numbers) -> Twin | None:
    """The force that a motion makes; none of what acts otherwise too, and of numbers that lack or contradict each
    other.

    Parameters
    ----------
    candidate : Candidate
    numbers : mapping
        Named as in a fit.
    """
    if any(f"{candidate.key}.{known.name}" not in numbers for known in candidate.effect.parameters):
        return None
    try:
        added = candidate.extension(_within_bounds(candidate, numbers))
    except SloshlabError:
        return None
    if any((added.liquid, added.structure, added.faults, added.drives, added.run_terms)) or not added.terms:
        return None
    return forces_alone(added.terms)


class _Logarithms:
    """Numbers of an effect as logarithms of their sizes, signs as they are at a place."""

    def __init__(self, candidate: Candidate, at: Numbers) -> None:
        self._candidate, self._at = candidate, at
        priors = candidate.prior
        self._names = [known.name for known in priors]
        self._signs = np.array([np.sign(at[name]) or 1.0 for name in self._names])
        ends = [_ends(known) for known in priors]
        self.low, self.high = (np.log([each[k] for each in ends]) for k in (0, 1))

    def of(self, numbers: Numbers) -> FloatArray:
        """Within the range that is believed."""
        sizes = np.maximum(np.abs([numbers[name] for name in self._names]), 1e-300)
        return np.asarray(np.clip(np.log(sizes), self.low, self.high))

    def numbers(self, x: FloatArray) -> dict[str, float]:
        """Within the bounds of the effect."""
        moved = {**self._at, **dict(zip(self._names, (self._signs * np.exp(x)).tolist(), strict=True))}
        within = _within_bounds(self._candidate, moved)
        return {f"{self._candidate.key}.{name}": value for name, value in within.items()}


def _ends(known: ParameterPrior) -> tuple[float, float]:
    """Between which a size is sought."""
    high = max(abs(known.low), abs(known.high), 1e-300)
    return max(min(abs(known.low), abs(known.high)), 1e-6 * high), high


def _mean_square(series: FloatArray) -> float:
    return float(np.mean(series**2))


def _misfit(match: Match) -> float:
    return match.misfit
