"""A linear mechanism: masses, springs, dampers, what drives it, what is read; and the twin that the engine runs.

    M q̈ + C q̇ + K q = d F(t) + p f,    x = p·q

with the driving force F along `d`, and the added forces f along `p`, which see x and its derivatives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eigh

from sloshlab.errors import AnalysisError, InputError
from sloshlab.twin.motion import Motion
from sloshlab.twin.structure import Structure
from sloshlab.twin.structure_forces import MASS_ERROR
from sloshlab.twin.terms import Term
from sloshlab.twin.twin import Twin

FloatArray = NDArray[np.float64]
MOST_COORDINATES: Final = 30
_MOST_COUPLED: Final = 0.3


@dataclass(frozen=True, eq=False)
class Reading:
    """What a channel shows: a sum over the coordinates' displacements, velocities and accelerations, and a series.

    Attributes
    ----------
    displacement, velocity, acceleration : float or array_like, shape (n_coordinates,)
        Weights; relative to the base where it moves.
    plus : float or array_like, shape (n_samples,)
        What is added, such as the motion of the base.
    """

    displacement: ArrayLike = 0.0
    velocity: ArrayLike = 0.0
    acceleration: ArrayLike = 0.0
    plus: ArrayLike = 0.0


@dataclass(frozen=True, eq=False)
class Mechanism:
    """Masses, springs and dampers of one run.

    Attributes
    ----------
    mass_kg, stiffness_n_per_m, damping_n_s_per_m : float or array_like, shape (n, n)
        Symmetric; masses and stiffnesses positive definite. Dampers must leave the modes nearly uncoupled.
    readings : mapping of str to Reading
        Per compared channel.
    driving_force_n : array_like, shape (n_samples,), optional
    driven_along : array_like, shape (n,), optional
        d; that of the added forces by default.
    base_acceleration_m_per_s2 : array_like, shape (n_samples,), optional
        Coordinates are then relative to the base. Not together with `driven_along`.
    base_along : array_like, shape (n,), optional
        How the coordinates move with the base; each with it by default.
    acts_along : array_like, shape (n,), optional
        p; the first coordinate by default. A joint between coordinates 1 and 2 is ``(1, -1)``.
    initial_displacement_m, initial_velocity_m_per_s : float
        Of x, shared among the coordinates as under a static force.
    forces : sequence of Term
        Nonlinear forces that the baseline has already, along `acts_along`.
    """

    mass_kg: ArrayLike
    stiffness_n_per_m: ArrayLike
    damping_n_s_per_m: ArrayLike
    readings: Mapping[str, Reading]
    driving_force_n: ArrayLike | None = None
    driven_along: ArrayLike | None = None
    base_acceleration_m_per_s2: ArrayLike | None = None
    base_along: ArrayLike | None = None
    acts_along: ArrayLike | None = None
    initial_displacement_m: float = 0.0
    initial_velocity_m_per_s: float = 0.0
    forces: Sequence[Term] = field(default=())


@dataclass(frozen=True, eq=False)
class EngineTwin:
    """A mechanism as the engine runs it.

    Attributes
    ----------
    twin : Twin
    modes : ndarray, shape (n, n_modes)
        Coordinates per modal coordinate.
    force_n, base : ndarray, shape (n_samples,), or None
        External force along p, and what drives the modes through their participation.
    """

    twin: Twin
    modes: FloatArray
    force_n: FloatArray | None
    base: FloatArray | None


def engine_twin(mechanism: Mechanism, terms: Sequence[Term], n_samples: int) -> EngineTwin:
    """The mechanism with more forces.

    Parameters
    ----------
    mechanism : Mechanism
    terms : sequence of Term
    n_samples : int

    Raises
    ------
    InputError
        If shapes, masses, springs or dampers cannot be.
    """
    everything = (*mechanism.forces, *terms)
    mass, stiffness, damping = (
        _matrix(mechanism, name) for name in ("mass_kg", "stiffness_n_per_m", "damping_n_s_per_m")
    )
    n = mass.shape[0]
    if {stiffness.shape, damping.shape} != {mass.shape}:
        raise InputError(
            "mechanism", got=f"matrices {mass.shape}, {stiffness.shape}, {damping.shape}", allowed="one shape"
        )
    along = _vector(mechanism.acts_along, n, "acts_along", np.eye(n)[0])
    # Masses go into the matrix and not into the forces: they change the modes, and with them what every channel
    # reads.
    added = sum(term.mass_kg for term in everything if term.kind is MASS_ERROR)
    mass = mass + added * np.outer(along, along)
    modes, stiffnesses, dampings = _modal(mass, stiffness, damping)
    force, base, participation = _drive(mechanism, mass, modes, along, n_samples)
    structure = Structure(np.ones(n), stiffnesses, dampings, np.ascontiguousarray(along @ modes), participation)
    others = tuple(term for term in everything if term.kind is not MASS_ERROR)
    return EngineTwin(Twin(structure, others), modes, force, base)


def _matrix(mechanism: Mechanism, name: str) -> FloatArray:
    values = np.atleast_2d(_numbers(getattr(mechanism, name), f"mechanism: {name}"))
    n = values.shape[0]
    if values.shape != (n, n) or not 1 <= n <= MOST_COORDINATES or not np.allclose(values, values.T):
        raise InputError(
            f"mechanism: {name}",
            got=f"shape {values.shape}",
            allowed=f"a number, or a symmetric matrix of at most {MOST_COORDINATES} rows",
        )
    return values


def _numbers(values: ArrayLike, what: str) -> FloatArray:
    try:
        array = np.asarray(values, np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(what, got=f"{type(values).__name__}", allowed="numbers") from error
    if not np.isfinite(array).all():
        # Whatever has more values than a mechanism has coordinates is a series.
        first = int(np.flatnonzero(~np.isfinite(array.ravel()))[0])
        place = f", first at sample {first}" if array.ndim == 1 and array.size > MOST_COORDINATES else ""
        raise AnalysisError(what, got=f"NaN or infinity{place}", allowed="finite numbers")
    return array


def _vector(values: ArrayLike | None, n: int, what: str, default: FloatArray) -> FloatArray:
    if values is None:
        return default
    array = np.atleast_1d(_numbers(values, f"mechanism: {what}"))
    if array.shape != (n,) or not array.any():
        raise InputError(f"mechanism: {what}", got=f"shape {array.shape}", allowed=f"({n},), not all zero")
    return array


def _modal(
    mass: FloatArray, stiffness: FloatArray, damping: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Modes for a modal mass of one."""
    try:
        stiffnesses, modes = eigh(stiffness, mass)
    except np.linalg.LinAlgError:
        raise AnalysisError("mechanism: mass_kg", got="a matrix that is not positive definite") from None
    if not stiffnesses.min() > 0:
        raise AnalysisError(
            "mechanism: stiffness_n_per_m",
            got="a motion without a spring",
            allowed="a positive definite matrix",
            remedy="a soft spring where a body is free",
        )
    # The engine moves uncoupled modes; what dampers couple beyond a little would silently be left out.
    coupled = modes.T @ damping @ modes
    own = np.diag(coupled).copy()
    between = np.sqrt(np.abs(np.outer(own, own)))
    worst = np.max(np.abs(coupled - np.diag(own)) - _MOST_COUPLED * between, initial=0.0)
    if worst > 1e-9 * np.sqrt(stiffnesses.max()):
        raise InputError(
            "mechanism: damping_n_s_per_m",
            got="dampers that couple the modes",
            allowed=f"coupling below {_MOST_COUPLED:g} of the modes' own damping",
            remedy="use a twin that simulates by itself",
        )
    return modes, stiffnesses, own


