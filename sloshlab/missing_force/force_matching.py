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
from scipy.optimize import differential_evolution, least_squares

from sloshlab.errors import SloshlabError
from sloshlab.identification.diagnosed_model import EXACT
from sloshlab.identification.effort import Effort
from sloshlab.identification.integration_steps import MOST_STEPS_OF_MEMORY, steps_needed, steps_per_sample
from sloshlab.missing_force.latent_force import (
    EITHER,
    STRUCTURE,
    TANK,
    LatentForce,
    RunForces,
    along,
    forces_alone,
)
from sloshlab.missing_force.shown_forces import MOST_OF_NOISE, ShownForces
from sloshlab.missing_physics.candidate import Candidate, Numbers
from sloshlab.missing_physics.prior import ParameterPrior
from sloshlab.twin.excitation import with_cached_inputs
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
        self._ways = [_Way(force) for force in forces]
        self._halved = [_Way(force, 0.5) for force in forces]
        self._shown = [ShownForces(forces, [forces]), *([] if undivided is None else [undivided])]
        self.is_more_than_noise = any(shown.is_more_than_noise for shown in self._shown)
        self._noise = sum(shown.noise for shown in self._shown)
        self._match_to(np.concatenate([shown.missing for shown in self._shown]))

    @classmethod
    def of_effect(
        cls, forces: Sequence[LatentForce], candidate: Candidate, numbers: Numbers, effort: Effort | None = None
    ) -> ForceMatching | None:
        """The force that an effect makes along these motions in the place of the missing one, whole.

        Parameters
        ----------
        forces : sequence of LatentForce
            What is left of the missing ones beside the effect.
        candidate : Candidate
        numbers : mapping
            Named as in a fit.
        effort : Effort, optional

        Returns
        -------
        ForceMatching or None
            None of what is no force that a motion makes.
        """
        found = cls(forces, effort=effort)
        found._shown = [ShownForces(forces, [])]
        if force_alone(candidate, numbers) is None:
            return None
        [force] = found._forces(candidate, [numbers])
        if force is None or not force.any():
            return None
        found._match_to(force * found._scale)
        return found

    def _match_to(self, missing: FloatArray) -> None:
        self.power = float(missing @ missing)
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
        refined that match best. Nothing evolves where least squares alone leave no more than noise.

        Parameters
        ----------
        candidate : Candidate
        ranked : sequence of Match
        """
        refined = self.refined(candidate, ranked)
        if refined[0].misfit * self.power <= MOST_OF_NOISE * self._noise:
            return refined
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
        twin = self._followed(candidate, numbers)
        if twin is None:
            return False
        for way, halved in zip(self._ways, self._halved, strict=True):
            one, half = motions([each.lane(twin) for each in (way, halved)])
            if not (_is_done(one) and _is_done(half)):
                continue
            changes = [each.tank_force_n - each.tank_force_n.mean() for each in (one, half)]
            if np.linalg.norm(changes[0] - 2.0 * changes[1]) > _EXACTLY * np.linalg.norm(one.tank_force_n):
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
        n = len(self._ways)
        # As many as run side by side: whole runs of some hundred sets together would fill the memory.
        for first in range(0, len(sets), N_LANES):
            twins = [self._followed(candidate, numbers) for numbers in sets[first : first + N_LANES]]
            lanes = [way.lane(twin) for twin in twins if twin is not None for way in self._ways]
            self._effort.add(self._n_samples * len(lanes) // n)
            found = iter(motions(lanes))
            for twin in twins:
                yield None if twin is None else self._joined(list(islice(found, n)))

    def _followed(self, candidate: Candidate, numbers: Numbers) -> Twin | None:
        """The force that a motion makes; none of one that changes faster than steps can follow."""
        twin = force_alone(candidate, numbers)
        return twin if twin is not None and all(way.follows(twin) for way in self._ways) else None

    def _joined(self, found: Sequence[Motion | Exception]) -> FloatArray | None:
        series = []
        for motion in found:
            if not _is_done(motion):
                return None
            series.append(motion.tank_force_n)
        return np.concatenate([shown.compared(series) for shown in self._shown]) / self._scale


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


def _is_done(motion: Motion | Exception) -> TypeGuard[Motion]:
    return not isinstance(motion, Exception) and motion.ending.status is Status.DONE


class _Way:
    """The recorded motion of one run, or a multiple of it, along which forces act.

    Parameters
    ----------
    force : LatentForce
    factor : float, optional
    """

    def __init__(self, force: LatentForce, factor: float = 1.0) -> None:
        motion = factor * np.concatenate([force.motion_before, force.motion])
        self._rate_hz = force.run.attributes.sampling_rate_hz
        self._speed_m_per_s = float(np.abs(motion[:, 1]).max())
        self._excitation = with_cached_inputs(along(motion, self._rate_hz))

    def lane(self, twin: Twin) -> Lane:
        """A force along it, in steps as small as its memory needs."""
        n_substeps = steps_per_sample(twin, self._rate_hz, speed_m_per_s=self._speed_m_per_s)
        return Lane(twin, self._excitation, n_substeps=n_substeps)

    def follows(self, twin: Twin) -> bool:
        """Whether there are steps as small as that."""
        return steps_needed(twin.terms, self._rate_hz, self._speed_m_per_s) <= MOST_STEPS_OF_MEMORY


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
    """Numbers of an effect as logarithms of their sizes, signs as they are at a place.

    Of what may have either sign arsinh(number/smallest size), which is its logarithm but near zero, where it may
    change its sign.
    """

    def __init__(self, candidate: Candidate, at: Numbers) -> None:
        self._candidate, self._at = candidate, at
        priors = candidate.prior
        self._names = [known.name for known in priors]
        self._signs = np.array([np.sign(at[name]) or 1.0 for name in self._names])
        self._has_either = np.array([known.may_be_negative for known in priors], np.bool_)
        least, most = np.array([_ends(known) for known in priors]).T
        self._least = least
        self.high = np.where(self._has_either, np.arcsinh(most / least), np.log(most))
        self.low = np.where(self._has_either, -self.high, np.log(least))

    def of(self, numbers: Numbers) -> FloatArray:
        """Within the range that is believed."""
        values = np.array([numbers[name] for name in self._names])
        logarithms = np.log(np.maximum(np.abs(values), 1e-300))
        places = np.where(self._has_either, np.arcsinh(values / self._least), logarithms)
        return np.asarray(np.clip(places, self.low, self.high))

    def numbers(self, x: FloatArray) -> dict[str, float]:
        """Within the bounds of the effect."""
        values = np.where(self._has_either, self._least * np.sinh(x), self._signs * np.exp(x))
        moved = {**self._at, **dict(zip(self._names, values.tolist(), strict=True))}
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
