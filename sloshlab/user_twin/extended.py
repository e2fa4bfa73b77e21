"""An extended user's twin on disk: parameters, added forces and effects as TOML. Nothing in it is run."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from sloshlab import atomic_file
from sloshlab.errors import InputError
from sloshlab.missing_physics.candidate import Candidate, extension_of
from sloshlab.missing_physics.extension import Extension
from sloshlab.missing_physics.saved_effects import effect_lines, saved_effects
from sloshlab.toml_file import read_toml
from sloshlab.twin.terms import Term, kind_named

FORMAT: Final = 1
_MOST_TERMS: Final = 100
_LARGEST_TABLE: Final = 10_000


def save_extended(
    module: str,
    baseline: Mapping[str, float],
    candidates: Sequence[Candidate],
    values: Mapping[str, float],
    path: Path,
) -> None:
    """Write parameters and effects; the user's module stays where it is.

    Parameters
    ----------
    module : str
        Name of the module, for a person.
    baseline : mapping
        Parameters of the baseline.
    candidates : sequence of Candidate
    values : mapping
        Their numbers, named as in a fit.
    path : Path
    """
    lines = [f"sloshlab_user_twin = {FORMAT}", f"module = {json.dumps(module)}", "", "[parameters]"]
    # The shortest text that reads back as the same number.
    lines += [f"{json.dumps(name)} = {float(value)!r}" for name, value in baseline.items()]
    added = extension_of(candidates, values)
    if added.numbers:
        lines += ["", "[numbers]"]
        lines += [f"{json.dumps(name)} = {float(value)!r}" for name, value in added.numbers.items()]
    for term in added.terms:
        lines += ["", "[[terms]]", f"name = {json.dumps(term.name)}"]
        lines += [f"{name} = {float(value)!r}" for name, value in term.values.items()]
        if term.table.size:
            lines.append(f"table = [{', '.join(repr(float(value)) for value in term.table)}]")
    lines += effect_lines(candidates, values)
    atomic_file.write_bytes(path, ("\n".join(lines) + "\n").encode())


def load_extended(path: str | Path) -> tuple[dict[str, float], Extension]:
    """Parameters and effects that `save_extended` wrote, as `UserTwinModel.simulate` takes them.

    Raises
    ------
    InputError
        If the file is absent, damaged, or names a force or an effect that is not registered.
    """
    file = Path(path)
    document = _document(file)
    try:
        values = {str(name): _finite(value) for name, value in document["parameters"].items()}
        numbers = {str(name): _finite(value) for name, value in document.get("numbers", {}).items()}
        described = document.get("terms", [])
        if len(described) > _MOST_TERMS:
            raise ValueError(f"{len(described)} terms")
        terms = tuple(_term(entry) for entry in described)
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"twin {file}", got=f"contents that are no twin ({error})"[:200]) from error
    return values, Extension(terms, numbers=numbers) + saved_effects(document, f"twin {file}")


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
    numbers = {name: _finite(value) for name, value in entry.items() if name not in ("name", "table")}
    table = entry.get("table", [])
    if not isinstance(table, list) or len(table) > _LARGEST_TABLE:
        raise ValueError("a table that is no short list")
    return kind_named(str(entry["name"]))(place="structure", table=[_finite(value) for value in table], **numbers)
