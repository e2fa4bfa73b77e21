"""Loading a user's module. That runs its code, so it is done only where the user names the file."""

from __future__ import annotations

import hashlib
import importlib.util
import sys
from pathlib import Path
from typing import Final

from sloshlab.diagnosis.user_twin.description import FreeTwin, MechanicalTwin, UserTwin, require_sound
from sloshlab.errors import InputError, SloshlabError

NAME: Final = "TWIN"
_LARGEST_BYTES: Final = 1_000_000


def load_user_twin(path: str | Path) -> UserTwin:
    """The ``TWIN`` of a Python module.

    Parameters
    ----------
    path : path
        Of a file that ends with ``.py``. Its code is run.

    Raises
    ------
    InputError
        If it cannot be loaded or defines no twin; one line that says why.
    """
    file = Path(path)
    if file.suffix != ".py" or not file.is_file():
        raise InputError(
            f"twin {file}",
            got="a folder" if file.is_dir() else "no such Python file",
            allowed="a file that ends with .py",
        )
    source = file.read_bytes()
    if len(source) > _LARGEST_BYTES:
        raise InputError(f"twin {file}", got=f"{len(source)} bytes", allowed=f"≤ {_LARGEST_BYTES}")
    twin = _run(file, f"sloshlab_user_twin_{hashlib.sha256(str(file.resolve()).encode()).hexdigest()[:16]}")
    if twin is None:
        raise InputError(f"twin {file}", got=f"no {NAME}", allowed=f"{NAME} = MechanicalTwin(…) or FreeTwin(…)")
    if not isinstance(twin, MechanicalTwin | FreeTwin):
        raise InputError(f"twin {file}: {NAME}", got=type(twin).__name__, allowed="MechanicalTwin or FreeTwin")
    try:
        require_sound(twin)
    except SloshlabError as error:
        raise InputError(f"twin {file}: {error}") from error
    return twin


def _run(file: Path, name: str) -> object:
    specification = importlib.util.spec_from_file_location(name, file)
    if specification is None or specification.loader is None:
        raise InputError(f"twin {file}", got="a file that Python cannot load")
    module = importlib.util.module_from_spec(specification)
    sys.modules[name] = module
    try:
        specification.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # whatever a user's code raises becomes one line
        del sys.modules[name]
        raise InputError(
            f"twin {file}", got=one_line(error), allowed="a module that Python can run", remedy="run it by itself"
        ) from error
    return getattr(module, NAME, None)


def one_line(error: BaseException) -> str:
    """Kind, place and text of an error of a user's code."""
    place = ""
    trace = error.__traceback__
    while trace is not None:
        code = trace.tb_frame.f_code
        if Path(code.co_filename).suffix == ".py" and "sloshlab_user_twin" in trace.tb_frame.f_globals.get(
            "__name__", ""
        ):
            place = f" in line {trace.tb_lineno}"
        trace = trace.tb_next
    text = " ".join(str(error).split())[:300]
    return f"{type(error).__name__}{place}: {text}"
