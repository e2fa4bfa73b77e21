"""The command `virtual`: runs of the virtual laboratory."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from acquisition.virtual_laboratory.campaign import make_campaign
from acquisition.virtual_laboratory.shaker_run import virtual_shaker_run, write_virtual_run
from pipelines.progress import progress
from sloshlab.errors import InputError
from sloshlab.rig import Rig

_EXPERIMENTS = ("shaker_sweep", "shaker_vfa")


@dataclass(frozen=True)
class VirtualRun:
    """What the virtual laboratory is asked to do."""

    experiment: str
    configuration: str
    acceleration_g: float
    direction: str
    law: str
    duration_s: float
    sampling_rate_hz: float
    seed: int


def make_virtual_run(run: VirtualRun, rig: Path | None, output: Path) -> dict[str, Any]:
    """Make one run and write it.

    Raises
    ------
    InputError
        If the experiment is unknown, no rig is given, or an argument is out of range.
    """
    if run.experiment not in _EXPERIMENTS:
        raise InputError("EXPERIMENT", got=repr(run.experiment), allowed=", ".join((*_EXPERIMENTS, "campaign")))
    if rig is None:
        raise InputError("--rig", got="nothing", allowed="a rig description", remedy="give --rig RIG.toml")
    recording = virtual_shaker_run(
        Rig.from_toml(rig),
        experiment=run.experiment,
        configuration=run.configuration,
        acceleration_g=run.acceleration_g,
        direction=run.direction,
        law=run.law,
        duration_s=run.duration_s,
        sampling_rate_hz=run.sampling_rate_hz,
        seed=run.seed,
        rig_name=rig.name,
    )
    write_virtual_run(recording, output)
    lines = [f"recording: {output} ({recording.sizes['time']} samples at {run.sampling_rate_hz:g} Hz)"]
    return {"lines": lines, "flags": [], "output": str(output)}


def make_campaign_folder(folder: Path, *, seed: int) -> dict[str, Any]:
    """Make the whole campaign of the shaker experiment."""
    with progress("campaign", 40) as advance:
        manifest = make_campaign(folder, seed=seed, progress=lambda done, of, name: advance(name))
    return {"lines": [f"manifest: {manifest}"], "flags": [], "output": str(folder)}
