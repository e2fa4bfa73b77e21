"""What maps of the second liquid say of the source's facts: ``python -m …two_phase_verification.box_facts``.

Points of steady shaking take the place of windows, and maps between them are those of `sloshlab shaker`; every
level counts as a run.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import xarray as xr

from sloshlab.maps.energy_maps import energy_maps
from sloshlab.rig import Liquid, Rig, Tank
from studies.measured_facts.laboratory import FILLING_LEVEL
from studies.measured_facts.table import Results
from studies.tank_reference.page import fact_table
from studies.tank_reference.points import BOX, WATER_DENSITY_KG_PER_M3, DrivenPoint
from studies.two_phase_verification import box_shaken, shaken
from studies.two_phase_verification.shaken import Shaking

Kept = Mapping[str, Mapping[str, Any]]

BOX_KEPT: Final = Path(__file__).with_name("box_shaken.json")
PLANE_KEPT: Final = Path(__file__).with_name("shaken.json")


def rig_of(filling_level: float) -> Rig:
    """The source's tank with water; no fact depends on its dry mass.

    Parameters
    ----------
    filling_level : float
    """
    return Rig(
        tank=Tank(height_m=BOX.height_m, length_m=BOX.length_m, width_m=BOX.depth_m, dry_mass_kg=0.61),
        liquid=Liquid(density_kg_per_m3=WATER_DENSITY_KG_PER_M3, fill_level=filling_level),
    )


def windows_of(kept: Kept, cases: Sequence[Shaking]) -> xr.Dataset:
    """The runs that are kept of some cases, each as one window of `sloshlab shaker`.

    All count alike in a map: older runs have kept no error.

    Parameters
    ----------
    kept : mapping
        Results by the names of their cases.
    cases : sequence of Shaking
    """
    known = [case for case in cases if case.name in kept]
    found = [kept[case.name] for case in known]
    points = [DrivenPoint(case.acceleration_g, case.frequency_hz) for case in known]
    mass_kg = np.array([rig_of(case.filling_level).liquid_mass_kg for case in known])
    speeds = np.array([point.amplitude_m_per_s2 / point.omega_rad_per_s for point in points])
    w_bar = np.array([run["w_bar"] for run in found])
    columns = {
        "run": np.array([f"{case.acceleration_g:g} g" for case in known]),
        "acceleration_g": np.array([point.acceleration_g for point in points]),
        "frequency_hz": np.array([point.frequency_hz for point in points]),
        "amplitude_m": np.array([point.u_bar * BOX.height_m for point in points]),
        "omega_bar": np.array([point.omega_bar for point in points]),
        "fill_level": np.array([case.filling_level for case in known]),
        "w_bar": w_bar,
        "work_j": w_bar * mass_kg * speeds**2,
        "dissipated_mass_kg": w_bar * mass_kg,
        "dissipated_mass_kg_std": np.zeros(w_bar.size),
        "beta": np.array([run["beta"] for run in found]),
        "beta_std": np.zeros(w_bar.size),
    }
    return xr.Dataset({name: ("window", values) for name, values in columns.items()})


def results_of(kept: Kept, cases: Sequence[Shaking], others: Sequence[Shaking] = ()) -> Results:
    """Windows of all cases, and the map of those that make one.

    Parameters
    ----------
    kept : mapping
    cases : sequence of Shaking
        Of a map of the half-filled tank.
    others : sequence of Shaking, optional
        Which are in no map.
    """
    maps = energy_maps(windows_of(kept, cases), rig_of(FILLING_LEVEL))
    dataset = maps.dataset.expand_dims(fill_level=[FILLING_LEVEL])
    return Results(windows_of(kept, [*cases, *others]), dataset)


def columns() -> dict[str, Results]:
    """The plane and three dimensions, by their names."""
    box, plane = (json.loads(path.read_text(encoding="utf-8")) for path in (BOX_KEPT, PLANE_KEPT))
    in_the_map = (*box_shaken.POINTS["campaign"], *box_shaken.POINTS["weakest"])
    return {
        "plane, h/16": results_of(plane, shaken.CAMPAIGN),
        "three dimensions, h/12": results_of(box, in_the_map, box_shaken.POINTS["fills"]),
    }


def lines(found: Mapping[str, Results]) -> Iterator[str]:
    """Yield the lines of both tables, an empty one between them.

    Parameters
    ----------
    found : mapping
        Of `columns`.
    """
    yield from fact_table("chooses", found)
    yield ""
    yield from fact_table("judges", found)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print both tables.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    argparse.ArgumentParser(description="What maps of liquid and gas say of the source's facts.").parse_args(
        arguments
    )
    sys.stdout.write("\n".join(lines(columns())) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
