"""Rivals that learn from development cases what residuals look like: nearest neighbours, and a random forest.

Nearest neighbours among drawn cases are approximate Bayesian computation by rejection (D. B. Rubin, Ann. Stat. 12
(1984) 1151–1172, doi:10.1214/aos/1176346785); on metadata alone they tell whether anything but the signals gives
the class away.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import MissingExtraError
from studies.rivals.libraries import EQUALS
from studies.rivals.said import Named, Verdict, label_of, named, nothing_missing, one_of, unknown
from studies.rivals.seen import Seen
from studies.rivals.training import Known

FloatArray = NDArray[np.float64]
Features = Callable[[Seen], Mapping[str, float]]
_VISIBLE: Final = 1.0
"""Noise floors, from which a masked case is learnt as one with its effect, and below as one without."""
_N_TREES: Final = 600
_LARGEST: Final = 8.0
"""Of a feature in interquartile ranges from its median: one spike must not make all others near."""
_N_NEIGHBOURS: Final = {"kind": 7, "effect": 3}


class Classifier(Protocol):
    """What of scikit-learn is used."""

    classes_: Any

    def fit(self, table: FloatArray, labels: Sequence[str], weights: FloatArray) -> Any:
        """Learn."""

    def predict_proba(self, table: FloatArray) -> FloatArray:
        """Probabilities, shape (n, n_classes)."""


@dataclass(frozen=True, eq=False)
class LearntClassifier:
    """Two classifiers, one of the class of a case and one of the effect, and what follows from both.

    Attributes
    ----------
    features : callable
        (what is seen) → numbers by name.
    names : tuple of str
        Of the features, in the order of the tables.
    middle, spread : ndarray, shape (n_features,)
    kinds, effects : Classifier
        Of classes of cases, and of block and name of an effect.
    equals : dict
        By effect, the sets that development trials accept for it where it is a look-alike.
    """

    features: Features
    names: tuple[str, ...]
    middle: FloatArray
    spread: FloatArray
    kinds: Classifier
    effects: Classifier
    equals: Mapping[Named, tuple[tuple[str, ...], ...]]

    @classmethod
    def learnt(
        cls, cases: Sequence[Known], features: Features, made: Callable[[str], Classifier]
    ) -> LearntClassifier:
        """From development cases.

        Parameters
        ----------
        cases : sequence of Known
        features : callable
        made : callable
            ('kind' or 'effect') → classifier.
        """
        every = [features(case.seen) for case in cases]
        names = tuple(sorted(set().union(*every)))
        raw = np.array([[case.get(name, 0.0) for name in names] for case in every])
        low, middle, high = np.quantile(raw, (0.25, 0.5, 0.75), axis=0)
        # A feature that most cases lack has no quartiles; its standard deviation says how large it is.
        spread = np.where(high > low, high - low, raw.std(axis=0))
        varied = spread > 0
        kept = tuple(name for name, is_varied in zip(names, varied, strict=True) if is_varied)
        found = cls(features, kept, middle[varied], spread[varied], made("kind"), made("effect"), _equals(cases))
        table = np.array([found._row(case.seen) for case in cases])
        rows = [(i, effect, 1 / len(case.effects)) for i, case in enumerate(cases) for effect in case.effects]
        places, labels, weights = zip(*rows, strict=True)
        with warnings.catch_warnings():
            # It warns that there are many effects for so few cases, which is so.
            warnings.simplefilter("ignore", UserWarning)
            found.kinds.fit(table, [_kind(case) for case in cases], np.ones(len(cases)))
            found.effects.fit(table[list(places)], [".".join(effect) for effect in labels], np.array(weights))
        return found

    def _row(self, seen: Seen) -> FloatArray:
        numbers = self.features(seen)
        row = np.array([numbers.get(name, 0.0) for name in self.names])
        return np.asarray(np.clip((row - self.middle) / self.spread, -_LARGEST, _LARGEST))

    def say(self, seen: Seen) -> Verdict:
        """The answer that is right with the largest probability.

        Parameters
        ----------
        seen : Seen
        """
        row = self._row(seen)[None]
        kind = _probabilities(self.kinds, row)
        effect = {_named(text): p for text, p in _probabilities(self.effects, row).items()}
        known = {each: p for each, p in effect.items() if each[1] != "unknown"}
        blocks = dict.fromkeys((block for block, _ in effect), 0.0)
        for (block, name), p in effect.items():
            # What has no name shows in its block like what has one, but less surely.
            blocks[block] += p if name == "unknown" else 0.5 * p
        pairs = _pairs(known)
        stated = _stated(kind, known, pairs)
        total = sum(known.values()) or 1.0
        best = max(known, key=lambda each: known[each])
        block = max(blocks, key=lambda each: blocks[each])
        answers = [
            (kind.get("nothing", 0.0), nothing_missing(stated)),
            (kind.get("one", 0.0) * known[best] / total, named([best], stated)),
            (kind.get("outside", 0.0) * blocks[block] / max(sum(blocks.values()), 1e-12), unknown(block, stated)),
        ]
        if pairs:
            pair = max(pairs, key=lambda each: pairs[each])
            answers.append((kind.get("pair", 0.0) * pairs[pair], named(pair, stated)))
        for each, sets in self.equals.items():
            share = sum(known.get((each[0], names[0]), 0.0) for names in sets if len(names) == 1) / total
            answers.append((kind.get("look_alike", 0.0) * share, one_of(each[0], sets, stated)))
        return max(answers, key=lambda answer: answer[0])[1]


def of_signals(seen: Seen) -> Mapping[str, float]:
    """Features of what the retuned baseline leaves; none where it could not be simulated.

    Parameters
    ----------
    seen : Seen
    """
    return seen.features or {}


def of_metadata(seen: Seen) -> Mapping[str, float]:
    """Everything but the signals.

    Parameters
    ----------
    seen : Seen
    """
    return seen.metadata or {}


def forest(what: str) -> Classifier:
    """A random forest; the same for the same cases.

    Parameters
    ----------
    what : {"kind", "effect"}

    Raises
    ------
    MissingExtraError
        If scikit-learn is not installed.

    References
    ----------
    L. Breiman, Machine Learning 45 (2001) 5–32, doi:10.1023/A:1010933404324.
    """
    del what
    try:
        from sklearn.ensemble import RandomForestClassifier
    except ImportError as error:
        raise MissingExtraError("scikit-learn", extra="peers", purpose="the random forest") from error
    found: Classifier = RandomForestClassifier(_N_TREES, min_samples_leaf=1, random_state=0)
    return found


class Neighbours:
    """Shares of labels among the nearest cases, weighted.

    Parameters
    ----------
    n_neighbours : int
    """

    def __init__(self, n_neighbours: int) -> None:
        self.n_neighbours = n_neighbours
        self.classes_: list[str] = []

    def fit(self, table: FloatArray, labels: Sequence[str], weights: FloatArray) -> Neighbours:
        """Keep the cases.

        Parameters
        ----------
        table : ndarray, shape (n, n_features)
        labels : sequence of str
        weights : ndarray, shape (n,)
        """
        self._table, self._labels, self._weights = table, np.array(labels), weights
        self.classes_ = sorted(set(labels))
        return self

    def predict_proba(self, table: FloatArray) -> FloatArray:
        """Probabilities, shape (n, n_classes).

        Parameters
        ----------
        table : ndarray, shape (n, n_features)
        """
        distance = np.linalg.norm(table[:, None] - self._table[None], axis=2)
        found = np.zeros((table.shape[0], len(self.classes_)))
        for row, near in zip(found, np.argsort(distance, axis=1, kind="stable"), strict=True):
            for k in near[: self.n_neighbours]:
                row[self.classes_.index(str(self._labels[k]))] += self._weights[k]
            row /= row.sum()
        return found


def neighbours(what: str) -> Classifier:
    """Nearest neighbours.

    Parameters
    ----------
    what : {"kind", "effect"}
    """
    return Neighbours(_N_NEIGHBOURS[what])


def _kind(case: Known) -> str:
    if case.kind in ("nothing", "retunable") or (case.kind == "masked" and case.strength < _VISIBLE):
        return "nothing"
    return {"single": "one", "masked": "one"}.get(case.kind, case.kind)


def _named(text: str) -> Named:
    block, _, name = text.partition(".")
    return block, name


def _probabilities(classifier: Classifier, row: FloatArray) -> dict[str, float]:
    return dict(zip(map(str, classifier.classes_), classifier.predict_proba(row)[0].tolist(), strict=True))


def _equals(cases: Sequence[Known]) -> dict[Named, tuple[tuple[str, ...], ...]]:
    found = dict(EQUALS)
    for case in cases:
        if case.kind == "look_alike":
            found[case.effects[0]] = tuple(tuple(sorted(names)) for names in case.truth["accepted"])
    return found


def _pairs(known: Mapping[Named, float]) -> dict[tuple[Named, Named], float]:
    """Probabilities of two effects of different blocks, if there are two."""
    effects = sorted(known)
    weights = {
        (a, b): known[a] * known[b] for i, a in enumerate(effects) for b in effects[i + 1 :] if a[0] != b[0]
    }
    total = sum(weights.values())
    return {pair: weight / total for pair, weight in weights.items()} if total > 0 else {}


def _stated(
    kind: Mapping[str, float], known: Mapping[Named, float], pairs: Mapping[tuple[Named, Named], float]
) -> dict[str, float]:
    """Probabilities of all labels."""
    stated = {"none": kind.get("nothing", 0.0), "unknown": kind.get("outside", 0.0)}
    total = sum(known.values()) or 1.0
    # Two effects need a second one that is possible.
    alone = kind.get("one", 0.0) + kind.get("look_alike", 0.0) + (0.0 if pairs else kind.get("pair", 0.0))
    for effect, p in known.items():
        name = label_of([effect])
        stated[name] = stated.get(name, 0.0) + alone * p / total
    for pair, p in pairs.items():
        name = label_of(pair)
        stated[name] = stated.get(name, 0.0) + kind.get("pair", 0.0) * p
    return {name: p for name, p in stated.items() if p > 1e-6}
