"""A law for a force that has no name: a sum of few products of powers of the motion, judged like any other model.

Products are added one by one. Beside a fit each one's gain is predicted in free simulation while all other numbers
follow, as that of any effect that may hide (`hidden_effects`); those that promise most are fitted.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis.findings import Findings, Scoring
from sloshlab.diagnosis.inference.scored_model import ScoredModel
from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.diagnosis.selection.hidden_effects import hidden_effects
from sloshlab.diagnosis.selection.known_fits import N_KEPT, SEARCH
from sloshlab.errors import SloshlabError
from sloshlab.identification.diagnosed_model import ModelOfBlocks
from sloshlab.identification.free_run_fit import fitted
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.missing_force.latent_force import STRUCTURE, TANK
from sloshlab.missing_physics.candidate import Candidate, Effect, EffectParameter, Numbers, Surroundings
from sloshlab.missing_physics.effects import scales
from sloshlab.missing_physics.extension import Extension
from sloshlab.missing_physics.prior import Range
from sloshlab.missing_physics.product_laws import formula_of, library, variables_of, words_of
from sloshlab.twin.product_forces import Product, sum_of_products

_MOST_PRODUCTS: Final = 3
"""Of a law: a formula that a person can read."""


@dataclass(frozen=True, eq=False)
class FoundLaw:
    """A law that describes a missing force better than nothing does, on runs that chose nothing, too.

    Attributes
    ----------
    model : ScoredModel
        The baseline with it, fitted; an effect for each product.
    block : str
    products : tuple of Product
    coefficients_n : tuple of float
        Of the products where the motion has its scales.
    scales : tuple of float
        Of displacement, velocity and acceleration.
    holds : bool
        Whether it is better than every model with a name, too. If not it is no more than a description of the
        latent force, with which new runs can be simulated.
    """

    model: ScoredModel
    block: str
    products: tuple[Product, ...]
    coefficients_n: tuple[float, ...]
    scales: tuple[float, float, float]
    holds: bool

    @property
    def formula(self) -> str:
        """In SI units, upward positive."""
        return formula_of(self.products, self.coefficients_n, self.scales)

    @property
    def words(self) -> str:
        """What kind of force it is."""
        return words_of(self.products)

    def force_n(self, motion: NDArray[np.float64]) -> NDArray[np.float64]:
        """The force along a motion, shape (n, 3), upward positive, shape (n,)."""
        terms = zip(self.products, self.coefficients_n, strict=True)
        return np.asarray(sum(c * product.of(motion, self.scales) for product, c in terms))


def found_law(found: Findings, block: str) -> FoundLaw | None:
    """The best law for the force that a block lacks beside the retuned baseline; None where none is better.

    One model is better than another if its evidence is more, where a law is one of as many as there are of its
    length, and if it leaves less on the runs that chose nothing. None is sought where the search of names has
    ended at its budget: what lacks may be one of these.

    Parameters
    ----------
    found : Findings
    block : str
        Of what is missing; empty where it is not located, and then structure and tank are tried.
    """
    places = [place for place in (STRUCTURE, TANK) if place in found.model.blocks and block in ("", place)]
    # a law is a force along one motion, which a twin of several blocks has not
    if not found.split.has_held_out or isinstance(found.model, ModelOfBlocks) or SEARCH in found.failed:
        return None
    laws = [law for place in places if (law := _law_at(found, place)) is not None]
    return max(laws, key=lambda law: law.model.evidence, default=None)


def _law_at(found: Findings, block: str) -> FoundLaw | None:
    search = _LawSearch(found, block)
    fit = found.retuned.fit
    best, evidence = found.retuned, found.retuned.evidence
    for _ in range(_MOST_PRODUCTS):
        longer = max(search.with_one_more(fit), key=search.evidence, default=None)
        if longer is None or search.evidence(longer) <= evidence:
            break
        best, evidence, fit = longer, search.evidence(longer), longer.fit
    if best is found.retuned or best.held_out_rms >= found.retuned.held_out_rms:
        return None
    holds = all(
        evidence > rival.evidence and best.held_out_rms < rival.held_out_rms for rival in found.explanations
    )
    products = tuple(search.products[candidate.key] for candidate in best.fit.candidates)
    coefficients = tuple(best.values[f"{candidate.key}.{_SIZE}"] for candidate in best.fit.candidates)
    return FoundLaw(best, block, products, coefficients, search.scales, holds)


_SIZE: Final = "force_n"


class _LawSearch:
    """Laws of one case, one product after the other."""

    def __init__(self, found: Findings, block: str) -> None:
        self._found, tests = found, found.case.names_by_test()
        self._runs = FittedRuns(found.model, found.fitting, tests)
        self._score = Scoring(found.model, found.fitting, found.held_out, found.retuned.fit, tests)
        at = found.surroundings
        self.scales = (at.displacement_m, at.velocity_m_per_s, at.acceleration_m_per_s2)
        self.products: dict[str, Product] = {}
        self._pool = []
        for product in library(block):
            candidate = Candidate(_effect(product, block, self.scales), at)
            self._pool.append(candidate)
            self.products[candidate.key] = product

    def evidence(self, model: ScoredModel) -> float:
        """Of a law, with a prior by which all laws of its length are as likely."""
        return model.evidence - math.log(math.comb(len(self._pool), len(model.fit.candidates)))

    def with_one_more(self, fit: FreeRunFit) -> list[ScoredModel]:
        """The most promising laws with one product more, fitted and scored."""
        models = []
        for hidden in hidden_effects(self._runs, fit, self._pool)[:N_KEPT]:
            with suppress(SloshlabError):
                longer, _ = fitted(self._runs.problem((*fit.candidates, hidden.candidate)), hidden.values)
                model = self._score.of(longer, self._found.retuned)
                if model is not None:
                    models.append(model)
        return models


def _effect(product: Product, block: str, sizes: tuple[float, float, float]) -> Effect:
    """An effect of this one case, which no vocabulary has."""

    def extension(numbers: Numbers, at: Surroundings, channel: str) -> Extension:
        del at, channel
        return Extension((sum_of_products(block, [product], [numbers[_SIZE]], sizes),))

    return Effect(
        f"law {variables_of(product)}",
        block,
        f"c {variables_of(product)}",
        (EffectParameter(_SIZE, -1e7, 1e7, range=Range(1e-3, 10.0, scales.force, may_be_negative=True)),),
        lambda at: [{_SIZE: 0.01 * at.force_n}],
        extension,
    )
