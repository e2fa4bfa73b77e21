"""What the command says of a simulation beside its recording."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from pipelines.twin.simulation_settings import SimulationSettings
from sloshlab.modal.rig_beam import scale_remarks
from sloshlab.recording import run_attributes
from sloshlab.rig import TANK_MODELS, Rig
from sloshlab.twin.recorded_run import Drive
from sloshlab.twin.simulated_channels import SimulatedRun
from sloshlab.twin.simulation import Simulation

_LARGEST_ENERGY_ERROR = 1e-3
"""Of the energy passed on, before the balance is flagged and more steps are asked for."""


def simulation_summary(
    settings: SimulationSettings,
    rig: Rig,
    recording: xr.Dataset,
    drive: Drive,
    *,
    simulation: Simulation,
    simulated: SimulatedRun,
    n_steps: int,
) -> dict[str, Any]:
    """Lines for a person, flags, and numbers for machines.

    Parameters
    ----------
    settings : SimulationSettings
    rig : Rig
    recording : xarray.Dataset
        What was recorded.
    drive : Drive
    simulation : Simulation
    simulated : SimulatedRun
    n_steps : int
        Per sample.
    """
    error = simulation.relative_energy_error
    flags = [*drive.flags, *simulation.remarks]
    if error > _LARGEST_ENERGY_ERROR:
        flags.append(f"energy balance closes only to {error:.1e} of the energy passed on: give more --steps")
    recorded, now = run_attributes(recording).configuration, simulated.recording.attrs["configuration"]
    lines = [
        f"simulation: {settings.output} ({simulation.time_s.size} samples, {n_steps} steps each)",
        f"driven by: {drive.description}",
        f"forces: {simulated.recording.attrs['simulated_forces']}",
    ]
    if simulation.twin.structure is not None:
        lines.append(f"energy balance: closes to {error:.1e} of the energy passed on")
    if recorded != now:
        lines.append(f"the run is recorded {recorded}, the twin is {now}")
        lines.append(f"to try next: {_to_try(settings, recorded, now)}")
    if simulated.left_out:
        lines.append(f"not simulated: {', '.join(simulated.left_out)}")
    if rig.structure is not None and rig.structure.kind == "beam":
        lines += [f"rig: {remark}" for remark in scale_remarks(rig.structure)]
    return {
        "lines": lines,
        "flags": flags,
        "output": str(settings.output),
        "samples": int(simulation.time_s.size),
        "steps_per_sample": n_steps,
        "driven_by": list(drive.channels),
        "initial_displacement_m": drive.initial_displacement_m,
        "channels": sorted(str(name) for name in simulated.recording.data_vars),
        "left_out": list(simulated.left_out),
        "events": simulation.n_events,
        "relative_energy_error": error,
        "rms": _rms(recording, simulated.recording),
    }


def _to_try(settings: SimulationSettings, recorded: str, now: str) -> str:
    """What makes twin and run alike, where they are not."""
    if settings.configuration != "sloshing":
        return f"leave --configuration {settings.configuration} out, or drive the twin with a run recorded {now}"
    if recorded != "sloshing":
        return f"--configuration {recorded}, or a run recorded sloshing"
    moving = ", ".join(name for name in TANK_MODELS.names if name != "frozen")
    return (
        f"a liquid that moves: tank_model = one of {moving} under [twin] of {settings.rig.name}; or `sloshlab "
        "diagnose` on a case of such runs, which finds what the frozen liquid lacks"
    )


def _rms(recording: xr.Dataset, simulated: xr.Dataset) -> dict[str, dict[str, float]]:
    """Root mean squares of what was recorded, what was simulated, and their difference, per channel."""
    compared = {}
    for name in simulated.data_vars:
        if name not in recording.data_vars or name == "quality":
            continue
        was, now = recording[name].values.astype(float), simulated[name].values
        both = np.isfinite(was) & np.isfinite(now)
        if both.any():
            values = {"recorded": was[both], "simulated": now[both], "difference": now[both] - was[both]}
            compared[str(name)] = {key: float(np.sqrt(np.mean(each**2))) for key, each in values.items()}
    return compared
