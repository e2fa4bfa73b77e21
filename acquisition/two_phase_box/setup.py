"""What is to be computed: the setup of the plane's tank, and how deep."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from acquisition.numerical_tank.tank import Box
from acquisition.two_phase_tank.setup import TwoPhaseSetup
from sloshlab.errors import InputError

MOST_CELLS: Final = 4_000_000
_FEWEST_HALVED: Final = 3


@dataclass(frozen=True)
class TwoPhaseBoxSetup:
    """Everything that determines a run apart from the motion of the tank.

    Attributes
    ----------
    plane : TwoPhaseSetup
        Box, column, cells over the height, fluids, walls, numerics; the column of liquid has the depth of the box.
    cells_deep : int, optional
        Cells over the depth; nearly as wide as high if not given. 1 is the plane.
    hold_front_and_back : bool
        Whether the fluids do not move along the walls before and behind; as the others if not given.
    """

    plane: TwoPhaseSetup
    cells_deep: int | None = None
    hold_front_and_back: bool | None = None

    def __post_init__(self) -> None:
        walls = self.plane.walls
        if walls.layer_frequency_hz > 0:
            raise InputError(
                "walls.layer_frequency_hz",
                got=f"{walls.layer_frequency_hz:g}",
                allowed="0: the walls before and behind are computed",
            )
        if walls.line_sticks or {walls.advancing_angle_deg, walls.receding_angle_deg} != {90.0}:
            raise InputError(
                "walls",
                got="contact angles other than 90°, or a line that sticks",
                allowed="90°, free",
                remedy="take the plane's tank",
            )
        if self.cells_deep is not None and self.cells_deep < 1:
            raise InputError("cells over the depth", got=f"{self.cells_deep}", allowed="1 and more")
        if (cells := self.plane.n_along * self.n_deep * self.plane.n_up) > MOST_CELLS:
            remedy = "take fewer over the height"
            raise InputError("cells", got=f"{cells}", allowed=f"at most {MOST_CELLS}", remedy=remedy)

    @property
    def box(self) -> Box:
        """The tank."""
        return self.plane.box

    @property
    def n_deep(self) -> int:
        """Cells over the depth: nearly cubes, and halved as often as those over the height."""
        if self.cells_deep is not None:
            return self.cells_deep
        up, halved = self.plane.n_up, 1
        while halved < 16 and up % (2 * halved) == 0 and up // (2 * halved) >= _FEWEST_HALVED:
            halved *= 2
        wanted = self.box.depth_m * up / self.box.height_m
        return max(round(wanted / halved), 1) * halved

    @property
    def cells(self) -> tuple[int, int, int]:
        """Cells along x, y and z."""
        return self.plane.n_along, self.n_deep, self.plane.n_up

    @property
    def cell_m(self) -> tuple[float, float, float]:
        """Sides of a cell."""
        dx, dz = self.plane.cell_m
        return dx, self.box.depth_m / self.n_deep, dz

    @property
    def hold(self) -> tuple[float, float, float]:
        """1 where the walls across an axis hold the fluids, 0 where they slip."""
        walls = self.plane.walls.hold
        deep = walls if self.hold_front_and_back is None else self.hold_front_and_back
        return float(walls), float(deep), float(walls)

    @property
    def liquid_mass_kg(self) -> float:
        """Mass of the liquid."""
        return self.plane.liquid_mass_kg

    @property
    def fluid_mass_kg(self) -> float:
        """Mass of liquid and gas."""
        return self.plane.fluid_mass_kg

    @property
    def step_s(self) -> float:
        """Time step, as in the plane; its parts are shorter."""
        return self.plane.step_s

    @property
    def steps_per_sample(self) -> int:
        """Steps in one sample; 1 where no sampling rate was asked for."""
        return self.plane.steps_per_sample
