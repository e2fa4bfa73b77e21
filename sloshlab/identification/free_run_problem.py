"""Weighted residuals of free-running simulations as a function of scaled parameters, and their derivatives."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import SloshlabError
from sloshlab.identification.baseline_parameter import BaselineParameter, prior_cost, prior_weights
from sloshlab.identification.block_jacobian import BlockJacobian
from sloshlab.identification.diagnosed_model import DiagnosedModel, Request
from sloshlab.identification.effort import Effort
from sloshlab.identification.observations import Observation
from sloshlab.identification.owning_runs import owning_runs
from sloshlab.missing_physics.candidate import Candidate, channels_of, extension_of
from sloshlab.missing_physics.extension import Extension, left_out_of_drives
from sloshlab.missing_physics.units import named_and_units
from sloshlab.units import DIMENSIONLESS, Dimension, dimension_of

FloatArray = NDArray[np.float64]
_Label = TypeVar("_Label")
_STEP: Final = 0.005
"""Of a finite difference, in tolerances: a frequency must not move by much of a cycle over a run."""
_COARSE_STEP: Final = 0.03
"""The same in stages with inflated noise, past the small-scale roughness that friction and contacts cause."""
_TOLERANCES_OF_DAMPING: Final = 3.0
"""Factor of the coarse step of dampings of the baseline."""
_Part = tuple[Sequence[Observation], Mapping[str, float]]
"""Observations of one run, and parameters with which it is simulated."""
HUBER_LIMIT: Final = 4.0
"""Standard deviations beyond which Huber's loss is linear: bursts of noise and lost blocks are outliers."""
TEMPERING: Final = 10.0
"""Factor by which log-likelihoods are too large: coefficients of a cell share what is wrong with their noise."""
DOWN_TO_NOISE: Final = 1.15
"""Mean square of the weighted residuals of a channel up to which nothing but noise is left."""
NEAR_A_BOUND: Final = 1e-6
"""Of a range: scaled numbers reach a bound only to rounding."""
_MOST_BYTES_AT_ONCE: Final = 3e7
"""Of the readings of simulations that are weighted together; results do not depend on it.

Motions and spectra take four times as much beside them, in every worker at once; so many still fill the lanes.
"""


@dataclass(frozen=True, eq=False)
class FreeRunFit:
    """A fitted simulation.

    Attributes
    ----------
    candidates : tuple of Candidate
        Effects beyond the baseline.
    values : dict
        Baseline parameters by name, and ``key.parameter`` of every candidate.
    cost : float
        Minus twice the logarithm of the tempered posterior, times the tempering, but for a constant: Huber loss of
        the weighted residuals and what the baseline costs by its prior.
    misfit : float
        The part of the cost that the residuals have.
    covariance : ndarray, shape (n, n)
        Of the free parameters in scaled values, in the order of `names`.
    names : tuple of str
    scales : ndarray, shape (n,)
    prior_weights : ndarray, shape (n,)
        Weights of the squares of scaled values in the Hessian, by the prior of the baseline.
    trouble : str
        Why there is no result; empty where there is one.
    """

    candidates: tuple[Candidate, ...]
    values: dict[str, float]
    cost: float
    misfit: float
    covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    names: tuple[str, ...] = ()
    scales: FloatArray = field(default_factory=lambda: np.zeros(0))
    prior_weights: FloatArray = field(default_factory=lambda: np.zeros(0))
    trouble: str = ""

    def standard_error(self, name: str) -> float:
        """Standard error of a parameter in its own unit."""
        return float(np.hypot(*self.standard_errors(name)))

    def standard_errors(self, name: str) -> tuple[float, float]:
        """Standard errors of a parameter in its own unit: by noise, and by what is not known of the baseline.

        The covariance C = (JᵀJ + W)⁻¹, with W the weights of the prior, is C JᵀJ C + C W C. The first part is by
        noise. Numbers of the baseline are off by the variance T/W, which moves the fit by C W: the second part
        counts T times, the factor by which likelihoods are tempered.
        """
        i = self.names.index(name)
        of_prior = float(self.covariance[i] ** 2 @ self.prior_weights)
        of_noise = max(float(self.covariance[i, i]) - of_prior, 0.0)
        scale = float(self.scales[i])
        return float(np.sqrt(of_noise)) * scale, float(np.sqrt(TEMPERING * of_prior)) * scale


