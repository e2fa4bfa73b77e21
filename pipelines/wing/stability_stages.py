"""Stages of a wing's stability: root locus, p-k, effective mass, fill level, energy maps, limit cycles."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.aircraft.tank_models import TankModels
from pipelines.flutter.analysis import Stability, stability_of
from pipelines.flutter.problem import Variant
from pipelines.wing.gust_stages import OUTPUT_STEP_S, flight_at, gust_of, tip_node
from pipelines.wing.results import (
    HIGHEST_SPEED_M_PER_S,
    LOWEST_SPEED_M_PER_S,
    SMALL_GUST_M_PER_S,
    Bifurcation,
    EnergyBalance,
    FillCurve,
    WingSettings,
)
from sloshlab.aeroelastic.root_locus import Crossing, first_flutter
from sloshlab.aircraft.beam_wing import wing_model
from sloshlab.aircraft.flight_stability import flight_system
from sloshlab.aircraft.limit_cycle import BranchPoint, Settling, followed, settle
from sloshlab.aircraft.linear_flight import LinearFlight
from sloshlab.aircraft.linear_sloshing import with_effective_mass
from sloshlab.aircraft.model import AircraftModel
from sloshlab.aircraft.wing_air import WingAir
from sloshlab.aircraft.wing_calibration import WingState, frozen_locus
from sloshlab.aircraft.wing_energy import EnergyMap, critical_mode, energy_map
from sloshlab.aircraft.wing_file import WingDescription
from sloshlab.maps.map_readings import mean_along_acceleration

FloatArray = npt.NDArray[np.float64]
Advance = Callable[[str], None]
FILL_LEVELS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.99)
_LOW_LEVEL_G = 0.25
"""Where the source reads the effective mass of its map."""
_LARGEST_AMPLITUDE_M = 0.3
_N_AMPLITUDES = 300
_ENERGY_STEP_M_PER_S = 0.25
_SEARCHED_M_PER_S = (150.0, 450.0)
_N_SEARCHED = 31
"""Where flutter is looked for at other fill levels and with effective masses."""


def locus_speeds(settings: WingSettings) -> FloatArray:
    """Of the root locus, as of the source."""
    return np.linspace(LOWEST_SPEED_M_PER_S, HIGHEST_SPEED_M_PER_S, settings.n_speeds)


def frozen_stability(state: WingState, speeds: FloatArray, advance: Advance) -> Stability:
    """Root locus and p-k with frozen liquids."""
    density = state.model.density_kg_per_m3
    system = flight_system(state.model, state.air.motion, "frozen", density_kg_per_m3=density)
    variant = Variant("frozen", system.structure, state.air.table.at, system.matrix_at)
    return stability_of(variant, state.air.motion, density, speeds, advance)


def flutter_with_effective_mass(state: WingState, fractions: Sequence[float]) -> Mapping[float, Crossing | None]:
    """First flutter with β̂ in all tanks, for each β̂."""
    return {
        fraction: _first_flutter(with_effective_mass(state.model, fraction), state.air) for fraction in fractions
    }


def _first_flutter(model: AircraftModel, air: WingAir) -> Crossing | None:
    system = flight_system(model, air.motion, "frozen", density_kg_per_m3=model.density_kg_per_m3)
    return first_flutter(system.matrix_at, np.linspace(*_SEARCHED_M_PER_S, _N_SEARCHED))


def fill_curve(described: WingDescription, air: WingAir, advance: Advance) -> FillCurve:
    """Flutter over the fill level of all tanks.

    Parameters
    ----------
    described : WingDescription
    air : WingAir
        On the modes, which the liquid does not change.
    advance : callable
    """
    found = []
    for level in FILL_LEVELS:
        # an empty tank is none; the equations need a free surface, so the fullest is nearly full
        filled = tuple(tank.model_copy(update={"fill_level": level}) for tank in described.tanks) if level else ()
        damped = wing_model(described.model_copy(update={"tanks": filled or described.tanks}))
        model = damped if level else _without_tanks(damped)
        found.append(_first_flutter(model, air))
        advance(f"fill level {level:g}")
    return FillCurve(
        np.array(FILL_LEVELS),
        np.array([np.nan if one is None else one.speed_m_per_s for one in found]),
        np.array([np.nan if one is None else one.frequency_rad_per_s for one in found]),
    )


def _without_tanks(model: AircraftModel) -> AircraftModel:
    return replace(model, tanks=())


def energy_balance(state: WingState, maps: xr.Dataset, settings: WingSettings) -> EnergyBalance | None:
    """Energy maps of the branch that flutters, with frozen liquids and with their effective mass at low level.

    Parameters
    ----------
    state : WingState
    maps : xarray.Dataset
        `w_bar` and `beta`.
    settings : WingSettings

    Returns
    -------
    EnergyBalance or None
        None if the wing does not flutter.
    """
    if state.flutter is None:
        return None
    beta = mean_along_acceleration(maps["beta"], _LOW_LEVEL_G)
    beta = beta if np.isfinite(beta) else 0.0
    both = [energy_of(state, maps["w_bar"], fraction, settings) for fraction in (0.0, beta)]
    return EnergyBalance(both[0], both[1], beta)


def energy_of(state: WingState, w_bar: xr.DataArray, fraction: float, settings: WingSettings) -> EnergyMap:
    """One energy map, in the mode that the wing has with an effective mass."""
    assert state.flutter is not None
    model, density = with_effective_mass(state.model, fraction), state.model.density_kg_per_m3
    # from below flutter, and so far that the highest speed of the bifurcation is inside
    speeds = np.arange(settings.first_m_per_s - 6, settings.last_m_per_s + 10.01, _ENERGY_STEP_M_PER_S)
    locus = frozen_locus(model, state.air, speeds)
    system = flight_system(model, state.air.motion, "frozen", density_kg_per_m3=density)
    tip = model.structure.motion_at(tip_node(model))[2]
    mode = critical_mode(locus, system.matrix_at, state.flutter.origin, tip)
    amplitudes = _LARGEST_AMPLITUDE_M * np.arange(1, _N_AMPLITUDES + 1) / _N_AMPLITUDES
    return energy_map(mode, model, state.air.table, w_bar, amplitudes)


def bifurcation(
    state: WingState, tanks: TankModels, settings: WingSettings, speeds: FloatArray, advance: Advance
) -> Bifurcation:
    """Limit cycles from rest, and continued with rising and falling speed.

    Parameters
    ----------
    state : WingState
    tanks : TankModels
    settings : WingSettings
    speeds : ndarray
        Ascending.
    advance : callable
        Told each speed, three times.
    """
    settling = Settling(longest_s=settings.longest_s, output_step_s=OUTPUT_STEP_S)
    node = tip_node(state.model)
    gust = gust_of(state, settings, float(speeds[0]), SMALL_GUST_M_PER_S)

    def at(speed: float) -> LinearFlight:
        return flight_at(state.model, state.air, speed)

    forces = tanks.forces()
    up, last = followed(at, forces, node, speeds.tolist(), settling, first_gust=gust, advance=advance)
    kept = [point.speed_m_per_s for point in up if not point.ending]
    if len(kept) < len(up):
        # the models went wild with the last motion; the branch is begun anew at the last speed that kept one
        forces, last = tanks.forces(), None
    falling = sorted(kept, reverse=True)
    down, _ = followed(at, forces, node, falling, settling, first_gust=gust, start=last, advance=advance)
    rest: list[BranchPoint] = []
    for speed in speeds.tolist():
        small = gust_of(state, settings, speed, SMALL_GUST_M_PER_S)
        rest.append(settle(at(speed), tanks.forces(), node, settling, gust=small).point)
        advance(f"from rest, {speed:.2f} m/s")
    return Bifurcation(tuple(rest), tuple(up), tuple(down))


def with_smaller_tanks(described: WingDescription, share: float) -> WingDescription:
    """The wing with smaller tanks of the same shape.

    Parameters
    ----------
    described : WingDescription
    share : float
        Of the volume, > 0.
    """
    side = share ** (1 / 3)
    sides = ("length_m", "width_m", "height_m")
    tanks = tuple(
        tank.model_copy(update={name: getattr(tank, name) * side for name in sides}) for tank in described.tanks
    )
    return described.model_copy(update={"tanks": tanks})
