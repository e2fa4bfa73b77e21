"""The wing that flies: assumed modes of a clamped beam, lumped tanks, hidden oscillators.

Coordinates are amplitudes of the exact bending modes of a clamped uniform beam and of the torsion modes of a
clamped rod, then of oscillators that nobody knows of (Rayleigh and Ritz). w is up, θ nose up; a point x behind the
elastic axis moves by w − θ x.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import eigh
from scipy.optimize import brentq

from acquisition.virtual_flight.described_wing import DescribedWing
from acquisition.virtual_flight.hidden_physics import HiddenFlight, Oscillator

FloatArray = npt.NDArray[np.float64]
N_BENDING, N_TORSION = 5, 4
_N_POINTS = 16
"""Gauss points along each part of the span; the highest modes have five half waves."""


@dataclass(frozen=True, eq=False)
class TrueWing:
    """Matrices of the structure without air.

    Attributes
    ----------
    mass, damping, stiffness : ndarray, shape (n, n)
    tank_rows, tank_twist_rows : ndarray, shape (n_tanks, n)
        Vertical displacement and twist at the tanks.
    sensor_rows : ndarray, shape (n_sensors, n)
        Vertical displacement at the accelerometers.
    rigid : ndarray, shape (n,)
        Generalised mass that a vertical motion of the root moves.
    tip_row : ndarray, shape (n,)
    """

    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    tank_rows: FloatArray
    tank_twist_rows: FloatArray
    sensor_rows: FloatArray
    rigid: FloatArray
    tip_row: FloatArray


def shapes_at(wing: DescribedWing, y_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Deflection and twist at places, shape (n_places, N_BENDING + N_TORSION) each."""
    y = np.atleast_1d(np.asarray(y_m, np.float64)) / wing.semi_span_m
    bent = np.zeros((y.size, N_BENDING + N_TORSION))
    twisted = np.zeros_like(bent)
    for j in range(N_BENDING):
        beta, ratio = _clamped(j)
        bent[:, j] = np.cosh(beta * y) - np.cos(beta * y) - ratio * (np.sinh(beta * y) - np.sin(beta * y))
    for j in range(N_TORSION):
        twisted[:, N_BENDING + j] = np.sin((2 * j + 1) * np.pi * y / 2)
    return bent, twisted


def _clamped(number: int) -> tuple[float, float]:
    """βL with cos βL cosh βL = −1, and the ratio of its mode."""
    middle = (number + 0.5) * np.pi
    beta = float(brentq(lambda x: np.cos(x) + 1 / np.cosh(x), middle - 0.6, middle + 0.6))
    return beta, float((np.cosh(beta) + np.cos(beta)) / (np.sinh(beta) + np.sin(beta)))


def points(wing: DescribedWing) -> tuple[FloatArray, FloatArray]:
    """Gauss points along clean wing and flap, and their weights [m]."""
    x, weight = np.polynomial.legendre.leggauss(_N_POINTS)
    ends = [0.0, wing.flap.inner_m, wing.flap.outer_m, wing.semi_span_m]
    parts = [(a, b) for a, b in itertools.pairwise(ends) if b > a]
    places = [0.5 * (b - a) * (x + 1) + a for a, b in parts]
    return np.concatenate(places), np.concatenate([0.5 * (b - a) * weight for a, b in parts])


