"""Posterior probabilities of models: evidence averaged over resampled recordings (pseudo-BMA+).

The evidence of a model is a sum over cells of time and frequency, which scatters from cell to cell where no
model is quite right. Weights are averaged over Bayesian bootstraps of the cells, so that a lead that rests on
few of them is no certainty (Yao, Vehtari, Simpson and Gelman 2018, doi:10.1214/17-BA1091).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from sloshlab.diagnosis.inference.places import SENSOR, block_of
from sloshlab.diagnosis.inference.remainder import SHARES
from sloshlab.diagnosis.inference.scored_model import (
    ScoredModel,
    difference,
    is_worth_a_word,
    strength,
)
from sloshlab.diagnosis.inference.thresholds import LEAST_STRENGTH, PRIOR_OF_REMAINDER, TOLD_APART
from sloshlab.identification.free_run_problem import TEMPERING
from sloshlab.missing_physics.candidate import BLOCKS

FloatArray = NDArray[np.float64]
NONE, UNKNOWN = "none", "unknown"
_N_DRAWS: Final = 1000
_MISSED: Final = 6 / 69
"""Of the effects with a name, those whose numbers no search finds: of the sixteenth blind trial, those that were
said to have no name."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A model, with noise alone or with a remainder at a place.

    Attributes
    ----------
    model : ScoredModel
    place : str
        Empty where nothing remains.
    label : str
        What is said if it is true: names joined by " + ", none, or unknown.
    log_prior : float
    by_cell : ndarray, shape (n_cells,)
        Tempered log-likelihood.
    """

    model: ScoredModel
    place: str
    label: str
    log_prior: float
    by_cell: FloatArray

    @property
    def log_evidence(self) -> float:
        """With its prior."""
        return float(self.by_cell.sum()) - self.model.complexity + self.log_prior


@dataclass(frozen=True, eq=False)
class Posterior:
    """Probabilities of hypotheses.

    Attributes
    ----------
    hypotheses : tuple of Hypothesis
    probabilities : ndarray, shape (n_hypotheses,)
    tempering : float
        By which log-likelihoods were divided.
    names : dict
        All names of the effects of a block, by block.
    """

    hypotheses: tuple[Hypothesis, ...]
    probabilities: FloatArray
    tempering: float
    names: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def by_label(self) -> dict[str, float]:
        """Probability of everything that may be said, the largest first."""
        return self._summed([hypothesis.label for hypothesis in self.hypotheses])

    def with_missed(self) -> dict[str, float]:
        """The same, with what has a name and was not found; the largest first.

        What no model describes has either no name or one whose numbers the search has missed. Prior and rate of
        these say which is how probable; all names of its block are alike.
        """
        without_name = PRIOR_OF_REMAINDER / (PRIOR_OF_REMAINDER + (1.0 - PRIOR_OF_REMAINDER) * _MISSED)
        sums: dict[str, float] = {}
        for hypothesis, p in zip(self.hypotheses, self.probabilities.tolist(), strict=True):
            names = self.names.get(block_of(hypothesis.place), ()) if hypothesis.label == UNKNOWN else ()
            shares = {hypothesis.label: without_name if names else 1.0}
            for name in names:
                shares[name] = (1.0 - without_name) / len(names)
            for label, share in shares.items():
                sums[label] = sums.get(label, 0.0) + share * p
        return dict(sorted(sums.items(), key=lambda item: -item[1]))

    def by_block(self) -> dict[str, float]:
        """Probability of each block of what is missing, given that something is; the largest first.

        Of a remainder it is the block of its place, of names alone that of all of them; effects of several blocks
        count for none.
        """
        blocks = [_block_of_hypothesis(h) for h in self.hypotheses]
        total = float(sum(p for h, p in zip(self.hypotheses, self.probabilities, strict=True) if h.label != NONE))
        return {} if total <= 0 else {block: p / total for block, p in self._summed(blocks).items() if block}

    def best(self, label: str) -> Hypothesis:
        """The best hypothesis of a label; of those that predict the same, the one that comes first in the chain.

        A force on a tank of frozen liquid is one on the structure, which comes first, unless the force between
        them is recorded.
        """
        alike = self.of_label(label)
        own = [h for h in alike if label in (NONE, UNKNOWN, " + ".join(h.model.names))] or alike
        same = [
            h
            for h in own
            if h.model.n_numbers == own[0].model.n_numbers
            and difference(h.model, own[0].model) / self.tempering < TOLD_APART
        ]
        return min(same, key=lambda h: sorted(BLOCKS.index(c.effect.block) for c in h.model.fit.candidates))

    def of_label(self, label: str) -> list[Hypothesis]:
        """All hypotheses of a label, the largest evidence first."""
        return sorted((h for h in self.hypotheses if h.label == label), key=lambda h: -h.log_evidence)

    def _summed(self, labels: Sequence[str]) -> dict[str, float]:
        sums: dict[str, float] = {}
        for label, p in zip(labels, self.probabilities, strict=True):
            sums[label] = sums.get(label, 0.0) + float(p)
        return dict(sorted(sums.items(), key=lambda item: -item[1]))


def _block_of_hypothesis(hypothesis: Hypothesis) -> str:
    if hypothesis.label == NONE:
        return ""
    if hypothesis.place:
        return block_of(hypothesis.place)
    blocks = {candidate.effect.block for candidate in hypothesis.model.fit.candidates}
    return blocks.pop() if len(blocks) == 1 else ""


def posterior(
    models: Sequence[ScoredModel],
    n_candidates: int,
    tempering: float = TEMPERING,
    seed: int = 0,
    names: Mapping[str, Sequence[str]] | None = None,
) -> Posterior:
    """Posterior of all models, each with noise alone and with a remainder at every place.

    Parameters
    ----------
    models : sequence of ScoredModel
        The first one without effects.
    n_candidates : int
        Effects at all places that were tried as a single one.
    tempering : float, optional
        Log-likelihoods are divided by it.
    seed : int
    names : mapping of str to sequence of str, optional
        Names of the effects that may be in a block, by block.
    """
    labels = _labels(models, tempering)
    found = [
        hypothesis
        for model, label in zip(models, labels, strict=True)
        for hypothesis in _hypotheses(model, label, n_candidates, tempering)
    ]
    n_cells = found[0].by_cell.size
    weights = np.random.default_rng(seed).dirichlet(np.ones(n_cells), _N_DRAWS) * n_cells
    fixed = np.array([h.log_prior - h.model.complexity for h in found])
    scores = weights @ np.stack([h.by_cell for h in found], axis=1) + fixed
    return Posterior(tuple(found), np.asarray(softmax(scores, axis=1).mean(axis=0)), tempering, names or {})


def _labels(models: Sequence[ScoredModel], tempering: float) -> list[str]:
    """What is said of each model: the names of the simplest one that it is no more than.

    A model is no more than one of fewer numbers that predicts the same, nor than one to which its further effects
    add nothing worth a word, if what is believed of the baseline does not tell them apart either.
    """
    labels = []
    for model in models:
        simpler = [
            other
            for other in models
            if other.n_numbers < model.n_numbers and _is_no_more_than(model, other, tempering)
        ]
        as_simple = min(simpler, key=lambda other: (other.n_numbers, -other.evidence), default=model)
        labels.append(" + ".join(as_simple.names) or NONE)
    return labels


def _is_no_more_than(model: ScoredModel, other: ScoredModel, tempering: float) -> bool:
    # Beliefs are readings, too: a model that needs less probable numbers of the baseline is another one.
    if other.cost_of_baseline - model.cost_of_baseline >= TOLD_APART:
        return False
    if difference(model, other) / tempering < TOLD_APART:
        return True
    return _is_nested(other, model) and strength(other, model) < LEAST_STRENGTH


def log_prior(n: int, n_candidates: int) -> float:
    """Of n effects: half of all cases have none, a quarter one, an eighth two …; candidates are alike.

    Parameters
    ----------
    n, n_candidates : int
    """
    return float(-(n + 1) * np.log(2.0) - n * np.log(max(n_candidates, 1)))


def _is_nested(other: ScoredModel, model: ScoredModel) -> bool:
    """Whether every effect of one model is one of another model, or what one of its effects reduces to."""
    left = list(model.fit.candidates)
    for effect in other.fit.candidates:
        within = [c for c in left if c.key == effect.key] or [c for c in left if c.reduces_to(effect)]
        if not within:
            return False
        left.remove(within[0])
    return True


def _told_apart(places: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Places without sensors that show as what moves does: only another reading tells a sensor from it."""
    moving = [by_share for place, by_share in places.items() if block_of(place) != SENSOR]
    return {
        place: by_share
        for place, by_share in places.items()
        if block_of(place) != SENSOR or not any(np.allclose(by_share, other) for other in moving)
    }


def _hypotheses(model: ScoredModel, label: str, n_candidates: int, tempering: float) -> list[Hypothesis]:
    of_model = log_prior(len(model.fit.candidates), n_candidates)
    found = [Hypothesis(model, "", label, of_model, model.remainder.noise / tempering)]
    places = _told_apart(model.remainder.places)
    # A remainder of a size that is not worth a word leaves the model what it is.
    of_remainder = UNKNOWN if is_worth_a_word(model.runs) else label
    for place, by_share in places.items():
        # The share of cells that describes best stands for all; the others are paid for by its prior.
        share = int(np.argmax(by_share.sum(axis=1)))
        found.append(
            Hypothesis(
                model,
                place,
                of_remainder,
                of_model + np.log(PRIOR_OF_REMAINDER / len(places) / SHARES.size),
                by_share[share] / tempering,
            )
        )
    return found
