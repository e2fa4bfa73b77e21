"""Values that one process hands to another as text and raw arrays, never as a pickle.

A pickle may run whatever its writer wants; of text and arrays, what was read from a file that nobody vouches for
can only be wrong numbers.
"""

from __future__ import annotations

import contextlib
import math
import mmap
import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sloshlab.out_of_core import LARGEST_IN_MEMORY_BYTES, reserve

# a cache line: no array begins within the one before, and every type is aligned
_ALIGNMENT = 64


class Store:
    """Arrays in files that both processes have.

    Parameters
    ----------
    descriptor : int
        Of a file in memory.
    on_disk : int, optional
        Of one on the disk, for arrays that need not fit into memory.
    """

    def __init__(self, descriptor: int, on_disk: int | None = None) -> None:
        self._descriptors = [descriptor] if on_disk is None else [descriptor, on_disk]
        self._n_bytes = [0] * len(self._descriptors)
        self._parts: list[tuple[int, int, int, int]] = []  # address, bytes, file, offset

    def empty(self, n: int, dtype: np.dtype[Any]) -> NDArray[Any]:
        """Array of which no copy is needed."""
        n_bytes = n * dtype.itemsize
        if not n_bytes:
            return np.empty(n, dtype)
        if n_bytes > LARGEST_IN_MEMORY_BYTES and len(self._descriptors) > 1:
            # a disk that is full: in memory then
            with contextlib.suppress(OSError):
                return self._mapped(1, n_bytes, dtype)
        return self._mapped(0, n_bytes, dtype)

    def _mapped(self, file: int, n_bytes: int, dtype: np.dtype[Any]) -> NDArray[Any]:
        descriptor = self._descriptors[file]
        offset = -(-self._n_bytes[file] // mmap.ALLOCATIONGRANULARITY) * mmap.ALLOCATIONGRANULARITY
        if file:
            reserve(descriptor, offset, n_bytes)
        else:
            os.truncate(descriptor, offset + n_bytes)
        self._n_bytes[file] = offset + n_bytes
        array = np.frombuffer(mmap.mmap(descriptor, n_bytes, offset=offset), dtype)
        self._parts.append((array.ctypes.data, n_bytes, file, offset))
        return array

    def place(self, array: NDArray[Any]) -> tuple[int, int]:
        """Offset and number of the file where the array is, written there if it was not made here."""
        address = array.ctypes.data
        for begins, n_bytes, file, offset in self._parts:
            if begins <= address and address + array.nbytes <= begins + n_bytes:
                return offset + address - begins, file
        start = -(-self._n_bytes[0] // _ALIGNMENT) * _ALIGNMENT
        rest = memoryview(array.reshape(-1).view(np.uint8).data)
        os.lseek(self._descriptors[0], start, os.SEEK_SET)
        while rest:
            rest = rest[os.write(self._descriptors[0], rest) :]
        self._n_bytes[0] = start + array.nbytes
        return start, 0


class Packed:
    """Values as text, their arrays in a store; an array that several share is one array afterwards, too."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._seen: dict[int, tuple[object, list[Any]]] = {}

    def value(self, value: Any) -> Any:
        """What `json` can write."""
        if value is None or (isinstance(value, (bool, int, float, str)) and not isinstance(value, np.generic)):
            return value
        if isinstance(value, Mapping):
            return {"mapping": [[self.value(key), self.value(item)] for key, item in value.items()]}
        if isinstance(value, (list, tuple)):
            return {type(value).__name__: [self.value(item) for item in value]}
        if isinstance(value, np.generic) and value.dtype.kind in "OV":
            return str(value)
        if isinstance(value, (np.ndarray, np.generic)):
            return {"number" if isinstance(value, np.generic) else "array": self._array(value)}
        raise TypeError(f"a reader may not return {type(value)}")

    def _array(self, value: np.ndarray | np.generic) -> list[Any]:
        if id(value) in self._seen:
            return self._seen[id(value)][1]
        array = np.asarray(value)
        packed: list[Any]
        if array.dtype.kind in "OV":
            packed = ["texts", list(array.shape), [str(item) for item in array.flat]]
        else:
            contiguous = np.ascontiguousarray(array).reshape(array.shape)
            place = self._store.place(contiguous) if array.size else (0, 0)
            packed = [array.dtype.str, list(array.shape), *place]
        # kept, so that no other array gets its place and number
        self._seen[id(value)] = value, packed
        return packed


class Unpacked:
    """The reverse of `Packed`."""

    def __init__(self, *files: memoryview) -> None:
        self._files = files
        self._arrays: dict[tuple[int, int, str, tuple[int, ...]], NDArray[Any]] = {}

    def value(self, packed: Any) -> Any:
        """The value."""
        if not isinstance(packed, dict):
            return packed
        ((kind, content),) = packed.items()
        if kind == "mapping":
            return {self.value(key): self.value(item) for key, item in content}
        if kind == "array":
            return self._array(*content)
        if kind == "number":
            return self._array(*content)[()]
        return tuple(map(self.value, content)) if kind == "tuple" else list(map(self.value, content))

    def _array(self, dtype: str, shape: list[int], where: Any, file: int = 0) -> NDArray[Any]:
        if dtype == "texts":
            texts = np.empty(len(where), dtype=object)
            texts[:] = where
            return texts.reshape(shape)
        key = where, file, dtype, tuple(shape)
        if key not in self._arrays:
            n = math.prod(shape)
            whole = np.frombuffer(self._files[file], dtype, n, where) if n else np.empty(0, dtype)
            self._arrays[key] = whole.reshape(shape)
        # without elements all arrays of a kind have the same place; they are nobody's clock
        return self._arrays[key]