def true_wing(wing: DescribedWing, hidden: HiddenFlight, deviation: dict[str, float]) -> TrueWing:
    """Matrices of the wing as it is.

    Parameters
    ----------
    wing : DescribedWing
    hidden : HiddenFlight
    deviation : dict of str to float
        Factors by which the laboratory is off: ``bending``, ``torsion``, ``damping``.
    """
    y, weight = points(wing)
    w, t = shapes_at(wing, y)
    n = w.shape[1]
    mass = wing.mass_kg_per_m * (w.T * weight) @ w + wing.pitch_inertia_kg_m * (t.T * weight) @ t
    coupling = -wing.mass_kg_per_m * wing.mass_offset_m * (w.T * weight) @ t
    mass = mass + coupling + coupling.T
    rigid = wing.mass_kg_per_m * (weight @ w - wing.mass_offset_m * (weight @ t))
    curvature, twist_rate = _rates(wing, y)
    stiffness = deviation["bending"] * wing.bending_stiffness_n_m2 * (curvature.T * weight) @ curvature
    stiffness += deviation["torsion"] * wing.torsion_stiffness_n_m2 * (twist_rate.T * weight) @ twist_rate
    tank_w, tank_t = shapes_at(wing, np.array([tank.y_m for tank in wing.tanks]))
    rows = np.array(
        [wt - tank.behind_axis_m * tt for tank, wt, tt in zip(wing.tanks, tank_w, tank_t, strict=True)]
    )
    for i, tank in enumerate(wing.tanks):
        fill = hidden.fill_levels.get(i, tank.fill_level)
        own = tank.dry_mass_kg + tank.liquid_kg(fill) * (1 + hidden.effective_mass.get(i, 0.0))
        mass = mass + own * np.outer(rows[i], rows[i])
        mass = mass + tank.pitch_inertia_kg_m2(fill) * np.outer(tank_t[i], tank_t[i])
        rigid = rigid + own * rows[i]
    damping = _modal_damping(mass, stiffness, wing.damping_ratio * deviation["damping"], hidden.loss_factor)
    sensor_w, sensor_t = shapes_at(wing, np.array([place for _, place, _ in wing.accelerometers]))
    behind = np.array([offset for _, _, offset in wing.accelerometers])
    sensor_rows = sensor_w - behind[:, None] * sensor_t
    tip, _ = shapes_at(wing, np.array([wing.semi_span_m]))
    bare = TrueWing(mass, damping, stiffness, rows, tank_t, sensor_rows, rigid, tip[0])
    for each in hidden.oscillators:
        bare = _with_oscillator(bare, wing, each)
    assert bare.mass.shape[0] == n + len(hidden.oscillators)
    return bare


def _rates(wing: DescribedWing, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """w'' and θ' at places."""
    x, length = y / wing.semi_span_m, wing.semi_span_m
    curved = np.zeros((y.size, N_BENDING + N_TORSION))
    twisting = np.zeros_like(curved)
    for j in range(N_BENDING):
        beta, ratio = _clamped(j)
        bent = np.cosh(beta * x) + np.cos(beta * x) - ratio * (np.sinh(beta * x) + np.sin(beta * x))
        curved[:, j] = (beta / length) ** 2 * bent
    for j in range(N_TORSION):
        rate = (2 * j + 1) * np.pi / (2 * length)
        twisting[:, N_BENDING + j] = rate * np.cos(rate * y)
    return curved, twisting


def _modal_damping(mass: FloatArray, stiffness: FloatArray, ratio: float, loss_factor: float) -> FloatArray:
    """2 ζ ω in every mode; a loss factor is ζ = η/2 there."""
    squares, modes = eigh(stiffness, mass)
    omega = np.sqrt(squares)
    weighted = mass @ modes
    return np.asarray((weighted * ((2 * ratio + loss_factor) * omega)) @ weighted.T)


def _with_oscillator(wing: TrueWing, described: DescribedWing, each: Oscillator) -> TrueWing:
    """One more coordinate: a mass on a spring that moves vertically, or a liquid that sloshes with the pitch."""
    n = wing.mass.shape[0]
    bent, twisted = shapes_at(described, np.array([each.y_m]))
    row = np.zeros(n)
    row[: bent.shape[1]] = twisted[0] if each.turns else bent[0] - each.behind_axis_m * twisted[0]
    omega = 2 * np.pi * each.frequency_hz

    def grown(matrix: FloatArray, coupling: FloatArray, own: float) -> FloatArray:
        return np.block([[matrix, coupling[:, None]], [coupling[None, :], np.array([[own]])]])

    mass = grown(wing.mass, each.inertial_coupling * row, each.mass_kg)
    damping = grown(wing.damping, 0.0 * row, 2 * each.damping_ratio * omega * each.mass_kg)
    stiffness = grown(wing.stiffness, -each.static_coupling * row, each.mass_kg * omega**2)

    def longer(rows: FloatArray) -> FloatArray:
        return np.hstack([rows, np.zeros((rows.shape[0], 1))])

    return TrueWing(
        mass,
        damping,
        stiffness,
        longer(wing.tank_rows),
        longer(wing.tank_twist_rows),
        longer(wing.sensor_rows),
        # its own mass is part of the wing that the root moves; relative motion is forced besides
        np.append(wing.rigid, 0.0 if each.turns else each.mass_kg),
        np.append(wing.tip_row, 0.0),
    )
