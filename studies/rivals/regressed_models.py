"""Sparse models of what the retuned baseline lacks: support by STLSQ, size by one Gauss–Newton step.

The support of a model comes from a regression on the latent force or on the residual of a channel, and from one on
the whitened residuals of all channels. Its coefficients, and the baseline's own numbers beside them, are then
refined by one step that is linear in both; its errors are those of the whitened residuals after this step.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis.inference.scored_model import robust_squares
from sloshlab.errors import MissingExtraError
from sloshlab.identification.free_run_problem import HUBER_LIMIT, FreeRunProblem, robust_weights
from studies.rivals.baseline import RetunedBaseline
from studies.rivals.force_targets import Target, targets_of
from studies.rivals.libraries import LIBRARIES, names_of

FloatArray = NDArray[np.float64]
THRESHOLDS: Final = (0.03, 0.05, 0.08, 0.12, 0.2, 0.3, 0.45, 0.65)
"""Of STLSQ: least RMS of a term over that of its target."""
_RIDGE: Final = 1e-3
"""Of STLSQ, times the number of samples: columns have unit RMS, and neighbours such as x and x³ are alike."""
_N_LEADERS: Final = 3
"""Models beside which a term at another place is tried."""
_LEAST_LEFT: Final = 1e-4
"""Share of the power of a term that retuning does not take, from which the term is more than retuning."""
Support = tuple[tuple[int, int], ...]
"""Number of the target and number of the term in its library."""


@dataclass(frozen=True)
class ChosenTerm:
    """A term of a model.

    Attributes
    ----------
    place, channel, term : str
    coefficient : float
        In true units.
    share : float
        RMS of what it adds to the residuals, over theirs.
    """

    place: str
    channel: str
    term: str
    coefficient: float
    share: float


@dataclass(frozen=True)
class RegressedModel:
    """Terms with their coefficients, and what they leave.

    Attributes
    ----------
    threshold : float or None
        Of STLSQ; None of single terms and of a term added to another model.
    terms : tuple of ChosenTerm
    fitted, judged : float
        Mean squares of the whitened residuals of fitted and of held-out runs.
    """

    threshold: float | None
    terms: tuple[ChosenTerm, ...]
    fitted: float
    judged: float

    @property
    def names(self) -> tuple[tuple[str, str], ...]:
        """Block and name of every effect that its terms are called, sorted."""
        shares: dict[tuple[str, str], dict[str, float]] = {}
        for term in self.terms:
            shares.setdefault((term.place, term.channel), {})[term.term] = term.share
        return tuple(
            sorted({(place, name) for (place, _), each in shares.items() for name in names_of(place, each)})
        )

    @property
    def block(self) -> str:
        """Of its largest term."""
        return max(self.terms, key=lambda term: term.share).place

    def to_document(self) -> dict[str, Any]:
        """As JSON holds it."""
        return asdict(self)

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> RegressedModel:
        """What `to_document` gave."""
        terms = tuple(ChosenTerm(**term) for term in document["terms"])
        return cls(document["threshold"], terms, document["fitted"], document["judged"])


def sequentially_thresholded(table: FloatArray, values: FloatArray, threshold: float) -> FloatArray:
    """Coefficients by pysindy's STLSQ; those of dropped terms are zero, shape (n_terms,).

    Parameters
    ----------
    table : ndarray, shape (n, n_terms)
    values : ndarray, shape (n,)
    threshold : float
        Least RMS of a term over that of the values.

    Raises
    ------
    MissingExtraError
        If pysindy is not installed.

    Notes
    -----
    Columns and values are scaled to unit RMS, so that one threshold serves all terms.
    S. L. Brunton, J. L. Proctor, J. N. Kutz, PNAS 113 (2016) 3932–3937, doi:10.1073/pnas.1517384113.
    """
    try:
        from pysindy import STLSQ
    except ImportError as error:
        raise MissingExtraError("pysindy", extra="peers", purpose="the sparse regression") from error
    found = np.zeros(table.shape[1])
    if not table.size:
        return found
    sizes, scale = _rms(table), float(_rms(values))
    usable = sizes > 0
    if scale > 0 and usable.any():
        optimiser = STLSQ(threshold=threshold, alpha=_RIDGE * values.size, max_iter=50)
        with warnings.catch_warnings():
            # It warns where no term is left, which is an answer.
            warnings.simplefilter("ignore", UserWarning)
            optimiser.fit(table[:, usable] / sizes[usable], values[:, None] / scale)
        found[usable] = np.asarray(optimiser.coef_, np.float64).ravel() * scale / sizes[usable]
    return found


def regressed_models(found: RetunedBaseline) -> list[RegressedModel]:
    """Models at every place and threshold, single terms, and terms of other places beside the best of them.

    Parameters
    ----------
    found : RetunedBaseline
    """
    targets = list(targets_of(found))
    step = GaussNewtonStep(found, targets)
    models: dict[Support, RegressedModel] = {}
    for threshold, support in (*_supports(targets), *_whitened_supports(targets, step)):
        if support not in models:
            models[support] = step.model(support, threshold)
    for leader in sorted(models, key=lambda support: models[support].judged)[:_N_LEADERS]:
        for support in _with_another(leader, targets):
            models.setdefault(support, step.model(support, None))
    return list(models.values())


def _supports(targets: Sequence[Target]) -> Iterator[tuple[float | None, Support]]:
    for i, target in enumerate(targets):
        for threshold in THRESHOLDS:
            chosen = np.flatnonzero(sequentially_thresholded(target.table, target.values, threshold))
            if chosen.size:
                yield threshold, tuple((i, k) for k in chosen.tolist())
        for k in range(len(LIBRARIES[target.place])):
            yield None, ((i, k),)


def _whitened_supports(targets: Sequence[Target], step: GaussNewtonStep) -> Iterator[tuple[float, Support]]:
    """The same by a regression on the whitened residuals, of every place and of all together."""
    every = [(i, k) for i, target in enumerate(targets) for k in range(len(LIBRARIES[target.place]))]
    for group in (*([each for each in every if each[0] == i] for i in range(len(targets))), every):
        table, values, usable = step.condensed(group)
        for threshold in THRESHOLDS:
            chosen = np.flatnonzero(sequentially_thresholded(table, values, threshold))
            if chosen.size:
                yield threshold, tuple(usable[k] for k in chosen.tolist())


def _with_another(leader: Support, targets: Sequence[Target]) -> Iterator[Support]:
    places = {targets[i].place for i, _ in leader}
    for i, target in enumerate(targets):
        if target.place not in places:
            for k, term in enumerate(LIBRARIES[target.place]):
                if term.effect:
                    yield tuple(sorted((*leader, (i, k))))


class GaussNewtonStep:
    """One step from the retuned baseline, linear in its own numbers and in the terms of all targets.

    Parameters
    ----------
    found : RetunedBaseline
    targets : sequence of Target
    """

    def __init__(self, found: RetunedBaseline, targets: Sequence[Target]) -> None:
        self.targets = targets
        problem = FreeRunProblem(found.model, found.runs)
        theta = problem.theta_of(found.values)
        whole = problem.residual(theta)
        derivatives = problem.jacobian(theta, whole, range(theta.size))
        self._n_own = theta.size
        self._own_of_run = [problem.owner(name) for name in problem.names]
        self._prior, self._pull = problem.prior_weights(theta), problem.prior_weights(theta) * theta
        self._first_of = np.cumsum([0, *(len(LIBRARIES[target.place]) for target in targets)]) + self._n_own
        self._runs = [run[0].run.name for run in found.runs]
        blocks = iter(derivatives.blocks)
        self._columns, self._residuals, self._shown = [], [], []
        for number, run in enumerate(found.runs):
            own, left = [], []
            for observation in run:
                block = next(blocks)
                dense = np.zeros((observation.spectra.size, self._n_own))
                dense[:, block.columns] = block.values
                own.append(dense)
                left.append(whole[block.rows])
            # A residual is recorded minus simulated: what a term adds to the simulation is taken off.
            terms = [-target.responses[number] for target in targets]
            self._columns.append(np.hstack([np.concatenate(own), *terms]))
            self._residuals.append(np.concatenate(left))
            self._shown.append(np.concatenate([observation.informative.ravel() for observation in run]))
        self._n_fitted = len(found.fitting)
        self._judged = range(self._n_fitted, len(found.runs)) if found.held_out else range(self._n_fitted)
        # The limit of the fit that found the baseline: at its optimum a step without terms is none.
        fitted = np.concatenate(self._residuals[: self._n_fitted])
        self._limit = max(HUBER_LIMIT, 3.0 * float(_rms(fitted)))
        n = self._columns[0].shape[1]
        self._normal, self._gradient = np.zeros((n, n)), np.zeros(n)
        for columns, residual in zip(
            self._columns[: self._n_fitted], self._residuals[: self._n_fitted], strict=True
        ):
            weights = robust_weights(residual, self._limit)
            weighted = columns * weights[:, None]
            self._normal += weighted.T @ weighted
            self._gradient += weighted.T @ (weights * residual)

    def model(self, support: Support, threshold: float | None) -> RegressedModel:
        """The model with some terms.

        Parameters
        ----------
        support : tuple of (int, int)
            Number of the target and of its term.
        threshold : float or None
        """
        chosen = [int(self._first_of[i]) + k for i, k in support]
        step = self._solved(chosen)
        after = [self._after(number, step) for number in range(len(self._runs))]
        # Of all coefficients: where the recording is quiet a term adds nothing.
        size = max(float(_rms(np.concatenate(self._residuals))), 1e-300)
        terms = []
        for place, (i, k) in zip(chosen, support, strict=True):
            added = np.concatenate([columns[:, place] * step[place] for columns in self._columns])
            target = self.targets[i]
            name = LIBRARIES[target.place][k].name
            share = float(_rms(added)) / size
            terms.append(ChosenTerm(target.place, target.channel, name, float(step[place]), share))
        fitted = _mean_square(after[: self._n_fitted])
        return RegressedModel(threshold, tuple(terms), fitted, _mean_square([after[n] for n in self._judged]))

    def condensed(self, wanted: Sequence[tuple[int, int]]) -> tuple[FloatArray, FloatArray, list[tuple[int, int]]]:
        """A small least-squares problem that has the solution of the whole one.

        Parameters
        ----------
        wanted : sequence of (int, int)
            Number of the target and of its term.

        Returns
        -------
        table : ndarray, shape (n, n)
        values : ndarray, shape (n,)
        usable : list of (int, int)
            Those of the wanted terms that do more than numbers of the baseline: the columns of the table.

        Notes
        -----
        The baseline's own numbers are eliminated (Schur complement S of the normal equations). With S = RᵀR and
        the gradient g, |R c − R⁻ᵀ g|² is the sum of squares but for a constant.
        """
        places = np.array([int(self._first_of[i]) + k for i, k in wanted])
        own = np.arange(self._n_own)
        among = self._normal[np.ix_(own, own)] + np.diag(self._prior)
        cross = self._normal[np.ix_(own, places)]
        shifts = np.linalg.lstsq(among, np.column_stack([cross, self._gradient[own] + self._pull]), rcond=1e-10)[0]
        left = self._normal[np.ix_(places, places)] - cross.T @ shifts[:, :-1]
        pull = self._gradient[places] - cross.T @ shifts[:, -1]
        before = np.diag(self._normal)[places]
        good = np.flatnonzero((before > 0) & (np.diag(left) > _LEAST_LEFT * before))
        scale = np.sqrt(np.diag(left)[good])
        squares, vectors = np.linalg.eigh(left[np.ix_(good, good)] / np.outer(scale, scale))
        roots = np.sqrt(np.maximum(squares, 1e-10))
        table = roots[:, None] * vectors.T * scale
        values = (vectors.T @ (-pull[good] / scale)) / roots
        return table, values, [wanted[k] for k in good.tolist()]

    def _solved(self, chosen: Sequence[int]) -> FloatArray:
        free = [*range(self._n_own), *chosen]
        normal = self._normal[np.ix_(free, free)].copy()
        gradient = self._gradient[free].copy()
        own = range(self._n_own)
        normal[own, own] += self._prior
        gradient[: self._n_own] += self._pull
        scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        solved = np.linalg.lstsq(normal / np.outer(scale, scale), -gradient / scale, rcond=1e-10)[0]
        step = np.zeros(self._normal.shape[0])
        step[free] = solved / scale
        return step

    def _after(self, number: int, step: FloatArray) -> FloatArray:
        """Residuals of a run where it stands out of the noise.

        Numbers that belong to it alone are fitted to it, also where it is held out.
        """
        columns, step = self._columns[number], step.copy()
        alone = [k for k, run in enumerate(self._own_of_run) if run == self._runs[number]]
        step[alone] = 0.0
        left = self._residuals[number] + columns @ step
        if alone:
            weights = robust_weights(left, self._limit)
            table = columns[:, alone] * weights[:, None]
            normal = table.T @ table + np.diag(self._prior[alone])
            gradient = table.T @ (weights * left) + self._pull[alone]
            left = left - columns[:, alone] @ np.linalg.lstsq(normal, gradient, rcond=1e-10)[0]
        return np.asarray(left[self._shown[number]])


def _mean_square(residuals: Sequence[FloatArray]) -> float:
    joined = np.concatenate([np.zeros(0), *residuals])
    return float(robust_squares(joined).mean()) if joined.size else 0.0


def _rms(values: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))
