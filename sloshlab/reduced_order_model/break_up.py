"""Memory of whether the liquid is broken up: a gain on the force of a model that knows the steady state only.

Liquid at rest that is suddenly shaken first moves like a frozen one. While the tank is pulled down faster than
the liquid falls, its surface is unstable and what disturbs it grows. The share b of the liquid that is broken up
follows

    ḃ = r b (1 − b) − (b − b₀)/τ,        r = κ max(−v̇/g − 1, 0)ⁿ,

and the force is b Δf(v), Δf being that of the model without memory.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class BreakUp:
    """How the liquid breaks up and calms down.

    Attributes
    ----------
    growth_per_s, exponent : float
        κ and n: growth while the surface is unstable.
    calming_s : float
        τ.
    at_rest : float
        b₀: the share that is never in one piece, from which it grows.
    """

    growth_per_s: float
    exponent: float
    calming_s: float
    at_rest: float

    def __post_init__(self) -> None:
        values = {field_.name: getattr(self, field_.name) for field_ in fields(self)}
        wrong = [name for name, value in values.items() if not 0 < value < 1e6]
        if wrong or self.at_rest >= 1:
            name = wrong[0] if wrong else "at_rest"
            raise InputError(f"break-up: {name}", got=f"{values[name]:g}", allowed="> 0, at_rest also < 1")

    def share(self, velocity_m_per_s: FloatArray, sampling_rate_hz: float) -> FloatArray:
        """Return b at each sample, from the velocities up to the sample before.

        Parameters
        ----------
        velocity_m_per_s : ndarray, shape (n,)
            Of the tank, upward positive; a run begins with the liquid at rest. After a gap, NaN, the liquid is
            taken to be broken up, as it is where a model without memory holds.
        sampling_rate_hz : float

        Examples
        --------
        >>> calm = BreakUp(10.0, 0.5, 2.0, 0.01)
        >>> calm.share(np.zeros(3), 100.0).round(6).tolist()
        [0.01, 0.01, 0.01]
        """
        shares = np.empty(velocity_m_per_s.size)
        parameters = np.array([getattr(self, field_.name) for field_ in fields(self)])
        _follow(np.ascontiguousarray(velocity_m_per_s, np.float64), 1 / sampling_rate_hz, parameters, shares)
        return shares

    def scaled(self, time: float) -> BreakUp:
        """Return it for another tank with the same accelerations, whose times are so many times longer.

        Parameters
        ----------
        time : float
        """
        # accelerations are equal in both tanks, so that the exponent and b₀ stay
        return replace(self, growth_per_s=self.growth_per_s / time, calming_s=self.calming_s * time)

    def facts(self) -> dict[str, Any]:
        """Return what makes it again."""
        return asdict(self)


@njit(cache=True)
def next_share(share, last, before, step_s, parameters):  # type: ignore[no-untyped-def]
    """b one step later, the rate being constant over the step: growth exactly, then calming exactly."""
    growth, exponent, calming_s, at_rest = parameters
    # downward acceleration in g: only while the tank falls faster than the liquid is the surface unstable
    excess = (before - last) / (step_s * GRAVITY_M_PER_S2) - 1.0
    rate = growth * excess**exponent if excess > 0 else 0.0
    # logistic growth in closed form: it cannot overshoot 1 at any step
    grown = 1 / (1 + (1 / share - 1) * np.exp(-rate * step_s))
    return at_rest + (grown - at_rest) * np.exp(-step_s / calming_s)


@njit(cache=True)
def _follow(velocity, step_s, parameters, shares):  # type: ignore[no-untyped-def]
    share = parameters[-1]
    for k in range(velocity.size):
        if k:
            last = velocity[k - 1]
            before = velocity[k - 2] if k > 1 else 0.0
            if np.isnan(last):
                # after a gap the liquid counts as broken up, which is where the model without memory holds
                share = 1.0
            else:
                share = next_share(share, last, last if np.isnan(before) else before, step_s, parameters)
        shares[k] = share