@dataclass(frozen=True)
class _Number:
    """A free number: counted from its centre in units of its scale, within its bounds.

    Numbers of the baseline are counted in tolerances from what is believed, so that the negative logarithm of
    their prior is a function of theta; those of effects by their starts, from zero, where an effect
    is absent. `channels` are those that it alone changes, none where it changes the motion.
    """

    name: str
    centre: float
    scale: float
    low: float
    high: float
    channels: tuple[str, ...]
    is_reading: bool = False
    is_damping: bool = False
    dimension: Dimension = DIMENSIONLESS


class FreeRunProblem:
    """Weighted residuals of one set of observations as a function of scaled parameters.

    Parameters
    ----------
    model : DiagnosedModel
    runs : sequence of sequences of Observation
        Per run.
    candidates : sequence of Candidate
    fixed : mapping, optional
        Parameters that are not free.
    effort : Effort, optional
        That of a search, to which its simulations are added.
    faulty : collection of str, optional
        Channels that leave the drive to others; those on which the candidates act if not given.
    """

    def __init__(
        self,
        model: DiagnosedModel,
        runs: Sequence[Sequence[Observation]],
        candidates: Sequence[Candidate] = (),
        fixed: Mapping[str, float] | None = None,
        effort: Effort | None = None,
        faulty: Collection[str] | None = None,
    ) -> None:
        self.effort = effort or Effort()
        self.model, self.candidates = model, tuple(candidates)
        self.faulty = faulty_channels(candidates) if faulty is None else frozenset(faulty)
        self._left_out = self.faulty - faulty_channels(candidates)
        self._with_all = [run for run in runs if run]
        self.runs = [[each.beside_faults(self.faulty) for each in run] for run in self._with_all]
        self.fixed = dict(fixed or {})
        present = {observation.run.name for run in self.runs for observation in run}

        self._owners = owning_runs(model.parameters, self.candidates)

        def is_free(name: str) -> bool:
            return name not in self.fixed and self.owner(name) in ("", *present)

        baseline = [_of_baseline(known) for known in model.parameters if is_free(known.name)]
        # An effect on a sensor that drives changes the motion and with it every channel.
        driving = {name for run in self.runs for name in model.driving(run[0].run)}
        of_effects = [number for candidate in self.candidates for number in _of_effect(candidate, driving)]
        # Numbers of runs that are not there rest where they start.
        absent = {n.name: n.scale for n in of_effects if n.name not in self.fixed and not is_free(n.name)}
        self.fixed |= absent
        free = [*baseline, *(number for number in of_effects if is_free(number.name))]
        self.n_baseline = len(baseline)
        self.names = tuple(number.name for number in free)
        self.centres, self.scales, self.low, self.high = (
            np.array([getattr(number, of) for number in free], np.float64)
            for of in ("centre", "scale", "low", "high")
        )
        self._channels_changed = [number.channels for number in free]
        self._is_reading = np.array([number.is_reading for number in baseline], bool)
        self._is_damping = [number.is_damping for number in free]
        powers = [(number.dimension.mass, number.dimension.length) for number in free]
        self._powers = np.array(powers, np.float64).reshape(-1, 2)
        ends = np.cumsum([0] + [observation.spectra.size for run in self.runs for observation in run])
        self._rows = [slice(int(first), int(end)) for first, end in pairwise(ends)]

    def owner(self, name: str) -> str:
        """The run to which a number belongs alone; empty where it belongs to all."""
        return self._owners.get(name, "")

    def prior_cost(self, theta: FloatArray, inflation: float = 0.0) -> float:
        """What scaled parameters cost by their prior, zero where all are as believed.

        Minus twice its logarithm, times the tempering: likelihood and prior have the weights of the posterior.
        Inflated noise weakens the likelihood by itself.
        """
        return _tempering(inflation) * float(prior_cost(theta[: self.n_baseline]).sum())

    def prior_weights(self, theta: FloatArray, inflation: float = 0.0) -> FloatArray:
        """Weights of the squares of scaled parameters with the slope of this cost; zero of those of effects."""
        weights = _tempering(inflation) * prior_weights(theta[: self.n_baseline])
        return np.pad(weights, (0, len(self.names) - self.n_baseline))

    def misfit(self, residual: FloatArray, inflation: float = 0.0) -> float:
        """Huber's loss of comparable residuals: minus twice a log-likelihood, but for a common constant.

        Parameters
        ----------
        residual : ndarray
        inflation : float, optional
            As of `inflation_weights`.
        """
        comparable = self.comparable(residual)
        return huber_cost(comparable if inflation == 0 else self.comparison_weights(inflation) * comparable)

    def comparable(self, residual: FloatArray) -> FloatArray:
        """Residuals by which models are compared in which others drive, or changes of them; a linear map.

        Beside a fault of a sensor that has left the drive the other channels are taken given its reading, which
        tells most of what its absence adds to their noise, and in the noise where all drive.

        Parameters
        ----------
        residual : ndarray
            As of `residual`.
        """
        if not self.is_otherwise_driven:
            return residual
        found, rows = [], iter(self._rows)
        for run, known in zip(self.runs, self._with_all, strict=True):
            own = [residual[next(rows)].reshape(each.spectra.shape) * np.sqrt(each.variance) for each in run]
            place = {each.channel: i for i, each in enumerate(run)}
            for i, with_all in enumerate(known):
                faulty = [name for name in with_all.other_drives if name in self.faulty and name in place]
                if with_all.channel in self.faulty or len(faulty) != 1:
                    found.append(own[i] / np.sqrt(run[i].variance))
                    continue
                [name] = faulty
                told = with_all.other_drives[name].told * own[place[name]]
                found.append((own[i] - told) / np.sqrt(with_all.variance))
        return np.concatenate([each.ravel() for each in found])

    def comparison_weights(self, inflation: float) -> FloatArray:
        """As `inflation_weights`, of comparable residuals.

        Parameters
        ----------
        inflation : float
        """
        return _inflation_weights(self._with_all if self.is_otherwise_driven else self.runs, inflation)

    @cached_property
    def is_otherwise_driven(self) -> bool:
        """Whether a sensor that drives elsewhere is faulty here."""
        pairs = zip(self.runs, self._with_all, strict=True)
        return any(new is not old for run, known in pairs for new, old in zip(run, known, strict=True))

    @property
    def changes_motion(self) -> NDArray[np.bool_]:
        """Which of the baseline's parameters change the motion, not only what a channel reads."""
        return ~self._is_reading

    def is_down_to_noise(self, fit: FreeRunFit) -> bool:
        """Whether a fit leaves no more than the noise in any channel."""
        residual = self.residual(self.theta_of(fit.values))
        left = mean_squares([observation for run in self.runs for observation in run], residual)
        return max(left.values(), default=0.0) < DOWN_TO_NOISE

    def values(self, theta: FloatArray) -> dict[str, float]:
        """Parameters by name in their own units."""
        # Starts and finite differences may lie outside the bounds; the simulation never does.
        physical = np.clip(self.centres + theta * self.scales, self.low, self.high)
        return {**self.fixed, **dict(zip(self.names, physical.tolist(), strict=True))}

    def theta_of(self, values: Mapping[str, float]) -> FloatArray:
        """Scaled parameters; those that are not given are as believed."""
        known = np.array([values.get(name, centre) for name, centre in zip(self.names, self.centres, strict=True)])
        return np.asarray((known - self.centres) / self.scales)

    def at_bounds(self, theta: FloatArray) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which parameters are as small as they may be, and which as large."""
        physical = self.centres + theta * self.scales
        near = NEAR_A_BOUND * (self.high - self.low)
        return physical <= self.low + near, physical >= self.high - near

    def residual(self, theta: FloatArray) -> FloatArray:
        """Weighted residuals of all runs; infinite where the simulation does not reach its end."""
        return self.residuals([theta])[0]

    def residuals(self, thetas: Sequence[FloatArray]) -> list[FloatArray]:
        """Residuals of several sets of parameters, all runs of all sets simulated together."""
        parts = [(run, values) for values in map(self.values, thetas) for run in self.runs]
        found = iter(self._weighted(parts))
        return [np.concatenate([next(found) for run in self.runs for _ in run]) for _ in thetas]

    def costs(self, several: Sequence[Mapping[str, float]]) -> FloatArray:
        """Cost of several sets of values, as of a fit; infinite where a simulation does not reach its end."""
        thetas = [self.theta_of(values) for values in several]
        return np.array(
            [
                self.misfit(residual) + self.prior_cost(theta) if np.isfinite(residual).all() else np.inf
                for theta, residual in zip(thetas, self.residuals(thetas), strict=True)
            ]
        )

    def _weighted(self, parts: Sequence[_Part]) -> Iterator[FloatArray]:
        """Weighted residuals of every observation of every part, one after the other."""
        self.effort.add(sum(observation.spectra.size for run, _ in parts for observation in run))
        for some in _at_once(parts):
            yield from weighted_residuals(self.model, some, self.candidates, self._left_out)

    def inflation_weights(self, inflation: float) -> FloatArray:
        """Factors of the residuals with inflated noise: every channel known only to a share of its RMS.

        √(σ²/(σ² + share² ⟨y²⟩)) for the variance σ² of a coefficient of the channel y.
        """
        return _inflation_weights(self.runs, inflation)

    def jacobian(
        self,
        theta: FloatArray,
        at: FloatArray,
        columns: Sequence[int],
        *,
        coarse: bool = False,
        forward: bool = True,
        most: FloatArray | None = None,
    ) -> BlockJacobian:
        """Derivatives of the residuals by some scaled parameters, by finite differences.

        Coarse differences are wider: the residual is rough on a small scale with dry friction and contacts. Steps
        are upward, or downward where not `forward`, and away from bounds. What is given as `most` limits the
        steps of all parameters.

        Those by all parameters are right along changes of scale, too, by the least change of the others.
        """
        direction = 1.0 if forward else -1.0
        places = [self._moved(theta, column, direction, coarse=coarse, most=most) for column in columns]
        changed = [self._changed_by([column]) for column in columns]
        parts = [
            (chosen, self.values(place))
            for place, (_, by_run) in zip(places, changed, strict=True)
            for chosen in by_run
        ]
        scalings = self._small_changes_of_scale(theta, direction) if len(columns) == theta.size else []
        parts += [(run, self.values(theta + scaling)) for scaling in scalings for run in self.runs]
        residuals = self._weighted(parts)
        derivatives = []
        for place, column, (blocks, _) in zip(places, columns, changed, strict=True):
            found = {block: next(residuals) for block in blocks}
            # In place, as a column is as large as all recordings that it changes.
            for block, derivative in found.items():
                derivative -= at[self._rows[block]]
                derivative /= place[column] - theta[column]
            # A parameter whose simulation fails has no derivative, and the step does not use it.
            good = all(np.isfinite(derivative).all() for derivative in found.values())
            derivatives.append(found if good else {})
        jacobian = BlockJacobian.of_blocks(
            derivatives, [observation.spectra.size for run in self.runs for observation in run]
        )
        if scalings:
            changes = np.concatenate(list(residuals)).reshape(len(scalings), -1) - at
            runs = np.isfinite(changes).all(axis=1)
            jacobian.correct(np.array(scalings)[runs].T, changes[runs].T)
        return jacobian

    def _moved(
        self, theta: FloatArray, column: int, direction: float, *, coarse: bool, most: FloatArray | None
    ) -> FloatArray:
        """Parameters of which one is moved by a finite difference."""
        is_effect, is_damping = column >= self.n_baseline, self._is_damping[column]
        step = _COARSE_STEP if coarse and (is_effect or is_damping) else _STEP
        if is_effect:
            # Relative to the parameter, which may have moved far from the start that scales it; an effect of size
            # nothing still needs a step.
            step *= max(abs(theta[column]), 0.05)
        elif is_damping and coarse:
            # Only in coarse stages: the optimum itself is sought with the fine step.
            step *= _TOLERANCES_OF_DAMPING
        step = direction * (step if most is None else min(step, float(most[column])))
        physical = self.centres[column] + (theta[column] + step) * self.scales[column]
        moved = theta.copy()
        # Away from the bound, where the values would be clipped and the difference zero.
        moved[column] += step if self.low[column] <= physical <= self.high[column] else -step
        return moved

    def changes_of_scale(self, theta: FloatArray) -> list[FloatArray]:
        """Directions in which all numbers grow as the unit of mass, or that of length, becomes smaller.

        All motions and forces grow in proportion, and readings stay as they are where gains are free. One by one
        these numbers change the motion much, and rough where friction and contacts jump: what such columns of a
        Jacobian say of their sum is roughness.

        Parameters
        ----------
        theta : ndarray

        Returns
        -------
        list of ndarray, shape of theta
            Each by one tolerance of the baseline's number that is known best; those that change two numbers, and
            one where both units change the same numbers alike.
        """
        values, found = self.centres / self.scales + theta, []
        for powers in self._powers.T:
            direction = powers * values
            largest = np.abs(direction[: self.n_baseline]).max(initial=0.0)
            if largest > 0 and np.count_nonzero(direction) > 1:
                found.append(direction / largest)
        return found[: np.linalg.matrix_rank(np.stack(found))] if found else []

    def _small_changes_of_scale(self, theta: FloatArray, sign: float) -> list[FloatArray]:
        """As wide as a finite difference, or opposite where a number would leave its bounds; none at both ends."""
        low, high = ((bounds - self.centres) / self.scales - theta for bounds in (self.low, self.high))
        found = []
        for direction in self.changes_of_scale(theta):
            for step in (sign * _STEP * direction, -sign * _STEP * direction):
                if np.all((step == 0) | (low <= step) & (step <= high)):
                    found.append(step)
                    break
        return found

    def central_jacobian(self, theta: FloatArray) -> BlockJacobian:
        """Derivatives by all scaled parameters, by central differences: for a covariance.

        Where two numbers do nearly the same, such as a frequency and a spring that stiffens, what tells them apart
        is the small difference of two large columns, within the error of forward differences.
        """
        at, columns = self.residual(theta), range(theta.size)
        return self.jacobian(theta, at, columns).mean_with(self.jacobian(theta, at, columns, forward=False))

    def residuals_moved(
        self, thetas: Sequence[FloatArray], columns: Sequence[int], at: FloatArray
    ) -> Iterator[FloatArray]:
        """Residuals after some parameters were moved, one after another: all together would fill the memory.

        Unchanged in other runs and channels where the parameters have their own.

        Parameters
        ----------
        thetas : sequence of ndarray
        columns : sequence of int
            Of the parameters.
        at : ndarray
            Residuals where nothing is moved.
        """
        blocks, by_run = self._changed_by(columns)
        weighted = iter(self._weighted([(chosen, self.values(theta)) for theta in thetas for chosen in by_run]))
        for _ in thetas:
            moved = at.copy()
            for block in blocks:
                moved[self._rows[block]] = next(weighted)
            yield moved

    def _changed_by(self, columns: Sequence[int]) -> tuple[list[int], list[list[Observation]]]:
        """Blocks that any of some parameters changes, and their observations run by run."""
        # The sparsity of the Jacobian: a release or an offset is simulated for its run alone, a gain for its
        # channel alone.
        seen = [(self.owner(self.names[column]), self._channels_changed[column]) for column in columns]
        blocks: list[int] = []
        runs: list[list[Observation]] = []
        n_before = 0
        for run in self.runs:
            chosen = [
                i
                for i, observation in enumerate(run)
                if any(
                    owner in ("", observation.run.name) and (not by or observation.channel in by)
                    for owner, by in seen
                )
            ]
            runs += [[run[i] for i in chosen]] if chosen else []
            blocks += [n_before + i for i in chosen]
            n_before += len(run)
        return blocks, runs


def _inflation_weights(runs: Sequence[Sequence[Observation]], inflation: float) -> FloatArray:
    return np.concatenate(
        [
            np.sqrt(each.variance / (each.variance + inflation**2 * float(np.mean(each.spectra**2)))).ravel()
            for run in runs
            for each in run
        ]
    )


def faulty_channels(candidates: Sequence[Candidate]) -> frozenset[str]:
    """Channels that are lost to a drive, as what some effects make of their readings cannot be undone.

    Parameters
    ----------
    candidates : sequence of Candidate
    """
    of_sensors = [each for each in candidates if each.effect.block == "sensor"]
    faults = [
        fault for each in of_sensors for start in each.starts()[:1] for fault in extension_of([each], start).faults
    ]
    return frozenset(fault.channel for fault in faults if fault.leaves_drive)


def _tempering(inflation: float) -> float:
    return TEMPERING if inflation == 0 else 1.0


def _at_once(parts: Sequence[_Part]) -> Iterator[Sequence[_Part]]:
    """Parts whose readings together take no more memory than they may."""
    first, n_bytes = 0, 0
    for i, (run, _) in enumerate(parts):
        n_bytes += 8 * sum(observation.known.size for observation in run)
        if n_bytes > _MOST_BYTES_AT_ONCE:
            yield parts[first : i + 1]
            first, n_bytes = i + 1, 0
    yield parts[first:]


def weighted_residuals(
    model: DiagnosedModel, parts: Sequence[_Part], candidates: Sequence[Candidate], left_out: Collection[str] = ()
) -> list[FloatArray]:
    """Weighted residuals; infinite of a run whose simulation does not reach its end.

    Parameters
    ----------
    model : DiagnosedModel
    parts : sequence of (observations of one run, values)
        Values of the baseline, and ``key.parameter`` of every candidate.
    candidates : sequence of Candidate
    left_out : collection of str, optional
        Channels that do not drive, although no candidate acts on them.

    Returns
    -------
    list of ndarray, shape (size of the observation,)
        Of every observation of every part, one after the other.
    """
    # of each observation, where its residuals go and what was simulated
    simulated: dict[int, tuple[Observation, list[int], list[FloatArray]]] = {}
    requests: list[Request | None] = []
    for run, values in parts:
        # Numbers with which an effect cannot be said describe nothing, like those of a simulation that fails.
        try:
            extension = extension_of(candidates, values)
        except SloshlabError:
            requests.append(None)
        else:
            if left_out:
                extension += Extension(faults=left_out_of_drives(left_out))
            requests.append(Request(run[0].run, values, extension, [observation.channel for observation in run]))
    readings = iter(model.simulate_many([request for request in requests if request is not None]))
    sizes: list[int] = []
    for (run, _), request in zip(parts, requests, strict=True):
        of_run = None if request is None else next(readings)
        for observation in run:
            # A simulation that fails describes nothing. It must not end the search, which tries many parameters
            # that do not run.
            if isinstance(of_run, dict):
                _, places, series = simulated.setdefault(id(observation), (observation, [], []))
                places.append(len(sizes))
                series.append(of_run[observation.channel])
            sizes.append(observation.spectra.size)
    found: dict[int, FloatArray] = {}

    def weigh(item: tuple[Observation, list[int], list[FloatArray]]) -> None:
        observation, places, series = item
        for place, residual in zip(places, observation.residuals(series), strict=True):
            found[place] = residual.ravel()

    list(model.executor.map(weigh, simulated.values()))
    return [found[i] if i in found else np.full(size, np.inf) for i, size in enumerate(sizes)]


def _of_baseline(known: BaselineParameter) -> _Number:
    return _Number(
        known.name,
        known.believed,
        known.tolerance,
        *known.bounds,
        (known.channel,) if known.channel else (),
        known.is_reading,
        known.is_damping,
        known.dimension or dimension_of(known.units),
    )


def _of_effect(candidate: Candidate, driving: Collection[str]) -> list[_Number]:
    channels, is_sensor = _only_channels(candidate, driving), candidate.effect.block == "sensor"
    return [
        _Number(
            name,
            0.0,
            candidate.scale(known.name),
            *candidate.bounds(known),
            channels,
            dimension=DIMENSIONLESS if is_sensor else dimension_of(named_and_units(known.name)[1]),
        )
        for name, known in candidate.names.items()
    ]


def _only_channels(candidate: Candidate, driving: Collection[str]) -> tuple[str, ...]:
    """Channels that alone an effect changes; none given where it changes the motion."""
    # an error of the airspeed is one of a sensor that is compared with nothing and moves everything
    is_of_channels = candidate.effect.block == "sensor" and bool(candidate.channel)
    changed = channels_of(candidate.channel) if is_of_channels else ()
    return () if any(name in driving for name in changed) else changed


def mean_squares(observed: Sequence[Observation], residual: FloatArray) -> dict[str, float]:
    """Mean Huber loss of the informative residuals of each channel over all runs.

    Parameters
    ----------
    observed : sequence of Observation
    residual : ndarray
        Of all of them, one after another.
    """
    return _means(observed, residual, lambda observation: observation.channel)


def _means(
    observed: Sequence[Observation], residual: FloatArray, label: Callable[[Observation], _Label], least: int = 1
) -> dict[_Label, float]:
    sums: dict[_Label, list[float]] = {}
    first = 0
    for observation in observed:
        own = residual[first : first + observation.spectra.size]
        first += observation.spectra.size
        chosen = own[observation.informative.ravel()]
        total = sums.setdefault(label(observation), [0.0, 0.0])
        total[0] += huber_cost(chosen)
        total[1] += chosen.size
    return {name: squares / n for name, (squares, n) in sums.items() if n >= least}


def robust_weights(residual: FloatArray, limit: float = HUBER_LIMIT) -> FloatArray:
    """Square roots of Huber's weights, for iteratively reweighted least squares."""
    size = np.abs(residual)
    # Square roots, since they multiply rows of the Jacobian and the residual, of which products are summed.
    return np.asarray(np.where(size > limit, np.sqrt(limit / np.maximum(size, 1e-300)), 1.0))


def huber_cost(residual: FloatArray, limit: float = HUBER_LIMIT) -> float:
    """Huber loss: a sum of squares that grows linearly beyond some standard deviations, four by default."""
    size = np.abs(residual)
    within = np.minimum(size, limit)
    return float((within * (2 * size - within)).sum())
