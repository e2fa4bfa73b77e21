"""The command `virtual`: runs of the virtual laboratory."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import xarray as xr

from acquisition.virtual_laboratory.campaign import make_campaign
from acquisition.virtual_laboratory.numerical_campaign import (
    CampaignSettings,
    FinishedRun,
    make_numerical_campaign,
)
from acquisition.virtual_laboratory.numerical_liquid import STOPPED, NumericalLiquid
from acquisition.virtual_laboratory.shaker_run import write_virtual_run
from pipelines.report.free_place import require_free_file
from pipelines.report.progress import amounts, progress
from sloshlab.errors import InputError
from sloshlab.experiments import EXPERIMENTS, experiment_names
from sloshlab.registry import loaded
from sloshlab.rig import Rig

LIQUIDS: Final = ("law", "numerical")
CAMPAIGN: Final = "campaign"
"""In place of an experiment: a whole folder of raw_data."""


def virtual_experiments() -> tuple[str, ...]:
    """Experiments that the virtual laboratory can run."""
    return experiment_names(lambda experiment: bool(experiment.virtual_run))


@dataclass(frozen=True)
class VirtualRun:
    """What the virtual laboratory is asked to do; of the options it takes those that the experiment has."""

    experiment: str
    configuration: str
    seed: int
    liquid: str
    layers: int
    acceleration_g: float
    direction: str
    law: str
    frequency_hz: float
    duration_s: float | None
    sampling_rate_hz: float | None
    initial_displacement_m: float | None
    rms_g: float
    second_frequency_hz: float = 14.7

    def settings(self) -> dict[str, Any]:
        """Arguments of the laboratory's own function."""
        chosen: dict[str, Any] = {
            "experiment": self.experiment,
            "configuration": self.configuration,
            "seed": self.seed,
            "duration_s": self.duration_s,
            "sampling_rate_hz": self.sampling_rate_hz,
        }
        for argument, source in EXPERIMENTS[self.experiment].virtual_options.items():
            chosen[argument] = getattr(self, source) if isinstance(source, str) else source
        return {name: value for name, value in chosen.items() if value is not None}


def make_virtual_run(
    run: VirtualRun, rig: Path | None, output: Path, checkpoint: Path | None = None
) -> dict[str, Any]:
    """Make one run and write it.

    Parameters
    ----------
    run : VirtualRun
    rig : Path, optional
        Rig description; needed.
    output : Path
        The recording.
    checkpoint : Path, optional
        Where a computed liquid is saved meanwhile; by default beside the recording. Removed at the end.

    Raises
    ------
    InputError
        If the experiment is unknown, no rig is given, or an argument is out of range.
    """
    if run.experiment not in virtual_experiments():
        allowed = (*virtual_experiments(), CAMPAIGN)
        raise InputError("EXPERIMENT", got=repr(run.experiment), allowed=", ".join(allowed))
    _check_liquid(run.liquid)
    if rig is None:
        raise InputError("--rig", got="nothing", allowed="a rig description", remedy="give --rig RIG.toml")
    saved = checkpoint or output.with_suffix(".checkpoint")
    require_free_file(saved, f"--checkpoint {saved}")
    # it may be there to go on from: beside a mistyped one, hours would be computed once more
    if checkpoint is not None and not checkpoint.absolute().parent.is_dir():
        got = f"{checkpoint.parent}, which is not there"
        raise InputError(f"--checkpoint {checkpoint}", got=got, allowed="a file in a folder that exists")
    with amounts(run.experiment) as advance:
        numerical = NumericalLiquid(run.layers, saved, lambda share: advance(round(1000 * share), 1000))
        recording = _recorded(run, rig, numerical)
    write_virtual_run(recording, output)
    saved.unlink(missing_ok=True)
    rate_hz = recording.attrs["sampling_rate_hz"]
    lines = [f"recording: {output} ({recording.sizes['time']} samples at {rate_hz:g} Hz)"]
    stopped = recording.attrs.get(STOPPED)
    return {"lines": lines, "flags": [str(stopped)] if stopped else [], "output": str(output)}


def _recorded(run: VirtualRun, rig: Path, numerical: NumericalLiquid) -> xr.Dataset:
    """The liquid follows its law where there is one and nothing else is asked for."""
    described, experiment = Rig.from_toml(rig), EXPERIMENTS[run.experiment]
    # no law is known for the liquid in a tank that moves with a structure
    computed = numerical if run.liquid == "numerical" or experiment.structure else None
    make: Callable[..., xr.Dataset] = loaded(experiment.virtual_run)
    return make(described, numerical=computed, rig_name=rig.name, **run.settings())


def make_campaign_folder(
    folder: Path, liquid: str, settings: CampaignSettings, say: Callable[[str], None]
) -> dict[str, Any]:
    """Make the campaign whose liquid follows its law, of which only the seed can be chosen, or is computed.

    Parameters
    ----------
    folder : Path
    liquid : {'law', 'numerical'}
    settings : CampaignSettings
    say : callable
        Takes a line for every computed run.
    """
    _check_liquid(liquid)
    if liquid == "numerical":
        return _make_numerical_campaign_folder(folder, settings, say)
    with progress("campaign", 40) as advance:
        manifest = make_campaign(folder, seed=settings.seed, progress=lambda done, of, name: advance(name))
    return {"lines": [f"manifest: {manifest}"], "flags": [], "output": str(folder)}


def _check_liquid(liquid: str) -> None:
    if liquid not in LIQUIDS:
        raise InputError("--liquid", got=repr(liquid), allowed=", ".join(LIQUIDS))


def _make_numerical_campaign_folder(
    folder: Path, settings: CampaignSettings, say: Callable[[str], None]
) -> dict[str, Any]:
    share, start_s = [0.0], time.monotonic()

    def told(run: FinishedRun) -> None:
        left_s = (time.monotonic() - start_s) * (1 - share[0]) / max(share[0], 1e-6)
        ending = f" ({run.flag})" if run.flag else ""
        say(
            f"{run.n_done} of {run.n_runs}: {run.name}{ending}, computed for {_duration(run.computing_s)}; "
            f"{100 * share[0]:.0f} % of the work, {_duration(left_s)} left"
        )

    with amounts("campaign") as advance:

        def progressed(now: float) -> None:
            share[0] = now
            advance(round(10_000 * now), 10_000)

        summary = make_numerical_campaign(folder, settings, progressed=progressed, finished=told)
    lines = [f"made: {summary.n_made}, kept: {summary.n_kept}", f"manifest: {summary.manifest}"]
    return {
        "lines": lines,
        "flags": list(summary.flags),
        "output": str(folder),
        "made": summary.n_made,
        "kept": summary.n_kept,
    }


def _duration(seconds: float) -> str:
    minutes = round(seconds / 60)
    return f"{seconds:.0f} s" if seconds < 100 else f"{minutes // 60} h {minutes % 60:02d} min"
