"""Running a module that a user names: its code is run, and whatever it raises becomes one line."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Final

from sloshlab.errors import InputError, SloshlabError

PREFIX: Final = "sloshlab_user_"
_LARGEST_BYTES: Final = 1_000_000
_FORMER_NAMES: Final = {
    "sloshlab.diagnosis.user_twin": "sloshlab.user_twin",
    "sloshlab.diagnosis.case": "sloshlab.identification.case",
    **{
        f"sloshlab.diagnosis.{name}": f"sloshlab.missing_physics.{name}"
        for name in ("candidate", "effects", "effects.force_effect", "effects.scales", "extension", "prior")
    },
}
"""What modules of users may import, under the names that it had in `sloshlab.diagnosis`: they still run."""


def user_module(path: str | Path, what: str) -> ModuleType:
    """The module in a file.

    Parameters
    ----------
    path : path
        Of a file that ends with ``.py``. Its code is run.
    what : str
        It is expected to be, for messages.

    Raises
    ------
    InputError
        If there is no such file, or it cannot be run; one line that says why.
    """
    file = Path(path)
    if file.suffix != ".py" or not file.is_file():
        raise InputError(
            f"{what} {file}",
            got="a folder" if file.is_dir() else "no such Python file",
            allowed="a file that ends with .py",
        )
    if file.stat().st_size > _LARGEST_BYTES:
        raise InputError(f"{what} {file}", got=f"{file.stat().st_size} bytes", allowed=f"≤ {_LARGEST_BYTES}")
    name = module_name(file, what)
    specification = importlib.util.spec_from_file_location(name, file)
    if specification is None or specification.loader is None:
        raise InputError(f"{what} {file}", got="a file that Python cannot load")
    module = importlib.util.module_from_spec(specification)
    # Before it is run, as dataclasses look up the module of their class.
    sys.modules[name] = module
    _know_former_names(file)
    try:
        specification.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # whatever a user's code raises becomes one line
        del sys.modules[name]
        if isinstance(error, SloshlabError):  # it says itself what is allowed
            raise InputError(f"{what} {file}{_line_of(error)}: {error}") from error
        raise InputError(
            f"{what} {file}",
            got=one_line(error),
            allowed="a module that Python can run",
            remedy="run it by itself",
        ) from error
    return module


def _know_former_names(file: Path) -> None:
    """What a module imports by a former name, under that name."""
    text = file.read_bytes()
    for former, present in _FORMER_NAMES.items():
        if former.encode() in text:
            sys.modules.setdefault(former, importlib.import_module(present))


def module_name(file: Path, what: str) -> str:
    """Name under which a file is a module; the same file has the same name."""
    return f"{PREFIX}{what}_{hashlib.sha256(str(file.resolve()).encode()).hexdigest()[:16]}"


def one_line(error: BaseException) -> str:
    """Kind, place and text of an error of a user's code."""
    text = " ".join(str(error).split())[:300]
    return f"{type(error).__name__}{_line_of(error)}: {text}"


def _line_of(error: BaseException) -> str:
    """Where in a user's code an error came from, in words; empty where it did not."""
    place = ""
    trace = error.__traceback__
    while trace is not None:
        code = trace.tb_frame.f_code
        if Path(code.co_filename).suffix == ".py" and trace.tb_frame.f_globals.get("__name__", "").startswith(
            PREFIX
        ):
            place = f" in line {trace.tb_lineno}"
        trace = trace.tb_next
    return place
