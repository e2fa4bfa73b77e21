"""Start values of effects from equation error: their force along the measured motion is matched to the latent
force.

The cost of free-running simulations has local minima, where the phase slips or a contact comes a cycle late. The
force along the measured motion has fewer, and needs no simulation of the motion: the parameters of every effect
that is one more force, or another damper of the liquid, are sought there first. The part of a force that springs,
dampers and masses of the baseline can follow is projected out, and bands in which noise dominates are left out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, prev_fast_len, rfft
from scipy.optimize import minimize

from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.extension import NOTHING, Extension
from sloshlab.diagnosis.latent_force import EITHER, STRUCTURE, TANK, LatentForce, run_forces
from sloshlab.diagnosis.observations import Observation
from sloshlab.diagnosis.rig_model import RigModel
from sloshlab.errors import SloshlabError
from sloshlab.twin.excitation import Excitation, recorded, with_cached_inputs
from sloshlab.twin.terms import Term
from sloshlab.twin.twin import Twin

FloatArray = NDArray[np.float64]
_MOST_SAMPLES: Final = 12_000
"""Of all runs of a place: each evaluation filters all of them."""
_FEWEST_NUMBERS: Final = 2
"""The size of an effect of one parameter comes from its score test."""
_MOST_TRIED: Final = 2
"""Starts from which descents begin, the best at their best size."""
_N_EVALUATIONS: Final = 15, 40
"""Per parameter: for each start that is tried, and then for the best."""
_MOST_DESCENTS: Final = 6
"""Of many places, those from which descents begin."""
_FIRST_PLACES: Final = 100
_LARGEST_SHARE_LEFT: Final = 0.9
"""Share of the latent force that the best of the first places may leave if the others are to be evaluated.

Where no impact is near, 2 s of a search on a driven beam become 1 s.
"""
_LONG_STEP, _SHORT_STEP = 0.7, 0.15
"""Initial simplex, in the logarithm of a parameter; the minima of multimodal forces are narrow."""
_MOTIONS_OF_BASELINE: Final = {STRUCTURE: [0, 1], EITHER: [0, 1], TANK: [2, 1]}
"""Motions of a place whose multiples the baseline follows.

