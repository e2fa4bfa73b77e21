"""The second liquid of the project at the same points, from what its own study wrote; it may be missing."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from sloshlab.errors import InputError
from studies.tank_reference.comparison import POINTS, PointValues
from studies.tank_reference.points import DrivenPoint
from studies.tank_reference.steady_state import MeanOverCycles

PLACE: Final = Path(__file__).parents[1] / "two_phase_verification" / "shaken.json"
"""Where its study keeps what it computed, if it does."""
_AIR_KG_PER_M3: Final = 1.204
LARGEST_BYTES: Final = 10_000_000


def second_liquid(place: Path = PLACE) -> dict[DrivenPoint, PointValues]:
    """W̄ and β at the common points, of the finest of the usual cases; nothing where the file is not there.

    Parameters
    ----------
    place : Path
        Results by names, each with its ``case``.

    Raises
    ------
    InputError
        If the file is no such table.
    """
    if not place.is_file():
        return {}
    if place.stat().st_size > LARGEST_BYTES:
        raise InputError(f"{place}", got=f"{place.stat().st_size} bytes", allowed=f"≤ {LARGEST_BYTES}")
    try:
        results = json.loads(place.read_bytes()).values()
        usual = [result for result in results if _is_usual(result["case"])]
        found = {}
        for result in sorted(usual, key=lambda result: float(result["case"]["cells_per_height"])):
            point = DrivenPoint(float(result["case"]["acceleration_g"]), float(result["case"]["frequency_hz"]))
            found[point] = _values(result)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"{place}", got=repr(error), allowed="results of the second liquid's study") from error
    return {point: found[point] for point in POINTS if point in found}


def _is_usual(settings: Mapping[str, Any]) -> bool:
    """Water and air between walls that hold, without what a plane does not have, from the first start."""
    return bool(
        settings["surface_tension_n_per_m"] > 0
        and settings["hold"] == 1
        and settings["layer_frequency_hz"] == 0
        and settings["seed"] == 0
        and settings.get("gas_density_kg_per_m3", _AIR_KG_PER_M3) == _AIR_KG_PER_M3
    )


def _values(result: Mapping[str, Any]) -> PointValues:
    """The study leaves out the first half; the scatter of single cycles is all that it says of chance."""
    error = float(result["w_bar_scatter"]) / math.sqrt(result["case"]["n_cycles"] // 2)
    w_bar, beta = float(result["w_bar"]), float(result["beta"])
    return PointValues(MeanOverCycles(w_bar, error), MeanOverCycles(beta, math.nan))