def _drive(
    mechanism: Mechanism, mass: FloatArray, modes: FloatArray, along: FloatArray, n_samples: int
) -> tuple[FloatArray | None, FloatArray | None, FloatArray]:
    """Force along p, series that drives through the participation, and that participation.

    The engine's base acceleration a acts on mode j as −Γ_j a: with Γ = −Φᵀ d it is a force along any d.
    """
    n = mass.shape[0]
    force = _series(mechanism.driving_force_n, n_samples, "driving_force_n")
    base = _series(mechanism.base_acceleration_m_per_s2, n_samples, "base_acceleration_m_per_s2")
    if base is not None:
        if mechanism.driven_along is not None:
            raise InputError("mechanism", got="base_acceleration_m_per_s2 and driven_along", allowed="one of them")
        with_base = _vector(mechanism.base_along, n, "base_along", np.ones(n))
        return force, base, modes.T @ mass @ with_base
    if mechanism.driven_along is None:
        return force, None, np.zeros(n)
    driven = _vector(mechanism.driven_along, n, "driven_along", along)
    return None, force, -modes.T @ driven


def _series(values: ArrayLike | None, n_samples: int, what: str) -> FloatArray | None:
    if values is None:
        return None
    array = _numbers(values, f"mechanism: {what}")
    if array.shape != (n_samples,):
        raise InputError(f"mechanism: {what}", got=f"shape {array.shape}", allowed=f"({n_samples},)")
    return array


def reading_of(reading: Reading, motion: Motion, modes: FloatArray, channel: str) -> FloatArray:
    """What a perfect sensor shows, shape (n_samples,)."""
    n_samples, n = motion.modes.shape[0], modes.shape[0]
    total = np.zeros(n_samples)
    for order, name in enumerate(("displacement", "velocity", "acceleration")):
        weights = np.atleast_1d(_numbers(getattr(reading, name), f"reading {channel}: {name}"))
        if weights.shape not in ((n,), (1,)):
            raise InputError(f"reading {channel}: {name}", got=f"shape {weights.shape}", allowed=f"({n},)")
        if weights.any():
            total += motion.modes[:, order] @ (np.broadcast_to(weights, n) @ modes)
    plus = _numbers(reading.plus, f"reading {channel}: plus")
    if plus.shape not in ((), (n_samples,)):
        raise InputError(f"reading {channel}: plus", got=f"shape {plus.shape}", allowed=f"({n_samples},)")
    return np.asarray(total + plus)
