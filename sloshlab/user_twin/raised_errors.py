"""Errors that compiled equations would raise, found before they are compiled.

A compiled function that the engine calls by its address has nobody to raise to: the error would be printed at
every step, and the simulation would go on with what stood in memory.
"""

from __future__ import annotations

import dis
from collections.abc import Iterator
from types import CodeType, FunctionType
from typing import Any, Final

from sloshlab.errors import InputError

_RAISING: Final = ("RAISE_VARARGS", "LOAD_ASSERTION_ERROR")
_COMPILED_ELSEWHERE: Final = ("numpy", "numba")
"""Packages whose Python is not what numba compiles."""


def require_no_raise(equations: Any, name: str) -> None:
    """Refuse equations that raise an error or assert something, in themselves or in functions that they call.

    Parameters
    ----------
    equations : callable
    name : str
        For messages.

    Raises
    ------
    InputError
        Naming the line.
    """
    if not isinstance(equations, FunctionType):
        return
    for code in _codes_of(equations):
        line = code.co_firstlineno
        for instruction in dis.get_instructions(code):
            line = instruction.positions.lineno or line if instruction.positions else line
            if instruction.opname in _RAISING:
                raise InputError(
                    f"{name}: equations",
                    got=f"an error that is raised in line {line}",
                    allowed="numbers: compiled equations cannot raise",
                    remedy="return math.nan where there is no answer; or simulate by yourself (FreeTwin)",
                )


def _codes_of(function: FunctionType) -> Iterator[CodeType]:
    """Code of a function, of functions within it and of those that it calls by name; each once."""
    waiting: list[Any] = [function]
    seen: set[int] = set()
    while waiting:
        # numba keeps the plain function of what it compiled
        called = waiting.pop()
        called = getattr(called, "py_func", called)
        if not isinstance(called, FunctionType) or id(called) in seen:
            continue
        if (called.__module__ or "").partition(".")[0] in _COMPILED_ELSEWHERE:
            continue
        seen.add(id(called))
        cells = [cell.cell_contents for cell in called.__closure__ or () if _is_filled(cell)]
        codes = [called.__code__]
        while codes:
            code = codes.pop()
            yield code
            codes += [part for part in code.co_consts if isinstance(part, CodeType)]
            waiting += [called.__globals__[name] for name in code.co_names if name in called.__globals__]
        waiting += cells


def _is_filled(cell: Any) -> bool:
    try:
        return cell.cell_contents is not None
    except ValueError:
        return False
