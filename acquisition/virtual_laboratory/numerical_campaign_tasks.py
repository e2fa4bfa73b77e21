"""Which runs a campaign of a computed liquid makes, how finely, and at what cost."""

from __future__ import annotations

import fnmatch
import hashlib
import json
import math
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

from acquisition.numerical_tank.tank import TankSetup
from acquisition.two_phase_tank.setup import TwoPhaseSetup
from acquisition.virtual_laboratory.campaign import (
    CAMPAIGN_LABORATORY,
)
from acquisition.virtual_laboratory.numerical_liquid import numerical_setup, two_phase_setup
from acquisition.virtual_laboratory.numerical_runs import RIG_TEXTS, NumericalRun
from sloshlab._version import __version__
from sloshlab.errors import InputError
from sloshlab.rig import Rig

CHECKPOINTS_NAME: Final = ".checkpoints"
_SAMPLING_RATE_HZ: Final = 512.0

_FIRST_SEED: Final = 500
"""Other seeds than those of the campaign whose liquid follows a law."""

# of a quarter filled at h/16 four layers would be left; six of h/24 are as many as of 3/8 at h/16
_SHALLOWEST_FILL: Final = 0.375  # a shallower liquid is computed more finely


@dataclass(frozen=True)
class CampaignSettings:
    """How a campaign is made.

    Attributes
    ----------
    seed : int
        Of noise, motion and liquid.
    layers_per_height : int
        Resolution: height of the tank over the distance of the particles, or over the side of a cell; half as fine
        again at α = 0.25.
    n_workers : int
        Processes.
    only : str
        Pattern of the names of the runs to be made, as of files.
    checkpoints : path-like, optional
        Folder of the checkpoints; by default one within the campaign's.
    laboratory_seed : int, optional
        Of the laboratory that serves all runs; None for one that is as the rigs tell.
    overwrite : bool
        Whether recordings may be replaced that the manifest does not name.
    with_gas : bool
        Whether liquid and gas are computed on a grid; else the liquid alone as particles.
    """

    seed: int = 0
    layers_per_height: int = 16
    n_workers: int = 2
    only: str = "*"
    checkpoints: str | os.PathLike[str] | None = None
    laboratory_seed: int | None = CAMPAIGN_LABORATORY
    overwrite: bool = False
    with_gas: bool = False


@dataclass(frozen=True)
class CampaignTask:
    """One run of a campaign, as a worker is told it: places, seeds and resolution."""

    run: NumericalRun
    recording: Path
    checkpoint: Path
    seed: int
    layers_per_height: int
    laboratory_seed: int | None
    with_gas: bool


def campaign_tasks(folder: Path, settings: CampaignSettings, runs: Sequence[NumericalRun]) -> list[CampaignTask]:
    """The tasks of a campaign.

    Raises
    ------
    InputError
        If a setting is out of range, or no run has such a name.
    """
    for name, number in (("seed", settings.seed), ("laboratory seed", settings.laboratory_seed or 0)):
        if number < 0:
            raise InputError(f"{name} of the campaign", got=str(number), allowed="≥ 0")
    chosen = [run for run in runs if fnmatch.fnmatchcase(run.name, settings.only)]
    if not chosen:
        names = ", ".join(run.name for run in runs[:2])
        raise InputError("--only", got=repr(settings.only), allowed=f"a pattern of names such as {names}")
    return [_task(folder, settings, run) for run in chosen]


def _task(folder: Path, settings: CampaignSettings, run: NumericalRun) -> CampaignTask:
    """What a worker is told; what cannot be computed is refused here, before hours are spent on others."""
    task = CampaignTask(
        run,
        folder / f"{run.name}.nc",
        Path(),
        1000 * settings.seed + _FIRST_SEED + run.number,
        _layers_per_height(settings, run),
        settings.laboratory_seed,
        settings.with_gas,
    )
    kept_in = Path(settings.checkpoints or folder / CHECKPOINTS_NAME)
    # the hash in the name, so that a checkpoint of other settings is not taken up, nor lost
    checkpoint = kept_in / f"{run.name.replace('/', '_')}_{made_of(task)[:12]}.checkpoint"
    return replace(task, checkpoint=checkpoint)


def _layers_per_height(settings: CampaignSettings, run: NumericalRun) -> int:
    """A shallow liquid is computed more finely, so that it is as many particles deep as one that fills 3/8."""
    fill_level = Rig.from_toml_text(RIG_TEXTS[run.rig]).liquid.fill_level
    return max(settings.layers_per_height, math.ceil(_SHALLOWEST_FILL * settings.layers_per_height / fill_level))


def setup_of(task: CampaignTask) -> TankSetup | TwoPhaseSetup | None:
    """The computed tank of a run; None where no liquid moves."""
    if not task.run.is_computed:
        return None
    rig = Rig.from_toml_text(RIG_TEXTS[task.run.rig])
    common: dict[str, Any] = {"seed": task.seed, "sampling_rate_hz": _SAMPLING_RATE_HZ}
    if task.with_gas:
        return two_phase_setup(rig, cells_per_height=task.layers_per_height, **common)
    return numerical_setup(rig, layers_per_height=task.layers_per_height, **common)


def cost_of(task: CampaignTask) -> float:
    """Steps of particles or cells, about proportional to the time of computing."""
    setup, duration_s = setup_of(task), float(task.run.settings["duration_s"])
    if setup is None:
        return duration_s * 1e4
    n = setup.n_along * setup.n_up if isinstance(setup, TwoPhaseSetup) else setup.n_particles
    return duration_s * n / setup.step_s


def made_of(task: CampaignTask) -> str:
    """Hash of all that a recording follows from."""
    setup = setup_of(task)
    content = {
        "rig": RIG_TEXTS[task.run.rig],
        "run": asdict(task.run),
        "seeds": [task.seed, task.laboratory_seed],
        "tank": None if setup is None else asdict(setup),
        # another version may compute another liquid: its recordings are made again
        "version": __version__,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
