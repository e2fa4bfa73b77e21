"""What rivals say, in the form of a verdict: the same document that the marks of a trial read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sealed_trial.scoring.answer import label

Verdict = dict[str, Any]
Named = tuple[str, str]
"""Block and name of an effect."""


def nothing_missing(probabilities: Mapping[str, float] | None = None) -> Verdict:
    """Nothing is missing.

    Parameters
    ----------
    probabilities : mapping, optional
        By label, as in `verdict.json`.

    Examples
    --------
    >>> nothing_missing()["verdict"]
    'nothing_missing'
    """
    return _verdict("nothing_missing", (), (), probabilities)


def named(effects: Sequence[Named], probabilities: Mapping[str, float] | None = None) -> Verdict:
    """These effects, in their blocks.

    Parameters
    ----------
    effects : sequence of (str, str)
    probabilities : mapping, optional
    """
    return _verdict("named", effects, (), probabilities)


def one_of(block: str, sets: Sequence[Sequence[str]], probabilities: Mapping[str, float] | None = None) -> Verdict:
    """One of several sets of names in a block; which cannot be told.

    Parameters
    ----------
    block : str
    sets : sequence of sequences of str
    probabilities : mapping, optional
    """
    effects = [(block, name) for name in sets[0]]
    return _verdict("indistinguishable", effects, sets, probabilities)


def unknown(block: str, probabilities: Mapping[str, float] | None = None) -> Verdict:
    """Something without a name in a block.

    Parameters
    ----------
    block : str
    probabilities : mapping, optional
    """
    return _verdict("unknown", ((block, "unknown"),), (), probabilities)


def _verdict(
    kind: str,
    effects: Sequence[Named],
    sets: Sequence[Sequence[str]],
    probabilities: Mapping[str, float] | None,
) -> Verdict:
    return {
        "verdict": kind,
        "effects": [{"name": name, "block": block} for block, name in effects],
        "alternatives": [sorted(names) for names in sets],
        "probabilities": dict(probabilities or {}),
    }


def label_of(effects: Sequence[Named]) -> str:
    """Names of effects as one label.

    Examples
    --------
    >>> label_of([("tank", "mass_error"), ("sensor", "mains_hum")])
    'mains_hum+mass_error'
    """
    return label(name for _, name in effects)
