"""What the compiled loops of the hidden laboratory take: a system in its run, and where results go."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


# functions that are called for every stage take arrays, not this: handing so many values on by the hundred
# thousand, and counting references to them, cost a quarter of the time
class CompiledSystem(NamedTuple):
    """A structure with a tank, the motion of its base, and which contacts are closed.

    Attributes
    ----------
    inverse_mass, damping, stiffness : ndarray, shape (n, n)
    gamma, psi : ndarray, shape (n,)
        Γ, and ψ at the tank.
    p : ndarray, shape (N_PARAMETERS,)
        Parameters, see `kernel_layout`.
    bank : ndarray, shape (N_RELAXATION, 2)
        Rate and weight of every relaxing spring.
    step : float
        Of the table [s].
    table : ndarray, shape (m, 4)
        Motion of the base.
    conditions : ndarray of int64, shape (N_CONDITIONS,)
        Of the contacts; changed.
    """

    inverse_mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    gamma: FloatArray
    psi: FloatArray
    p: FloatArray
    bank: FloatArray
    step: float
    table: FloatArray
    conditions: npt.NDArray[np.int64]


class Sampling(NamedTuple):
    """Samples wanted, their distance [s], and the relative error allowed in a step."""

    n_samples: int
    step_s: float
    relative: float


class Record(NamedTuple):
    """What a run writes.

    Attributes
    ----------
    seen : ndarray, shape (n_samples, N_OUTPUTS)
    events : ndarray, shape (most, 3)
        Time, condition and its new value.
    """

    seen: FloatArray
    events: FloatArray


class Trial(NamedTuple):
    """A step that is tried.

    Attributes
    ----------
    slopes : ndarray, shape (7, n)
        Rates at the stages; the first is given.
    end : ndarray, shape (n,)
        Written: where the step leads.
    seen : ndarray, shape (N_OUTPUTS + 4,)
        Written: what is seen there.
    """

    slopes: FloatArray
    end: FloatArray
    seen: FloatArray
