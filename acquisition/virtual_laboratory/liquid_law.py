"""What the virtual liquid does: known maps of dissipated work and effective mass.

Both are smooth closed forms of the non-dimensional frequency ω̄ = Ω/√(g/h), the non-dimensional
amplitude ū = u₀/h (their product ū ω̄² is the acceleration a in g) and the fill level α. They are no
theory of sloshing: they are shaped to obey the facts that the measured maps of the vertical-sloshing
tank show (thesis ch. 1, Figs. 1.11–1.21; App. E).

Dissipated work, with x = ln(ω̄/ω̄ₚ), y = ln(ū/ūₚ), G(a) = aⁿ/(aⁿ + aₕⁿ) and s = d ln G/d ln a at aₚ:

    W̄ = W̄ₚ · G(a)/G(aₚ) · (a/aₚ)⁻ˢ · exp(−x²/(2σ²) − k (e^{c y} − 1 − c y)/c²)

The factor (a/aₚ)⁻ˢ takes away the slope of the onset G at the peak, so that the maximum is exactly
W̄ₚ at (ω̄ₚ, ūₚ = aₚ/ω̄ₚ²). For α = 0.5 the two coefficients k and c follow from two published numbers,
see `amplitude_shape_from_means`.

Effective mass, with b(a) = aᵐ/(aᵐ + a_βᵐ):

    β = −(β_q − Δβ b(0.25)) · (1 + t (ω̄/ω̄_c − 1)) − Δβ b(a)

so that the mean over the band 5…20 Hz, whose centre is ω̄_c, is −β_q at 0.25 g.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class LiquidLaw:
    """Coefficients of the law at one fill level, non-dimensional.

    Attributes
    ----------
    work_peak, omega_bar_peak, acceleration_peak
        W̄ₚ, ω̄ₚ and aₚ [g].
    frequency_width
        σ, in ln ω̄.
    amplitude_stiffness, amplitude_skew
        k and c: curvature at the peak in ln ū, and how much steeper the far side falls.
    onset_acceleration, onset_exponent
        aₕ [g] and n: where the free surface breaks and how sharply.
    mass_quiet, mass_change, mass_acceleration, mass_exponent, mass_tilt
        β_q, Δβ, a_β [g], m and t (the only one that is negative).
    """

    work_peak: float
    omega_bar_peak: float
    acceleration_peak: float
    frequency_width: float
    amplitude_stiffness: float
    amplitude_skew: float
    onset_acceleration: float
    onset_exponent: float
    mass_quiet: float
    mass_change: float
    mass_acceleration: float
    mass_exponent: float
    mass_tilt: float

    @property
    def u_bar_peak(self) -> float:
        """ūₚ, where W̄ is largest."""
        return self.acceleration_peak / self.omega_bar_peak**2

    def dissipated_work(self, omega_bar: ArrayLike, u_bar: ArrayLike) -> FloatArray:
        """W̄(ω̄, ū), positive = dissipated."""
        omega, u = _positive(omega_bar), _positive(u_bar)
        acceleration = u * omega**2
        relative = np.log(acceleration / self.acceleration_peak)
        onset = _onset(acceleration, self.onset_acceleration, self.onset_exponent)
        onset_peak = _onset(self.acceleration_peak, self.onset_acceleration, self.onset_exponent)
        slope = self.onset_exponent * (1.0 - float(onset_peak))
        x, y = np.log(omega / self.omega_bar_peak), np.log(u / self.u_bar_peak)
        c = self.amplitude_skew
        distance = (
            x**2 / (2 * self.frequency_width**2) + self.amplitude_stiffness * (np.expm1(c * y) - c * y) / c**2
        )
        # far from the peak the exponential is too small for a float, and no work is right
        with np.errstate(under="ignore"):
            return np.asarray(self.work_peak * onset / onset_peak * np.exp(-slope * relative - distance))

    def effective_mass(self, omega_bar: ArrayLike, u_bar: ArrayLike) -> FloatArray:
        """β(ω̄, ū), negative: the liquid's centre of mass moves against the tank."""
        omega, u = _positive(omega_bar), _positive(u_bar)
        grown = _onset(u * omega**2, self.mass_acceleration, self.mass_exponent)
        grown_quiet = float(_onset(0.25, self.mass_acceleration, self.mass_exponent))
        quiet = self.mass_quiet - self.mass_change * grown_quiet
        return np.asarray(
            -quiet * (1 + self.mass_tilt * (omega / _OMEGA_BAR_CENTRE - 1)) - self.mass_change * grown
        )


# the mean of β over the band is then −β_q at 0.25 g, whatever its tilt
_OMEGA_BAR_CENTRE: Final = 4.1356
"""ω̄ at 12.5 Hz, the middle of the 5…20 Hz band, for the tank of 27.2 mm height."""

_SMALLEST: Final = 1e-12

