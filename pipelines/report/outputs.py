"""Writing results: netCDF with the same bytes for the same content."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol, runtime_checkable

from sloshlab import atomic_file, interrupt

if TYPE_CHECKING:  # every command looks at its result folder with this module before anything else
    import xarray as xr

_HASH_BLOCK = 1 << 20
_SMALLEST_COMPRESSED_SIZE = 1000
_IDENTIFIER_DIGITS = 16
RESULT_ID: Final = "result_id"
"""Name of the identifier in every file of a result."""


@runtime_checkable
class InMemory(Protocol):
    """What was handed over in memory instead of as a file: it has a name, and says what it holds."""

    @property
    def name(self) -> str:
        """What it is called."""
        ...

    @property
    def sha256(self) -> str:
        """SHA-256 of its content, in hexadecimal."""
        ...


def write_dataset(dataset: xr.Dataset, path: Path) -> None:
    """Write a result atomically; text is stored as fixed-width characters so that bytes repeat."""
    from sloshlab.netcdf_lock import NETCDF_LOCK

    encoding: dict[str, dict[str, Any]] = {}
    stored = dataset.copy(deep=False)
    for name in [*stored.data_vars, *stored.coords]:
        variable = stored[name]
        if variable.dtype.kind in "OU":
            stored[name] = variable.astype(str)
            encoding[str(name)] = {"dtype": "S1", "char_dim_name": f"{name}_length"}
        elif variable.size >= _SMALLEST_COMPRESSED_SIZE and variable.dtype.kind == "f":
            encoding[str(name)] = {"zlib": True, "complevel": 4, "shuffle": True, "_FillValue": float("nan")}
    # the netCDF library is not made for threads; an interrupt within xarray would leave its lock taken for ever
    with atomic_file.replaced(path) as temporary, NETCDF_LOCK, interrupt.held():
        stored.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=encoding)


def sha256_of(path: Path | InMemory) -> str:
    """SHA-256 of a file's bytes, or of what is in memory, in hexadecimal."""
    if not isinstance(path, Path):
        return path.sha256
    digest = hashlib.sha256()
    with path.open("rb") as source:
        while block := source.read(_HASH_BLOCK):
            digest.update(block)
    return digest.hexdigest()


def versions() -> dict[str, str]:
    """Versions of everything that a result depends on."""
    import platform
    from importlib.metadata import version

    names = ("sloshlab", "numpy", "scipy", "numba", "xarray", "netCDF4")
    return {"python": platform.python_version(), **{name: version(name) for name in names}}


def provenance_of(
    command: str,
    inputs: Iterable[Path | InMemory],
    known_sha256: Mapping[Path | InMemory, str] | None = None,
    *,
    settings: object,
) -> dict[str, Any]:
    """What a result rests on: the command, hashes of the input files, settings and versions.

    Parameters
    ----------
    command : str
        What the user typed.
    inputs : iterable of Path or InMemory
        Every file that the results depend on, and what was handed over in memory.
    known_sha256 : mapping of Path or InMemory to str, optional
        Hashes that need not be computed again.
    settings : object
        Everything that was chosen: data classes, mappings, sequences and plain values.

    Returns
    -------
    dict
        Also `result_id`, one identifier of all that is made of the same inputs by the same settings and versions.
    """
    known = known_sha256 or {}
    hashed = [(path.name, known.get(path) or sha256_of(path)) for path in inputs]
    chosen, used = _plain(settings), versions()
    # no clock, and no place: the same run again has the same identifier
    whole = json.dumps([sorted(hashed), chosen, used], sort_keys=True)
    return {
        RESULT_ID: hashlib.sha256(whole.encode()).hexdigest()[:_IDENTIFIER_DIGITS],
        "command": command,
        "inputs": dict(hashed),
        "settings": json.dumps(chosen, sort_keys=True),
        "versions": used,
    }


def _plain(value: object) -> Any:
    """A value as JSON has it; files by their names, as their contents are hashed."""
    if isinstance(value, Path | InMemory):
        return value.name
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
        return {type(value).__name__: fields}
    if isinstance(value, Mapping):
        return {str(name): _plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return value if value is None or isinstance(value, bool | int | float | str) else repr(value)


def stamp_of(provenance: Mapping[str, Any]) -> dict[str, str]:
    """Attributes of a result: what it rests on, and which run made it; the command stands in the report only.

    Files of the same inputs then have the same bytes, wherever they are written.
    """
    rests_on = {name: json.dumps(provenance.get(name, {}), sort_keys=True) for name in ("inputs", "versions")}
    return {RESULT_ID: str(provenance.get(RESULT_ID, "")), **rests_on}


def report_lines(folder: Path, *, written: bool = True) -> list[str]:
    """Where the report is, for the summary of a command; nothing if none was asked for."""
    return [f"report: {folder / 'report.html'}"] if written else []
