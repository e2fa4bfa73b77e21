"""The motion of the wing in one run: strips with lags of their own, integrated by a fixed step of fourth order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit
from scipy.linalg import eigh

from acquisition.virtual_flight.described_wing import DescribedWing
from acquisition.virtual_flight.hidden_physics import HiddenFlight
from acquisition.virtual_flight.thin_aerofoil import flap_of_aerofoil
from acquisition.virtual_flight.true_wing import TrueWing, points, shapes_at

FloatArray = npt.NDArray[np.float64]
GRAVITY = 9.81
_WAGNER_SHARES, _WAGNER_LAGS = np.array([0.165, 0.335]), np.array([0.0455, 0.3])
_KUSSNER_SHARES, _KUSSNER_LAGS = np.array([0.5, 0.5]), np.array([0.13, 1.0])
_STEEPNESS = 6.0
"""Of the onset of sloshing over the acceleration."""


@dataclass(frozen=True, eq=False)
class Drive:
    """What acts on the wing in a run, at twice the rate of the integration.

    Attributes
    ----------
    rate_hz : float
        Of these series.
    airspeed_m_per_s, density_kg_per_m3 : float
    gust_m_per_s, flap_rad, flap_rate_rad_per_s, root_m_per_s2 : ndarray, shape (n,)
    """

    rate_hz: float
    airspeed_m_per_s: float
    density_kg_per_m3: float
    gust_m_per_s: FloatArray
    flap_rad: FloatArray
    flap_rate_rad_per_s: FloatArray
    root_m_per_s2: FloatArray


class _Equations(NamedTuple):
    """The wing and the air around it, as the compiled loops take them."""

    inverse: FloatArray  # of the mass matrix, (n, n)
    damping: FloatArray
    stiffness: FloatArray
    rigid: FloatArray  # inertia against the motion of the root, (n,)
    tip: FloatArray  # shapes at the tip, (n,)
    w: FloatArray  # shapes at the strips, (n_strips, n)
    t: FloatArray
    lift_rows: FloatArray
    flap_share: FloatArray
    by_rate: FloatArray  # forces of the flap without circulation
    by_angle: FloatArray
    tank_rows: FloatArray  # (n_tanks, n)
    sloshing: FloatArray  # threshold [g], largest W̄, mass [kg]
    loss: FloatArray  # kg/s


class _Air(NamedTuple):
    """Lift with its lags, and what else acts on the wing."""

    u: float  # airspeed
    b: float  # semi-chord
    lift_per_angle: float
    stall: float
    lever: float  # b (½ − a), of the rate of pitch
    flap_downwash: float
    flap_rate_downwash: float
    shares: FloatArray
    lags: FloatArray
    gust_shares: FloatArray
    gust_lags: FloatArray
    tip_stiffness: float  # cubic
    buffet: float
    buffet_omega: float
    slug_kg: float
    slug_threshold: float
    memory_s: float


class _Inputs(NamedTuple):
    """The series of a drive, or their values at an instant."""

    gust: FloatArray
    flap: FloatArray
    flap_rate: FloatArray
    root: FloatArray


def accelerations(wing: DescribedWing, true: TrueWing, hidden: HiddenFlight, drive: Drive) -> FloatArray:
    """Absolute vertical accelerations at the accelerometers, shape (n, n_sensors), at half the rate of the drive.

    Parameters
    ----------
    wing : DescribedWing
    true : TrueWing
    hidden : HiddenFlight
    drive : Drive
    """
    inputs = _Inputs(drive.gust_m_per_s, drive.flap_rad, drive.flap_rate_rad_per_s, drive.root_m_per_s2)
    equations, air = _equations(wing, true, hidden, drive), _air(wing, true, hidden, drive)
    motion = _integrated(equations, air, inputs, 2.0 / drive.rate_hz)
    return np.asarray(motion @ true.sensor_rows.T + drive.root_m_per_s2[: 2 * motion.shape[0] : 2, None])


def _equations(wing: DescribedWing, true: TrueWing, hidden: HiddenFlight, drive: Drive) -> _Equations:
    y, weight = points(wing)
    bent, twisted = shapes_at(wing, y)
    n = true.mass.shape[0]
    w, t = (np.hstack([rows, np.zeros((y.size, n - rows.shape[1]))]) for rows in (bent, twisted))
    b, a, u, rho = wing.semi_chord_m, wing.elastic_axis, drive.airspeed_m_per_s, drive.density_kg_per_m3
    gain = 1 + hidden.lift_gain
    carried = np.pi * rho * b**2 * gain
    ww, wt, tt = (w.T * weight) @ w, (w.T * weight) @ t, (t.T * weight) @ t
    # without circulation: L = πρb²(−ẅ + Uθ̇ − baθ̈), M = πρb²(−baẅ − b(½ − a)Uθ̇ − b²(⅛ + a²)θ̈)
    added = carried * (ww + b * a * (wt + wt.T) + b**2 * (0.125 + a**2) * tt)
    damped = carried * u * (-wt + b * (0.5 - a) * tt)
    quarter = w + b * (0.5 + a) * t
    flap = flap_of_aerofoil(wing.flap.hinge, a)
    inside = np.where((y >= wing.flap.inner_m) & (y <= wing.flap.outer_m), 1.0, 0.0)
    plain = gain * rho * b**2 * u * weight * inside
    tanks = range(len(wing.tanks))
    return _Equations(
        inverse=np.linalg.inv(true.mass + added),
        damping=true.damping + damped,
        stiffness=true.stiffness,
        rigid=true.rigid,
        tip=true.tip_row,
        w=w,
        t=t,
        lift_rows=quarter * weight[:, None],
        flap_share=inside,
        by_rate=flap.lift_rate * plain @ w + b * flap.moment_rate * plain @ t,
        by_angle=u * flap.moment * plain @ t,
        tank_rows=true.tank_rows,
        sloshing=np.array([[*hidden.sloshing.get(i, (1.0, 0.0)), wing.tanks[i].liquid_kg()] for i in tanks]),
        loss=np.array([hidden.liquid_loss_kg_per_s.get(i, 0.0) for i in tanks]),
    )


def _air(wing: DescribedWing, true: TrueWing, hidden: HiddenFlight, drive: Drive) -> _Air:
    b, a, u, rho = wing.semi_chord_m, wing.elastic_axis, drive.airspeed_m_per_s, drive.density_kg_per_m3
    flap = flap_of_aerofoil(wing.flap.hinge, a)
    # a rate without lags is one that has forgotten everything
    has_lags = bool(np.isfinite(hidden.lag_ratio))
    return _Air(
        u=float(u),
        b=float(b),
        lift_per_angle=float(rho * b * u**2 * wing.lift_slope * (1 + hidden.lift_gain)),
        stall=float(hidden.stall_angle_rad),
        lever=float(b * (0.5 - a)),
        flap_downwash=float(flap.downwash),
        flap_rate_downwash=float(b * flap.downwash_rate),
        shares=_WAGNER_SHARES if has_lags else np.zeros(2),
        lags=_WAGNER_LAGS * (hidden.lag_ratio if has_lags else 1.0),
        gust_shares=_KUSSNER_SHARES,
        gust_lags=_KUSSNER_LAGS * (hidden.lag_ratio if has_lags else 1e3),
        tip_stiffness=float(hidden.tip_stiffness_n_per_m3),
        buffet=float(rho * u**2 * b * hidden.buffet_lift_coefficient),
        buffet_omega=float(2 * np.pi * hidden.buffet_strouhal * u / (2 * b)),
        slug_kg=float(hidden.slug_kg),
        slug_threshold=float(hidden.slug_threshold_g * GRAVITY),
        # how hard it was shaken a liquid remembers for half a period of the wing
        memory_s=float(np.pi / np.sqrt(eigh(true.stiffness, true.mass, eigvals_only=True)[0])),
    )


@njit(cache=True)
def _add_lift(state, out, force, equations, air, now, time):  # type: ignore[no-untyped-def]
    """Lift of gust and motion with their lags, and buffet; rates of the lags into `out`."""
    n, (n_strips, _) = force.size, equations.w.shape
    w, t, lift_rows, flap_share = equations.w, equations.t, equations.lift_rows, equations.flap_share
    shares, lags, gust_shares, gust_lags, u, b = (
        air.shares, air.lags, air.gust_shares, air.gust_lags, air.u, air.b,
    )  # fmt: skip
    q, v = state[:n], state[n : 2 * n]
    place = 2 * n + 2 * n_strips
    of_gust = 0.0
    for k in range(2):
        rate = gust_lags[k] * u / b
        of_gust += gust_shares[k] * rate * state[place + k]
        out[place + k] = now.gust - rate * state[place + k]
    if u <= 0.0:
        return
    for s in range(n_strips):
        down = flap_share[s] * (air.flap_downwash * u * now.flap + air.flap_rate_downwash * now.flap_rate)
        for j in range(n):
            down += -w[s, j] * v[j] + t[s, j] * (u * q[j] + air.lever * v[j])
        seen = down
        for k in range(2):
            lag = 2 * n + 2 * s + k
            rate = lags[k] * u / b
            seen += shares[k] * (rate * state[lag] - down)
            out[lag] = down - rate * state[lag]
        angle = (seen + of_gust) / u
        angle = min(max(angle, -air.stall), air.stall)
        for j in range(n):
            force[j] += air.lift_per_angle * angle * lift_rows[s, j]
    buffet = air.buffet * np.sin(air.buffet_omega * time)
    if buffet != 0.0:
        for s in range(n_strips):
            for j in range(n):
                force[j] += buffet * lift_rows[s, j]


@njit(cache=True)
def _add_sloshing(state, out, force, equations, place, memory_s):  # type: ignore[no-untyped-def]
    """Forces of the liquids by how hard they are shaken; rates of their memories of speed into `out`."""
    n, tank_rows, sloshing = force.size, equations.tank_rows, equations.sloshing
    v = state[n : 2 * n]
    for i in range(tank_rows.shape[0]):
        speed = 0.0
        for j in range(n):
            speed += tank_rows[i, j] * v[j]
        shaken = max(state[place + 2 * i], 0.0)
        moving = max(state[place + 2 * i + 1], 1e-9)
        ratio = (shaken / (sloshing[i, 0] * GRAVITY)) ** _STEEPNESS
        if sloshing[i, 1] != 0.0:
            # work per cycle W̄ m (ωu)²: γ = W̄ m ω/π, ω from how hard and how fast it is shaken
            pull = sloshing[i, 1] * sloshing[i, 2] / np.pi * (shaken / moving) * ratio / (1.0 + ratio)
            for j in range(n):
                force[j] -= pull * speed * tank_rows[i, j]
        out[place + 2 * i + 1] = (0.5 * np.pi * abs(speed) - state[place + 2 * i + 1]) / memory_s


@njit(cache=True)
def _add_tank_reactions(state, out, equations, air, place, root, time):  # type: ignore[no-untyped-def]
    """Liquid that has run out and liquid that falls behind, on the accelerations in `out`."""
    n, tank_rows, inverse = equations.by_rate.size, equations.tank_rows, equations.inverse
    n_tanks = tank_rows.shape[0]
    for i in range(n_tanks):
        lost = equations.loss[i] * time
        if lost != 0.0:
            # what has run out is inertia that is not there (Sherman and Morrison)
            up, own = root, 0.0
            for j in range(n):
                up += tank_rows[i, j] * out[n + j]
                for k in range(n):
                    own += tank_rows[i, j] * inverse[j, k] * tank_rows[i, k]
            pull = lost * up / (1.0 - lost * own)
            for j in range(n):
                for k in range(n):
                    out[n + j] += inverse[j, k] * tank_rows[i, k] * pull
        up = root
        for j in range(n):
            up += tank_rows[i, j] * out[n + j]
        if i == n_tanks - 1 and air.slug_kg != 0.0 and up < -air.slug_threshold:
            # liquid that falls behind the tank and pushes it down
            pull = air.slug_kg * (up + air.slug_threshold)
            for j in range(n):
                for k in range(n):
                    out[n + j] -= inverse[j, k] * tank_rows[i, k] * pull
        out[place + 2 * i] = (0.5 * np.pi * abs(up) - state[place + 2 * i]) / air.memory_s


@njit(cache=True)
def _rates(state, out, equations, air, now, time):  # type: ignore[no-untyped-def]
    inverse, damping, stiffness, tip = equations.inverse, equations.damping, equations.stiffness, equations.tip
    n = inverse.shape[0]
    q, v = state[:n], state[n : 2 * n]
    force = -equations.rigid * now.root
    for i in range(n):
        for j in range(n):
            force[i] -= damping[i, j] * v[j] + stiffness[i, j] * q[j]
        force[i] += equations.by_rate[i] * now.flap_rate + equations.by_angle[i] * now.flap
    _add_lift(state, out, force, equations, air, now, time)
    if air.tip_stiffness != 0.0:
        up = 0.0
        for j in range(n):
            up += tip[j] * q[j]
        for j in range(n):
            force[j] -= air.tip_stiffness * up**3 * tip[j]
    place = 2 * n + 2 * equations.w.shape[0] + 2
    _add_sloshing(state, out, force, equations, place, air.memory_s)
    for i in range(n):
        out[i] = v[i]
        total = 0.0
        for j in range(n):
            total += inverse[i, j] * force[j]
        out[n + i] = total
    _add_tank_reactions(state, out, equations, air, place, now.root, time)


@njit(cache=True)
def _integrated(equations, air, inputs, step):  # type: ignore[no-untyped-def]
    """Accelerations of the coordinates at every second instant of the drive."""
    n, n_strips, n_tanks = equations.inverse.shape[0], equations.w.shape[0], equations.tank_rows.shape[0]
    gust, flap, flap_rate, root = inputs
    size = 2 * n + 2 * n_strips + 2 + 2 * n_tanks
    n_steps = (gust.size - 1) // 2
    state, trial = np.zeros(size), np.zeros(size)
    slopes = np.zeros((4, size))
    found = np.zeros((n_steps, n))
    for i in range(n_steps):
        for stage in range(4):
            at = 2 * i + (stage + 1) // 2
            share = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
            for j in range(size):
                trial[j] = state[j] + (share * step * slopes[stage - 1, j] if stage > 0 else 0.0)
            now = _Inputs(gust[at], flap[at], flap_rate[at], root[at])
            _rates(trial, slopes[stage], equations, air, now, (i + 0.5 * ((stage + 1) // 2)) * step)
            if stage == 0:
                found[i] = slopes[0, n : 2 * n]
        for j in range(size):
            state[j] += step / 6 * (slopes[0, j] + 2 * slopes[1, j] + 2 * slopes[2, j] + slopes[3, j])
    return found