# Columns in the order of LiquidLaw. The first two of α = 0.5 are what the source prints;
# k and c of α = 0.5 are the solution of `amplitude_shape_from_means`.
LAWS: Final[dict[float, LiquidLaw]] = {
    0.25: LiquidLaw(1.40, 3.60, 3.85, 0.38, 2.10, 4.20, 1.48, 7.0, 0.172, 0.52, 2.6, 2.5, -0.10),
    0.50: LiquidLaw(1.65, 3.78, 3.70, 0.42, 1.66279015, 4.21743097, 1.40, 7.0, 0.154, 0.58, 2.2, 2.5, -0.10),
    0.75: LiquidLaw(0.92, 4.15, 3.75, 0.62, 1.35, 3.60, 1.42, 7.0, 0.131, 0.44, 2.0, 2.5, -0.10),
}
"""Fill level → its law."""

FILL_LEVEL_RANGE: Final = (0.2, 0.8)
"""Between these fill levels coefficients are interpolated; outside nothing is known."""


def liquid_law(fill_level: float) -> LiquidLaw:
    """The law at a fill level: one of `LAWS`, or the parabola through their coefficients.

    Raises
    ------
    InputError
        If the fill level is outside `FILL_LEVEL_RANGE`.

    Examples
    --------
    >>> round(liquid_law(0.5).u_bar_peak, 4)
    0.259
    """
    low, high = FILL_LEVEL_RANGE
    if not low <= fill_level <= high:
        raise InputError(
            "fill level of the virtual liquid",
            got=f"{fill_level:g}",
            allowed=f"{low:g} … {high:g}",
            remedy="the law is known for 0.25, 0.50 and 0.75 only; choose a fill level near them",
        )
    if fill_level in LAWS:
        return LAWS[fill_level]
    z = (fill_level - 0.5) / 0.25
    # parabolas meet the three laws exactly, which are all that is known
    weights = {0.25: z * (z - 1) / 2, 0.50: 1 - z**2, 0.75: z * (z + 1) / 2}
    return LiquidLaw(
        **{
            field.name: sum(weight * getattr(LAWS[level], field.name) for level, weight in weights.items())
            for field in fields(LiquidLaw)
        }
    )


def dissipated_work(omega_bar: ArrayLike, u_bar: ArrayLike, fill_level: float) -> FloatArray:
    """Non-dimensional dissipated work per cycle W̄ = W/(m_l u₀² Ω²) (1.18) of the virtual liquid.

    Parameters
    ----------
    omega_bar, u_bar : array_like
        ω̄ and ū, broadcast; 0 is taken as the limit from above.
    fill_level : float
        α.

    Returns
    -------
    ndarray
        W̄ ≥ 0, positive = dissipated.

    Examples
    --------
    >>> float(dissipated_work(3.78, 3.70 / 3.78**2, 0.5).round(9))
    1.65
    """
    return liquid_law(fill_level).dissipated_work(omega_bar, u_bar)


def effective_mass(omega_bar: ArrayLike, u_bar: ArrayLike, fill_level: float) -> FloatArray:
    """Effective-mass fraction β (1.24) of the virtual liquid; same arguments as `dissipated_work`.

    Examples
    --------
    >>> bool(effective_mass(3.78, 0.26, 0.5) < 0)
    True
    """
    return liquid_law(fill_level).effective_mass(omega_bar, u_bar)


def amplitude_shape_from_means(
    *,
    omega_bar: float = 3.55,
    u_bar: float = 0.162,
    work_there: float = 1.38,
    mean_work: float = 1.274,
    stroke_limit_u_bar: float = 0.0125 / 0.0272,
) -> tuple[float, float]:
    """Find k and c of α = 0.5 from two published numbers (App. E: c_rand and c₁).

    The mean is taken over the measured amplitudes beyond the onset: from the 1 g line to the 6 g line
    or the stroke limit, whichever comes first. Over all amplitudes from 0.25 g the printed mean could
    not be met: with W̄ ≈ 0 below 1 g and W̄ ≤ 1.65 it would need W̄ ≈ 1.67 all the way from ū = 0.162 up.

    Returns
    -------
    tuple of float
        k and c.
    """
    from dataclasses import replace

    from scipy.integrate import quad
    from scipy.optimize import fsolve

    # from the onset at 1 g on: with the amplitudes below no law could have the published mean
    low, high = 1.0 / omega_bar**2, min(6.0 / omega_bar**2, stroke_limit_u_bar)

    def misses(shape: FloatArray) -> list[float]:
        law = replace(LAWS[0.50], amplitude_stiffness=float(shape[0]), amplitude_skew=float(shape[1]))
        total = quad(lambda u: float(law.dissipated_work(omega_bar, u)), low, high, epsabs=1e-12)[0]
        return [float(law.dissipated_work(omega_bar, u_bar)) - work_there, total / (high - low) - mean_work]

    stiffness, skew = fsolve(misses, [1.0, 1.5], xtol=1e-12)
    return float(stiffness), float(skew)


def _onset(acceleration: ArrayLike, half: float, exponent: float) -> FloatArray:
    with np.errstate(under="ignore"):
        return np.asarray(1.0 / (1.0 + (half / np.asarray(acceleration, dtype=float)) ** exponent))


def _positive(values: ArrayLike) -> FloatArray:
    array = np.asarray(values, dtype=float)
    if not np.all(array >= 0):
        raise InputError("ω̄ and ū of the liquid law", got=f"{array.min():g}", allowed="≥ 0")
    return np.asarray(np.maximum(array, _SMALLEST))
