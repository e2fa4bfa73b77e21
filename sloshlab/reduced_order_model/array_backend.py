"""Where arrays live: NumPy by default, or any library of the Python array API, on a GPU too.

The networks and the normal equations use only what the standard has, so that NumPy, PyTorch and CuPy give
the same numbers to rounding.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import InputError, MissingExtraError

Array = Any
"""An array of the library that was chosen."""
LIBRARIES: Final = ("numpy", "torch", "cupy")


@dataclass(frozen=True)
class ArrayBackend:
    """A library of arrays and a device.

    Attributes
    ----------
    xp : module
        Namespace of the array API.
    device : object
        None is the library's usual one.
    """

    xp: Any
    device: Any = None

    def asarray(self, values: Any) -> Array:
        """Return values as a float64 array of this library, on this device."""
        # double precision everywhere: normal equations square the condition number
        return self.xp.asarray(values, dtype=self.xp.float64, device=self.device)

    def indices(self, values: NDArray[np.int64]) -> Array:
        """Return indices as an array of this library, on this device."""
        return self.xp.asarray(values, dtype=self.xp.int64, device=self.device)

    def to_numpy(self, array: Array) -> NDArray[np.float64]:
        """Return an array as a NumPy array in the memory of the host."""
        if hasattr(array, "get"):  # CuPy
            array = array.get()
        if hasattr(array, "cpu"):  # PyTorch
            array = array.cpu()
        return np.asarray(array, np.float64)


def array_backend(library: str = "numpy", device: str | None = None) -> ArrayBackend:
    """Choose a library.

    Parameters
    ----------
    library : {"numpy", "torch", "cupy"}
    device : str, optional
        As the library names it, for example ``"cuda:0"`` with PyTorch.

    Raises
    ------
    InputError
        If there is no such library or device.
    MissingExtraError
        If it is not installed.

    Examples
    --------
    >>> array_backend().asarray([1, 2]).dtype
    dtype('float64')
    """
    if library not in LIBRARIES:
        raise InputError("array library", got=repr(library), allowed=", ".join(LIBRARIES))
    try:
        xp = importlib.import_module(f"array_api_compat.{library}")
    except ImportError:
        raise MissingExtraError(library, extra="gpu", purpose=f"arrays of {library}") from None
    backend = ArrayBackend(xp, device)
    try:
        # whether the device exists shows only when an array is put there
        backend.asarray([0.0])
    except (ValueError, TypeError, RuntimeError, AssertionError) as error:
        reason = " ".join(str(error).split())[:200]
        raise InputError(f"device of {library}", got=repr(device), remedy=reason) from None
    return backend
