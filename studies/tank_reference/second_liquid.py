"""The second liquid of the project at the same points, from what its own study wrote; it may be missing."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from sloshlab.errors import InputError
from studies.steady_state import MeanOverCycles
from studies.tank_reference.comparison import POINTS, PointValues
from studies.tank_reference.points import DrivenPoint

PLACE: Final = Path(__file__).parents[1] / "two_phase_verification" / "shaken.json"
"""Where its study keeps what it computed, if it does."""
_AIR_KG_PER_M3: Final = 1.204
LARGEST_BYTES: Final = 10_000_000
FEWEST_STARTS: Final = 3


def second_liquid(place: Path = PLACE) -> dict[DrivenPoint, PointValues]:
    """W̄ and β at the common points, of the finest usual cases over their starts; nothing if there is no file.

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
        starts: dict[DrivenPoint, dict[float, list[PointValues]]] = {}
        for result in usual:
            point = DrivenPoint(float(result["case"]["acceleration_g"]), float(result["case"]["frequency_hz"]))
            of_point = starts.setdefault(point, {})
            of_point.setdefault(float(result["case"]["cells_per_height"]), []).append(_values(result))
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"{place}", got=repr(error), allowed="results of the second liquid's study") from error
    return {point: _over_starts(starts[point][max(starts[point])]) for point in POINTS if point in starts}


def _is_usual(settings: Mapping[str, Any]) -> bool:
    """Water and air between walls that hold, without what a plane does not have, from any start."""
    return bool(
        settings["surface_tension_n_per_m"] > 0
        and settings["hold"] == 1
        and settings["layer_frequency_hz"] == 0
        and settings.get("gas_density_kg_per_m3", _AIR_KG_PER_M3) == _AIR_KG_PER_M3
    )


def _values(result: Mapping[str, Any]) -> PointValues:
    """Means of one start; results kept before cycles were looked at have no error."""
    w_bar, beta = (
        MeanOverCycles(float(result[name]), float(result.get(f"{name}_error", math.nan)))
        for name in ("w_bar", "beta")
    )
    return PointValues(w_bar, beta)


def _over_starts(starts: list[PointValues]) -> PointValues:
    """Mean over the starts, with the error of their scatter where there are enough to tell, else of the cycles."""
    if len(starts) < FEWEST_STARTS:
        return starts[0]
    means = []
    for name in ("w_bar", "beta"):
        values = np.array([getattr(start, name).value for start in starts])
        means.append(MeanOverCycles(float(values.mean()), float(values.std(ddof=1)) / math.sqrt(values.size)))
    return PointValues(*means)
