"""The rival that names what a sparse regression selects; its rules are fixed, their numbers learnt."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from sealed_trial.scoring.answer import answer_of
from sealed_trial.scoring.mark import marked
from studies.rivals.libraries import EQUALS, LIBRARIES, STRUCTURE
from studies.rivals.regressed_models import RegressedModel
from studies.rivals.said import Named, Verdict, named, nothing_missing, one_of, unknown
from studies.rivals.seen import Seen
from studies.rivals.training import Known, Truth

_MOST_NAMES: Final = 2
_GRID: Final = {
    "least_gain": (0.02, 0.05, 0.1, 0.2, 0.4, 0.7),
    "least_second_gain": (0.05, 0.1, 0.2, 0.4, 0.8, 1.5),
    "most_left": (1.1, 1.3, 1.6, 2.0, 3.0, 5.0, math.inf),
    "as_good": (0.0, 0.01, 0.03, 0.1, 0.2),
    "least_unknown": (1.1, 1.3, 1.6, 2.0, 3.0, 5.0, math.inf),
}
"""Values that are tried; every number in turn, from both ends of the list, until none changes."""


@dataclass(frozen=True)
class SparseRegression:
    """How errors on held-out runs become an answer.

    Attributes
    ----------
    least_gain : float
        ln of the mean square without names over that with one, from which something is missing.
    least_second_gain : float
        The same of one name over two.
    most_left : float
        Mean square of held-out residuals, above which the best names do not explain the case: unknown.
    as_good : float
        ln of the mean square over the least one, up to which other names are as good: a set.
    least_unknown : float
        Mean square of the retuned baseline, from which something is missing although no name gains enough.
    """

    least_gain: float = 0.1
    least_second_gain: float = 0.4
    most_left: float = 2.0
    as_good: float = 0.03
    least_unknown: float = 2.0

    @classmethod
    def learnt(cls, cases: Sequence[Known]) -> SparseRegression:
        """Those of a grid with most right answers to development cases, two numbers at a time.

        Parameters
        ----------
        cases : sequence of Known
        """
        lists = [(case.truth, Shortlist.of(case.seen)) for case in cases]
        best = cls()
        score = best._n_right(lists)
        for _ in range(4):
            before = best
            for first, second in itertools.combinations(_GRID, 2):
                for a, b in itertools.product(_GRID[first], _GRID[second]):
                    tried = replace(best, **{first: a, second: b})
                    right = tried._n_right(lists)
                    if right > score:
                        best, score = tried, right
            if best == before:
                break
        return best

    def _n_right(self, lists: Sequence[tuple[Truth, Shortlist]]) -> int:
        return sum(marked(truth, answer_of(self._said(shortlist))).right for truth, shortlist in lists)

    def say(self, seen: Seen) -> Verdict:
        """The answer to a case.

        Parameters
        ----------
        seen : Seen
        """
        return self._said(Shortlist.of(seen))

    def held_out(self, seen: Seen) -> float:
        """Error on held-out runs of what is chosen, in noise floors.

        Parameters
        ----------
        seen : Seen
        """
        chosen = self._chosen(Shortlist.of(seen))
        return math.sqrt(seen.judged if chosen is None else chosen.judged)

    def _said(self, shortlist: Shortlist) -> Verdict:
        chosen = self._chosen(shortlist)
        if chosen is None:
            if shortlist.judged <= self.least_unknown:
                return nothing_missing()
            return unknown(shortlist.block)
        if not chosen.names or chosen.judged > self.most_left:
            return unknown(chosen.block)
        (block, name), *others = chosen.names
        sets = [[each for _, each in names] for names in self._as_good_as(shortlist, chosen)]
        sets += [list(names) for names in (() if others else EQUALS.get((block, name), ()))]
        distinct = sorted({tuple(sorted(names)) for names in sets})
        return one_of(block, distinct) if len(distinct) > 1 else named(chosen.names)

    def _chosen(self, shortlist: Shortlist) -> Choice | None:
        """The model with the fewest names that no other beats by enough; None where nothing is missing."""
        left, chosen = shortlist.judged, None
        # Terms without a name, a curved characteristic for one, are something missing all the same.
        for n, least in ((0, self.least_gain), (1, self.least_gain), (2, self.least_second_gain)):
            model = shortlist.best.get(n)
            if model is not None and math.log(left / max(model.judged, 1e-12)) > least:
                left, chosen = model.judged, model
        return chosen

    def _as_good_as(self, shortlist: Shortlist, chosen: Choice) -> list[tuple[Named, ...]]:
        """Names of models that leave as little as the chosen one with as few names, in the same blocks."""
        most = chosen.judged * math.exp(self.as_good)
        alike = [model for model in shortlist.choices if len(model.names) == len(chosen.names)]
        near = [model.names for model in alike if model.judged < most and model.blocks == chosen.blocks]
        return [chosen.names, *near]


@dataclass(frozen=True)
class Choice:
    """The best model of some names.

    Attributes
    ----------
    names : tuple of (str, str)
    judged : float
        Mean square of the whitened residuals of held-out runs.
    block : str
        Of its largest term.
    """

    names: tuple[Named, ...]
    judged: float
    block: str

    @property
    def blocks(self) -> set[str]:
        """Of its names."""
        return {block for block, _ in self.names}


@dataclass(frozen=True)
class Shortlist:
    """The models of a case that can be an answer.

    Attributes
    ----------
    judged : float
        Of the retuned baseline.
    choices : tuple of Choice
        Of at most two names, each set of names once.
    best : dict
        By number of names, the one that leaves least.
    block : str
        Of the model that leaves least, whatever it is called.
    """

    judged: float
    choices: tuple[Choice, ...]
    best: dict[int, Choice]
    block: str

    @classmethod
    def of(cls, seen: Seen) -> Shortlist:
        """From all models of a case.

        Parameters
        ----------
        seen : Seen
        """
        ordered = sorted(seen.models, key=lambda model: model.judged)
        choices: dict[tuple[Named, ...], Choice] = {}
        for model in ordered:
            names = model.names
            if len(names) <= _MOST_NAMES and (names or not _only_retunes(model)):
                choices.setdefault(names, Choice(names, model.judged, model.block))
        best: dict[int, Choice] = {}
        for choice in choices.values():
            best.setdefault(len(choice.names), choice)
        block = ordered[0].block if ordered else STRUCTURE
        return cls(seen.judged, tuple(choices.values()), best, block)


def _only_retunes(model: RegressedModel) -> bool:
    """Whether a model has no terms but those that correct a number of the baseline."""
    own = {(place, term.name) for place, terms in LIBRARIES.items() for term in terms if term.is_own}
    return all((term.place, term.term) in own for term in model.terms)
