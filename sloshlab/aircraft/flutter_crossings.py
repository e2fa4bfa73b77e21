"""Where oscillations of an aircraft begin to grow, and what moves in them: the body, its modes, or the liquids.

A root locus that follows every branch names a crossing by the mode that its branch started at. Near another
branch that name means little; the energies of the motion at the crossing do not depend on it. Of an aircraft that
is its own mirror image, motions of both parities are looked at apart, and eigenvalues alone are computed over the
speed, so that many places of a tank can be tried.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt
from scipy.linalg import eig, eigvals
from scipy.optimize import linear_sum_assignment

from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aircraft.flight_stability import FlightSystem, Liquids, flight_system
from sloshlab.aircraft.mirror_symmetry import mirror_symmetry
from sloshlab.aircraft.model import AircraftModel
from sloshlab.aircraft.practical_mean_axes import to_body_axes

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
Kind = Literal["symmetric", "antisymmetric", "flutter", "sloshing", "flight"]

_SLOWEST_RAD_PER_S: Final = 5.0
"""Slower roots are phugoid, spiral and dutch roll, which forces without drag do not decide."""
_LEAST_ELASTIC_SHARE: Final = 0.02
"""Of the energy in modes; below it the body moves as a whole."""


@dataclass(frozen=True)
class FlutterCrossing:
    """An oscillation that begins to grow with the speed.

    Attributes
    ----------
    speed_m_per_s, frequency_rad_per_s : float
    parity : str
        ``symmetric`` or ``antisymmetric`` motion, or ``flutter`` of an aircraft without a mirror image.
    liquid_share, elastic_share : float
        Of the kinetic energy, in sideways liquids and in modes.
    """

    speed_m_per_s: float
    frequency_rad_per_s: float
    parity: Literal["symmetric", "antisymmetric", "flutter"]
    liquid_share: float
    elastic_share: float

    @property
    def kind(self) -> Kind:
        """``sloshing`` of the liquids, ``flight`` of the body as a whole, or else the parity of the flutter."""
        if self.liquid_share > 0.5:
            return "sloshing"
        return "flight" if self.elastic_share < _LEAST_ELASTIC_SHARE else self.parity


@dataclass(frozen=True, eq=False)
class _Half:
    """Motions of one parity: the states that they need, per state of the whole."""

    parity: Literal["symmetric", "antisymmetric", "flutter"]
    of_states: FloatArray
    matrix_at: Callable[[float], FloatArray]


def flutter_crossings(
    model: AircraftModel,
    air: RationalForces,
    liquids: Liquids,
    speeds_m_per_s: FloatArray,
    *,
    tolerance_m_per_s: float = 1e-3,
) -> tuple[FlutterCrossing, ...]:
    """Find all oscillations that begin to grow within a range of speeds, and those that grow from its start on.

    Parameters
    ----------
    model : AircraftModel
    air : RationalForces
        Of the aircraft's coordinates in axes x aft, y to starboard, z up.
    liquids : str
        ``frozen`` or ``lateral``.
    speeds_m_per_s : ndarray
        Ascending, in steps that roots near the axis can be followed by.
    tolerance_m_per_s : float
        Of the bisection.

    Returns
    -------
    tuple of FlutterCrossing
        By speed; one that grows at the first speed already has that speed.

    Notes
    -----
    A deck is never quite its own mirror image; forces of motions of one parity on those of the other are left out.
    """
    system = flight_system(model, air, liquids, density_kg_per_m3=model.density_kg_per_m3)
    found: list[FlutterCrossing] = []
    for half in _halves(model, air, system):
        for speed, root in _growing(half.matrix_at, np.asarray(speeds_m_per_s, np.float64), tolerance_m_per_s):
            found.append(_described(model, system, half, speed, root))
    return tuple(sorted(found, key=lambda crossing: crossing.speed_m_per_s))


def first_flutter(crossings: Sequence[FlutterCrossing]) -> FlutterCrossing | None:
    """The lowest flutter of the body with its modes that is symmetric, or of any kind without a mirror image.

    Parameters
    ----------
    crossings : sequence of FlutterCrossing
        By speed.
    """
    return next((crossing for crossing in crossings if crossing.kind in ("symmetric", "flutter")), None)


def _halves(model: AircraftModel, air: RationalForces, system: FlightSystem) -> list[_Half]:
    symmetry, n_all = mirror_symmetry(model), len(system.names)
    n_states = 2 * n_all + air.lags.size
    owner = _coordinate_of_lag(air)
    if symmetry is None or owner is None:
        return [_Half("flutter", np.eye(n_states), system.matrix_at)]
    halves = []
    for parity, sign, motions in zip(
        ("symmetric", "antisymmetric"), (1.0, -1.0), symmetry.halves(n_all - symmetry.parity.size), strict=True
    ):
        lags = np.eye(air.lags.size)[:, symmetry.parity[owner] == sign]
        m, n_lags = motions.shape[1], lags.shape[1]
        states = np.zeros((n_states, 2 * m + n_lags))
        states[:n_all, :m] = states[n_all : 2 * n_all, m : 2 * m] = motions
        states[2 * n_all :, 2 * m :] = lags
        halves.append(
            _Half(
                "symmetric" if parity == "symmetric" else "antisymmetric",
                states,
                lambda speed, states=states: states.T @ system.matrix_at(speed) @ states,  # type: ignore[misc]
            )
        )
    return halves


def _coordinate_of_lag(air: RationalForces) -> npt.NDArray[np.int64] | None:
    """Which coordinate drives each lag; None if one is driven by several, as of minimum states."""
    size = np.abs(air.lag_input)
    if size.size == 0 or np.count_nonzero(size, axis=1).max() > 1:
        return None
    return np.asarray(size.argmax(axis=1), np.int64)


def _growing(
    matrix_at: Callable[[float], FloatArray], speeds: FloatArray, tolerance: float
) -> list[tuple[float, complex]]:
    """Speeds and roots that begin to grow."""
    before = _oscillating(eigvals(matrix_at(float(speeds[0]))))
    found = [(float(speeds[0]), complex(root)) for root in before if root.real > 0]
    for low, high in zip(speeds[:-1].tolist(), speeds[1:].tolist(), strict=True):
        now = _oscillating(eigvals(matrix_at(high)))
        # one that came or went through the slowest frequency has no partner
        rows, columns = linear_sum_assignment(np.abs(before[:, None] - now[None, :]))
        found += [
            _bisected(matrix_at, (low, complex(before[i])), (high, complex(now[j])), tolerance)
            for i, j in zip(rows.tolist(), columns.tolist(), strict=True)
            if before[i].real <= 0 < now[j].real
        ]
        before = now
    return found


def _oscillating(roots: ComplexArray) -> ComplexArray:
    return np.asarray(roots[roots.imag > _SLOWEST_RAD_PER_S])


def _bisected(
    matrix_at: Callable[[float], FloatArray],
    low: tuple[float, complex],
    high: tuple[float, complex],
    tolerance: float,
) -> tuple[float, complex]:
    while high[0] - low[0] > tolerance:
        middle = 0.5 * (low[0] + high[0])
        roots = _oscillating(eigvals(matrix_at(middle)))
        root = complex(roots[np.argmin(np.abs(roots - 0.5 * (low[1] + high[1])))])
        if root.real > 0:
            high = (middle, root)
        else:
            low = (middle, root)
    share = -low[1].real / max(high[1].real - low[1].real, np.finfo(float).tiny)
    return low[0] + share * (high[0] - low[0]), low[1] + share * (high[1] - low[1])


def _described(
    model: AircraftModel, system: FlightSystem, half: _Half, speed: float, root: complex
) -> FlutterCrossing:
    poles, vectors = eig(half.matrix_at(speed))
    n_all, n = len(system.names), model.structure.mass_matrix.shape[0]
    motion = half.of_states[:n_all] @ vectors[:, np.argmin(np.abs(poles - root))]
    if model.structure.is_free:
        motion = np.concatenate([to_body_axes(model.structure.n_modes) @ motion[:n], motion[n:]])
    mass = system.structure.mass[:n, :n]
    elastic = np.where(np.arange(n) < len(system.rigid), 0.0, motion[:n])
    liquid = float(np.vdot(motion[n:], motion[n:]).real)
    whole = float((motion[:n].conj() @ mass @ motion[:n]).real) + liquid
    in_modes = float((elastic.conj() @ mass @ elastic).real)
    return FlutterCrossing(speed, root.imag, half.parity, liquid / whole, in_modes / whole)
