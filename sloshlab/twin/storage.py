"""A twin on disk: one TOML file for a person, and one netCDF file for arrays. Never pickle, nothing is evaluated.

A twin names its forces; modules that register them are imported before it is loaded. Saving a loaded twin gives
the same bytes.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy.io import netcdf_file

from sloshlab.atomic_file import replaced, write_bytes
from sloshlab.errors import InputError
from sloshlab.toml_file import read_toml
from sloshlab.twin import (  # noqa: F401  they register forces
    external_forces,
    liquid_effects,
    product_forces,
    rate_independent_forces,
    reduced_order_model_force,
    rocking_liquid,
    structure_forces,
    tank_forces,
)
from sloshlab.twin.sensors import Sensor
from sloshlab.twin.structure import RockedModes, Structure
from sloshlab.twin.terms import Term, kind_named
from sloshlab.twin.twin import Twin

FloatArray = npt.NDArray[np.float64]
FORMAT: Final = 1
# Checked before anything is read: a file may hold anything.
_LARGEST_ARRAYS_BYTES = 200_000_000
_MOST_TERMS = 1000
_STRUCTURE_ARRAYS = (
    "masses_kg",
    "stiffnesses_n_per_m",
    "dampings_kg_per_s",
    "mode_shape",
    "base_participation_kg",
)
_ROCKED_SHARES, _ROCKED_ROTATION = "rocked_shares_of_clamped_modes", "rocked_rotation_rad_per_m"
_SENSOR_NUMBERS = (
    "gain",
    "delay_s",
    "high_pass_time_constant_s",
    "noise_std",
    "range_min",
    "range_max",
)


def save_twin(twin: Twin, path: str | os.PathLike[str], further_lines: Sequence[str] = ()) -> None:
    """Write the twin to `path` (TOML) and, where its forces have tables, to the same name with `.nc`.

    Each file is written completely or not at all; the text last, so that it never names arrays that are absent.

    Parameters
    ----------
    twin : Twin
    path : path
    further_lines : sequence of str
        Tables for others who read the file; `load_twin` passes over them.
    """
    file = Path(path)
    tables = {f"term_{i}": term.table for i, term in enumerate(twin.terms) if term.table.size}
    # arrays first: a text without its arrays would be a twin that cannot be loaded
    if tables:
        _write_arrays(file.with_suffix(".nc"), tables)
    write_bytes(file, (_text(twin) + "".join(f"{line}\n" for line in further_lines)).encode())


def load_twin(path: str | os.PathLike[str]) -> Twin:
    """Read a twin that `save_twin` wrote.

    Raises
    ------
    InputError
        If a file is missing, damaged, or names a force that is not registered.
    """
    file = Path(path)
    document = _document(file)
    try:
        tables = _read_arrays(file.with_suffix(".nc")) if document.get("has_tables") else {}
        described = document.get("terms", [])
        if len(described) > _MOST_TERMS:
            raise ValueError(f"{len(described)} terms")
        terms = tuple(_term(i, entry, tables) for i, entry in enumerate(described))
        sensors = tuple(Sensor(**entry) for entry in document.get("sensors", []))
        return Twin(_structure(document), terms, sensors, float(document["carried_mass_kg"]))
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"twin {file}", got=f"contents that are no twin ({error})"[:200], remedy="save it again"
        ) from error


def _number(value: float) -> str:
    if math.isinf(value):
        return "inf" if value > 0 else "-inf"
    # `repr` gives the shortest text that reads back as the same number
    return "nan" if math.isnan(value) else repr(float(value))


def _list(name: str, values: FloatArray) -> str:
    return f"{name} = [{', '.join(_number(value) for value in values)}]"


def _text(twin: Twin) -> str:
    lines = [
        f"sloshlab_twin = {FORMAT}",
        f"carried_mass_kg = {_number(twin.carried_mass_kg)}",
        f"has_tables = {str(any(term.table.size for term in twin.terms)).lower()}",
    ]
    if twin.structure is not None:
        lines += ["", "[structure]"]
        lines += [_list(name, getattr(twin.structure, name)) for name in _STRUCTURE_ARRAYS]
        rocked = twin.structure.rocked
        if rocked is not None:
            lines += [
                _list(_ROCKED_SHARES, rocked.of_clamped.ravel()),
                _list(_ROCKED_ROTATION, rocked.rotation_rad_per_m),
            ]
    for term in twin.terms:
        lines += ["", "[[terms]]", f"name = {json.dumps(term.name)}", f"place = {json.dumps(term.place)}"]
        lines += [f"{name} = {_number(value)}" for name, value in term.values.items()]
    for sensor in twin.sensors:
        lines += ["", "[[sensors]]", f"channel = {json.dumps(sensor.channel)}"]
        lines += [f"{name} = {_number(getattr(sensor, name))}" for name in _SENSOR_NUMBERS]
    return "\n".join(lines) + "\n"


def _document(file: Path) -> dict[str, Any]:
    remedy = "a module of a user's own is run by UserTwinModel.simulate, what was found by load_extended beside it"
    if file.suffix == ".py":
        raise InputError(f"twin {file}", got="a Python module", allowed="a saved twin of a rig", remedy=remedy)
    document = read_toml(file, f"twin {file}")
    if "sloshlab_user_twin" in document:
        got = "what was found of a Python module"
        raise InputError(f"twin {file}", got=got, allowed="a saved twin of a rig", remedy=remedy)
    if document.get("sloshlab_twin") != FORMAT:
        raise InputError(
            f"twin {file}: sloshlab_twin", got=repr(document.get("sloshlab_twin"))[:80], allowed=str(FORMAT)
        )
    return document


def _structure(document: dict[str, Any]) -> Structure | None:
    described = document.get("structure")
    if described is None:
        return None
    arrays = [np.array(described[name], dtype=np.float64) for name in _STRUCTURE_ARRAYS]
    if len({array.shape for array in arrays}) != 1 or arrays[0].ndim != 1 or arrays[0].size == 0:
        raise ValueError("structure: lists of different lengths")
    if not all(np.isfinite(array).all() for array in arrays[:4]) or arrays[0].min() <= 0 or arrays[1].min() <= 0:
        raise ValueError("structure: masses and stiffnesses must be positive numbers")
    mass, stiffness, damping, shape, base = arrays
    return Structure(mass, stiffness, damping, shape, base, _rocked(described, mass.size))


def _rocked(described: dict[str, Any], n: int) -> RockedModes | None:
    if _ROCKED_SHARES not in described and _ROCKED_ROTATION not in described:
        return None
    shares, rotation = (np.array(described[name], dtype=np.float64) for name in (_ROCKED_SHARES, _ROCKED_ROTATION))
    if shares.shape != (n * n,) or rotation.shape != (n,) or not np.isfinite([*shares, *rotation]).all():
        raise ValueError(f"structure: {_ROCKED_SHARES} and {_ROCKED_ROTATION} must be {n * n} and {n} numbers")
    return RockedModes(shares.reshape(n, n), rotation)


def _term(i: int, entry: dict[str, Any], tables: dict[str, FloatArray]) -> Term:
    numbers = {name: value for name, value in entry.items() if name not in ("name", "place")}
    return kind_named(str(entry["name"]))(place=entry["place"], table=tables.get(f"term_{i}", ()), **numbers)


def _write_arrays(file: Path, tables: dict[str, FloatArray]) -> None:
    """netCDF classic: same arrays, same bytes."""
    with replaced(file) as temporary, netcdf_file(temporary, "w", version=2, mmap=False) as target:
        for name, values in tables.items():
            target.createDimension(name, values.size)
            target.createVariable(name, "f8", (name,))[:] = values


def _read_arrays(file: Path) -> dict[str, FloatArray]:
    try:
        if file.stat().st_size > _LARGEST_ARRAYS_BYTES:
            raise InputError(
                f"twin {file}", got=f"{file.stat().st_size} bytes", allowed=f"≤ {_LARGEST_ARRAYS_BYTES}"
            )
        with netcdf_file(file, "r", mmap=False) as source:
            return {name: np.array(v.data, dtype=np.float64) for name, v in source.variables.items()}
    except OSError as error:
        raise InputError(
            f"twin {file}", got=error.strerror or str(error), allowed="its arrays beside it"
        ) from error
    except (TypeError, ValueError, IndexError, KeyError, AssertionError) as error:
        raise InputError(
            f"twin {file}", got="bytes that are no netCDF file", remedy="save the twin again"
        ) from error
