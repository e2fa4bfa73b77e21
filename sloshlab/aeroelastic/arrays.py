"""Names of array types, and the check that every number that comes from outside passes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sloshlab.errors import AnalysisError

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


def require_positive(**numbers: float) -> None:
    """Refuse numbers that are not finite and above zero.

    Parameters
    ----------
    **numbers : float
        Under the name that the message shall have.

    Raises
    ------
    AnalysisError
        Names the first bad number.

    Examples
    --------
    >>> require_positive(speed_m_per_s=-3.0)
    Traceback (most recent call last):
    sloshlab.errors.AnalysisError: speed_m_per_s: got -3.0; allowed: > 0
    """
    for name, number in numbers.items():
        if not (np.isfinite(number) and number > 0):
            raise AnalysisError(name, got=f"{number}", allowed="> 0")


def require_shape(name: str, array: npt.NDArray[np.generic], shape: tuple[int, ...]) -> None:
    """Refuse an array of another shape, or with numbers that are not finite.

    Parameters
    ----------
    name : str
        What the message calls it.
    array : ndarray
        The array.
    shape : tuple of int
        −1 allows any length.

    Raises
    ------
    AnalysisError
        If shape or content is not as asked.
    """
    fits = array.ndim == len(shape) and all(n in (-1, m) for n, m in zip(shape, array.shape, strict=True))
    if not fits:
        wanted = " × ".join("n" if n < 0 else str(n) for n in shape)
        raise AnalysisError(name, got=f"shape {array.shape}", allowed=wanted)
    if not np.all(np.isfinite(array)):
        raise AnalysisError(name, got="numbers that are not finite", allowed="finite numbers")
