"""`response.nc`: gust responses of an aircraft or a wing, case by case and model by model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.aircraft.tank_simulation import FlightResponse
from sloshlab.aircraft.vertical_sloshing import TankDeparture, outside_domain
from sloshlab.errors import AnalysisError
from sloshlab.quantities import described

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RecordedResponse:
    """One model in one gust.

    Attributes
    ----------
    model : str
        ``frozen``, ``lateral``, ``vertical`` or ``full``, or another name.
    response : FlightResponse
    departures : tuple of TankDeparture
        Tanks that left what their model knows.
    """

    model: str
    response: FlightResponse
    departures: tuple[TankDeparture, ...] = ()


@dataclass(frozen=True, eq=False)
class RecordedCase:
    """A gust, and all models that flew through it with the same output step.

    Attributes
    ----------
    name : str
    speed_m_per_s, amplitude_m_per_s, length_m : float
        U, w_ga and L_g; NaN where a gust has none.
    runs : tuple of RecordedResponse
    """

    name: str
    speed_m_per_s: float
    amplitude_m_per_s: float
    length_m: float
    runs: tuple[RecordedResponse, ...]


def response_dataset(cases: Sequence[RecordedCase], node: int) -> xr.Dataset:
    """Put responses side by side; NaN where a simulation had ended, or a model has no such coordinate.

    Parameters
    ----------
    cases : sequence of RecordedCase
        All of one aircraft, with one output step.
    node : int
        Where the angle of attack of a free aircraft is taken, or the acceleration of the tip of a clamped wing.

    Returns
    -------
    xarray.Dataset
        Along ``case``, ``model``, ``time`` and ``tank``, ``mode`` or ``liquid``.

    Raises
    ------
    AnalysisError
        If there is no response, or output steps differ.
    """
    runs = [run for case in cases for run in case.runs]
    if not runs:
        raise AnalysisError("responses to write", got="none", allowed="one at least")
    time = max((run.response.time_s for run in runs), key=len)
    if any(not np.allclose(run.response.time_s, time[: run.response.time_s.size]) for run in runs):
        raise AnalysisError("responses to write", got="different output steps", allowed="the same in all")
    structure = runs[0].response.flight.model.structure
    tanks = [tank.name for tank in runs[0].response.flight.model.tanks]
    modes = [f"mode {number + 1}" for number in range(structure.n_modes)]
    liquids = list(dict.fromkeys(name for run in runs for name in run.response.flight.liquids))
    models = list(dict.fromkeys(run.model for run in runs))

    def filled(values: Any, *labels: Sequence[str]) -> FloatArray:
        """Values of each run, shape (n_cases, n_models, n_times, …)."""
        whole = np.full((len(cases), len(models), time.size, *(len(label) for label in labels)), np.nan)
        for row, case in enumerate(cases):
            for run in case.runs:
                whole[row, models.index(run.model), : run.response.time_s.size] = values(run)
        return whole

    motion, seen = _motion_at(node, is_free=structure.is_free)
    along = ("case", "model", "time")
    variables = {
        motion: (along, filled(lambda run: seen(run.response))),
        "modal_coordinate": ((*along, "mode"), filled(lambda run: largest_displacements(run.response), modes)),
        "tank_acceleration": (
            (*along, "tank"), filled(lambda run: run.response.tank_acceleration_m_per_s2, tanks)
        ),
        "sloshing_force": ((*along, "tank"), filled(lambda run: run.response.force_n, tanks)),
        "sloshing_coordinate": (
            (*along, "liquid"), filled(lambda run: _displacements(run.response, liquids), liquids)
        ),
        "outside_domain": (
            (*along, "tank"), filled(lambda run: outside_domain(run.response, run.departures), tanks)
        ),
        "w_gust": (("case", "time"), _gusts(cases, time.size)),
        "gust_speed": ("case", [case.speed_m_per_s for case in cases]),
        "gust_amplitude": ("case", [case.amplitude_m_per_s for case in cases]),
        "gust_length": ("case", [case.length_m for case in cases]),
        "ending": (("case", "model"), _endings(cases, models)),
    }  # fmt: skip
    names = {
        "case": [case.name for case in cases],
        "model": models,
        "tank": tanks,
        "mode": modes,
        "liquid": liquids,
    }
    coordinates = {name: np.array(labels, dtype=object) for name, labels in names.items()}
    return described(xr.Dataset(variables, coords={"time": time, **coordinates}))


def _motion_at(node: int, *, is_free: bool) -> tuple[str, Any]:
    if is_free:
        return "angle_of_attack", lambda response: response.angle_of_attack_at(node)
    return "tip_acceleration", lambda response: response.acceleration_at(node)


def largest_displacements(response: FlightResponse) -> FloatArray:
    """Each mode as the displacement [m] of the node that it moves farthest, shape (n_times, n_modes).

    A mode then has unit tip displacement, whatever its modal mass.
    """
    structure = response.flight.model.structure
    farthest = np.linalg.norm(structure.shapes[:, :, :3], axis=2).max(axis=1)
    first = response.flight.to_structure.shape[0] - structure.n_modes
    return np.asarray(response.states[:, first : first + structure.n_modes] * farthest)


def _displacements(response: FlightResponse, liquids: Sequence[str]) -> FloatArray:
    """Of sideways masses by name, shape (n_times, n_liquids); NaN where the linear part does not have one."""
    found = np.full((response.time_s.size, len(liquids)), np.nan)
    found[:, [liquids.index(name) for name in response.flight.liquids]] = response.liquid_displacement_m
    return found


def _gusts(cases: Sequence[RecordedCase], n_times: int) -> FloatArray:
    whole = np.full((len(cases), n_times), np.nan)
    for row, case in enumerate(cases):
        longest = max((run.response.wind for run in case.runs), key=len, default=np.zeros((0, 2)))
        whole[row, : len(longest)] = longest[:, 0]
    return whole


def _endings(cases: Sequence[RecordedCase], models: Sequence[str]) -> npt.NDArray[Any]:
    endings = np.full((len(cases), len(models)), "", dtype=object)
    for row, case in enumerate(cases):
        for run in case.runs:
            endings[row, models.index(run.model)] = run.response.ending
    return endings
