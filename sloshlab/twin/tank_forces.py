"""What the liquid does beyond being frozen: Δf = F_S + m_l a on the tank, upward positive, static weight removed.

The structure of a twin always carries the frozen liquid. A liquid that is frozen therefore has no force here.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import log2, pi, sqrt

import numpy as np
import numpy.typing as npt
import xarray as xr
from numba import njit

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import InputError
from sloshlab.twin.break_up import (
    AVERAGING,
    at_rest,
    level_g,
    rate_of_break_up,
    share_broken_up,
    share_by_saturation,
)
from sloshlab.twin.break_up import PARAMETERS as BREAK_UP_PARAMETERS
from sloshlab.twin.law import ACCELERATION, DISPLACEMENT, VELOCITY, law
from sloshlab.twin.map_region import outside_remarks
from sloshlab.twin.terms import ForceKind, Parameter, register

# mypy: disable-error-code="no-untyped-def"

FloatArray = npt.NDArray[np.float64]
_G = GRAVITY_M_PER_S2
# Beyond them a quadratic fitted within the range of a shaker goes on to any value.
_MOST_OCTAVES, _MOST_DOUBLINGS = 2.0, 3.0
_RADIUS, _STIFFNESS, _DAMPING, _HARDENING, _FROZEN, _LIQUID, _HEIGHT, _IN_FLIGHT, _PULLS = range(9)


@law
def _nothing(motion, parameters, memory, rates):
    return 0.0


@law
def _bouncing_ball(motion, parameters, memory, rates):
    """Force of the ball on the tank (2.3, 2.4) and its motion (2.1, with the right sign of F_b)."""
    radius = parameters[_RADIUS]
    mass = (1.0 - parameters[_FROZEN]) * parameters[_LIQUID]
    # of the ball over the floor, which moves with the tank
    height = memory[0] - motion[DISPLACEMENT]
    closing = memory[1] - motion[VELOCITY]
    # (2.3) is printed with ν = ż_b − ż_T always; the text lets ball and tank touch only in contact, the default
    # here
    contact = parameters[_IN_FLIGHT] * parameters[_DAMPING] * closing
    for side in range(2):
        # the switch, never the function itself: within a step the contact is held
        if memory[2 + side] < 0:
            # s of (2.2): negative on the floor, positive under the ceiling
            overlap = height - radius if side == 0 else height - parameters[_HEIGHT] + radius
            stiffness = parameters[_STIFFNESS] * (
                1.0 + parameters[_HARDENING] * overlap * overlap / (radius - abs(overlap))
            )
            contact = stiffness * overlap + parameters[_DAMPING] * closing
            # towards the wall: damping pulls the ball back before it lets go, as printed; a liquid only pushes
            if (contact > 0.0) == (side == 0):
                contact *= parameters[_PULLS]
    # F_b is the force on the tank and enters the ball with a minus; printed with a plus in (2.1), its spring
    # would pull
    rates[0], rates[1] = memory[1], -_G - contact / mass
    # m_b (a + g) of the equation: the term with a is the negative mass of the kind, the weight stands here
    return contact + mass * _G


@law
def _bouncing_ball_events(motion, parameters, memory, values):
    height = memory[0] - motion[DISPLACEMENT]
    values[0] = height - parameters[_RADIUS]
    values[1] = parameters[_HEIGHT] - parameters[_RADIUS] - height
    values[2] = height
    values[3] = parameters[_HEIGHT] - height
    return 0.0


def _ball_at_rest(values: Mapping[str, float]) -> tuple[float, float]:
    """Height of the ball resting on the floor of a tank at rest, found by bisection, and its velocity."""
    radius = values["radius_m"]
    weight = (1.0 - values["beta"]) * values["liquid_mass_kg"] * _G
    low, high = 0.0, radius
    # bisection, as the spring is infinitely stiff at the radius
    for _ in range(200):
        overlap = 0.5 * (low + high)
        gap = radius - overlap
        penalty = values["hardening_per_m"] * overlap**2 / gap if gap > 0 else np.inf
        # k̂ (1 + α s²/(r₀ − |s|)) |s| = m_b g; the force rises with |s|, so that there is one root
        if values["stiffness_n_per_m"] * (1.0 + penalty) * overlap < weight:
            low = overlap
        else:
            high = overlap
    return radius - 0.5 * (low + high), 0.0


def _check_ball(values: Mapping[str, float]) -> None:
    # (2.2) has floor and ceiling contact at once otherwise
    if 2 * values["radius_m"] >= values["height_m"]:
        raise InputError(
            "bouncing_ball: radius_m",
            got=f"{values['radius_m']:g} in a tank {values['height_m']:g} m high",
            allowed="less than half the tank's height",
        )
    if _ball_at_rest(values)[0] < 1e-6 * values["radius_m"]:
        raise InputError(
            "bouncing_ball: stiffness_n_per_m",
            got=f"{values['stiffness_n_per_m']:g}, which lets the ball's weight press it through the floor",
            allowed="stiff enough to carry (1 − beta) m_l g",
        )


BOUNCING_BALL = register(
    ForceKind(
        "bouncing_ball",
        ("tank",),
        (
            Parameter("radius_m", "m", 1e-6, 10.0),
            Parameter("stiffness_n_per_m", "N m-1", 1e-3, 1e8),
            Parameter("damping_kg_per_s", "kg s-1", 0.0, 1e6),
            Parameter("hardening_per_m", "m-1", 0.0, 1e6),
            Parameter("beta", "1", 0.0, 0.999),
            Parameter("liquid_mass_kg", "kg", 1e-9, 1e6),
            Parameter("height_m", "m", 1e-6, 100.0),
            # share of the damping that acts in flight too: 0 while in contact only, 1 as (2.3) is printed
            Parameter("damping_in_flight", "1", 0.0, 1.0, 0.0),
            # share of what damping pulls back before contact is lost: 1 as printed, 0 of a liquid, which pushes
            Parameter("contact_pulls", "1", 0.0, 1.0, 1.0),
        ),
        _bouncing_ball,
        events=_bouncing_ball_events,
        n_switches=2,
        limits=("ball below the floor of its tank", "ball above the ceiling of its tank"),
        moves_with_place=True,
        memory=lambda values, table: _ball_at_rest(values),
        # the structure carries the whole liquid as frozen: the ball takes its own mass out of it, β m_l stays
        mass=lambda values: -(1.0 - values["beta"]) * values["liquid_mass_kg"],
        check=_check_ball,
        equation="F_b + m_b (a + g); F_b = k̂ (1 + α s²/(r₀ − |s|)) s + c ν in contact (2.1–2.5)",
    )
)


@njit(error_model="numpy", inline="always")  # type: ignore[untyped-decorator]
def _map_value(numbers, at, omega_bar, u_bar):
    """Bilinear value of the map stored from `at` on: sizes, both axes, values; held constant beyond its edges."""
    n, m = int(numbers[at]), int(numbers[at + 1])
    first, second = at + 2, at + 2 + n
    i = 0
    while i < n - 2 and numbers[first + i + 1] < omega_bar:
        i += 1
    j = 0
    while j < m - 2 and numbers[second + j + 1] < u_bar:
        j += 1
    p = (omega_bar - numbers[first + i]) / (numbers[first + i + 1] - numbers[first + i])
    q = (u_bar - numbers[second + j]) / (numbers[second + j + 1] - numbers[second + j])
    # the nearest value beyond the edges, nothing is extrapolated; motion there is remarked on
    p, q = min(max(p, 0.0), 1.0), min(max(q, 0.0), 1.0)
    k = second + m + i * m + j
    below = numbers[k] * (1 - q) + numbers[k + 1] * q
    above = numbers[k + m] * (1 - q) + numbers[k + m + 1] * q
    return below * (1 - p) + above * p


@njit(error_model="numpy", inline="always")  # type: ignore[untyped-decorator]
def _track(motion, parameters, memory, rates):
    """Frequency from running mean squares of v and a; amplitude from the present v and a."""
    # the present v and a give an amplitude at every instant, but not a frequency: at a turning point v is zero
    # bounded, so that a motion that has died away gives a number
    omega = min(max(sqrt(memory[1] / memory[0]) if memory[0] > 0 else 0.0, 1e-3), 1e5)
    rates[0] = (motion[VELOCITY] ** 2 - memory[0]) / parameters[2]
    rates[1] = (motion[ACCELERATION] ** 2 - memory[1]) / parameters[2]
    # u₀ of the harmonic motion that has the present v and a: Ω²u₀² = v² + (a/Ω)²
    return omega, sqrt(motion[VELOCITY] ** 2 + (motion[ACCELERATION] / omega) ** 2) / omega


_OF_MAPS = (
    Parameter("liquid_mass_kg", "kg", 1e-9, 1e6),
    Parameter("height_m", "m", 1e-6, 100.0),
    Parameter("time_constant_s", "s", 1e-4, 100.0, 0.2),
    Parameter("start_frequency_hz", "Hz", 1e-3, 1e4, 10.0),
    *BREAK_UP_PARAMETERS,
)
_BREAK_UP, _TABLE = 4, len(_OF_MAPS)
"""Where the numbers of `break_up` and the table begin."""


@njit(error_model="numpy", inline="always")  # type: ignore[untyped-decorator]
def _share_of_map(motion, parameters, memory, rates):
    """Share of a map that acts; the map is that of liquid that is broken up, at levels below saturation."""
    rates[2] = (motion[ACCELERATION] ** 2 - memory[2]) / parameters[_BREAK_UP + AVERAGING]
    level = level_g(memory[2])
    rates[3] = rate_of_break_up(parameters, _BREAK_UP, level, memory[3])
    return share_broken_up(parameters, _BREAK_UP, memory[3]) * share_by_saturation(parameters, _BREAK_UP, level)


@law
def _viscous_map(motion, parameters, memory, rates):
    """−s c(ω̄, ū) v with c from (E.4)."""
    omega, amplitude = _track(motion, parameters, memory, rates)
    w_bar = _map_value(parameters, _TABLE, omega / sqrt(_G / parameters[1]), amplitude / parameters[1])
    share = _share_of_map(motion, parameters, memory, rates)
    # c = (m_l/π) √(g/h) ω̄ W̄ with √(g/h) ω̄ = Ω
    return -share * parameters[0] / pi * omega * w_bar * motion[VELOCITY]


@law
def _effective_mass_map(motion, parameters, memory, rates):
    """−s β(ω̄, ū) m_l a."""
    omega, amplitude = _track(motion, parameters, memory, rates)
    beta = _map_value(parameters, _TABLE, omega / sqrt(_G / parameters[1]), amplitude / parameters[1])
    share = _share_of_map(motion, parameters, memory, rates)
    return -share * parameters[0] * beta * motion[ACCELERATION]


def _tracked_at_start(values: Mapping[str, float], table: FloatArray) -> tuple[float, float, float, float]:
    """Mean squares of a motion of h/10: a release begins with v = 0, which is no infinite frequency."""
    omega = 2 * pi * values["start_frequency_hz"]
    velocity = 0.1 * values["height_m"] * omega / sqrt(2.0)
    return velocity**2, (omega * velocity) ** 2, 0.0, at_rest(values["break_up_s"])


VISCOUS_MAP = register(
    ForceKind(
        "viscous_map",
        ("tank",),
        _OF_MAPS,
        _viscous_map,
        memory=_tracked_at_start,
        uses_acceleration=True,
        remarks=outside_remarks,
        equation="−s c(ω̄, ū) v, c = (m_l/π) √(g/h) ω̄ W̄(ω̄, ū) (E.4); s = 1 unless it saturates or breaks up late",
    )
)
EFFECTIVE_MASS_MAP = register(
    ForceKind(
        "effective_mass_map",
        ("tank",),
        _OF_MAPS,
        _effective_mass_map,
        memory=_tracked_at_start,
        uses_acceleration=True,
        remarks=outside_remarks,
        equation="−s β(ω̄, ū) m_l a; s = 1 unless it saturates or breaks up late",
    )
)
EFFECTIVE_MASS = register(
    ForceKind(
        "effective_mass",
        ("tank",),
        (Parameter("beta", "1", -0.99, 10.0), Parameter("liquid_mass_kg", "kg", 1e-9, 1e6)),
        # the force is all inertia: as a mass it is part of the mass matrix and lags behind nothing
        _nothing,
        mass=lambda values: values["beta"] * values["liquid_mass_kg"],
        equation="−β m_l a",
    )
)


@law
def _fading_mass(motion, parameters, memory, rates):
    """−β m_l a / (1 + (â/a_f)²), â from the running mean square of a."""
    rates[0] = (motion[ACCELERATION] ** 2 - memory[0]) / parameters[3]
    return (
        -parameters[0] * parameters[1] * motion[ACCELERATION] / (1.0 + (level_g(memory[0]) / parameters[2]) ** 2)
    )


FADING_MASS = register(
    ForceKind(
        "fading_mass",
        ("tank",),
        (
            Parameter("beta", "1", -0.99, 10.0),
            Parameter("liquid_mass_kg", "kg", 1e-9, 1e6),
            Parameter("fade_g", "1", 1e-3, 1e6),
            Parameter("averaging_s", "s", 1e-3, 100.0, 0.2),
        ),
        _fading_mass,
        memory=lambda values, table: (0.0,),
        uses_acceleration=True,
        equation="−β m_l a / (1 + (â/a_f)²): the share of the liquid that does not follow falls with the motion",
    )
)


@law
def _varying_mass(motion, parameters, memory, rates):
    """−β(f, â) m_l a, f and â from the running mean squares of v and a."""
    rates[0] = (motion[VELOCITY] ** 2 - memory[0]) / parameters[9]
    rates[1] = (motion[ACCELERATION] ** 2 - memory[1]) / parameters[9]
    frequency = sqrt(memory[1] / memory[0]) / (2.0 * pi) if memory[0] > 0 else parameters[1]
    octaves = min(max(log2(max(frequency, 1e-6) / parameters[1]), -_MOST_OCTAVES), _MOST_OCTAVES)
    doublings = min(max(log2(max(level_g(memory[1]), 1e-6) / parameters[2]), -_MOST_DOUBLINGS), _MOST_DOUBLINGS)
    beta = parameters[3] + (parameters[4] + parameters[5] * octaves) * octaves
    beta += (parameters[6] + parameters[7] * doublings + parameters[8] * octaves) * doublings
    # the mass that follows, (1 + β) m_l, stays positive
    return -parameters[0] * max(beta, -0.99) * motion[ACCELERATION]


VARYING_MASS = register(
    ForceKind(
        "varying_mass",
        ("tank",),
        (
            Parameter("liquid_mass_kg", "kg", 1e-9, 1e6),
            Parameter("frequency_hz", "Hz", 1e-3, 1e4),
            Parameter("level_g", "1", 1e-6, 1e6),
            Parameter("beta", "1", -0.99, 10.0),
            Parameter("beta_per_octave", "1", -10.0, 10.0, 0.0),
            Parameter("beta_per_octave_squared", "1", -10.0, 10.0, 0.0),
            Parameter("beta_per_doubling", "1", -10.0, 10.0, 0.0),
            Parameter("beta_per_doubling_squared", "1", -10.0, 10.0, 0.0),
            Parameter("beta_per_octave_and_doubling", "1", -10.0, 10.0, 0.0),
            Parameter("averaging_s", "s", 1e-3, 100.0, 0.2),
        ),
        _varying_mass,
        # the ratio of both is the stated frequency, their size next to nothing
        memory=lambda values, table: (1e-6, 1e-6 * (2 * pi * values["frequency_hz"]) ** 2),
        uses_acceleration=True,
        equation="−β(f, â) m_l a, β = β₀ + b₁ x + b₂ x² + b₃ y + b₄ y² + b₅ x y, x = log₂(f/f₀) within ±2, "
        "y = log₂(â/a₀) within ±3",
    )
)


@law
def _linear_response(motion, parameters, memory, rates):
    return memory[0]


@law
def _linear_response_update(motion, parameters, memory, rates):
    """Push the velocity into the history and hold Σ b_i v[k − i] until the next step."""
    n = int(parameters[0])
    for i in range(n - 1, 0, -1):
        memory[1 + i] = memory[i]
    # the history moves only after an output step, outside of the integration
    memory[1] = motion[VELOCITY]
    memory[0] = 0.0
    for i in range(n):
        memory[0] += parameters[1 + i] * memory[1 + i]
    return 0.0


LINEAR_RESPONSE = register(
    ForceKind(
        "linear_response",
        ("tank",),
        (Parameter("n_delays", "1", 1, 10_000),),
        _linear_response,
        update=_linear_response_update,
        memory=lambda values, table: (0.0,) * (1 + int(values["n_delays"])),
        equation="Δf[k] = Σ b_i v[k − i], held over one output step; the example of a model in discrete time",
    )
)


def table_of(map_: xr.DataArray, *, measured: xr.DataArray | None = None) -> FloatArray:
    """What `viscous_map` (of W̄) and `effective_mass_map` (of β) take as `table`.

    Parameters
    ----------
    map_ : xarray.DataArray
        Over ``omega_bar`` and ``u_bar``, both rising, at least two each, without gaps.
    measured : xarray.DataArray, optional
        Where on the same grid the map was measured; everywhere by default. Motion elsewhere is remarked on.

    Raises
    ------
    InputError
        If it is not such a map.
    """
    if set(map_.dims) != {"omega_bar", "u_bar"}:
        raise InputError("map", got=f"dimensions {tuple(map_.dims)}", allowed="(omega_bar, u_bar)")
    grid = map_.transpose("omega_bar", "u_bar")
    omega_bar, u_bar = (np.asarray(grid[name].values, dtype=np.float64) for name in ("omega_bar", "u_bar"))
    for name, axis in (("omega_bar", omega_bar), ("u_bar", u_bar)):
        if axis.size < 2 or not (np.diff(axis) > 0).all():
            raise InputError(f"map: {name}", got=f"{axis.size} values", allowed="two or more, rising")
    values = np.asarray(grid.values, dtype=np.float64)
    if not np.isfinite(values).all():
        raise InputError("map", got="gaps", remedy="fill them, or cut the map to the measured region")
    known = np.ones_like(values)
    if measured is not None:
        known = np.asarray(measured.transpose("omega_bar", "u_bar").values, dtype=np.float64)
    # where it was measured comes last: the law reads the values only, the remarks both
    return np.concatenate([[omega_bar.size, u_bar.size], omega_bar, u_bar, values.ravel(), known.ravel()])
