"""MAT files of version 5 (`save -v6`, `-v7`), read by scipy after a walk over all declared sizes."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.files.channel_map import SourceSection
from acquisition.files.reading_limits import (
    DeclaredBytes,
    ReaderGuard,
    check_declared,
    checked_size,
    decoded_allowance,
)
from acquisition.files.table import Column, Table, as_float64, rows_of
from sloshlab.errors import FileFormatError

_INT8, _INT32, _UINT32, _UTF8 = 1, 5, 6, 16
_ITEM_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
"""Type of a data element → bytes per number."""

_COMPLEX_FLAG = 0x0800
_OPAQUE = 17
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE = 1, 2, 3, 4, 5
_NUMERIC = frozenset(range(6, 16))
_CLASS_NAMES = {_OBJECT: "an object", _SPARSE: "a sparse matrix", 16: "a function", 17: "an opaque object"}
_DEEPEST = 12
# a file of a few kilobytes may declare millions of empty cells
_MOST_ELEMENTS = 1_000_000


def read(path: Path, settings: SourceSection) -> Table:
    """Read a version-5 MAT file.

    Matrices become one column per row (or per column, whichever is shorter), members of structures
    ``name.member``; single numbers are scalars.

    Raises
    ------
    FileFormatError
        If a declared size does not fit the file, or nothing in it is a series of numbers.
    """
    import scipy.io

    checked_size(path)
    unusable: dict[str, str] = {}
    wanted: list[str] = []
    # Before scipy reads anything: its C code trusts the structure of the file, and a damaged one brought the
    # process down. After the walk random mutations end in a result or in an error of one line.
    for name, reason in _walked(path):
        if reason:
            unusable[name] = reason
        else:
            wanted.append(name)
    with ReaderGuard(path, "MAT v5") as guard:
        # without appendmat=False scipy would append .mat to a name that ends otherwise
        content = scipy.io.loadmat(
            str(path), variable_names=wanted, struct_as_record=True, squeeze_me=False, appendmat=False
        )
    found = Found()
    for name in wanted:
        if name in content:
            collect(name, content[name], found)
    found.unusable.update(unusable)
    return table_of(path, "mat", found, guard.traps)


class Found:
    """What has been collected from the variables of a file."""

    def __init__(self) -> None:
        self.columns: list[Column] = []
        self.scalars: dict[str, float] = {}
        self.unusable: dict[str, str] = {}


def table_of(path: Path, format_name: str, found: Found, traps: list[str]) -> Table:
    """The table of collected variables.

    Raises
    ------
    FileFormatError
        If none is a series of numbers.
    """
    if not found.columns:
        raise FileFormatError(
            f"source {path}",
            got=f"no series of numbers (variables: {', '.join([*found.scalars, *found.unusable][:8]) or 'none'})",
            allowed="numeric vectors or matrices",
            remedy="save the signals as numeric arrays",
        )
    return Table(
        format_name, tuple(found.columns), traps=tuple(traps), unusable=found.unusable, scalars=found.scalars
    )


def collect(name: str, value: Any, found: Found, depth: int = 0) -> None:
    """Add the numeric series of one variable, structures and cells opened."""
    if depth > _DEEPEST:
        found.unusable[name] = "nested too deeply"
        return
    array = np.asarray(value)
    if array.dtype.names:
        for member in array.dtype.names:
            for position, element in enumerate(array[member].flat, start=1):
                suffix = f"({position})" if array.size > 1 else ""
                collect(f"{name}{suffix}.{member}", element, found, depth + 1)
    elif array.dtype == object:
        for index in np.ndindex(array.shape):
            label = ",".join(str(i + 1) for i in index)
            collect(f"{name}{{{label}}}", array[index], found, depth + 1)
    elif array.dtype.kind == "c":
        found.unusable[name] = "complex numbers"
    elif array.dtype.kind not in "fiub":
        found.unusable[name] = "text"
    elif array.size == 0:
        found.unusable[name] = "empty"
    elif array.size == 1:
        found.scalars[name] = float(array.reshape(-1)[0])
    else:
        series = rows_of(name, array)
        if not series:
            found.unusable[name] = f"a matrix of shape {array.shape}: no side is clearly time"
        found.columns.extend(Column(label, as_float64(row)) for label, row in series)


@dataclass
class _Budget:
    """What may still be declared."""

    numbers: DeclaredBytes
    n_elements: int = _MOST_ELEMENTS


def _walked(path: Path) -> Iterator[tuple[str, str]]:
    """Name and, where it is not usable, reason of every variable; declared sizes checked."""
    content = path.read_bytes()
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    # by a zero among the first four bytes scipy knows version 4, whatever else the header says
    if len(content) < 136 or order is None or 0 in content[:4]:
        raise _damaged(path, "no MAT v5 header")
    budget = _Budget(DeclaredBytes(path))
    for kind, body in _elements(content[128:], order, path):
        if kind == _COMPRESSED:
            kind, body = _decompressed(body, order, path)
        if kind != _MATRIX:
            continue
        name, reason = _checked_matrix(body, order, path, 0, budget)
        if name and not name.startswith("__"):
            yield name, reason


def _elements(content: bytes, order: str, path: Path) -> Iterator[tuple[int, bytes]]:
    """Type and bytes of each element; every declared length must fit what is there."""
    view = memoryview(content)
    position = 0
    while position + 8 <= len(content):
        word, length = struct.unpack_from(order + "II", content, position)
        if word >> 16:  # small element: type and length share one word
            length, kind, start, step = word >> 16, word & 0xFFFF, position + 4, 8
            if length > 4:
                raise _damaged(path, "a small element longer than 4 bytes")
        else:
            # elements are padded to 8 bytes, compressed ones are not
            padded = length if word == _COMPRESSED else -(-length // 8) * 8
            kind, start, step = word, position + 8, 8 + padded
        if start + length > len(content):
            raise _damaged(path, f"an element of {length} bytes where {max(0, len(content) - start)} are left")
        yield kind, bytes(view[start : start + length])
        position += step
    if any(content[position:]):
        raise _damaged(path, "half an element at its end")


def _decompressed(body: bytes, order: str, path: Path) -> tuple[int, bytes]:
    try:
        stream = zlib.decompressobj()
        head = stream.decompress(body, 8)
        if len(head) < 8:
            raise _damaged(path, "a compressed variable without content")
        kind, length = struct.unpack(order + "II", head)
        check_declared(path, "a compressed variable", length, decoded_allowance(path.stat().st_size))
        # no more than is declared, which was checked before
        inner = stream.decompress(stream.unconsumed_tail, length + 16) if length else b""
    except zlib.error as error:
        raise _damaged(path, f"a compressed variable that cannot be opened ({error})") from error
    if len(inner) < length:
        raise _damaged(path, f"a variable of {length} bytes of which {len(inner)} are there")
    return kind, inner[:length]


def _checked_matrix(body: bytes, order: str, path: Path, depth: int, budget: _Budget) -> tuple[str, str]:
    if depth > _DEEPEST:
        raise _damaged(path, "structures nested too deeply")
    if not body:
        return "", "empty"
    parts = list(_elements(body, order, path))
    types = [element for element, _ in parts]
    if types[:2] != [_UINT32, _INT32] or len(parts[0][1]) != 8 or len(parts[1][1]) % 4 or len(parts) < 3:
        raise _damaged(path, "a variable without flags, shape or name")
    flags = struct.unpack_from(order + "I", parts[0][1])[0]
    kind = flags & 0xFF
    name = parts[2][1].decode("latin-1")[:200] if kind != _OPAQUE else ""
    if kind in _CLASS_NAMES:
        return name or "(unnamed)", f"{_CLASS_NAMES[kind]}, not an array"
    shape = struct.unpack(f"{order}{len(parts[1][1]) // 4}i", parts[1][1])
    if types[2] not in (_INT8, _UTF8) or not 2 <= len(shape) <= 32 or min(shape) < 0:
        raise _damaged(path, f"variable {name[:40]!r} of shape {shape[:4]}")
    size = math.prod(shape)
    if kind in _NUMERIC:
        _check_numbers(path, name, size, parts[3:], 2 if flags & _COMPLEX_FLAG else 1)
        # every number becomes one of eight bytes, however short it is stored
        budget.numbers.add(f"variable {name[:40]!r}", 8 * size)
    elif kind == _CHAR:
        _check_numbers(path, name, size, parts[3:], 1, exact=False)
        budget.numbers.add(f"text {name[:40]!r}", 8 * size)
    elif kind == _CELL:
        _check_members(path, name, size, parts[3:], order=order, depth=depth, budget=budget)
    elif kind == _STRUCT:
        n_fields = _n_fields(path, name, parts[3:5], order)
        _check_members(path, name, size * n_fields, parts[5:], order=order, depth=depth, budget=budget)
    else:
        return name, f"of unknown class {kind}"
    return name, ""


def _check_numbers(
    path: Path, name: str, size: int, parts: list[tuple[int, bytes]], n_parts: int, *, exact: bool = True
) -> None:
    if len(parts) != n_parts or any(element not in _ITEM_BYTES for element, _ in parts):
        raise _damaged(path, f"variable {name[:40]!r} without its numbers")
    for element, data in parts:
        n_items, rest = divmod(len(data), _ITEM_BYTES[element])
        if rest or (n_items != size if exact else n_items > 4 * size):
            raise _damaged(path, f"variable {name[:40]!r} of {size} numbers in {len(data)} bytes")


def _n_fields(path: Path, name: str, parts: list[tuple[int, bytes]], order: str) -> int:
    if [element for element, _ in parts] != [_INT32, _INT8] or len(parts[0][1]) != 4:
        raise _damaged(path, f"structure {name[:40]!r} without field names")
    length = struct.unpack(order + "i", parts[0][1])[0]
    if not 0 < length <= 256 or len(parts[1][1]) % length:
        raise _damaged(path, f"structure {name[:40]!r} with field names of {length} bytes")
    names = [parts[1][1][start : start + length] for start in range(0, len(parts[1][1]), length)]
    if len(set(names)) != len(names) or any(not field.strip(b"\0") or field[-1] for field in names):
        raise _damaged(path, f"structure {name[:40]!r} with broken field names")
    return len(names)


def _check_members(
    path: Path,
    name: str,
    n_members: int,
    parts: list[tuple[int, bytes]],
    *,
    order: str,
    depth: int,
    budget: _Budget,
) -> None:
    if n_members != len(parts) or any(element != _MATRIX for element, _ in parts):
        raise _damaged(path, f"variable {name[:40]!r} of {n_members} members of which {len(parts)} are there")
    budget.n_elements -= len(parts)
    if budget.n_elements < 0:
        raise _damaged(path, "more than a million cells and members")
    for _, data in parts:
        _checked_matrix(data, order, path, depth + 1, budget)


def _damaged(path: Path, what: str) -> FileFormatError:
    return FileFormatError(
        f"source {path}",
        got=what,
        allowed="a complete MAT v5 file",
        remedy="save it again with -v7, or copy it again",
    )
