"""Linear substitutes of vertical sloshing in the tanks of a wing: an effective mass (3.14), or a damper (E.8)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import sqrt
from typing import Final, Literal

import xarray as xr

from sloshlab.aircraft.model import AircraftModel
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.viscous_equivalent import (
    damping_at_maximum_kg_per_s,
    damping_mean_over_amplitude_kg_per_s,
    damping_of_maximum_kg_per_s,
)

DamperChoice = Literal["c_1", "c_2", "c_3"]
DAMPER_CHOICES: Final[tuple[DamperChoice, ...]] = ("c_1", "c_2", "c_3")


def with_effective_mass(model: AircraftModel, fraction: float) -> AircraftModel:
    """The model with Δf = −β̂ m_l ü in every tank.

    Parameters
    ----------
    model : AircraftModel
    fraction : float
        β̂; negative where the liquid moves in counter-phase, so that the effective mass is (1 + β̂) m_l. The source
        prints (3.14) with the other sign, which would make the mass grow.
    """
    return replace(model, tanks=tuple(replace(tank, effective_mass_fraction=fraction) for tank in model.tanks))


def with_dampers(model: AircraftModel, damping_n_s_per_m: Mapping[str, float]) -> AircraftModel:
    """The model with Δf = −c u̇ in the tanks that are named.

    Parameters
    ----------
    model : AircraftModel
    damping_n_s_per_m : mapping
        c by the names of tanks.
    """
    return replace(
        model,
        tanks=tuple(
            replace(tank, viscous_damping_n_s_per_m=damping_n_s_per_m.get(tank.name, 0.0)) for tank in model.tanks
        ),
    )


def dampers_of_map(
    model: AircraftModel, w_bar: xr.DataArray, choice: DamperChoice, *, frequency_rad_per_s: float
) -> dict[str, float]:
    """c of every tank by one of the choices of (E.8) [N s/m].

    Parameters
    ----------
    model : AircraftModel
    w_bar : xarray.DataArray
        W̄(omega_bar, u_bar).
    choice : str
        c₁: mean over the amplitude at the frequency; c₂: the largest, where it is; c₃: the largest, as if it were
        at the frequency.
    frequency_rad_per_s : float
        ω_F.

    Raises
    ------
    AnalysisError
        If the map has nothing at the frequency of a tank.
    """
    found = {}
    for tank in model.tanks:
        scales = {"liquid_mass_kg": tank.box.liquid_mass_kg, "tank_height_m": tank.box.height_m}
        omega_bar = frequency_rad_per_s / sqrt(GRAVITY_M_PER_S2 / tank.box.height_m)
        if choice == "c_1":
            found[tank.name] = damping_mean_over_amplitude_kg_per_s(w_bar, omega_bar, **scales)
        elif choice == "c_2":
            found[tank.name] = damping_at_maximum_kg_per_s(w_bar, **scales)
        else:
            found[tank.name] = damping_of_maximum_kg_per_s(w_bar, omega_bar, **scales)
    return found
