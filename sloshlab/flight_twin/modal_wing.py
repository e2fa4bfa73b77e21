"""Wing and air in the lowest modes of the wing with frozen liquid, by parts that numbers of the twin scale."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from math import acos, pi, sqrt
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.linalg import eigh

from sloshlab.aeroelastic.bending_torsion_beam import WingModes, assembled, uniform_beam
from sloshlab.aeroelastic.modal_structure import of_modes
from sloshlab.flight_twin.described_wing import FlightWing
from sloshlab.lateral_sloshing.box_tank import BoxTank

FloatArray = npt.NDArray[np.float64]
N_MODES: Final = 8
"""With frozen liquid: stalls and stops shake even those that no recorder sees any more."""
N_STRIPS: Final = 24
"""Across the span; between flap and clean wing one ends at each end of the flap."""
_N_ELEMENTS: Final = 24


@dataclass(frozen=True, eq=False)
class FlapCoefficients:
    """Theodorsen's flap (NACA Report 496, 1935): T₁₀/π, T₁₁/2π, −T₄, moment per angle and per rate.

    Attributes
    ----------
    downwash, downwash_rate : float
        At the three-quarter chord, over U β and b β̇.
    lift_rate : float
        Without circulation, over ρ b² U β̇.
    moment, moment_rate : float
        About the elastic axis, nose up, over ρ b² U² β and ρ b³ U β̇.
    """

    downwash: float
    downwash_rate: float
    lift_rate: float
    moment: float
    moment_rate: float


def flap_coefficients(hinge: float, elastic_axis: float) -> FlapCoefficients:
    """Coefficients of a flap.

    Parameters
    ----------
    hinge, elastic_axis : float
        Behind mid-chord, in semi-chords.

    Examples
    --------
    >>> round(flap_coefficients(-1.0, 0.0).downwash, 12)  # a flap of the whole chord
    1.0
    """
    c, s, turn = hinge, sqrt(1 - hinge * hinge), acos(hinge)
    t1, t4 = c * turn - s * (2 + c * c) / 3, c * s - turn
    t8, t10, t11 = c * turn - s * (1 + 2 * c * c) / 3, s + turn, turn * (1 - 2 * c) + s * (2 - c)
    return FlapCoefficients(
        t10 / pi, t11 / (2 * pi), -t4, -(t4 + t10), -(t1 - t8 - (c - elastic_axis) * t4 + t11 / 2)
    )


@dataclass(frozen=True, eq=False)
class ModalWing:
    """Parts of the equations in n modes; w up, θ nose up, a point x behind the elastic axis moves by w − θ x.

    Attributes
    ----------
    bending, torsion : ndarray, shape (n, n)
        Stiffness as believed; their sum is diagonal.
    damping : ndarray, shape (n, n)
        2 ζ ω as believed; modal masses are one.
    omega_rad_per_s : ndarray, shape (n,)
    rigid : ndarray, shape (n,)
        Generalised mass that a vertical motion of the root moves.
    tank_rows, tank_twist_rows : ndarray, shape (n_tanks, n)
    sensor_rows : ndarray, shape (n_sensors, n)
    tip_row : ndarray, shape (n,)
        Deflection of the elastic axis.
    strips : StripIntegrals
    """

    bending: FloatArray
    torsion: FloatArray
    damping: FloatArray
    omega_rad_per_s: FloatArray
    rigid: FloatArray
    tank_rows: FloatArray
    tank_twist_rows: FloatArray
    sensor_rows: FloatArray
    tip_row: FloatArray
    strips: StripIntegrals


@dataclass(frozen=True, eq=False)
class StripIntegrals:
    """Sums over strips across the span; h = w + b(½ + a)θ is the displacement of the quarter chord.

    Attributes
    ----------
    flap_share : ndarray, shape (n_strips,)
        One where the flap is.
    deflection, twist : ndarray, shape (n_strips, n)
        w and θ of the modes.
    quarter_chord : ndarray, shape (n_strips, n)
        h times the width [m]: generalised force of a lift per length on each strip.
    lift_deflection, lift_twist : ndarray, shape (n, n)
        ∫hw, ∫hθ.
    lift, lift_of_flap, deflection_of_flap, twist_of_flap : ndarray, shape (n,)
        ∫h; ∫h, ∫w and ∫θ along the flap.
    squares : tuple of ndarray, shape (n, n)
        ∫ww, ∫wθ, ∫θθ.
    """

    flap_share: FloatArray
    deflection: FloatArray
    twist: FloatArray
    quarter_chord: FloatArray
    lift_deflection: FloatArray
    lift_twist: FloatArray
    lift: FloatArray
    lift_of_flap: FloatArray
    deflection_of_flap: FloatArray
    twist_of_flap: FloatArray
    squares: tuple[FloatArray, FloatArray, FloatArray]


def modal_wing(described: FlightWing, n_modes: int = N_MODES) -> ModalWing:
    """Reduce a wing to its lowest modes, tanks included.

    Parameters
    ----------
    described : FlightWing
    n_modes : int
    """
    wing = described.wing
    beam = uniform_beam(
        wing.semi_span_m,
        n_elements=_N_ELEMENTS,
        bending_stiffness_n_m2=wing.bending_stiffness_n_m2,
        torsion_stiffness_n_m2=wing.torsion_stiffness_n_m2,
        mass_kg_per_m=wing.mass_kg_per_m,
        mass_offset_m=wing.mass_offset_m,
        pitch_inertia_kg_m=wing.pitch_inertia_kg_m,
    )
    mass, both = (matrix[3:, 3:] for matrix in assembled(beam))
    size = mass.shape[0]
    # rows of the deflection and the twist of any place per coordinate of the nodes
    every = WingModes(
        of_modes(np.ones(size)), beam.node_m, *(np.vstack([np.zeros(size), np.eye(size)[k::3]]) for k in range(3))
    )
    tank_w, tank_t = every.at(np.array([tank.y_m for tank in described.tanks]))
    tank_w = tank_w - np.array([[tank.behind_axis_m] for tank in described.tanks]) * tank_t
    rigid_motion = np.tile([1.0, 0.0, 0.0], size // 3)
    rigid = mass @ rigid_motion
    # elements that end at the clamped root carry mass of nodes that do not move relative to it
    rigid = rigid + assembled(beam)[0][3:, 0]
    for tank, row, twist in zip(described.tanks, tank_w, tank_t, strict=True):
        carried = tank.dry_mass_kg + tank.box().liquid_mass_kg
        mass = mass + carried * np.outer(row, row) + frozen_inertia_kg_m2(tank.box()) * np.outer(twist, twist)
        rigid = rigid + carried * row
    squares, modes = eigh(both, mass, subset_by_index=[0, n_modes - 1])
    omega = np.sqrt(squares)
    is_torsion = np.arange(size) % 3 == 2
    bending = np.where(is_torsion[:, None] | is_torsion[None, :], 0.0, both)
    sensor_w, sensor_t = every.at(np.array([each.y_m for each in described.accelerometers]))
    sensors = sensor_w - np.array([[each.behind_axis_m] for each in described.accelerometers]) * sensor_t
    y, width, share = _strips(described)
    deflection, twist = every.at(y)
    strips = _integrals(described, width, share, deflection @ modes, twist @ modes)
    return ModalWing(
        modes.T @ bending @ modes,
        modes.T @ (both - bending) @ modes,
        np.diag(2 * wing.damping_ratio * omega),
        omega,
        rigid @ modes,
        tank_w @ modes,
        tank_t @ modes,
        sensors @ modes,
        every.at(np.array([wing.semi_span_m]))[0][0] @ modes,
        strips,
    )


def _integrals(
    described: FlightWing, width: FloatArray, share: FloatArray, w: FloatArray, t: FloatArray
) -> StripIntegrals:
    arm = described.wing.semi_chord_m * (0.5 + described.wing.elastic_axis)
    quarter = width[:, None] * (w + arm * t)
    along_flap = width * share
    squares = tuple((left * width[:, None]).T @ right for left, right in ((w, w), (w, t), (t, t)))
    return StripIntegrals(
        share, w, t, quarter, quarter.T @ w, quarter.T @ t, quarter.sum(axis=0), quarter.T @ share,
        along_flap @ w, along_flap @ t, (squares[0], squares[1], squares[2]),
    )  # fmt: skip


def frozen_inertia_kg_m2(box: BoxTank) -> float:
    """Of the frozen liquid in pitch, about its centre: m (a² + h_f²)/12."""
    return box.liquid_mass_kg * (box.length_m**2 + box.fill_height_m**2) / 12


def _strips(described: FlightWing) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Middles and widths of strips that end at the ends of the flap, and where the flap is."""
    ends = sorted({0.0, described.flap.inner_m, described.flap.outer_m, described.wing.semi_span_m})
    edges = [0.0]
    for inner, outer in itertools.pairwise(ends):
        n = max(1, round(N_STRIPS * (outer - inner) / described.wing.semi_span_m))
        edges += np.linspace(inner, outer, n + 1)[1:].tolist()
    across = np.array(edges)
    middle = 0.5 * (across[:-1] + across[1:])
    inside = (middle > described.flap.inner_m) & (middle < described.flap.outer_m)
    return middle, np.diff(across), inside * 1.0
