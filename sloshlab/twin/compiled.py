"""How the loops of the twin are compiled: those that Python calls, and what is compiled into them.

Their arguments are tuples of dozens of arrays. Code that takes them from Python and hands errors back is longer
than most functions are, and takes longer to compile; only an `entry` has it. Calling one of the others from Python
would end the process: they belong into compiled code.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeVar

import numpy as np
from numba import njit, typeof

_F = TypeVar("_F", bound=Callable[..., Any])

_LOOP: Final = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False}
_WITHIN: Final = {**_LOOP, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def entry(function: _F) -> _F:
    """A loop that is called from Python, too."""
    return njit(**_LOOP)(function)  # type: ignore[no-any-return]


def called(function: _F) -> _F:
    """Called from compiled code alone."""
    return njit(**_WITHIN)(function)  # type: ignore[no-any-return]


def inlined(function: _F) -> _F:
    """Put into compiled code wherever it is called."""
    return njit(**_WITHIN, forceinline=True)(function)  # type: ignore[no-any-return]


def pasted(function: _F) -> _F:
    """Put into the one function that calls it, before anything is compiled: it is compiled but once."""
    return njit(**_WITHIN, inline="always")(function)  # type: ignore[no-any-return]


def address_of(function: Callable[..., Any], *arguments: Any) -> int:
    """Where a compiled function is that was compiled for the types of these arguments."""
    key = (function, *map(_form_of, arguments))
    if key not in _addresses:
        given = tuple(typeof(argument) for argument in arguments)
        function.compile(given)  # type: ignore[attr-defined]
        compiled = function.overloads[given]  # type: ignore[attr-defined]
        _addresses[key] = int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))
    return _addresses[key]


_addresses: Final[dict[tuple[Any, ...], int]] = {}
"""By function and forms of its arguments: to ask for their types takes longer than a simulation of seconds."""


def _form_of(argument: Any) -> Any:
    """What tells the type for which something is compiled."""
    if isinstance(argument, tuple):
        return (type(argument), *map(_form_of, argument))
    if isinstance(argument, np.ndarray):
        flags = argument.flags
        return (
            argument.dtype,
            argument.ndim,
            flags.c_contiguous,
            flags.f_contiguous,
            flags.aligned,
            flags.writeable,
        )
    return type(argument)
