"""MAT files of version 7.3, which are HDF5, read by h5py; links out of the file are not followed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from acquisition.files.channel_map import SourceSection
from acquisition.files.matlab5 import Found, collect, table_of
from acquisition.files.reading_limits import DeclaredBytes, ReaderGuard, checked_size, library
from acquisition.files.table import Table
from sloshlab.file_structure import require_sound_heaps
from sloshlab.hdf5_contents import decoded_bytes, listed, outside

_OF_MATLAB = ("#refs#", "#subsystem#")
"""MATLAB's own groups: cells and objects are reached by references into them."""

_MOST_CELLS = 10_000


def read(path: Path, settings: SourceSection) -> Table:
    """Read a version-7.3 MAT file.

    Members of structures are ``name.member``; cells and references are opened only where they hold
    numbers of the file itself.

    Raises
    ------
    FileFormatError
        If the file is damaged, too large once decoded, or holds no series of numbers.
    MissingExtraError
        If h5py is not installed.
    """
    h5py = library("h5py", "reading MAT v7.3 files")
    checked_size(path)
    # a damaged heap would keep the HDF5 library for ever
    require_sound_heaps(path, what=f"source {path}")
    found = Found()
    declared = DeclaredBytes(path)
    with ReaderGuard(path, "MAT v7.3") as guard, h5py.File(path, "r") as source:
        datasets: list[tuple[str, Any]] = []
        for item in listed(source, passed_over=_OF_MATLAB):
            name = ".".join(item.path)
            if item.trouble:
                found.unusable[name] = item.trouble
                continue
            # HDF5 compresses: what is declared counts, not the size of the file
            declared.add(f"variable {name[:60]!r}", item.decoded_bytes)
            datasets.append((name, source["/".join(item.path)]))
        for name, dataset in datasets:
            _collected(source, name, dataset, found, declared)
    return table_of(path, "mat73", found, guard.traps)


def _collected(source: Any, name: str, dataset: Any, found: Found, declared: DeclaredBytes) -> None:
    import h5py

    class_text = _class_of(dataset)
    if dataset.attrs.get("MATLAB_empty", 0) or dataset.shape is None:
        found.unusable[name] = "empty"
    elif class_text == "char":
        found.unusable[name] = "text"
    elif h5py.check_ref_dtype(dataset.dtype) is not None:
        _collected_cells(source, name, dataset, found, declared)
    elif dataset.dtype.kind not in "fiub":
        found.unusable[name] = f"{class_text or dataset.dtype}, not real numbers"
    else:
        # MATLAB stores columns first
        collect(name, np.asarray(dataset[()]).T, found)


def _class_of(dataset: Any) -> str:
    name = dataset.attrs.get("MATLAB_class", b"")
    return name.decode("latin-1") if isinstance(name, bytes) else str(name)


def _collected_cells(source: Any, name: str, dataset: Any, found: Found, declared: DeclaredBytes) -> None:
    if dataset.size > _MOST_CELLS:
        found.unusable[name] = f"{dataset.size} cells"
        return
    references = np.asarray(dataset[()]).T
    for index in np.ndindex(references.shape):
        label = f"{name}{{{','.join(str(i + 1) for i in index)}}}"
        target: Any = source[references[index]] if references[index] else None
        trouble = _trouble_of_cell(target)
        if trouble:
            found.unusable[label] = trouble
            continue
        # each reference is a column of its own, even where all lead to one array
        declared.add(f"cell {label[:60]}", decoded_bytes(target.id))
        collect(label, np.asarray(target[()]).T, found)


def _trouble_of_cell(target: Any) -> str:
    """Why what a reference leads to is no array of real numbers of the file; empty where it is."""
    import h5py

    if not isinstance(target, h5py.Dataset):
        return "not an array of real numbers"
    # a reference leads past the links that were looked at
    elsewhere = outside(target.id)
    if elsewhere:
        return elsewhere
    is_numeric = target.dtype.kind in "fiu" and _class_of(target) != "char"
    return "" if is_numeric else "not an array of real numbers"
