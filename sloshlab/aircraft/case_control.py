"""What the case control section of a deck selects: constraints, the method of its modes, parameters."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from sloshlab.aircraft.bulk_lines import Line
from sloshlab.errors import FileFormatError

_SUBCASE: Final = re.compile(r"\s*(SUBC\w*|SYM|SUBCOM|SYMCOM|REPCASE)\s*=?\s*\d+", re.IGNORECASE)
_SELECTION: Final = re.compile(
    r"\s*(SPC|MPC|METH\w*|SUPORT1|STATSUB)\s*(?:\(([^)]*)\))?\s*=\s*(\S+)", re.IGNORECASE
)
_PARAMETER: Final = re.compile(r"\s*PARAM[\s,]+(\w+)[\s,]+([^\s,]+)", re.IGNORECASE)


@dataclass
class CaseControl:
    """Selections by command (SPC, MPC, METHOD, SUPORT1).

    Attributes
    ----------
    selections : dict of str to tuple of int
        What the subcases select, each number once; 0 where one of them selects nothing.
    parameters : dict of str to str
        PARAM by name; a name with two values is refused.
    """

    selections: dict[str, tuple[int, ...]] = field(default_factory=dict)
    parameters: dict[str, str] = field(default_factory=dict)


def case_control_of(lines: Iterable[Line]) -> CaseControl:
    """Selections of the lines between CEND and BEGIN BULK; other commands choose output and are passed over.

    Raises
    ------
    FileFormatError
        If a selection is no number, or STATSUB asks for modes of a structure under load.
    """
    above: dict[str, int] = {}
    subcases: list[dict[str, int]] = []
    parameters: dict[str, str] = {}
    for line in lines:
        if _SUBCASE.match(line.text):
            subcases.append({})
            continue
        parameter = _PARAMETER.match(line.text)
        if parameter:
            name, value = parameter[1].upper(), parameter[2]
            if parameters.setdefault(name, value) != value:
                raise FileFormatError(
                    f"{line.place}: PARAM {name}", got=f"{value[:20]} after {parameters[name][:20]}",
                    allowed="one value for all subcases",
                )  # fmt: skip
        selection = _SELECTION.match(line.text)
        if selection:
            command, number = _number_of(line, selection)
            if command:
                (subcases[-1] if subcases else above)[command] = number
    commands = {*above, *(command for subcase in subcases for command in subcase)}
    selections = {
        command: tuple(dict.fromkeys(case.get(command, above.get(command, 0)) for case in subcases or [above]))
        for command in commands
    }
    return CaseControl(selections, parameters)


def _number_of(line: Line, selection: re.Match[str]) -> tuple[str, int]:
    command = "METHOD" if selection[1].upper().startswith("METH") else selection[1].upper()
    if command == "METHOD" and (selection[2] or "").strip().upper() == "FLUID":
        return "", 0
    if command == "STATSUB":
        raise FileFormatError(line.place, got="STATSUB", allowed="modes of a structure without preload")
    if not re.fullmatch(r"\d{1,9}", selection[3]):
        raise FileFormatError(f"{line.place}: {command}", got=selection[3][:40], allowed="an integer")
    return command, int(selection[3])
