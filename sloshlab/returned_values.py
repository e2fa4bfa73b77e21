"""Values that one process hands to another as text and raw arrays, never as a pickle.

A pickle may run whatever its writer wants; of text and arrays, what was read from a file that nobody vouches for
can only be wrong numbers.
"""

from __future__ import annotations

import math
import mmap
import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

# a cache line: no array begins within the one before, and every type is aligned
_ALIGNMENT = 64


class Store:
    """Arrays in a file that both processes have."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._n_bytes = 0
        self._parts: list[tuple[int, int, int]] = []  # address, bytes, offset

    def empty(self, n: int, dtype: np.dtype[Any]) -> NDArray[Any]:
        """Array of which no copy is needed."""
        n_bytes = n * dtype.itemsize
        if not n_bytes:
            return np.empty(n, dtype)
        offset = -(-self._n_bytes // mmap.ALLOCATIONGRANULARITY) * mmap.ALLOCATIONGRANULARITY
        self._n_bytes = offset + n_bytes
        os.truncate(self._descriptor, self._n_bytes)
        array = np.frombuffer(mmap.mmap(self._descriptor, n_bytes, offset=offset), dtype)
        self._parts.append((array.ctypes.data, n_bytes, offset))
        return array

    def offset(self, array: NDArray[Any]) -> int:
        """Where the array is, after it has been written if it was not made here."""
        address = array.ctypes.data
        for begins, n_bytes, offset in self._parts:
            if begins <= address and address + array.nbytes <= begins + n_bytes:
                return offset + address - begins
        start = -(-self._n_bytes // _ALIGNMENT) * _ALIGNMENT
        rest = memoryview(array.reshape(-1).view(np.uint8).data)
        os.lseek(self._descriptor, start, os.SEEK_SET)
        while rest:
            rest = rest[os.write(self._descriptor, rest) :]
        self._n_bytes = start + array.nbytes
        return start


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
            packed = [array.dtype.str, list(array.shape), self._store.offset(contiguous) if array.size else 0]
        # kept, so that no other array gets its place and number
        self._seen[id(value)] = value, packed
        return packed


class Unpacked:
    """The reverse of `Packed`."""

    def __init__(self, store: memoryview) -> None:
        self._store = store
        self._arrays: dict[tuple[int, str, tuple[int, ...]], NDArray[Any]] = {}

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

    def _array(self, dtype: str, shape: list[int], where: Any) -> NDArray[Any]:
        if dtype == "texts":
            texts = np.empty(len(where), dtype=object)
            texts[:] = where
            return texts.reshape(shape)
        key = where, dtype, tuple(shape)
        if key not in self._arrays:
            n = math.prod(shape)
            whole = np.frombuffer(self._store, dtype, n, where) if n else np.empty(0, dtype)
            self._arrays[key] = whole.reshape(shape)
        # without elements all arrays of a kind have the same place; they are nobody's clock
        return self._arrays[key]