Not all three: in a free motion any force is a combination of those.
"""
_N_PROBED: Final = 400
"""Samples of the fastest part of a run, on which contacts are tested to be resolved."""
_RESONANT_NUMBER: Final = "frequency_hz"
"""A parameter to which a force is so sensitive that it is scanned on a grid first."""
_GRID_MARGIN: Final = 2.0
"""Factor of the grid of frequencies below and above those of the starts."""
_N_FREQUENCIES: Final = 40
_PROPORTIONALITY_TOLERANCE: Final = 1e-3
"""Relative error of the doubled force, up to which a force is proportional to a parameter."""
_LEAST_FACTOR: Final = 1e-3
"""Of a size: forces of the wrong sign are not turned round."""
_LARGEST_LOG_CHANGE: Final = 4.0
"""Bound of the logarithm of a parameter over its start."""
_ABOVE_NOISE: Final = 1.0
"""Mean square of a latent force over that of its noise, from which starts are sought."""
_LEAST_EXPLAINED: Final = 0.03
"""Share of the mean square of the latent force, below which a start is none."""
_POWER_KEPT: Final = 0.98
"""Share of the power of the latent force within its band."""


@dataclass(frozen=True, eq=False)
class _Piece:
    """The motion of a place in one run, a short part of it where it is fastest, and the band of its latent
    force.
    """

    drive: Excitation
    fastest: Excitation
    passband: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class _Place:
    """The latent force of a place in some runs, without what the baseline can follow of it.

    Attributes
    ----------
    pieces : list of _Piece
    force_n : ndarray, shape (n,)
        All runs one after another.
    baseline_motions : ndarray, shape (n, 2)
        Orthonormal: spring and damper of the structure, mass and damper of the tank.
    """

    pieces: list[_Piece]
    force_n: FloatArray
    baseline_motions: FloatArray

    def comparable(self, added: Sequence[FloatArray]) -> FloatArray:
        """Forces of the same runs, concatenated, within the band of the latent force and beyond the baseline."""
        filtered = [_band(force, piece.passband) for force, piece in zip(added, self.pieces, strict=True)]
        return self._beyond_baseline(np.concatenate(filtered))

    def unexplained_share(self, force: FloatArray) -> float:
        """Share of the mean square of the latent force that a force leaves unexplained."""
        left = self.force_n - force
        return float(left @ left) / max(float(self.force_n @ self.force_n), 1e-300)

    def factor(self, force: FloatArray) -> float:
        """Least-squares factor of a force to the latent force; zero of no force."""
        size = float(force @ force)
        return max(float(force @ self.force_n) / size, _LEAST_FACTOR) if size else 0.0

    def _beyond_baseline(self, force: FloatArray) -> FloatArray:
        return np.asarray(force - self.baseline_motions @ (self.baseline_motions.T @ force))

    @classmethod
    def of(cls, forces: Sequence[LatentForce]) -> _Place | None:
        """The runs with the largest latent forces, up to a number of samples; None where no latent force is
        there.
        """
        pieces: list[_Piece] = []
        series: list[FloatArray] = []
        motions: list[FloatArray] = []
        n, of_noise = 0, 0.0
        # The largest first, as evaluations filter every sample and only some runs fit in.
        for latent in sorted(forces, key=lambda latent: -latent.power_n2):
            if latent.power_n2 <= 0.0 or (pieces and n + latent.force_n.size > _MOST_SAMPLES):
                break
            # Lengths with small prime factors: the filter is a Fourier transform per evaluation.
            kept = slice(0, prev_fast_len(min(latent.force_n.size, _MOST_SAMPLES), real=True))
            force, motion, rate = latent.force_n[kept], latent.motion[kept], latent.run.attributes.sampling_rate_hz
            own_motion = motion[:, _MOTIONS_OF_BASELINE[latent.place]]
            # The band is that of what is left: a spring that is a little off has most of its power at the
            # resonance.
            own, *_ = np.linalg.lstsq(own_motion, force)
            middle = int(np.argmax(np.abs(motion[:, 1])))
            about = motion[max(0, middle - _N_PROBED // 2) : middle + _N_PROBED // 2]
            piece = _Piece(
                _driven(rate, motion), _driven(rate, about), _band_of_most_power(force - own_motion @ own)
            )
            pieces.append(piece)
            series.append(_band(force, piece.passband))
            motions.append(np.stack([_band(column, piece.passband) for column in own_motion.T], axis=1))
            n, of_noise = n + force.size, of_noise + force.size * latent.standard_error_n**2
        if not pieces:
            return None
        # All runs together, as the baseline's spring and damper are the same in all.
        baseline_motions, _ = np.linalg.qr(np.concatenate(motions) / np.concatenate(motions).std(axis=0))
        place = cls(pieces, np.concatenate(series), baseline_motions)
        place = replace(place, force_n=place._beyond_baseline(place.force_n))
        return place if float(place.force_n @ place.force_n) > _ABOVE_NOISE * of_noise else None


@dataclass(frozen=True)
class ForceStart:
    """Parameters of an effect whose force is like the latent force.

    Attributes
    ----------
    numbers : dict
        Named as in a fit.
    unexplained_share : float
        Of the mean square of the latent force, beyond what the baseline can follow.
    others : tuple of dict
        Parameters at which other descents ended, of multimodal effects.
    """

    numbers: dict[str, float]
    unexplained_share: float
    others: tuple[dict[str, float], ...] = ()


class ForceStarts:
    """The latent forces beside a fit of a rig's twin, and parameters of effects that make such forces.

    Parameters
    ----------
    model : RigModel
    fitting : sequence of sequences of Observation
    values : mapping
        Of the baseline's parameters, and of effects that it has already.
    known : Extension, optional
        Those effects.
    """

    def __init__(
        self,
        model: RigModel,
        fitting: Sequence[Sequence[Observation]],
        values: Mapping[str, float],
        known: Extension = NOTHING,
    ) -> None:
        self._model = model
        self._forces: list[LatentForce] = []
        for observed in fitting:
            with suppress(SloshlabError):
                self._forces += run_forces(model, observed, values, extension=known).forces
        self._places: dict[str, _Place | None] = {}

    def of(self, candidate: Candidate) -> ForceStart | None:
        """The best parameters for a candidate; None where its force explains next to nothing.

        Parameters
        ----------
        candidate : Candidate
        """
        parameters = candidate.effect.parameters
        place = self._at(candidate.effect.block) if len(parameters) >= _FEWEST_NUMBERS else None
        if place is None:
            return None
        names = [f"{candidate.key}.{parameter.name}" for parameter in parameters]
        bounds = np.array([candidate.bounds(parameter) for parameter in parameters])

        def left(numbers: FloatArray) -> float:
            added = force(numbers)
            return np.inf if added is None else place.unexplained_share(added)

        def force(numbers: FloatArray) -> FloatArray | None:
            inside = np.clip(numbers, *bounds.T).tolist()
            named = {parameter.name: value for parameter, value in zip(parameters, inside, strict=True)}
            return self._force(candidate, named, place)

        starts = [np.array([start[name] for name in names]) for start in candidate.starts()]
        resonant = next((k for k, parameter in enumerate(parameters) if parameter.name == _RESONANT_NUMBER), -1)
        if resonant >= 0:
            starts = [
                _with_number(starts[0], resonant, frequency) for frequency in _frequencies_about(starts, resonant)
            ]
        sized_starts = sorted(
            (_at_best_size(force, start, place) for start in starts), key=lambda reached: reached[0]
        )
        first, then = (n * len(names) for n in _N_EVALUATIONS)
        share, numbers = min(
            (_simplex_descent(left, start, first) for _, start in sized_starts[:_MOST_TRIED]),
            key=lambda reached: reached[0],
        )
        others: list[tuple[float, FloatArray]] = []
        if sought := [np.array([numbers[name] for name in names]) for numbers in candidate.sought_at()]:
            proportional = np.array([parameter.name in candidate.sizes for parameter in parameters])
            others = _descended_from_many(force, sought, place, proportional, first)
            share, numbers = min([(share, numbers), *others], key=lambda other: other[0])
        if share < 1.0 - _LEAST_EXPLAINED:
            share, numbers = _simplex_descent(left, numbers, then, _SHORT_STEP if sought else _LONG_STEP)
        # `not … <`, so that infinity and no number are refused, too.
        if not share < 1.0 - _LEAST_EXPLAINED:
            return None
        # The ends of the other descents too: no free-running fit leads from one of them to another.
        best, *more = (
            dict(zip(names, np.clip(reached, *bounds.T).tolist(), strict=True))
            for reached in (numbers, *(end for _, end in others))
        )
        return ForceStart(best, share, tuple(more))

    def _at(self, block: str) -> _Place | None:
        if block not in self._places:
            self._places[block] = _Place.of([force for force in self._forces if force.place in (block, EITHER)])
        return self._places[block]

    def _force(self, candidate: Candidate, numbers: Mapping[str, float], place: _Place) -> FloatArray | None:
        """Force of an effect along the motion of its place, filtered; None where it is no force or does not
        run.
        """
        try:
            extension = candidate.extension(numbers)
            # On a short part first: a contact too stiff for its steps has an event in each, and the whole run
            # would take long.
            if not all(_is_resolved(extension.terms, piece.fastest) for piece in place.pieces):
                return None
            added = [self._added(extension, piece.drive) for piece in place.pieces]
        except SloshlabError:
            return None
        # In all runs or not at all: shares of some runs cannot be compared with those of all.
        known = [force for force in added if force is not None and np.isfinite(force).all()]
        return place.comparable(known) if len(known) == len(added) else None

    def _added(self, extension: Extension, drive: Excitation) -> FloatArray | None:
        """The force that an extension adds along a motion; None where it adds something else."""
        if extension.faults or extension.drives or extension.run_terms or extension.structure is not None:
            return None
        force = _force_along(extension.terms, drive)
        if extension.liquid is not None:
            # What acts on the liquid's forces adds the difference that it makes to them.
            liquid = tuple(term for term in self._model.twin.terms if term.place == "tank")
            force = force + _force_along(extension.liquid(liquid), drive) - _force_along(liquid, drive)
        return force


def _frequencies_about(starts: Sequence[FloatArray], place: int) -> list[float]:
    """Values of one parameter from well below to well above those of all starts."""
    known = [float(start[place]) for start in starts]
    return [
        float(frequency_hz)
        for frequency_hz in np.geomspace(min(known) / _GRID_MARGIN, max(known) * _GRID_MARGIN, _N_FREQUENCIES)
    ]


def _with_number(start: FloatArray, place: int, value: float) -> FloatArray:
    changed = start.copy()
    changed[place] = value
    return changed


def _at_best_size(
    force: Callable[[FloatArray], FloatArray | None], start: FloatArray, place: _Place
) -> tuple[float, FloatArray]:
    """Share of the latent force that a start leaves at its best size, and the start with that size.

    The size is the parameter, if there is one, to which the force is proportional.
    """
    found = force(start)
    factor = 0.0 if found is None else place.factor(found)
    if found is None or factor == 0.0:
        return np.inf, start
    size = float(found @ found)
    for k in range(start.size):
        doubled = force(_with_number(start, k, 2.0 * start[k]))
        if (
            doubled is not None
            and float(((doubled - 2.0 * found) ** 2).sum()) < _PROPORTIONALITY_TOLERANCE**2 * size
        ):
            return place.unexplained_share(found * factor), _with_number(start, k, start[k] * factor)
    return place.unexplained_share(found), start


def _descended_from_many(
    force: Callable[[FloatArray], FloatArray | None],
    places: Sequence[FloatArray],
    at: _Place,
    proportional: NDArray[np.bool_],
    n_evaluations: int,
) -> list[tuple[float, FloatArray]]:
    """Unexplained shares and parameters after descents from the best of many places, each at its best size.

    The force grows in proportion to the numbers that are `proportional`. An effect that leaves nearly all of the
    force at each of the first places is not what is missing; nothing is returned then.
    """

    def sized(numbers: FloatArray) -> tuple[float, FloatArray]:
        found = force(numbers)
        factor = 0.0 if found is None else at.factor(found)
        if found is None or factor == 0.0:
            return np.inf, numbers
        return at.unexplained_share(found * factor), np.where(proportional, numbers * factor, numbers)

    # Two hundred further places only where the first hundred show that the effect may be there.
    sized_starts = [sized(numbers) for numbers in places[:_FIRST_PLACES]]
    if min(share for share, _ in sized_starts) > _LARGEST_SHARE_LEFT:
        return []
    sized_starts += [sized(numbers) for numbers in places[_FIRST_PLACES:]]
    best = sorted(sized_starts, key=lambda reached: reached[0])
    tried = [numbers for _, numbers in best[:_MOST_DESCENTS]]
    reached = [
        _simplex_descent(lambda numbers: sized(numbers)[0], place, n_evaluations, _SHORT_STEP) for place in tried
    ]
    return [sized(numbers) for _, numbers in reached]


def _simplex_descent(
    left: Callable[[FloatArray], float], start: FloatArray, n_evaluations: int, step: float = _LONG_STEP
) -> tuple[float, FloatArray]:
    """Simplex (Nelder and Mead 1965, doi:10.1093/comjnl/7.4.308) in logarithms of parameters that keep their
    sign.
    """
    scale = np.where(start == 0, 1.0, start)

    def numbers(at: FloatArray) -> FloatArray:
        return np.asarray(scale * np.exp(np.clip(at, -_LARGEST_LOG_CHANGE, _LARGEST_LOG_CHANGE)))

    def cost(at: FloatArray) -> float:
        # A simplex needs numbers that can be compared; infinity less infinity is none.
        value = left(numbers(at))
        return value if np.isfinite(value) else 1e12

    n = start.size
    simplex = np.vstack([np.zeros(n), np.diag(np.full(n, step))])
    options = {"maxfev": n_evaluations, "initial_simplex": simplex, "xatol": 1e-2, "fatol": 1e-4}
    found = minimize(cost, np.zeros(n), method="Nelder-Mead", options=options)
    return float(found.fun), numbers(found.x)


def _driven(rate_hz: float, motion: FloatArray) -> Excitation:
    drive = recorded(rate_hz, displacement=motion[:, 0], velocity=motion[:, 1], acceleration=motion[:, 2])
    return with_cached_inputs(drive)


def _force_along(terms: Sequence[Term], drive: Excitation) -> FloatArray:
    if not terms:
        return np.zeros(drive.n_samples)
    # Without a structure the motion is prescribed, and where a force acts does not matter.
    alone = Twin(None, tuple(replace(term, place="tank") for term in terms))
    return np.asarray(alone.simulate(drive).require_done().forces_n.sum(axis=1))


def _is_resolved(terms: Sequence[Term], drive: Excitation) -> bool:
    """Whether a force has fewer events than samples; a contact too stiff for its steps has more."""
    if not any(term.kind.events is not None for term in terms):
        return True
    alone = Twin(None, tuple(replace(term, place="tank") for term in terms))
    return bool(alone.simulate(drive).require_done().n_events < drive.n_samples)


def _band_of_most_power(force: FloatArray) -> NDArray[np.bool_]:
    """Frequencies up to that below which nearly all power of a force lies."""
    power = np.cumsum(np.abs(rfft(force)) ** 2)
    return np.arange(power.size) <= int(np.searchsorted(power, _POWER_KEPT * power[-1]))


def _band(series: FloatArray, passed: NDArray[np.bool_]) -> FloatArray:
    return np.asarray(irfft(np.where(passed, rfft(series), 0.0), series.size))
