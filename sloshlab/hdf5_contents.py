"""What an HDF5 file holds, found without following anything out of it and without reading samples.

An HDF5 file may name other files: by external and soft links, by external storage of a data set, by virtual data
sets. Whoever follows them hands any file of the machine on as samples. And it may contain itself, by a hard link
to a group around it. Both are found here, from the links and creation properties alone, for every reader.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from sloshlab.errors import RecordingError

DEEPEST_GROUP: Final = 12
"""Structures within structures; files of measurements have two or three."""
MOST_OBJECTS: Final = 100_000
"""Data sets and groups of one file: MATLAB keeps each cell as one, and a larger file takes minutes to list."""

# as the library counts a number once it is decoded to float64
_DECODED_BYTES = 8


@dataclass(frozen=True)
class Hdf5Object:
    """One data set of a file, or what stands in place of one.

    Attributes
    ----------
    path : tuple of str
        Names of the groups around it, then its own.
    trouble : str
        Why it must not be read; empty for data of the file itself.
    decoded_bytes : int
        Size of its numbers as float64, by its declared shape.
    """

    path: tuple[str, ...]
    trouble: str = ""
    decoded_bytes: int = 0


def listed(file: Any, *, passed_over: tuple[str, ...] = ()) -> Iterator[Hdf5Object]:
    """Every data set of an open file, and every link that must not be followed.

    Parameters
    ----------
    file : h5py.File
    passed_over : tuple of str
        Groups of the root that are not entered.
    """
    import h5py

    root = file.id
    seen = {_address(h5py.h5o.get_info(root))}
    n_objects = 0
    waiting: list[tuple[tuple[str, ...], Any]] = [((), h5py.h5g.open(root, b"/"))]
    while waiting:
        above, group = waiting.pop()
        for name, kind in _links(group):
            path = (*above, name.decode("utf-8", errors="replace"))
            n_objects += 1
            if path[0] in passed_over:
                continue
            if kind != h5py.h5l.TYPE_HARD:
                yield Hdf5Object(path, "a link, not followed")
                continue
            found = h5py.h5o.open(group, name)
            if isinstance(found, h5py.h5d.DatasetID):
                yield Hdf5Object(path, outside(found), decoded_bytes(found))
            elif isinstance(found, h5py.h5g.GroupID):
                address = _address(h5py.h5o.get_info(found))
                if address in seen:
                    yield Hdf5Object(path, "a group that is there already, not entered again")
                elif len(path) > DEEPEST_GROUP or n_objects > MOST_OBJECTS:
                    yield Hdf5Object(path, "nested too deeply")
                else:
                    seen.add(address)
                    waiting.append((path, found))


def _address(information: Any) -> tuple[int, int]:
    return information.fileno, information.addr


def _links(group: Any) -> list[tuple[bytes, int]]:
    """Name and kind of each link; of a group with too many, as many as are looked at."""
    links: list[tuple[bytes, int]] = []

    def noted(name: bytes, information: Any) -> bool | None:
        links.append((name, information.type))
        return True if len(links) > MOST_OBJECTS else None

    group.links.iterate(noted, info=True)
    return links


def outside(dataset: Any) -> str:
    """Why a data set is not in the file itself; empty where it is.

    Parameters
    ----------
    dataset : h5py.h5d.DatasetID
        Opened, which reads nothing.
    """
    import h5py

    properties = dataset.get_create_plist()
    is_elsewhere = properties.get_layout() == h5py.h5d.VIRTUAL or properties.get_external_count() > 0
    return "data outside the file, not followed" if is_elsewhere else ""


def decoded_bytes(dataset: Any) -> int:
    """Declared size of a data set in the file itself, at least eight bytes a number; 0 for any other."""
    # the shape of a virtual data set is that of its sources: asking for it opens them
    if outside(dataset):
        return 0
    n_numbers = 1
    for extent in dataset.get_space().shape or ():
        n_numbers *= int(extent)
    return n_numbers * max(_DECODED_BYTES, int(dataset.get_type().get_size()))


def is_hdf5(path: str | os.PathLike[str]) -> bool:
    """Whether a file is HDF5, by its signature."""
    import h5py

    return bool(h5py.is_hdf5(path))


def require_self_contained(path: str | os.PathLike[str], *, what: str) -> None:
    """Refuse a file of which anything lies outside of it, or within itself.

    Parameters
    ----------
    path : path-like
        An HDF5 file.
    what : str
        What the message calls it.

    Raises
    ------
    RecordingError
        Naming the first such object.
    OSError
        If the file cannot be opened.
    """
    import h5py

    with h5py.File(path, "r") as file:
        troubled = next((found for found in listed(file) if found.trouble), None)
    if troubled is not None:
        raise RecordingError(
            f"{what}: {'/'.join(troubled.path)[:200]}",
            got=troubled.trouble,
            allowed="data in the file itself",
            remedy="copy what is meant into one file",
        )
