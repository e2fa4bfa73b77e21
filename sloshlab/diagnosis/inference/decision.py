"""The decision: what is said, from the posterior alone, by the numbers of `thresholds`.

- That something is missing has the posterior `NAMED`, and so has what is named; a set of names that has it
  together is said as a set.
- Of a set all of whose models have one of them in common that one is named (Barbieri and Berger 2004,
  doi:10.1214/009053604000000238); whether more is missing cannot be told.
- Two models that predict the same within `TOLD_APART`, at baselines as probable, are equals; of one that needs
  more numbers for it only the simpler one is said.
- An effect or a remainder below `LEAST_STRENGTH` is not worth a word: it counts as nothing.
- A name may leave `LAW` of the amplitude that lacks without it; more is a remainder.
- The place of what has no name needs `LOCATED`.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from sloshlab.diagnosis.inference.places import block_of
from sloshlab.diagnosis.inference.posterior import NONE, UNKNOWN, Posterior
from sloshlab.diagnosis.inference.scored_model import ScoredModel, difference
from sloshlab.diagnosis.inference.thresholds import LOCATED, NAMED, TOLD_APART


@dataclass(frozen=True, eq=False)
class Decision:
    """What is said.

    Attributes
    ----------
    kind : {"nothing_missing", "named", "indistinguishable", "unknown"}
    best : ScoredModel or None
        What is named, or the nearest model with a name of what has none; None where nothing is missing.
    alternatives : list of ScoredModel
        All that cannot be told apart, the best first; it alone where one is named.
    place : str
        Of what has no name; empty where it is not located.
    probabilities : dict
        Of everything that may be true, names that the search has missed included; the largest first.
    wider : list of ScoredModel
        Models of what is named and something besides, which cannot be told from it.
    """

    kind: str
    best: ScoredModel | None
    alternatives: list[ScoredModel]
    place: str
    probabilities: dict[str, float]
    wider: list[ScoredModel] = field(default_factory=list)

    @property
    def block(self) -> str:
        """Block of what has no name."""
        return block_of(self.place)


def decided(found: Posterior) -> Decision:
    """What is said of a posterior.

    Parameters
    ----------
    found : Posterior
    """
    labels, stated = found.by_label(), found.with_missed()
    named = {label: p for label, p in labels.items() if label not in (NONE, UNKNOWN)}
    none = labels.get(NONE, 0.0)
    if none > 1 - NAMED and none >= labels.get(UNKNOWN, 0.0):
        return Decision("nothing_missing", None, [], "", stated)
    chosen: list[str] = []
    for label in named:
        chosen.append(label)
        if sum(named[each] for each in chosen) >= NAMED:
            break
    if sum(named[each] for each in chosen) < NAMED:
        return _unknown(found, next(iter(named), ""), stated)
    best = found.best(chosen[0]).model
    models = [found.best(label).model for label in chosen]
    models += [model for model in equals_of(best, found) if all(model.names != m.names for m in models)]
    for model in models:
        wider = [other for other in models if other is not model]
        if all(Counter(model.names) < Counter(other.names) for other in wider):
            return Decision("named", model, [model], "", stated, wider)
    return Decision("indistinguishable", best, models, "", stated)


def _unknown(found: Posterior, nearest: str, stated: dict[str, float]) -> Decision:
    blocks = found.by_block()
    block, p = next(iter(blocks.items()), ("", 0.0))
    places = [h.place for h in found.of_label(UNKNOWN) if block_of(h.place) == block]
    best = found.best(nearest).model if nearest else None
    return Decision("unknown", best, [], next(iter(places), block) if p >= LOCATED else "", stated)


def equals_of(best: ScoredModel, found: Posterior) -> list[ScoredModel]:
    """Models of no more numbers that predict the same as the best within what recordings and beliefs tell apart.

    Parameters
    ----------
    best : ScoredModel
    found : Posterior
    """
    models = {id(h.model): h.model for h in found.hypotheses if not h.place and h.label not in (NONE, UNKNOWN)}
    alike = [
        model
        for model in models.values()
        if model.names != best.names
        and model.n_numbers <= best.n_numbers
        and not set(best.keys) < set(model.keys)
        # Beliefs are readings, too.
        and difference(best, model) / found.tempering + model.cost_of_baseline - best.cost_of_baseline < TOLD_APART
    ]
    return sorted(alike, key=lambda model: -model.evidence)
