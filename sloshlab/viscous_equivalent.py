"""The viscous damper that dissipates what the sloshing liquid dissipates (Appendix E).

The liquid's force on the tank is approximated by F_S = −c u̇. Equal work per cycle gives
c = (m_l/π) √(g/h) ω̄ Φ_d (E.4), where Φ_d = W̄ is positive when energy is dissipated. The four metrics
below choose one point, or one line, of the measured map W̄(ω̄, ū).
"""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import AnalysisError


def viscous_damping_kg_per_s(
    omega_bar: float, w_bar: float, *, liquid_mass_kg: float, tank_height_m: float
) -> float:
    """Equivalent viscous damping c = (m_l/π) √(g/h) ω̄ W̄ (E.4) [kg/s].

    Parameters
    ----------
    omega_bar : float
        Frequency Ω/√(g/h).
    w_bar : float
        Dissipated work W/(m_l u₀² Ω²), positive = dissipated.
    liquid_mass_kg, tank_height_m : float
        m_l and the inner height h, both > 0.

    Returns
    -------
    float
        c of F_S = −c u̇; positive = dissipated.

    Examples
    --------
    >>> c = viscous_damping_kg_per_s(3.55, 1.65, liquid_mass_kg=0.12433, tank_height_m=0.0272)
    >>> round(c, 2)
    4.4
    """
    for name, value in (("liquid_mass_kg", liquid_mass_kg), ("tank_height_m", tank_height_m)):
        if not (math.isfinite(value) and value > 0):
            raise AnalysisError(name, got=str(value), allowed="> 0")
    # (E.4); the printed c₁ = 3.40 … c_rand = 3.686 kg/s need ω̄₁ = 3.55, though 2π·10.87 Hz/√(g/h) is 3.597
    return liquid_mass_kg / math.pi * math.sqrt(GRAVITY_M_PER_S2 / tank_height_m) * omega_bar * w_bar


def damping_mean_over_amplitude_kg_per_s(
    w_bar: xr.DataArray, omega_bar: float, *, liquid_mass_kg: float, tank_height_m: float
) -> float:
    """c₁ (E.5): W̄ at ω̄ averaged over all measured amplitudes ū [kg/s].

    Parameters
    ----------
    w_bar : xarray.DataArray
        W̄(omega_bar, u_bar), NaN outside the measured region; linear between its grid lines.
    omega_bar : float
        Frequency of the application, for example of the beam's first mode.
    liquid_mass_kg, tank_height_m : float
        As for `viscous_damping_kg_per_s`.
    """
    line = _at_frequency(w_bar, omega_bar)
    u_bar, values = line["u_bar"].values, line.values
    measured = np.isfinite(values)
    if not measured.any():
        raise _outside(f"omega_bar = {omega_bar:g}", w_bar)
    return viscous_damping_kg_per_s(
        omega_bar,
        _mean_over(u_bar, values, measured),
        liquid_mass_kg=liquid_mass_kg,
        tank_height_m=tank_height_m,
    )


def damping_at_maximum_kg_per_s(w_bar: xr.DataArray, *, liquid_mass_kg: float, tank_height_m: float) -> float:
    """c₂ (E.5): largest W̄ of the map at the frequency where it occurs [kg/s]."""
    omega_bar, _, largest = maximum_of(w_bar)
    return viscous_damping_kg_per_s(omega_bar, largest, liquid_mass_kg=liquid_mass_kg, tank_height_m=tank_height_m)


def damping_of_maximum_kg_per_s(
    w_bar: xr.DataArray, omega_bar: float, *, liquid_mass_kg: float, tank_height_m: float
) -> float:
    """c₃ (E.5): largest W̄ of the map, taken as if it occurred at the application's ω̄ [kg/s]."""
    _, _, largest = maximum_of(w_bar)
    return viscous_damping_kg_per_s(omega_bar, largest, liquid_mass_kg=liquid_mass_kg, tank_height_m=tank_height_m)


def damping_at_amplitude_kg_per_s(
    w_bar: xr.DataArray, omega_bar: float, u_bar: float, *, liquid_mass_kg: float, tank_height_m: float
) -> float:
    """c_rand (E.6): W̄ at the application's frequency ω̄ and mean amplitude ū [kg/s]."""
    line = _at_frequency(w_bar, omega_bar)
    value = float(line.interp(u_bar=u_bar))
    if not math.isfinite(value):
        raise _outside(f"(omega_bar, u_bar) = ({omega_bar:g}, {u_bar:g})", w_bar)
    return viscous_damping_kg_per_s(omega_bar, value, liquid_mass_kg=liquid_mass_kg, tank_height_m=tank_height_m)


def maximum_of(w_bar: xr.DataArray) -> tuple[float, float, float]:
    """(ω̄, ū, W̄) of the grid point with the largest W̄; NaN is passed over."""
    grid = _checked(w_bar)
    if not np.isfinite(grid.values).any():
        raise _outside("any point", w_bar)
    row, column = np.unravel_index(int(np.nanargmax(grid.values)), grid.shape)
    return float(grid["omega_bar"][row]), float(grid["u_bar"][column]), float(grid[row, column])


def _checked(w_bar: xr.DataArray) -> xr.DataArray:
    if set(w_bar.dims) != {"omega_bar", "u_bar"}:
        raise AnalysisError("map of w_bar", got=f"dimensions {tuple(w_bar.dims)}", allowed="(omega_bar, u_bar)")
    return w_bar.transpose("omega_bar", "u_bar")


def _at_frequency(w_bar: xr.DataArray, omega_bar: float) -> xr.DataArray:
    return _checked(w_bar).interp(omega_bar=omega_bar)


def _mean_over(u_bar: np.ndarray, values: np.ndarray, measured: np.ndarray) -> float:
    """Mean over the measured stretches of ū, by trapezia; a lone point counts as itself."""
    both = measured[1:] & measured[:-1]
    if not both.any():
        return float(values[measured].mean())
    # only stretches with measured ends: a gap in the map has no mean
    widths = np.diff(u_bar)[both]
    middles = (0.5 * (values[1:] + values[:-1]))[both]
    return float((widths * middles).sum() / widths.sum())


def _outside(place: str, w_bar: xr.DataArray) -> AnalysisError:
    omega_bar, u_bar = w_bar["omega_bar"].values, w_bar["u_bar"].values
    return AnalysisError(
        f"w_bar at {place}",
        got="no measured value",
        allowed=f"omega_bar {omega_bar.min():.3g} … {omega_bar.max():.3g}, "
        f"u_bar {u_bar.min():.3g} … {u_bar.max():.3g}, inside the measured region",
        remedy="measure there, or choose another metric",
    )
