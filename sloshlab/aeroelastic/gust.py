"""Gusts: shapes in time, forces on the modes, and the response of a flexible structure.

x = (q, q̇, a, a_g) with the gust and its rate as inputs:
f_gust = q_D/U [A₀ w_g + (b/U) A₁ ẇ_g + C a_g],   ȧ_g = −(U/b) P a_g + B ẇ_g
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm

from sloshlab.aeroelastic.arrays import FloatArray, require_positive, require_shape
from sloshlab.aeroelastic.generalised_forces import GeneralisedForces
from sloshlab.aeroelastic.modal_structure import ModalStructure
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aeroelastic.rational_roger import roger_fit
from sloshlab.aeroelastic.state_space import state_matrix, total_mass
from sloshlab.errors import AnalysisError

GustShape = Callable[[FloatArray], FloatArray]

USUAL_LENGTH_IN_SEMI_CHORDS = 25.0
_LARGEST_N_STEPS = 10_000_000


def one_minus_cosine(amplitude_m_per_s: float, *, gust_length_m: float, speed_m_per_s: float) -> GustShape:
    """Discrete gust w_g = ½ w_ga (1 − cos(2πUt/L_g)) for 0 < t < L_g/U, else 0 (3.38).

    Parameters
    ----------
    amplitude_m_per_s : float
        w_ga, the largest vertical speed, up positive.
    gust_length_m : float
        L_g.
    speed_m_per_s : float
        U.

    Returns
    -------
    callable
        Takes times in s, gives w_g in m/s.
    """
    require_positive(gust_length_m=gust_length_m, speed_m_per_s=speed_m_per_s)

    def shape(time_s: FloatArray) -> FloatArray:
        way = speed_m_per_s * np.asarray(time_s, dtype=float) / gust_length_m
        inside = (way > 0) & (way < 1)
        return np.where(inside, 0.5 * amplitude_m_per_s * (1 - np.cos(2 * np.pi * way)), 0.0)

    return shape


@dataclass(frozen=True)
class GustResponse:
    """Motion in a gust.

    Attributes
    ----------
    time_s : ndarray, shape (n_times,)
        From 0.
    displacement, velocity, acceleration : ndarray, shape (n_times, n)
        Of the coordinates.
    gust_m_per_s : ndarray, shape (n_times, n_zones)
        w_g on each zone.
    """

    time_s: FloatArray
    displacement: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    gust_m_per_s: FloatArray


def gust_fit(forces: GeneralisedForces, *, lags: FloatArray | None = None) -> RationalForces:
    """Rational function of the columns of a gust, one per zone, without A₂.

    Parameters
    ----------
    forces : GeneralisedForces
        Of motion and gust.
    lags : ndarray, optional
        As for `roger_fit`.

    Returns
    -------
    RationalForces
        Inputs are w_g/U on the zones.
    """
    return roger_fit(
        forces.reduced_frequency, forces.gust, semi_chord_m=forces.semi_chord_m, lags=lags, with_mass=False
    )


def delays_of_zones_s(zone_place_m: FloatArray, speed_m_per_s: float) -> FloatArray:
    """When a gust that is carried along by the flow reaches each zone, from the first.

    Parameters
    ----------
    zone_place_m : ndarray, shape (n_zones,)
        x of the zones.
    speed_m_per_s : float
        U.

    Returns
    -------
    ndarray, shape (n_zones,)
        All 0 is the gust that is the same everywhere.
    """
    require_positive(speed_m_per_s=speed_m_per_s)
    return np.asarray((zone_place_m - zone_place_m[0]) / speed_m_per_s, dtype=float)


def gust_response(
    structure: ModalStructure,
    motion: RationalForces,
    gust: RationalForces,
    shape: GustShape,
    *,
    density_kg_per_m3: float,
    speed_m_per_s: float,
    time_step_s: float,
    duration_s: float,
    delays_s: FloatArray | None = None,
) -> GustResponse:
    """Response from rest, exact for a gust that is linear between the steps.

    Parameters
    ----------
    structure : ModalStructure
        n coordinates.
    motion, gust : RationalForces
        Forces by motion, n by n, and by w_g/U, n by n_zones.
    shape : callable
        w_g over time.
    density_kg_per_m3, speed_m_per_s : float
        Of the air.
    time_step_s, duration_s : float
        Of the simulation.
    delays_s : ndarray, shape (n_zones,), optional
        When the gust reaches each zone; all at once if not given.

    Returns
    -------
    GustResponse

    Raises
    ------
    AnalysisError
        If the gust's forces are not of the same coordinates, or the simulation is too long.
    """
    require_positive(time_step_s=time_step_s, duration_s=duration_s)
    n, n_zones = structure.mass.shape[0], gust.a0.shape[1]
    require_shape("gust forces", gust.a0, (n, -1))
    n_steps = round(duration_s / time_step_s)
    if n_steps > _LARGEST_N_STEPS:
        raise AnalysisError("steps of a gust response", got=f"{n_steps}", allowed=f"≤ {_LARGEST_N_STEPS}")
    delays = np.zeros(n_zones) if delays_s is None else np.asarray(delays_s, dtype=float)
    require_shape("delays_s", delays, (n_zones,))
    time = np.asarray(time_step_s * np.arange(n_steps + 1), dtype=np.float64)
    wind = np.stack([shape(time - delay) for delay in delays], axis=1)
    system, inputs = gust_system(
        structure, motion, gust, density_kg_per_m3=density_kg_per_m3, speed_m_per_s=speed_m_per_s
    )
    states, rates = _integrated(system, inputs, wind, time_step_s)
    return GustResponse(time, states[:, :n], states[:, n : 2 * n], rates[:, n : 2 * n], wind)


def gust_system(
    structure: ModalStructure,
    motion: RationalForces,
    gust: RationalForces,
    *,
    density_kg_per_m3: float,
    speed_m_per_s: float,
) -> tuple[FloatArray, FloatArray]:
    """Matrices of ẋ = A x + B (w_g, ẇ_g), x = (q, q̇, a, a_g).

    Parameters
    ----------
    structure, motion, gust, density_kg_per_m3, speed_m_per_s
        As for `gust_response`.

    Returns
    -------
    system : ndarray, shape (n_states, n_states)
    inputs : ndarray, shape (n_states, 2 n_zones)
    """
    own = state_matrix(structure, motion, density_kg_per_m3=density_kg_per_m3, speed_m_per_s=speed_m_per_s)
    n, n_own, n_lags, n_zones = structure.mass.shape[0], own.shape[0], gust.lags.size, gust.a0.shape[1]
    b, per_speed = gust.semi_chord_m, 0.5 * density_kg_per_m3 * speed_m_per_s
    mass = total_mass(structure, motion, density_kg_per_m3)
    system = np.zeros((n_own + n_lags,) * 2)
    inputs = np.zeros((n_own + n_lags, 2 * n_zones))
    system[:n_own, :n_own] = own
    system[n : 2 * n, n_own:] = np.linalg.solve(mass, per_speed * gust.lag_output)
    system[n_own:, n_own:] = -speed_m_per_s / b * np.diag(gust.lags)
    inputs[n : 2 * n, :n_zones] = np.linalg.solve(mass, per_speed * gust.a0)
    inputs[n : 2 * n, n_zones:] = np.linalg.solve(mass, per_speed * b / speed_m_per_s * gust.a1)
    inputs[n_own:, n_zones:] = gust.lag_input
    return system, inputs


def force_history(
    gust: RationalForces,
    wind_m_per_s: npt.ArrayLike,
    *,
    density_kg_per_m3: float,
    speed_m_per_s: float,
    time_step_s: float,
) -> FloatArray:
    """Forces of a gust on a structure that is held, without those of ẇ_g itself (A₁).

    Parameters
    ----------
    gust : RationalForces
        By w_g/U, n by n_zones.
    wind_m_per_s : array-like, shape (n_times, n_zones)
        w_g; it may start with a step.
    density_kg_per_m3, speed_m_per_s : float
        Of the air.
    time_step_s : float
        Of the wind.

    Returns
    -------
    ndarray, shape (n_times, n)
    """
    wind = np.asarray(wind_m_per_s, dtype=float)
    decay = np.exp(-speed_m_per_s / gust.semi_chord_m * gust.lags * time_step_s)
    # mean of the decay over a step, exact for a wind that is linear within it
    within = (1 - decay) * gust.semi_chord_m / (speed_m_per_s * gust.lags * time_step_s)
    lag = gust.lag_input @ wind[0]
    history = []
    for index, now in enumerate(wind):
        if index:
            lag = decay * lag + within * (gust.lag_input @ (now - wind[index - 1]))
        history.append(gust.a0 @ now + gust.lag_output @ lag)
    return 0.5 * density_kg_per_m3 * speed_m_per_s * np.array(history)


def _integrated(
    system: FloatArray, inputs: FloatArray, wind: FloatArray, step: float
) -> tuple[FloatArray, FloatArray]:
    """States and their rates; within a step the wind is linear and its rate constant."""
    n, n_zones = system.shape[0], wind.shape[1]
    # one exponential of the matrix that holds the inputs, too: wind grows with the rate, the rate stays
    whole = np.zeros((n + 2 * n_zones,) * 2)
    whole[:n, :n], whole[:n, n:] = system, inputs
    whole[n : n + n_zones, n + n_zones :] = np.eye(n_zones)
    advance = expm(whole * step)[:n]
    rate = np.vstack([np.diff(wind, axis=0) / step, np.zeros((1, n_zones))])
    forced = np.hstack([wind, rate]) @ advance[:, n:].T
    states = np.zeros((wind.shape[0], n))
    for index in range(wind.shape[0] - 1):
        states[index + 1] = advance[:, :n] @ states[index] + forced[index]
    return states, states @ system.T + np.hstack([wind, rate]) @ inputs.T
