"""An extended user's twin on disk: parameters and added forces as TOML. Nothing in it is run."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from sloshlab import atomic_file
from sloshlab.errors import InputError
from sloshlab.missing_physics.extension import Extension
from sloshlab.toml_file import read_toml
from sloshlab.twin.terms import Term, kind_named

FORMAT: Final = 1
_MOST_TERMS: Final = 100


def save_extended(module: str, values: Mapping[str, float], extension: Extension, path: Path) -> None:
    """Write parameters and added forces; the user's module stays where it is.

    Parameters
    ----------
    module : str
        Name of the module, for a person.
    values : mapping
        Parameters of the baseline.
    extension : Extension
        Faults of sensors stay out: they are no part of what is simulated.
    path : Path
    """
    lines = [f"sloshlab_user_twin = {FORMAT}", f"module = {json.dumps(module)}", "", "[parameters]"]
    # The shortest text that reads back as the same number.
    lines += [f"{json.dumps(name)} = {float(value)!r}" for name, value in values.items()]
    for term in extension.terms:
        lines += ["", "[[terms]]", f"name = {json.dumps(term.name)}"]
        lines += [f"{name} = {float(value)!r}" for name, value in term.values.items()]
    atomic_file.write_bytes(path, ("\n".join(lines) + "\n").encode())


def load_extended(path: str | Path) -> tuple[dict[str, float], Extension]:
    """Parameters and added forces that `save_extended` wrote, as `UserTwinModel.simulate` takes them.

    Raises
    ------
    InputError
        If the file is absent, damaged, or names a force that is not registered.
    """
    file = Path(path)
    document = _document(file)
    try:
        values = {str(name): _finite(value) for name, value in document["parameters"].items()}
        described = document.get("terms", [])
        if len(described) > _MOST_TERMS:
            raise ValueError(f"{len(described)} terms")
        terms = tuple(_term(entry) for entry in described)
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"twin {file}", got=f"contents that are no twin ({error})"[:200]) from error
    return values, Extension(terms)


def _document(file: Path) -> dict[str, Any]:
    document = read_toml(file, f"twin {file}")
    if document.get("sloshlab_user_twin") != FORMAT:
        got = repr(document.get("sloshlab_user_twin"))[:80]
        raise InputError(f"twin {file}: sloshlab_user_twin", got=got, allowed=str(FORMAT))
    return document


def _finite(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{value!r} is no number"[:80])
    return float(value)


def _term(entry: dict[str, Any]) -> Term:
    numbers = {name: _finite(value) for name, value in entry.items() if name != "name"}
    return kind_named(str(entry["name"]))(place="structure", **numbers)
