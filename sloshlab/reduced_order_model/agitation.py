"""Memory of the liquid's state: slow states that the motion drives, which the network sees beside its delay line.

A model that sees only the last velocities cannot know whether the liquid is still calm after a sudden start or
still agitated after a decay. Here each state follows what stirs the liquid, p, with a time constant τ,

    ṡ = (p − s)/τ,        p = (v/v₀)²,  v₀ = 1 m/s,  or  p = max(|v̇|/g − 1, 0),

the square of the velocity or the acceleration beyond that which holds the liquid down;
the network gets √s. All is sampled at the rate of the model: p is taken from the two samples before.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import AnalysisError, InputError

FloatArray = NDArray[np.float64]
Kind = Literal["speed", "excess_acceleration"]

KINDS: Final = ("speed", "excess_acceleration")
_SPEED: Final = 0
# Five per cent of a wrong s are left after three time constants.
FORGOTTEN: Final = 3.0
"""So many time constants after a gap a state that began at rest is taken to be known."""


@dataclass(frozen=True)
class Agitation:
    """Slow states of one model.

    Attributes
    ----------
    kind : {'speed', 'excess_acceleration'}
    time_constants_s : tuple of float
        τ, one for each state.
    spread : float
        Standard deviation of each state in the network's values; that of its whole delay line is the
        `input_spread` of training.
    offsets, scales : tuple of float
        From a state to the network's value, (state − offset)/scale; set by `fitted`.
    """

    kind: Kind
    time_constants_s: tuple[float, ...]
    spread: float = 1.0
    offsets: tuple[float, ...] = ()
    scales: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError("kind of memory", got=repr(self.kind), allowed=", ".join(KINDS))
        positive = (*self.time_constants_s, self.spread, *self.scales)
        wrong = [value for value in positive if not 1e-6 < value < 1e6]
        if wrong or not self.time_constants_s:
            got = f"{wrong[0]:g}" if wrong else "no time constant"
            raise InputError("memory: time constants, spread and scales", got=got, allowed="> 0")
        if {len(self.offsets), len(self.scales)} - {0, self.n_states} or not np.isfinite(self.offsets).all():
            raise InputError(
                "memory: offsets and scales", got=f"{len(self.offsets)}", allowed="one for each state"
            )

    @property
    def n_states(self) -> int:
        """How many regressors it adds."""
        return len(self.time_constants_s)

    def states(self, velocity_m_per_s: FloatArray, sampling_rate_hz: float) -> FloatArray:
        """States that follow from the velocities before each sample, before scaling.

        Parameters
        ----------
        velocity_m_per_s : ndarray, shape (n,)
            NaN where it is not known. A run begins with the liquid at rest.
        sampling_rate_hz : float

        Returns
        -------
        ndarray, shape (n_states, n)
            √s [1]; NaN for `FORGOTTEN` time constants after a gap.

        Examples
        --------
        >>> speed = Agitation("speed", (0.5,))
        >>> speed.states(np.ones(2000), 1000.0)[0, [0, 500, 1999]].round(3).tolist()
        [0.0, 0.795, 0.991]
        """
        velocity = np.ascontiguousarray(velocity_m_per_s, np.float64)
        rows = []
        for time_constant_s in self.time_constants_s:
            unknown = round(FORGOTTEN * time_constant_s * sampling_rate_hz)
            state = _follow(KINDS.index(self.kind), velocity, 1 / sampling_rate_hz, time_constant_s, unknown)
            rows.append(np.sqrt(state))
        return np.stack(rows)

    def regressors(self, velocity_m_per_s: FloatArray, sampling_rate_hz: float) -> FloatArray:
        """Return the states in the network's values, shape (n_states, n)."""
        states = self.states(velocity_m_per_s, sampling_rate_hz)
        return np.asarray((states - np.array(self.offsets)[:, None]) / np.array(self.scales)[:, None])

    def fitted(self, velocities_m_per_s: Sequence[FloatArray], sampling_rate_hz: float) -> Agitation:
        """Return it with offsets and scales that give each state the wanted spread over some runs.

        Parameters
        ----------
        velocities_m_per_s : sequence of ndarray
        sampling_rate_hz : float

        Raises
        ------
        AnalysisError
            If a state does not change.
        """
        states = np.concatenate([self.states(v, sampling_rate_hz) for v in velocities_m_per_s], axis=1)
        means, spreads = np.nanmean(states, axis=1), np.nanstd(states, axis=1)
        if not (spreads > 1e-9).all():
            raise AnalysisError(
                "memory of the liquid", got="a state that stays the same", remedy="train on runs that agitate it"
            )
        return replace(self, offsets=tuple(means.tolist()), scales=tuple((spreads / self.spread).tolist()))

    def scaled(self, *, time: float, velocity: float) -> Agitation:
        """Return it for another tank, whose times and velocities are so many times larger.

        Parameters
        ----------
        time, velocity : float
        """
        # √s has the unit of a velocity there; the other state is a ratio of accelerations, equal in both tanks
        # (2.33–2.35)
        if self.kind == "speed":
            rescaled = (
                tuple(offset * velocity for offset in self.offsets),
                tuple(s * velocity for s in self.scales),
            )
        else:
            rescaled = self.offsets, self.scales
        taus = tuple(tau * time for tau in self.time_constants_s)
        return replace(self, time_constants_s=taus, offsets=rescaled[0], scales=rescaled[1])

    def facts(self) -> dict[str, Any]:
        """Return what `from_facts` needs to make it again."""
        return asdict(self)

    @classmethod
    def from_facts(cls, facts: dict[str, Any]) -> Agitation:
        """Make it from what `facts` returned, read back from JSON.

        Raises
        ------
        TypeError, InputError
            If something is missing or impossible.
        """
        made: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in facts.items()}
        return cls(**made)


@njit(cache=True)
def _follow(kind, velocity, step_s, time_constant_s, unknown):  # type: ignore[no-untyped-def]
    """One state along a run; exact for a p that is constant over each step."""
    state, value, wait = np.empty(velocity.size), 0.0, 0
    for k in range(velocity.size):
        if k:
            # only velocities before this sample, as in the delay line
            last = velocity[k - 1]
            before = velocity[k - 2] if k > 1 else 0.0
            if np.isnan(last):
                # after a gap the state is not known; it starts anew and is told only when it has forgotten that
                value, wait = 0.0, unknown
            else:
                if np.isnan(before):
                    before = last
                if kind == _SPEED:
                    stirred = last * last
                else:
                    # acceleration beyond g: the liquid is held down by its weight below it
                    stirred = max(abs(last - before) / (step_s * GRAVITY_M_PER_S2) - 1.0, 0.0)
                # the exact step of ṡ = (p − s)/τ, stable for any τ; Euler's would need τ far above a step
                value = stirred + (value - stirred) * math.exp(-step_s / time_constant_s)
                wait = max(wait - 1, 0)
        state[k] = np.nan if wait else value
    return state
