"""Which recommended experiments a case holds already: it would be no advice to repeat them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

from sloshlab.configurations import SLOSHING
from sloshlab.identification.case import Case, level
from sloshlab.informative_runs import Decision, informative_runs

_LEVEL, _FREQUENCY, _REST = "laws over the level", "laws over the frequency", "damping and friction"
"""How the questions begin that `informative_runs` answers."""
_LIQUID: Final = "frozen and moving liquid"
NEEDS: Final[Mapping[str, tuple[str, ...]]] = {
    "two or more amplitudes": (_LEVEL,),
    "two or more amplitudes and frequencies": (_LEVEL, _FREQUENCY),
    "decays or sweeps at two or more amplitudes": (_LEVEL,),
    "decays or sweeps at two or more amplitudes, and at two frequencies": (_LEVEL, _FREQUENCY),
    "decays or sweeps at two or more amplitudes, down to rest": (_LEVEL, _REST),
    "the same amplitude at two frequencies": (_FREQUENCY,),
    "runs with frozen and moving liquid, at several amplitudes": (_LIQUID, _LEVEL),
}
"""What a recommendation asks for, in the words of the effects; others ask for what no recording states."""


def lacking_of(recommended: Sequence[str], case: Case) -> list[str]:
    """Recommended experiments but for those that a case holds.

    Parameters
    ----------
    recommended : sequence of str
        In the words of effects (`separated_by`).
    case : Case
    """
    decided = {decision.question: decision for decision in informative_runs(case).decisions}
    return [words for words in dict.fromkeys(recommended) if not _is_held(words, case, decided)]


def _is_held(words: str, case: Case, decided: Mapping[str, Decision]) -> bool:
    needs = NEEDS.get(words)
    if needs is None:
        return False
    configurations = {run.attributes.configuration for run in case.runs}
    special: Mapping[str, Callable[[], bool]] = {
        _LIQUID: lambda: SLOSHING in configurations and "frozen" in configurations
    }
    return all(special[need]() if need in special else _is_possible(need, decided) for need in needs)


def _is_possible(beginning: str, decided: Mapping[str, Decision]) -> bool:
    return any(decision.is_possible for question, decision in decided.items() if question.startswith(beginning))


def unheld_level(case: Case) -> str:
    """Words for a level that no run of a case has.

    Parameters
    ----------
    case : Case
    """
    ordered = sorted(case.runs, key=level)
    return f"a level below that of {ordered[0].name}, or above that of {ordered[-1].name}"
