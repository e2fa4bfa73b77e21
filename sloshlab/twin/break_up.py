"""What makes the damping of a liquid less than that of liquid that is broken up: saturation, and break-up in time.

Laws of the liquid share these; the level is that of a harmonic motion with the running mean square of a.
"""

from __future__ import annotations

from math import sqrt
from typing import Final

from numba import njit

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.twin.terms import Parameter

# mypy: disable-error-code="no-untyped-def"

NEVER_G: Final = 1e6
"""A level that no motion reaches: a law without saturation."""
_AT_ONCE_S: Final = 1e-3
"""Break-up times up to this are none: a state that fast left all bounds at low rates, and no force needs it."""
_G: Final = GRAVITY_M_PER_S2

PARAMETERS: Final = (
    Parameter("saturation_g", "1", 1e-3, 1e6, NEVER_G),
    Parameter("break_up_s", "s", 1e-4, 100.0, _AT_ONCE_S),
    Parameter("agitated_g", "1", 1e-3, 1e6, 1.0),
    Parameter("calming_s", "s", 0.0, 1e9, 0.0),
    Parameter("sharpness", "1", 1.0, 100.0, 30.0),
    Parameter("averaging_s", "s", 1e-3, 100.0, 0.2),
    Parameter("saturation_exponent", "1", 0.0, 10.0, 2.0),
)
"""Of every law that has both, side by side; a break-up time of a millisecond or less is none."""
_SATURATION, _BREAK_UP, _AGITATED, _CALMING, _SHARPNESS, AVERAGING, _EXPONENT = range(len(PARAMETERS))


@njit(error_model="numpy", inline="always")  # type: ignore[untyped-decorator]
def level_g(mean_square):
    """Amplitude in g of a harmonic acceleration with this mean square."""
    # a Runge–Kutta stage may take a mean square that fades below zero
    return sqrt(2.0 * max(mean_square, 0.0)) / _G


@njit(error_model="numpy", inline="always")  # type: ignore[untyped-decorator]
def share_by_saturation(parameters, at, level):
    """(a_s/â)ⁿ beyond a_s, else one; `at` is where `PARAMETERS` begin. With n = 2 work per cycle stops growing."""
    if level > parameters[at + _SATURATION]:
        return (parameters[at + _SATURATION] / level) ** parameters[at + _EXPONENT]
    return 1.0


@njit(error_model="numpy", inline="always")  # type: ignore[untyped-decorator]
def share_broken_up(parameters, at, broken_up):
    """The state s, or one where liquid is broken up at once."""
    return broken_up if parameters[at + _BREAK_UP] > _AT_ONCE_S else 1.0


@njit(error_model="numpy", inline="always")  # type: ignore[untyped-decorator]
def rate_of_break_up(parameters, at, level, broken_up):
    """ṡ = p (1 − s)/τ − (1 − p) s/τ_calm, p = rⁿ/(1 + rⁿ), r = â/a_agitated; τ_calm = τ where none is stated.

    Zero where liquid is broken up at once: no step of a simulation has to follow a millisecond.
    """
    if parameters[at + _BREAK_UP] <= _AT_ONCE_S:
        return 0.0
    agitated, time_constant = parameters[at + _AGITATED], parameters[at + _BREAK_UP]
    # smooth instead of a jump at a_agitated, which would leave fits of the level in side valleys
    violent = 1.0 / (1.0 + (agitated / max(level, 1e-3 * agitated)) ** parameters[at + _SHARPNESS])
    calming = parameters[at + _CALMING] if parameters[at + _CALMING] > 0.0 else time_constant
    return violent * (1.0 - broken_up) / time_constant - (1.0 - violent) * broken_up / calming


def at_rest(time_constant_s: float) -> float:
    """The state s of liquid at rest: not broken up, or one where that takes no time."""
    return 0.0 if time_constant_s > _AT_ONCE_S else 1.0
