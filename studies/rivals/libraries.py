"""Candidate terms of the sparse regression, and what each is called in the vocabulary: fixed before any case.

Force terms are functions of displacement x, velocity v and acceleration a (relative to the base in the structure,
absolute in the tank); terms of a sensor are functions of what the retuned baseline reads there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

FloatArray = NDArray[np.float64]
STRUCTURE, TANK, SENSOR = "structure", "tank", "sensor"


@dataclass(frozen=True, eq=False)
class Motion:
    """One run along which terms are computed.

    Attributes
    ----------
    x, v, a : ndarray, shape (n,)
        Displacement [m], velocity [m/s], acceleration [m/s²]; of a sensor its reading, derivative and integral.
    time_s : ndarray, shape (n,)
        From the start of the run.
    largest : tuple of float
        Largest |x|, |v|, |a| of all fitted runs of the case.
    """

    x: FloatArray
    v: FloatArray
    a: FloatArray
    time_s: FloatArray
    largest: tuple[float, float, float]

    @property
    def amplitude(self) -> FloatArray:
        """√2 times the running RMS of a over half a second, over its largest value in the case, shape (n,)."""
        n = max(1, round(0.5 / max(float(np.median(np.diff(self.time_s))), 1e-9)))
        power = uniform_filter1d(self.a**2, n, mode="nearest")
        return np.asarray(np.sqrt(2 * np.maximum(power, 0.0)) / max(self.largest[2], 1e-300))


@dataclass(frozen=True)
class Term:
    """One column of a library.

    Attributes
    ----------
    name : str
    value : callable
        (motion) → its values, shape (n,).
    effect : str
        What it is called in the vocabulary; empty where it has no name there.
    is_own : bool
        Whether the baseline has a number for it: it is named only where no other term is chosen.
    """

    name: str
    value: Callable[[Motion], FloatArray]
    effect: str = ""
    is_own: bool = False


def _beyond(share: float) -> Callable[[Motion], FloatArray]:
    return lambda m: np.sign(m.x) * np.maximum(np.abs(m.x) - share * m.largest[0], 0.0)


STRUCTURE_TERMS: Final = (
    Term("1", lambda m: np.ones_like(m.x), "constant_force"),
    Term("x", lambda m: m.x, is_own=True),
    Term("v", lambda m: m.v, "viscous_damping", is_own=True),
    Term("a", lambda m: m.a, is_own=True),
    Term("x²", lambda m: m.x**2, "quadratic_stiffness"),
    Term("x³", lambda m: m.x**3, "cubic_stiffness"),
    Term("sign v", lambda m: np.sign(m.v), "coulomb_friction"),
    Term(
        "sign v exp −(10 v/v̂)²",
        lambda m: np.sign(m.v) * np.exp(-((10 * m.v / max(m.largest[1], 1e-300)) ** 2)),
        "stribeck_friction",
    ),
    Term("|v| v", lambda m: np.abs(m.v) * m.v, "quadratic_drag"),
    Term("|x| sign v", lambda m: np.abs(m.x) * np.sign(m.v), "structural_damping"),
    Term("x beyond 0.3 x̂", _beyond(0.3), "clearance"),
    Term("x beyond 0.6 x̂", _beyond(0.6), "clearance"),
)
TANK_TERMS: Final = (
    Term("v", lambda m: m.v, "viscous_damping", is_own=True),
    Term("a", lambda m: m.a, "mass_error", is_own=True),
    Term("sign v", lambda m: np.sign(m.v), "coulomb_friction"),
    Term("|v| v", lambda m: np.abs(m.v) * m.v, "quadratic_drag"),
    Term("A a", lambda m: m.amplitude * m.a, "effective_mass"),
    Term("t a", lambda m: m.time_s * m.a, "liquid_loss"),
    Term("A v", lambda m: m.amplitude * m.v, "high_g_saturation"),
    Term("v where A > ½ Â", lambda m: m.v * (m.amplitude > 0.5), "liquid_sloshing"),
    Term("v exp −t/0.3 s", lambda m: m.v * np.exp(-m.time_s / 0.3), "breakup_delay"),
    Term("a beyond 0.6 â", lambda m: np.sign(m.a) * np.maximum(np.abs(m.a) - 0.6 * m.largest[2], 0.0)),
)
SENSOR_TERMS: Final = (
    Term("y", lambda m: m.x, "sensor_gain", is_own=True),
    Term("dy/dt", lambda m: m.v, "sensor_delay"),
    Term("∫y", lambda m: m.a, "sensor_high_pass"),
    Term("t", lambda m: m.time_s - m.time_s.mean(), "sensor_drift"),
    Term("t dy/dt", lambda m: m.time_s * m.v, "clock_skew"),
    Term(
        "y beyond 0.8 ŷ",
        lambda m: np.sign(m.x) * np.maximum(np.abs(m.x) - 0.8 * m.largest[0], 0.0),
        "sensor_clipping",
    ),
    Term("y²", lambda m: m.x**2 - np.mean(m.x**2)),
    Term("y³", lambda m: m.x**3),
)
LIBRARIES: Final = {STRUCTURE: STRUCTURE_TERMS, TANK: TANK_TERMS, SENSOR: SENSOR_TERMS}

EQUALS: Final[dict[tuple[str, str], tuple[tuple[str, ...], ...]]] = {
    (STRUCTURE, "asymmetric_friction"): (("asymmetric_friction",), ("coulomb_friction", "constant_force")),
    (TANK, "mass_error"): (("mass_error",), ("effective_mass",)),
}
"""Names that no regression on these terms can tell apart: they are answered as a set."""


def columns(terms: Sequence[Term], motion: Motion) -> FloatArray:
    """Values of all terms, shape (n, n_terms).

    Parameters
    ----------
    terms : sequence of Term
    motion : Motion
    """
    return np.column_stack([np.asarray(term.value(motion), np.float64) for term in terms])


def names_of(place: str, shares: dict[str, float]) -> tuple[str, ...]:
    """What the terms of a model are called, in alphabetical order; empty where they have no name.

    Parameters
    ----------
    place : str
        Of LIBRARIES.
    shares : dict
        RMS of each chosen term over that of what is explained.

    Notes
    -----
    Terms that correct a number of the baseline are named only where there are no others, and then the largest.
    A constant with dry friction is asymmetric friction; friction that falls, beside dry friction, is Stribeck's.

    Examples
    --------
    >>> names_of("structure", {"x": 0.2, "x³": 0.9}), names_of("structure", {"1": 0.4, "sign v": 0.8})
    (('cubic_stiffness',), ('asymmetric_friction',))
    """
    known = {term.name: term for term in LIBRARIES[place]}
    foreign = [name for name in shares if not known[name].is_own]
    largest = max(shares, key=lambda name: shares[name], default="")
    kept = [largest] if not foreign and largest else foreign
    names = {known[name].effect for name in kept if known[name].effect}
    if "stribeck_friction" in names:
        names.discard("coulomb_friction")
    if place == STRUCTURE and names == {"coulomb_friction", "constant_force"}:
        names = {"asymmetric_friction"}
    return tuple(sorted(names))
