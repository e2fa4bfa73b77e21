"""The global attributes of a run that is about to be recorded: checked before any device is opened."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import xarray as xr

from sloshlab.errors import InputError
from sloshlab.recording import FORMAT, run_attributes
from sloshlab.toml_file import read_toml

_TEXTS = ("run_id", "experiment", "configuration", "rig")
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")


def checked_run_attributes(
    output: Path, rig: Path, table: Path | None, assignments: Iterable[str]
) -> dict[str, str | int | float]:
    """Attributes of the run, later sources of them taking precedence: defaults, table, assignments.

    Parameters
    ----------
    output : Path
        Its stem is the default of `run_id`.
    rig : Path
        Its name is the default of `rig`.
    table : Path or None
        A TOML file; its table ``[run]`` if it has one, otherwise its keys.
    assignments : iterable of str
        ``KEY=VALUE``; a value that reads as a number is one, except where the format wants text.

    Returns
    -------
    dict
        In the types of the recording format. What is measured may be among them, as in a table made of an
        earlier recording: `require_rate` compares a sampling rate with that of the device.

    Raises
    ------
    InputError
        If the table cannot be read, or an attribute breaks the format.

    Examples
    --------
    >>> given = ["repeat=2", "acceleration_g=3"]
    >>> found = checked_run_attributes(Path("sweep_3g.nc"), Path("rig.toml"), None, given)
    >>> found["run_id"], found["experiment"], found["repeat"], found["acceleration_g"]
    ('sweep_3g', 'other', 2, 3)
    """
    attributes: dict[str, str | int | float] = {
        "run_id": output.stem,
        "experiment": "other",
        "configuration": "sloshing",
        "rig": rig.name,
    }
    given = {**({} if table is None else _from_table(table)), **dict(map(_assigned, assignments))}
    for name, value in given.items():
        attributes[name] = _checked(name, value)
    measured = {"sloshlab_format": FORMAT, "sampling_rate_hz": 1.0, "start_time_utc": "2026-01-01"}
    run_attributes(xr.Dataset(attrs={**measured, **attributes}), name="the run to record")
    return attributes


def require_rate(attributes: Mapping[str, Any], sampling_rate_hz: float) -> None:
    """Compare a stated sampling rate, if there is one, with that of the first device.

    Raises
    ------
    InputError
        If they differ: the run is not the one that was described.
    """
    stated = float(attributes.get("sampling_rate_hz", sampling_rate_hz))
    if not math.isclose(stated, sampling_rate_hz, rel_tol=1e-9):
        raise InputError(
            "attribute sampling_rate_hz",
            got=f"{stated:.10g}",
            allowed=f"{sampling_rate_hz:.10g}, the rate of the first device",
            remedy="leave it out",
        )


def _from_table(path: Path) -> Mapping[str, Any]:
    what = f"run attributes {path}"
    document = read_toml(path, what)
    table = document.get("run", document)
    if not isinstance(table, dict):
        raise InputError(what, got="run that is no table", allowed="a table [run] of attributes")
    return table


def _assigned(text: str) -> tuple[str, str | int | float]:
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise InputError("--attribute", got=repr(text)[:80], allowed="KEY=VALUE", remedy="for example repeat=2")
    return name, value if name in _TEXTS else _number_or_text(value)


def _number_or_text(value: str) -> str | int | float:
    if re.fullmatch(r"[+-]?[0-9]{1,18}", value):
        return int(value)
    try:
        number = float(value)
    except ValueError:
        return value
    # "nan" and "inf" are no measured values but may be somebody's word
    return number if math.isfinite(number) else value


def _checked(name: str, value: object) -> str | int | float:
    what = f"attribute {name}"
    if not _NAME.fullmatch(name):
        raise InputError(f"attribute {name!r}"[:80], got="that name", allowed="letters, digits and underscores")
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise InputError(what, got=repr(value)[:80], allowed="text or a number")
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise InputError(what, got=repr(value)[:80], allowed="a number of 64 bits")
    return value
