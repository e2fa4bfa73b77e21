"""Euler–Bernoulli cantilever with a mass at its tip, in closed form.

Clamped at x = 0; at x = L the shear force is that of the tip mass M. With μ = M/(ρAL) the wave numbers
λ = kL solve 1 + cosh λ cos λ + μλ (sinh λ cos λ − cosh λ sin λ) = 0, and ω = (λ/L)² √(EI/ρA).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.optimize import brentq

from sloshlab.errors import AnalysisError
from sloshlab.quantities import described

FloatArray = npt.NDArray[np.float64]

_LARGEST_N_MODES = 50


@dataclass(frozen=True)
class Cantilever:
    """A beam of rectangular section, root clamped, with a point mass at its tip.

    Attributes
    ----------
    length_m, width_m, thickness_m : float
        Bending is about the width.
    youngs_modulus_pa, density_kg_per_m3 : float
        Of the material.
    tip_mass_kg : float
        Everything at the tip, liquid frozen.
    """

    length_m: float
    width_m: float
    thickness_m: float
    youngs_modulus_pa: float
    density_kg_per_m3: float
    tip_mass_kg: float = 0.0

    def __post_init__(self) -> None:
        for name in ("length_m", "width_m", "thickness_m", "youngs_modulus_pa", "density_kg_per_m3"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise AnalysisError(f"beam.{name}", got=f"{getattr(self, name)}", allowed="> 0")
        if not (np.isfinite(self.tip_mass_kg) and self.tip_mass_kg >= 0):
            raise AnalysisError("beam.tip_mass_kg", got=f"{self.tip_mass_kg}", allowed="≥ 0")

    @property
    def mass_per_length_kg_per_m(self) -> float:
        """ρA."""
        return self.density_kg_per_m3 * self.width_m * self.thickness_m

    @property
    def bending_stiffness_n_m2(self) -> float:
        """EI = E b h³/12."""
        return self.youngs_modulus_pa * self.width_m * self.thickness_m**3 / 12


@dataclass(frozen=True)
class BeamModes:
    """Modes of a beam, ψ = 1 at the tip.

    Attributes
    ----------
    frequency_hz : ndarray, shape (n_modes,)
        Undamped natural frequencies.
    modal_mass_kg : ndarray, shape (n_modes,)
        ∫ρAψ² dx + M with ψ(L) = 1.
    base_factor_kg : ndarray, shape (n_modes,)
        ∫ρAψ dx + M: a base acceleration a_s acts as the force −base_factor · a_s (2.31).
    x_m : ndarray, shape (n_points,)
        Distance from the root.
    mode_shape : ndarray, shape (n_points, n_modes)
        ψ, upward positive.
    """

    frequency_hz: FloatArray
    modal_mass_kg: FloatArray
    base_factor_kg: FloatArray
    x_m: FloatArray
    mode_shape: FloatArray

    def to_dataset(self) -> xr.Dataset:
        """Frequencies, masses, base factors and shapes over ``mode_number`` and ``x_m``."""
        variables = {
            "natural_frequency_hz": ("mode_number", self.frequency_hz),
            "modal_mass_kg": ("mode_number", self.modal_mass_kg),
            "base_factor_kg": ("mode_number", self.base_factor_kg),
            "mode_shape": (("x_m", "mode_number"), self.mode_shape),
        }
        coordinates = {"mode_number": np.arange(1, self.frequency_hz.size + 1), "x_m": self.x_m}
        return described(xr.Dataset(variables, coordinates))


def cantilever_modes(beam: Cantilever, *, n_modes: int, x_m: FloatArray | None = None) -> BeamModes:
    """Modes of the cantilever in closed form.

    Parameters
    ----------
    beam : Cantilever
        The beam.
    n_modes : int
        1 … 50.
    x_m : ndarray, shape (n_points,), optional
        Where shapes are wanted, 0 … length, for example the sensors; default 101 points.

    Returns
    -------
    BeamModes

    Raises
    ------
    AnalysisError
        If a point is not on the beam, or the number of modes is not allowed.

    Examples
    --------
    >>> steel = Cantilever(1.0, 0.05, 0.01, 210e9, 7850.0)
    >>> cantilever_modes(steel, n_modes=2).frequency_hz.round(3).tolist()
    [8.355, 52.361]
    """
    if not 1 <= n_modes <= _LARGEST_N_MODES:
        raise AnalysisError("number of beam modes", got=str(n_modes), allowed=f"1 … {_LARGEST_N_MODES}")
    x = np.linspace(0, beam.length_m, 101) if x_m is None else np.atleast_1d(np.asarray(x_m, dtype=np.float64))
    if not ((x >= 0) & (x <= beam.length_m * (1 + 1e-12))).all():
        raise AnalysisError(
            "position along the beam", got=f"{x.min():g} … {x.max():g} m", allowed=f"0 … {beam.length_m:g} m"
        )
    ratio = beam.tip_mass_kg / (beam.mass_per_length_kg_per_m * beam.length_m)
    # only the ratio of tip mass to beam mass enters the wave numbers; stiffness scales them to frequencies
    roots = np.array([_root(n, ratio) for n in range(1, n_modes + 1)])
    speed = np.sqrt(beam.bending_stiffness_n_m2 / beam.mass_per_length_kg_per_m)
    omega = (roots / beam.length_m) ** 2 * speed
    # Gauss points grow with the number of waves along the beam
    nodes, weights = _nodes_and_weights(40 + 4 * n_modes)
    along = 0.5 * (nodes + 1)
    inner = _shapes(roots, along)
    line_mass = 0.5 * weights * beam.mass_per_length_kg_per_m * beam.length_m
    return BeamModes(
        frequency_hz=omega / (2 * np.pi),
        modal_mass_kg=line_mass @ inner**2 + beam.tip_mass_kg,
        base_factor_kg=line_mass @ inner + beam.tip_mass_kg,
        x_m=x,
        mode_shape=_shapes(roots, x / beam.length_m),
    )


def _characteristic(root: float, ratio: float) -> float:
    """The characteristic equation over cosh λ."""
    tangent = np.tanh(root)  # over cosh λ, because cosh and sinh themselves overflow for high modes
    return float(1 / np.cosh(root) + np.cos(root) + ratio * root * (tangent * np.cos(root) - np.sin(root)))


@lru_cache(maxsize=64)
def _nodes_and_weights(n: int) -> tuple[FloatArray, FloatArray]:
    nodes, weights = np.polynomial.legendre.leggauss(n)
    # kept by the cache, and so shared by all callers
    nodes.flags.writeable = weights.flags.writeable = False
    return nodes, weights


@lru_cache(maxsize=1024)
def _root(n: int, ratio: float) -> float:
    """The n-th wave number: between the clamped–pinned root before it and the clamped–free root."""
    # one root in each interval for every tip mass; the first one tends to zero as the mass grows
    low = max((n - 1) * np.pi, 1e-3 / (1 + ratio))
    high = n * np.pi
    return float(brentq(_characteristic, low, high, args=(ratio,), xtol=1e-14, rtol=1e-14))


def _shapes(roots: FloatArray, position: FloatArray) -> FloatArray:
    """ψ with ψ(1) = 1, shape (n_points, n_modes), in exponentials that do not overflow.

    ψ ∝ cosh kx − cos kx − σ (sinh kx − sin kx), σ = (cosh λ + cos λ)/(sinh λ + sin λ): no moment at the tip.
    """
    shapes = []
    for root in roots:
        # everything over e^λ: cosh and sinh of high modes overflow, and their difference has no digits left
        decayed = np.exp(-2 * root)
        sum_c, sum_s = (
            1 + decayed + 2 * np.exp(-root) * np.cos(root),
            1 - decayed + 2 * np.exp(-root) * np.sin(root),
        )
        sigma = sum_c / sum_s
        # 1 − σ = (sinh λ + sin λ − cosh λ − cos λ)/(sinh λ + sin λ) without the difference of large numbers
        rest = 2 * np.exp(-root) * (np.sin(root) - np.cos(root) - np.exp(-root)) / sum_s

        def shape(x: FloatArray, root: float = root, sigma: float = sigma, rest: float = rest) -> FloatArray:
            growing = 0.5 * rest * np.exp(root * x)
            return np.asarray(
                growing + 0.5 * (1 + sigma) * np.exp(-root * x) - np.cos(root * x) + sigma * np.sin(root * x)
            )

        shapes.append(shape(position) / shape(np.ones(1)))
    return np.stack(shapes, axis=1)
