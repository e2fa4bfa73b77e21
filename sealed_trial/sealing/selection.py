"""Which cases of a trial: a half, or those named.

Odd case numbers develop, even ones judge. Classes are in random order, so that both halves are alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

from sloshlab.errors import InputError

Half = Literal["odd", "even"]
HALVES: Final[tuple[Half, ...]] = ("odd", "even")


@dataclass(frozen=True)
class Selection:
    """Cases that are asked for.

    Attributes
    ----------
    half : 'odd', 'even' or None
        By the number of the case; None takes both.
    names : tuple of str
        Cases by name; all where it is empty.
    """

    half: Half | None = None
    names: tuple[str, ...] = ()

    def of(self, cases: Sequence[str]) -> list[str]:
        """Those of `cases` that are chosen, in their order.

        Raises
        ------
        InputError
            If a name is no case of the trial, or nothing is left.

        Examples
        --------
        >>> Selection("odd").of(["case_001", "case_002", "case_003"])
        ['case_001', 'case_003']
        """
        strange = [name for name in self.names if name not in cases]
        if strange:
            raise InputError("--cases", got=strange[0], allowed=f"{cases[0]} … {cases[-1]}")
        # names of a challenge have no number: they are asked for a half only where one is chosen
        chosen = [
            case
            for case in cases
            if (self.half is None or self.half == half_of(case)) and (not self.names or case in self.names)
        ]
        if not chosen:
            raise InputError("--half and --cases", got="no case in both", allowed="at least one case")
        return chosen


EVERYTHING: Final = Selection()


def half_of(case: str) -> Half:
    """The half that a case belongs to.

    Examples
    --------
    >>> half_of("case_014")
    'even'
    """
    return "even" if int(case.rpartition("_")[2]) % 2 == 0 else "odd"


def selection_of(half: str | None, cases: str | None) -> Selection:
    """A selection as it is typed: `odd` or `even`, and names or numbers of cases with commas between them.

    Raises
    ------
    InputError
        If the half is another word, or a case no name.

    Examples
    --------
    >>> selection_of("even", "4,case_006").names
    ('case_004', 'case_006')
    """
    if half is not None and half not in HALVES:
        raise InputError("--half", got=half, allowed=" or ".join(HALVES))
    words = [word.strip() for word in (cases or "").split(",") if word.strip()]
    if cases is not None and not words:
        raise InputError("--cases", got="nothing", allowed="names or numbers with commas between them")
    names = tuple(f"case_{int(word):03d}" if word.isdecimal() else word for word in words)
    return Selection(None if half is None else "odd" if half == "odd" else "even", names)
