"""What is to be computed: box, liquid, gas, grid. What is impossible is refused here, in one line."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from acquisition.numerical_tank.tank import STANDARD_GRAVITY_M_PER_S2, Box, LiquidColumn
from sloshlab.errors import InputError

MOST_CELLS: Final = 400_000
FEWEST_CELLS: Final = 6
"""Along either side."""


@dataclass(frozen=True)
class Fluids:
    """Liquid, gas and the interface between them; the defaults are water and air at 20 °C.

    Attributes
    ----------
    density_kg_per_m3, viscosity_m2_per_s : float
        Of the liquid; the viscosity is kinematic.
    gas_density_kg_per_m3, gas_viscosity_m2_per_s : float
    surface_tension_n_per_m : float
        0 is none.
    """

    density_kg_per_m3: float = 998.2
    viscosity_m2_per_s: float = 1.0e-6
    gas_density_kg_per_m3: float = 1.204
    gas_viscosity_m2_per_s: float = 1.51e-5
    surface_tension_n_per_m: float = 0.0728


@dataclass(frozen=True)
class Walls:
    """What the walls do.

    Attributes
    ----------
    hold : bool
        Whether the fluids do not move along the walls in the plane (no slip).
    layer_frequency_hz : float
        Frequency of the motion whose boundary layers at the walls before and behind the plane slow the liquid
        down, 2 ρ ν/(δ b) per volume with δ = √(ν/πf) and b the depth (Stokes' oscillating plate); 0 is without.
    advancing_angle_deg, receding_angle_deg : float
        Contact angles between which the contact line is free; where both are equal it is the contact angle.
    line_sticks : bool
        Whether the contact line stays where it is between these angles (hysteresis) instead of being free.
    """

    hold: bool = True
    layer_frequency_hz: float = 0.0
    advancing_angle_deg: float = 90.0
    receding_angle_deg: float = 90.0
    line_sticks: bool = False


@dataclass(frozen=True)
class GridNumerics:
    """How it is computed.

    Attributes
    ----------
    courant_number : float
        Largest share of a cell's volume that leaves it in a part of a step; the method conserves liquid up to ½.
    tolerance : float
        Root mean square of the share of a cell's volume that one part of a step may make or lose.
    most_iterations : int
        For the pressure.
    disturbance : float
        Standard deviation of the surface at the start, in cells; what the seed decides.
    longest_step_s : float
        Time step that is not exceeded, for what moves with the tank and asks for shorter ones.
    """

    courant_number: float = 0.45
    tolerance: float = 1e-6
    most_iterations: int = 600
    disturbance: float = 0.01
    longest_step_s: float = 2e-3


@dataclass(frozen=True)
class TwoPhaseSetup:
    """Everything that determines a run apart from the motion of the tank.

    Attributes
    ----------
    box : Box
    column : LiquidColumn
    cells_per_height : int
        Cells over the height of the box.
    fluids : Fluids
    walls : Walls
    numerics : GridNumerics
    gravity_m_per_s2 : float
        g, downward.
    seed : int
        Of the disturbance at the start.
    sampling_rate_hz : float, optional
        If given, the time step is shortened so that a whole number of steps makes a sample.
    """

    box: Box
    column: LiquidColumn
    cells_per_height: int
    fluids: Fluids = Fluids()
    walls: Walls = Walls()
    numerics: GridNumerics = GridNumerics()
    gravity_m_per_s2: float = STANDARD_GRAVITY_M_PER_S2
    seed: int = 0
    sampling_rate_hz: float | None = None

    def __post_init__(self) -> None:
        _check(self)

    @property
    def n_up(self) -> int:
        """Cells over the height."""
        return self.cells_per_height

    @property
    def n_along(self) -> int:
        """Cells over the length: nearly square, and halved as often as those over the height."""
        halved = 1
        while halved < 16 and self.n_up % (2 * halved) == 0 and self.n_up // (2 * halved) >= 3:
            halved *= 2
        wanted = self.box.length_m * self.n_up / self.box.height_m
        return max(round(wanted / halved), 1) * halved

    @property
    def cell_m(self) -> tuple[float, float]:
        """Sides of a cell."""
        return self.box.length_m / self.n_along, self.box.height_m / self.n_up

    @property
    def liquid_mass_kg(self) -> float:
        """Mass of the liquid in the whole depth of the tank."""
        volume = self.column.length_m * self.column.height_m * self.box.depth_m
        return self.fluids.density_kg_per_m3 * volume

    @property
    def fluid_mass_kg(self) -> float:
        """Mass of liquid and gas in the whole depth of the tank."""
        box = self.box.length_m * self.box.height_m - self.column.length_m * self.column.height_m
        return self.liquid_mass_kg + self.fluids.gas_density_kg_per_m3 * box * self.box.depth_m

    @property
    def step_s(self) -> float:
        """Time step: half of what capillary waves allow, a quarter of a cell at √(g H); its parts are shorter."""
        side = min(self.cell_m)
        fluids = self.fluids
        longest = self.numerics.longest_step_s
        if fluids.surface_tension_n_per_m > 0:
            mass = (fluids.density_kg_per_m3 + fluids.gas_density_kg_per_m3) * side**3
            longest = min(longest, 0.5 * math.sqrt(mass / (4 * math.pi * fluids.surface_tension_n_per_m)))
        if self.gravity_m_per_s2 > 0:
            longest = min(longest, 0.25 * side / math.sqrt(self.gravity_m_per_s2 * self.box.height_m))
        stiffest = max(fluids.viscosity_m2_per_s, fluids.gas_viscosity_m2_per_s)
        if stiffest > 0:
            longest = min(longest, 0.1 * side**2 / stiffest)
        if self.sampling_rate_hz is None:
            return longest
        return 1 / (self.sampling_rate_hz * math.ceil(1 / (self.sampling_rate_hz * longest)))

    @property
    def steps_per_sample(self) -> int:
        """Steps in one sample; 1 where no sampling rate was asked for."""
        return 1 if self.sampling_rate_hz is None else round(1 / (self.sampling_rate_hz * self.step_s))


def filled_two_phase_tank(
    box: Box,
    filling_level: float,
    cells_per_height: int,
    *,
    fluids: Fluids | None = None,
    walls: Walls | None = None,
    numerics: GridNumerics | None = None,
    seed: int = 0,
    sampling_rate_hz: float | None = None,
) -> TwoPhaseSetup:
    """Describe a tank filled to a level.

    Parameters
    ----------
    box : Box
    filling_level : float
        Height of the liquid over height of the tank, 0 … 1.
    cells_per_height : int
        Cells over the height of the tank.
    fluids : Fluids, optional
    walls : Walls, optional
    numerics : GridNumerics, optional
    seed : int
        Of the disturbance at the start.
    sampling_rate_hz : float, optional
        If given, a whole number of steps makes a sample.

    Examples
    --------
    >>> tank = filled_two_phase_tank(Box(0.1172, 0.0272, 0.078), 0.5, 48)
    >>> tank.n_along, tank.n_up, round(tank.liquid_mass_kg, 4)
    (208, 48, 0.1241)
    """
    if not 0 < filling_level < 1:
        raise InputError("filling level", got=f"{filling_level}", allowed="0 < level < 1")
    return TwoPhaseSetup(
        box,
        LiquidColumn(box.length_m, filling_level * box.height_m),
        cells_per_height,
        fluids or Fluids(),
        walls or Walls(),
        numerics or GridNumerics(),
        seed=seed,
        sampling_rate_hz=sampling_rate_hz,
    )


_TINY: Final = math.ulp(0.0)
_RANGES: Final = {
    "box": {"length_m": (_TINY, 1e3), "height_m": (_TINY, 1e3), "depth_m": (_TINY, 1e3)},
    "column": {"length_m": (_TINY, 1e3), "height_m": (_TINY, 1e3)},
    "fluids": {
        "density_kg_per_m3": (1e-3, 1e5),
        "gas_density_kg_per_m3": (1e-4, 1e5),
        "viscosity_m2_per_s": (0.0, 1.0),
        "gas_viscosity_m2_per_s": (0.0, 1.0),
        "surface_tension_n_per_m": (0.0, 10.0),
    },
    "walls": {
        "layer_frequency_hz": (0.0, 1e4),
        "advancing_angle_deg": (5.0, 175.0),
        "receding_angle_deg": (5.0, 175.0),
    },
    "numerics": {
        "courant_number": (0.01, 0.5),
        "tolerance": (1e-13, 1e-3),
        "most_iterations": (1, 100_000),
        "disturbance": (0.0, 0.4),
        "longest_step_s": (1e-7, 2e-3),
    },
}


def _check(setup: TwoPhaseSetup) -> None:
    for part, ranges in _RANGES.items():
        for name, (low, high) in ranges.items():
            _check_range(f"{part}.{name}", getattr(getattr(setup, part), name), low, high)
    _check_range("gravity_m_per_s2", setup.gravity_m_per_s2, 0.0, 1e4)
    if setup.sampling_rate_hz is not None:
        _check_range("sampling_rate_hz", setup.sampling_rate_hz, 1.0, 1e6)
    walls = setup.walls
    if walls.receding_angle_deg > walls.advancing_angle_deg:
        raise InputError(
            "walls.receding_angle_deg",
            got=f"{walls.receding_angle_deg:g}",
            allowed=f"at most walls.advancing_angle_deg = {walls.advancing_angle_deg:g}",
        )
    _check_sizes(setup)


def _check_range(what: str, value: float, low: float, high: float) -> None:
    if not (math.isfinite(value) and low <= value <= high):
        raise InputError(what, got=f"{value}", allowed=f"{low:g} … {high:g}")


def _check_sizes(setup: TwoPhaseSetup) -> None:
    box, column = setup.box, setup.column
    for name in ("length_m", "height_m"):
        if getattr(column, name) > getattr(box, name):
            raise InputError(
                f"column.{name}",
                got=f"{getattr(column, name):g}",
                allowed=f"at most box.{name} = {getattr(box, name):g}",
            )
    _check_range("cells over the height", setup.cells_per_height, FEWEST_CELLS, 10_000)
    # by floating-point numbers, before anything is allocated
    cells = setup.cells_per_height**2 * box.length_m / box.height_m
    if not FEWEST_CELLS * setup.cells_per_height <= cells <= MOST_CELLS:
        raise InputError(
            "cells",
            got=f"{cells:.0f}",
            allowed=f"{FEWEST_CELLS * setup.cells_per_height} … {MOST_CELLS}",
            remedy="take other cells over the height",
        )
