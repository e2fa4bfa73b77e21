"""MAT files of version 7.3, which are HDF5, read by h5py; links out of the file are not followed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from acquisition.files.channel_map import SourceSection
from acquisition.files.matlab5 import Found, collect, table_of
from acquisition.files.reading_limits import ReaderGuard, check_declared, checked_size, library
from acquisition.files.table import Table
from sloshlab.file_structure import require_sound_heaps

_DEEPEST = 12
_MOST_VARIABLES = 100_000


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
    with ReaderGuard(path, "MAT v7.3") as guard, h5py.File(path, "r") as source:
        datasets: list[tuple[str, Any]] = []
        _listed(h5py, source, datasets, found)
        total = 0
        for name, dataset in datasets:
            # HDF5 compresses: what is declared counts, not the size of the file
            total += _decoded_bytes(dataset)
            check_declared(path, f"variable {name[:60]!r}", total)
        for name, dataset in datasets:
            _collected(h5py, source, name, dataset, found)
    return table_of(path, "mat73", found, guard.traps)


def _listed(
    h5py: Any, group: Any, datasets: list[tuple[str, Any]], found: Found, *, prefix: str = "", depth: int = 0
) -> None:
    for key in group:
        # MATLAB's own: cells and objects are reached by references into it
        if key.startswith("#") and not prefix:
            continue
        name = prefix + key
        # a link may lead into any file of the computer
        if not isinstance(group.get(key, getlink=True), h5py.HardLink):
            found.unusable[name] = "a link, not followed"
        elif depth > _DEEPEST or len(datasets) > _MOST_VARIABLES:
            found.unusable[name] = "nested too deeply"
        else:
            item = group[key]
            if isinstance(item, h5py.Group):
                _listed(h5py, item, datasets, found, prefix=f"{name}.", depth=depth + 1)
            elif isinstance(item, h5py.Dataset):
                datasets.append((name, item))


def _decoded_bytes(dataset: Any) -> int:
    size = 1
    for extent in dataset.shape or (0,):
        size *= int(extent)
    return size * max(8, int(dataset.dtype.itemsize))


def _collected(h5py: Any, source: Any, name: str, dataset: Any, found: Found) -> None:
    class_name = dataset.attrs.get("MATLAB_class", b"")
    class_text = class_name.decode("latin-1") if isinstance(class_name, bytes) else str(class_name)
    # data in other files, without any link
    if dataset.external or dataset.is_virtual:
        found.unusable[name] = "data outside the file, not followed"
    elif dataset.attrs.get("MATLAB_empty", 0) or dataset.shape is None:
        found.unusable[name] = "empty"
    elif class_text == "char":
        found.unusable[name] = "text"
    elif h5py.check_ref_dtype(dataset.dtype) is not None:
        _collected_cells(h5py, source, name, dataset, found)
    elif dataset.dtype.kind not in "fiub":
        found.unusable[name] = f"{class_text or dataset.dtype}, not real numbers"
    else:
        # MATLAB stores columns first
        collect(name, np.asarray(dataset[()]).T, found)


def _collected_cells(h5py: Any, source: Any, name: str, dataset: Any, found: Found) -> None:
    references = np.asarray(dataset[()]).T
    if references.size > 10_000:
        found.unusable[name] = f"{references.size} cells"
        return
    for index in np.ndindex(references.shape):
        label = f"{name}{{{','.join(str(i + 1) for i in index)}}}"
        target = source[references[index]] if references[index] else None
        is_plain = isinstance(target, h5py.Dataset) and target.dtype.kind in "fiu"
        if target is None or not is_plain or target.attrs.get("MATLAB_class", b"") == b"char":
            found.unusable[label] = "not an array of real numbers"
            continue
        check_declared(Path(str(source.filename)), f"cell {label}", _decoded_bytes(target))
        collect(label, np.asarray(target[()]).T, found)
