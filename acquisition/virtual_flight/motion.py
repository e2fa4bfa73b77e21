"""The motion of the wing in one run: strips with lags of their own, integrated by a fixed step of fourth order."""

from __future__ import annotations

from dataclasses import dataclass

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


def accelerations(wing: DescribedWing, true: TrueWing, hidden: HiddenFlight, drive: Drive) -> FloatArray:
    """Absolute vertical accelerations at the accelerometers, shape (n, n_sensors), at half the rate of the drive.

    Parameters
    ----------
    wing : DescribedWing
    true : TrueWing
    hidden : HiddenFlight
    drive : Drive
    """
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
    inside = ((y >= wing.flap.inner_m) & (y <= wing.flap.outer_m)) * 1.0
    plain = gain * rho * b**2 * u * weight * inside
    by_rate = flap.lift_rate * plain @ w + b * flap.moment_rate * plain @ t
    by_angle = u * flap.moment * plain @ t
    n_tanks = len(wing.tanks)
    sloshing = np.array([[*hidden.sloshing.get(i, (1.0, 0.0)), wing.tanks[i].liquid_kg()] for i in range(n_tanks)])
    loss = np.array([hidden.liquid_loss_kg_per_s.get(i, 0.0) for i in range(n_tanks)])
    # a rate without lags is one that has forgotten everything
    shares = _WAGNER_SHARES if np.isfinite(hidden.lag_ratio) else np.zeros(2)
    lag = hidden.lag_ratio if np.isfinite(hidden.lag_ratio) else 1.0
    gust_lag = lag if np.isfinite(hidden.lag_ratio) else 1e3
    air = np.array(
        [
            u,
            b,
            rho * b * u**2 * wing.lift_slope * gain,
            hidden.stall_angle_rad,
            b * (0.5 - a),
            flap.downwash,
            b * flap.downwash_rate,
        ]
    )
    outside = np.array(
        [
            hidden.tip_stiffness_n_per_m3,
            rho * u**2 * b * hidden.buffet_lift_coefficient,
            2 * np.pi * hidden.buffet_strouhal * u / (2 * b),
            hidden.slug_kg,
            hidden.slug_threshold_g * GRAVITY,
            # how hard it was shaken a liquid remembers for half a period of the wing
            np.pi / np.sqrt(eigh(true.stiffness, true.mass, eigvals_only=True)[0]),
        ]
    )
    inverse = np.linalg.inv(true.mass + added)
    motion = _integrated(
        inverse, true.damping + damped, true.stiffness, w, t, quarter * weight[:, None], inside, by_rate, by_angle,
        true.tank_rows, sloshing, loss, true.rigid, true.tip_row, air, outside, shares, _WAGNER_LAGS * lag,
        _KUSSNER_SHARES, _KUSSNER_LAGS * gust_lag, drive.gust_m_per_s, drive.flap_rad, drive.flap_rate_rad_per_s,
        drive.root_m_per_s2, 2.0 / drive.rate_hz,
    )  # fmt: skip
    return np.asarray(motion @ true.sensor_rows.T + drive.root_m_per_s2[: 2 * motion.shape[0] : 2, None])


@njit(cache=True)
def _rates(  # type: ignore[no-untyped-def]
    state, out, inverse, damping, stiffness, w, t, lift_rows, flap_share, by_rate, by_angle, tank_rows, sloshing,
    loss, rigid, tip, air, outside, shares, lags, gust_shares, gust_lags, gust, delta, delta_rate, root, time,
):  # fmt: skip
    n, n_strips, n_tanks = inverse.shape[0], w.shape[0], tank_rows.shape[0]
    u, b, lift_per_angle, stall = air[0], air[1], air[2], air[3]
    q, v = state[:n], state[n : 2 * n]
    force = -rigid * root
    for i in range(n):
        for j in range(n):
            force[i] -= damping[i, j] * v[j] + stiffness[i, j] * q[j]
        force[i] += by_rate[i] * delta_rate + by_angle[i] * delta
    place = 2 * n + 2 * n_strips
    of_gust = 0.0
    for k in range(2):
        rate = gust_lags[k] * u / b
        of_gust += gust_shares[k] * rate * state[place + k]
        out[place + k] = gust - rate * state[place + k]
    if u > 0.0:
        for s in range(n_strips):
            down = flap_share[s] * (air[5] * u * delta + air[6] * delta_rate)
            for j in range(n):
                down += -w[s, j] * v[j] + t[s, j] * (u * q[j] + air[4] * v[j])
            seen = down
            for k in range(2):
                lag = 2 * n + 2 * s + k
                rate = lags[k] * u / b
                seen += shares[k] * (rate * state[lag] - down)
                out[lag] = down - rate * state[lag]
            angle = (seen + of_gust) / u
            angle = min(max(angle, -stall), stall)
            for j in range(n):
                force[j] += lift_per_angle * angle * lift_rows[s, j]
        buffet = outside[1] * np.sin(outside[2] * time)
        if buffet != 0.0:
            for s in range(n_strips):
                for j in range(n):
                    force[j] += buffet * lift_rows[s, j]
    if outside[0] != 0.0:
        up = 0.0
        for j in range(n):
            up += tip[j] * q[j]
        for j in range(n):
            force[j] -= outside[0] * up**3 * tip[j]
    place += 2
    for i in range(n_tanks):
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
        out[place + 2 * i + 1] = (0.5 * np.pi * abs(speed) - state[place + 2 * i + 1]) / outside[5]
    for i in range(n):
        out[i] = v[i]
        total = 0.0
        for j in range(n):
            total += inverse[i, j] * force[j]
        out[n + i] = total
    for i in range(n_tanks):
        lost = loss[i] * time
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
        if i == n_tanks - 1 and outside[3] != 0.0 and up < -outside[4]:
            # liquid that falls behind the tank and pushes it down
            pull = outside[3] * (up + outside[4])
            for j in range(n):
                for k in range(n):
                    out[n + j] -= inverse[j, k] * tank_rows[i, k] * pull
        out[place + 2 * i] = (0.5 * np.pi * abs(up) - state[place + 2 * i]) / outside[5]


@njit(cache=True)
def _integrated(  # type: ignore[no-untyped-def]
    inverse, damping, stiffness, w, t, lift_rows, flap_share, by_rate, by_angle, tank_rows, sloshing, loss, rigid,
    tip, air, outside, shares, lags, gust_shares, gust_lags, gust, delta, delta_rate, root, step,
):  # fmt: skip
    n, size = inverse.shape[0], 2 * inverse.shape[0] + 2 * w.shape[0] + 2 + 2 * tank_rows.shape[0]
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
            _rates(
                trial, slopes[stage], inverse, damping, stiffness, w, t, lift_rows, flap_share, by_rate, by_angle,
                tank_rows, sloshing, loss, rigid, tip, air, outside, shares, lags, gust_shares, gust_lags,
                gust[at], delta[at], delta_rate[at], root[at], (i + 0.5 * ((stage + 1) // 2)) * step,
            )  # fmt: skip
            if stage == 0:
                found[i] = slopes[0, n : 2 * n]
        for j in range(size):
            state[j] += step / 6 * (slopes[0, j] + 2 * slopes[1, j] + 2 * slopes[2, j] + slopes[3, j])
    return found
