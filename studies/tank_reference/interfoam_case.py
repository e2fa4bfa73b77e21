"""The folder of an OpenFOAM case: the box of the numerical tank, half filled, moved by a given acceleration.

The computation runs in the frame of the tank; the body force is −(g + ü), tabulated. Dictionaries that are the
same for every case lie in ``case/``, with ``@names`` for what differs. The surface at the start is flat but for a
disturbance of a hundredth of the height, without which nothing would ever begin.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank.forced_motion import HarmonicMotion
from acquisition.numerical_tank.tank import STANDARD_GRAVITY_M_PER_S2
from sloshlab import atomic_file
from sloshlab.errors import InputError
from studies.tank_reference.points import (
    BOX,
    FILLING_LEVEL,
    RISE_CYCLES,
    WATER_DENSITY_KG_PER_M3,
    DrivenPoint,
)

FloatArray = NDArray[np.float64]
TEMPLATES: Final = Path(__file__).parent / "case"
MOST_CELLS: Final = 2_000_000
FEWEST_CELLS_OVER_HEIGHT: Final = 4
STEPS_PER_CYCLE: Final = 100
"""Of the table of the acceleration, and the fewest of the computation."""
DISTURBANCE: Final = 0.01
"""Root mean square of the surface at the start, over the height of the box."""
_DISTURBED_MODES: Final = 12
_LOOK_INTERVAL: Final = 4
"""Steps between two looks at gradients, which cost more than forces."""


class _CaseTemplate(Template):
    delimiter = "@"  # `$` is OpenFOAM's own


@dataclass(frozen=True)
class InterfoamCase:
    """What is computed; defaults are water and air at 20 °C between walls that hold.

    Attributes
    ----------
    point : DrivenPoint
    cells_over_height : int
        Cubes (squares) of this size along all directions.
    n_cycles : int
        In all, three of them of rising amplitude.
    solver : {"interFoam", "interIsoFoam"}
        Algebraic or geometric volume of fluid.
    walls : {"noSlip", "slip"}
    surface_tension_n_per_m : float
        σ.
    contact_angle_deg : float
        Static, measured in the water.
    gas_density_kg_per_m3, gas_viscosity_pa_s : float
        Of a gas that does not yield to pressure.
    water_viscosity_m2_per_s : float
        ν.
    courant_number : float
        Largest.
    dimensions : {2, 3}
    seed : int
        Of the disturbance of the surface at the start.
    """

    point: DrivenPoint
    cells_over_height: int = 24
    n_cycles: int = 30
    solver: Literal["interFoam", "interIsoFoam"] = "interFoam"
    walls: Literal["noSlip", "slip"] = "noSlip"
    surface_tension_n_per_m: float = 0.0728
    contact_angle_deg: float = 90.0
    gas_density_kg_per_m3: float = 1.2
    gas_viscosity_pa_s: float = 1.8e-5
    water_viscosity_m2_per_s: float = 1.0e-6
    courant_number: float = 0.5
    dimensions: Literal[2, 3] = 2
    seed: int = 0

    def __post_init__(self) -> None:
        for name, low, high in (
            ("cells_over_height", FEWEST_CELLS_OVER_HEIGHT, 10_000),
            ("n_cycles", 1, 100_000),
            ("surface_tension_n_per_m", 0.0, 10.0),
            ("contact_angle_deg", 0.0, 180.0),
            ("gas_density_kg_per_m3", 1e-6, WATER_DENSITY_KG_PER_M3),
            ("gas_viscosity_pa_s", 0.0, 1.0),
            ("water_viscosity_m2_per_s", 0.0, 1.0),
            ("courant_number", 0.01, 1.0),
        ):
            if not low <= getattr(self, name) <= high:
                raise InputError(name, got=f"{getattr(self, name)}", allowed=f"{low:g} … {high:g}")
        if math.prod(self.cells) > MOST_CELLS:
            raise InputError(
                "cells", got=f"{math.prod(self.cells)}", allowed=f"at most {MOST_CELLS}", remedy="take larger ones"
            )

    @property
    def cells(self) -> tuple[int, int, int]:
        """Along the length, over the height, across the depth."""
        size = BOX.height_m / self.cells_over_height
        across = 1 if self.dimensions == 2 else round(BOX.depth_m / size)
        return round(BOX.length_m / size), self.cells_over_height, across

    @property
    def duration_s(self) -> float:
        """Of the motion."""
        return self.n_cycles / self.point.frequency_hz

    @property
    def motion(self) -> HarmonicMotion:
        """Acceleration of the tank, as the numerical tank is moved."""
        rise_s = RISE_CYCLES / self.point.frequency_hz
        return HarmonicMotion(self.point.amplitude_m_per_s2, self.point.frequency_hz, rise_s=rise_s)


def case_files(case: InterfoamCase) -> dict[str, str]:
    """Texts of all files of a case by their places in its folder.

    Parameters
    ----------
    case : InterfoamCase
    """
    values = _values(case)
    files = {
        place.relative_to(TEMPLATES).as_posix(): _CaseTemplate(place.read_text(encoding="utf-8")).substitute(
            values
        )
        for place in sorted(TEMPLATES.rglob("*"))
        if place.is_file()
    }
    files["constant/acceleration.dat"] = _acceleration_table(case)
    n_along, n_over, n_across = case.cells
    heights = (np.arange(n_over) + 0.5) * BOX.height_m / n_over
    shape = (n_across, n_over, n_along)
    files["0/alpha.water"] = _field(
        "alpha.water", "[0 0 0 0 0 0 0]", filled_share(case), case, _contact(case.contact_angle_deg)
    )
    files["0/heightAboveFloor"] = _field(
        "heightAboveFloor", "[0 1 0 0 0 0 0]", np.broadcast_to(heights[None, :, None], shape), case, _FLAT
    )
    return files


def inputs_hash(case: InterfoamCase) -> str:
    """SHA-256 of the solver's name and of all files of a case, each after its place.

    Parameters
    ----------
    case : InterfoamCase
    """
    digest = hashlib.sha256(case.solver.encode())
    for place, text in sorted(case_files(case).items()):
        digest.update(f"\n{place}\n{text}".encode())
    return digest.hexdigest()


def write_case(case: InterfoamCase, folder: Path) -> None:
    """Write a case.

    Parameters
    ----------
    case : InterfoamCase
    folder : Path
        Made if it is not there.
    """
    for place, text in case_files(case).items():
        (folder / place).parent.mkdir(parents=True, exist_ok=True)
        atomic_file.write_bytes(folder / place, text.encode())


def filled_share(case: InterfoamCase) -> FloatArray:
    """Share of water of every cell at the start: exact below a disturbed surface.

    Parameters
    ----------
    case : InterfoamCase

    Returns
    -------
    ndarray, shape (n_across, n_over, n_along)
        Of the order in which OpenFOAM counts the cells of a block.
    """
    n_along, n_over, n_across = case.cells
    random = np.random.default_rng(case.seed)
    across = _cosines(n_across, 1 if case.dimensions == 2 else _DISTURBED_MODES)
    along = _cosines(n_along, _DISTURBED_MODES + 1)
    amplitudes = random.standard_normal((across.shape[0], along.shape[0]))
    surface = across.T @ amplitudes @ along
    surface -= surface.mean()
    surface *= DISTURBANCE * n_over / surface.std()
    below = FILLING_LEVEL * n_over + surface[:, None, :] - np.arange(n_over)[None, :, None]
    return np.asarray(np.clip(below, 0.0, 1.0))


def _cosines(n_cells: int, n_modes: int) -> FloatArray:
    """Modes of a box in the middles of cells, shape (n_modes, n_cells)."""
    return np.cos(np.pi * np.arange(n_modes)[:, None] * (np.arange(n_cells) + 0.5) / n_cells)


_FLAT: Final = "type zeroGradient;"


def _contact(angle_deg: float) -> str:
    # at a right angle the surface meets the wall without a force, which a gradient of zero says as well
    if angle_deg == 90.0:
        return _FLAT
    return f"type constantAlphaContactAngle; theta0 {angle_deg:g}; limit gradient; value uniform 0;"


def _field(name: str, dimensions: str, values: FloatArray, case: InterfoamCase, at_walls: str) -> str:
    numbers = " ".join(f"{value:.6g}" for value in values.ravel())
    sides = "type empty;" if case.dimensions == 2 else at_walls
    return (
        f"FoamFile {{ version 2.0; format ascii; class volScalarField; object {name}; }}\n\n"
        f"dimensions {dimensions};\ninternalField nonuniform List<scalar> {values.size} ({numbers});\n"
        f"boundaryField {{ walls {{ {at_walls} }} sides {{ {sides} }} }}\n"
    )


def _acceleration_table(case: InterfoamCase) -> str:
    """Times, and acceleration, angular velocity and angular acceleration at each; a little longer than the run."""
    step = 1 / (STEPS_PER_CYCLE * case.point.frequency_hz)
    times = np.asarray(np.arange(STEPS_PER_CYCLE * case.n_cycles + 10) * step, np.float64)
    values = case.motion(times).round(9) + 0.0  # no negative zero
    lines = (
        f"({time:.9g} ((0 {value:.7g} 0) (0 0 0) (0 0 0)))" for time, value in zip(times, values, strict=True)
    )
    return "(\n" + "\n".join(lines) + "\n)\n"


def _values(case: InterfoamCase) -> Mapping[str, str]:
    n_along, n_over, n_across = case.cells
    is_flat = case.dimensions == 2
    step = 1 / (STEPS_PER_CYCLE * case.point.frequency_hz)
    numbers = {
        "length": BOX.length_m,
        "height": BOX.height_m,
        "depth": BOX.depth_m,
        "gravity": STANDARD_GRAVITY_M_PER_S2,
        "end_time": case.duration_s,
        "first_step": step / 10,
        "longest_step": step,
        "courant_number": case.courant_number,
        "water_density": WATER_DENSITY_KG_PER_M3,
        "water_viscosity": case.water_viscosity_m2_per_s,
        "gas_density": case.gas_density_kg_per_m3,
        "gas_viscosity": case.gas_viscosity_pa_s / case.gas_density_kg_per_m3,
        "surface_tension": case.surface_tension_n_per_m,
    }
    words = {
        "n_along": str(n_along),
        "n_over": str(n_over),
        "n_across": str(n_across),
        "look_interval": str(_LOOK_INTERVAL),
        "wall_condition": case.walls,
        "wall_patches": "walls" if is_flat else "walls sides",
        "side_type": "empty" if is_flat else "wall",
        "side_velocity": "type empty;" if is_flat else f"type {case.walls};",
        "side_pressure": "type empty;" if is_flat else "type fixedFluxPressure; value uniform 0;",
    }
    return words | {name: f"{number:.9g}" for name, number in numbers.items()}
