"""Rigs as they are handed over: files, or descriptions in memory."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

from sloshlab.errors import InputError
from sloshlab.rig import Rig


@dataclass(frozen=True, eq=False)
class RigInMemory:
    """A rig that is no file.

    Attributes
    ----------
    name : str
        What it is called in messages, reports and provenance.
    rig : Rig
    """

    name: str
    rig: Rig

    def __str__(self) -> str:
        return self.name

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of everything it says; the same description has the same hash."""
        return hashlib.sha256(self.rig.model_dump_json().encode()).hexdigest()


RigSource = Path | RigInMemory
"""One rig, as pipelines take it."""

RigLike = str | os.PathLike[str] | Rig | RigInMemory
RigsLike = RigLike | Mapping[str, RigLike] | Iterable[RigLike]
"""One or several rigs, as people hand them over."""

_NAME: Final = "rig"
_FILES_OF_A_TWIN: Final = ("rom", "maps")
"""Parameters of tank models that are paths, relative to the rig's file."""


def rig_of(source: RigSource) -> Rig:
    """The rig.

    Raises
    ------
    RigError
        If the file is missing or describes no possible rig.
    """
    return Rig.from_toml(source) if isinstance(source, Path) else source.rig


def folder_of(source: RigSource) -> Path | None:
    """Where files that a rig names are looked for; None for a rig in memory, which has no folder.

    Raises
    ------
    InputError
        If a rig in memory names a file by a relative path: it would depend on the working directory.
    """
    if isinstance(source, Path):
        return source.absolute().parent
    parameters = source.rig.twin.parameters if source.rig.twin is not None else {}
    for name in _FILES_OF_A_TWIN:
        value = parameters.get(name)
        if isinstance(value, str) and not Path(value).is_absolute():
            raise InputError(
                f"{source}: twin.parameters.{name}",
                got=f"{value!r} in a rig that is no file",
                allowed="an absolute path",
                remedy="give the rig as its TOML file, beside which it is looked for",
            )
    return None


def rig_source(rig: RigLike, name: str = "") -> RigSource:
    """One rig as pipelines take it; `name` is for a description in memory.

    Raises
    ------
    InputError
        If it is no rig.
    """
    if isinstance(rig, RigInMemory):
        return rig
    if isinstance(rig, Rig):
        return RigInMemory(name or _NAME, rig)
    if isinstance(rig, str | os.PathLike):
        return Path(rig)
    got = f"an object of type {type(rig).__name__}"
    raise InputError("rig", got=got, allowed="a path or a sloshlab.Rig")


def rig_sources(rigs: RigsLike) -> list[RigSource]:
    """Rigs as pipelines take them, in the order given; those of a mapping are called by its keys.

    Raises
    ------
    InputError
        If there is nothing, or something else than a rig.
    """
    if isinstance(rigs, Mapping):
        found = [rig_source(rig, str(name)) for name, rig in rigs.items()]
    elif isinstance(rigs, str | os.PathLike | Rig | RigInMemory) or not isinstance(rigs, Iterable):
        found = [rig_source(rigs)]
    else:
        found = [rig_source(rig) for rig in rigs]
    if not found:
        raise InputError("rig", got="none", allowed="at least one", remedy="give rig=")
    return found
