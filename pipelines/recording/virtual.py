"""The command `virtual`: runs of the virtual laboratory."""

from __future__ import annotations

import inspect
import json
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import xarray as xr

from acquisition.numerical_tank.instability import STOPPED
from acquisition.virtual_laboratory.campaign import CAMPAIGN_LABORATORY, campaign_laboratory, make_campaign
from acquisition.virtual_laboratory.sensors import Laboratory
from acquisition.virtual_laboratory.shaker_run import write_virtual_run
from acquisition.virtual_laboratory.structure_rig import StructureLaboratory, structure_laboratory
from campaigns.executor import Executor
from campaigns.where import Where, executor_of
from pipelines.inputs.rigs import RigSource, rig_of
from pipelines.report.free_place import require_free_file, require_free_place
from pipelines.report.progress import amounts, progress
from pipelines.report.terminal import warn
from sloshlab import atomic_file
from sloshlab.errors import InputError
from sloshlab.experiments import EXPERIMENTS, experiment_names
from sloshlab.recording import read_recording
from sloshlab.registry import loaded
from sloshlab.rig import Rig

if TYPE_CHECKING:  # the compiled loops of a computed liquid take a second to load: only where it is computed
    from acquisition.two_phase_tank.setup import Walls
    from acquisition.virtual_laboratory.numerical_campaign import FinishedRun
    from acquisition.virtual_laboratory.numerical_campaign_tasks import CampaignSettings
    from acquisition.virtual_laboratory.numerical_liquid import NumericalLiquid

DEVIATIONS: Final = "laboratory_deviations"
"""Attribute of a recording: in what the laboratory differs from what the rig tells, as JSON."""
LABORATORIES: Final = ("exact", "drawn")
LIQUIDS: Final = ("law", "numerical", "two_phase")
CAMPAIGN: Final = "campaign"
"""In place of an experiment: a whole folder of raw_data."""
FLIGHT: Final = "flight"
"""In place of an experiment: a case of a wing in flight."""


def virtual_experiments() -> tuple[str, ...]:
    """Experiments that the virtual laboratory can run."""
    return experiment_names(lambda experiment: bool(experiment.virtual_run))


@dataclass(frozen=True)
class VirtualRun:
    """What the virtual laboratory is asked to do; of the options it takes those that the experiment has.

    Without `laboratory_seed` the rig is as told. `contact_angles` are degrees as ``ADVANCING,RECEDING``, between
    which the contact line sticks; empty for 90° without sticking.
    """

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
    laboratory_seed: int | None = None
    contact_angles: str = ""

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


def laboratory_seed_of(how: str, seed: int | None, *, is_campaign: bool) -> int | None:
    """The seed of the laboratory that the options ask for; None for the rig as told.

    Parameters
    ----------
    how : str
        ``exact`` or ``drawn``; empty for what is usual: drawn for a campaign or where there is a seed.
    seed : int, optional
    is_campaign : bool

    Raises
    ------
    InputError
        If the options contradict each other.
    """
    if how not in ("", *LABORATORIES):
        raise InputError("--laboratory", got=repr(how), allowed=", ".join(LABORATORIES))
    if seed is not None and seed < 0:
        raise InputError("--laboratory-seed", got=str(seed), allowed="≥ 0")
    if how == "exact" and seed is not None:
        raise InputError("--laboratory", got="exact, and a seed", allowed="one of them")
    is_drawn = how == "drawn" or seed is not None or (not how and is_campaign)
    return (seed or CAMPAIGN_LABORATORY) if is_drawn else None


def make_virtual_run(
    run: VirtualRun,
    rig: Path | None,
    output: Path,
    checkpoint: Path | None = None,
    *,
    overwrite: bool = False,
    attributes: Mapping[str, Any] | None = None,
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
    overwrite : bool
        Whether a recording that is there may be replaced.
    attributes : mapping, optional
        Global attributes beside and instead of those that the laboratory states.

    Raises
    ------
    InputError
        If the experiment is unknown, no rig is given, or an argument is out of range.
    """
    _check_run(run)
    if rig is None:
        raise InputError("--rig", got="nothing", allowed="a rig description", remedy="give --rig RIG.toml")
    saved = checkpoint or output.with_suffix(".checkpoint")
    require_free_file(saved, f"--checkpoint {saved}")
    # it may be there to go on from: beside a mistyped one, hours would be computed once more
    if checkpoint is not None and not checkpoint.absolute().parent.is_dir():
        got = f"{checkpoint.parent}, which is not there"
        raise InputError(f"--checkpoint {checkpoint}", got=got, allowed="a file in a folder that exists")
    require_free_place(output, overwrite=overwrite)
    recording = _computed(run, rig, saved)
    recording.attrs.update(attributes or {})
    with atomic_file.replaced(output, overwrite=overwrite) as place:
        write_virtual_run(recording, place)
    saved.unlink(missing_ok=True)
    rate_hz = recording.attrs["sampling_rate_hz"]
    lines = [f"recording: {output} ({recording.sizes['time']} samples at {rate_hz:g} Hz)"]
    deviations = json.loads(recording.attrs[DEVIATIONS])
    lines += [f"laboratory: {line}" for line in deviation_lines(run.laboratory_seed, deviations)]
    stopped = recording.attrs.get(STOPPED)
    return {
        "lines": lines,
        "flags": [str(stopped)] if stopped else [],
        "output": str(output),
        "laboratory_seed": run.laboratory_seed,
        "laboratory_deviations": deviations,
    }


def virtual_recording(run: VirtualRun, rig: RigSource) -> xr.Dataset:
    """Make one run, and keep it in memory as `read_recording` would give it.

    Parameters
    ----------
    run : VirtualRun
    rig : Path or RigInMemory

    Raises
    ------
    InputError
        If the experiment is unknown or an argument is out of range.
    """
    _check_run(run)
    with tempfile.TemporaryDirectory(prefix="sloshlab-virtual-") as folder:
        place = Path(folder) / "run.nc"
        # as counts of a converter, which is what a recorder would have written
        write_virtual_run(_computed(run, rig, place.with_suffix(".checkpoint")), place)
        return read_recording(place)


def _check_run(run: VirtualRun) -> None:
    if run.experiment not in virtual_experiments():
        allowed = (*virtual_experiments(), CAMPAIGN)
        raise InputError("EXPERIMENT", got=repr(run.experiment), allowed=", ".join(allowed))
    _check_liquid(run.liquid)
    _sticking_walls(run)


def _computed(run: VirtualRun, rig: RigSource, saved: Path) -> xr.Dataset:
    """The run, with progress; a computed liquid is saved meanwhile."""
    # no law is known for the liquid in a tank that moves with a structure
    if run.liquid == "law" and not EXPERIMENTS[run.experiment].structure:
        return _recorded(run, rig, None)
    from acquisition.virtual_laboratory.numerical_liquid import NumericalLiquid

    with amounts(run.experiment) as advance:
        numerical = NumericalLiquid(
            run.layers,
            saved,
            lambda share: advance(round(1000 * share), 1000),
            with_gas=run.liquid == "two_phase",
            walls=_sticking_walls(run),
        )
        return _recorded(run, rig, numerical)


def _sticking_walls(run: VirtualRun) -> Walls | None:
    """Walls at which the contact line sticks between two angles; None if that is not asked for."""
    if not run.contact_angles:
        return None
    from acquisition.two_phase_tank.setup import Walls

    if run.liquid != "two_phase":
        raise InputError("--contact-angles", got=f"with --liquid {run.liquid}", allowed="--liquid two_phase")
    allowed = "advancing and receding angle in degrees, 5 ≤ receding ≤ advancing ≤ 175, such as 80,50"
    try:
        advancing, receding = (float(part) for part in run.contact_angles.split(","))
    except ValueError as error:
        raise InputError("--contact-angles", got=repr(run.contact_angles), allowed=allowed) from error
    # not a number is in no range
    if not 5.0 <= receding <= advancing <= 175.0:
        raise InputError("--contact-angles", got=repr(run.contact_angles), allowed=allowed)
    return Walls(advancing_angle_deg=advancing, receding_angle_deg=receding, line_sticks=True)


def _recorded(run: VirtualRun, rig: RigSource, computed: NumericalLiquid | None) -> xr.Dataset:
    """The liquid follows its law where none is to be computed."""
    described, experiment = rig_of(rig), EXPERIMENTS[run.experiment]
    make: Callable[..., xr.Dataset] = loaded(experiment.virtual_run)
    drawn: dict[str, Any] = {}
    if run.laboratory_seed is not None:
        if "laboratory" not in inspect.signature(make).parameters:
            allowed = "experiments whose function takes a laboratory"
            raise InputError("--laboratory-seed", got=run.experiment, allowed=allowed)
        drawn = {"laboratory": _laboratory(run, described)}
    recording = make(described, numerical=computed, rig_name=rig.name, **drawn, **run.settings())
    if run.laboratory_seed is not None:
        # runs of one rig in two laboratories are not the same run
        recording.attrs["run_id"] += f"_laboratory{run.laboratory_seed}"
    # a function of one's own may have its own word
    recording.attrs = {**_laboratory_attributes(run, described), **recording.attrs}
    return recording


def _laboratory(run: VirtualRun, rig: Rig) -> Laboratory | StructureLaboratory:
    seed = run.laboratory_seed
    if EXPERIMENTS[run.experiment].structure:
        return structure_laboratory(rig, seed)
    return Laboratory.perfect() if seed is None else Laboratory.drawn(seed)


def _laboratory_attributes(run: VirtualRun, rig: Rig) -> dict[str, Any]:
    """What a recording says of the laboratory."""
    deviations = {} if run.laboratory_seed is None else _laboratory(run, rig).deviations()
    stated = {"laboratory": "exact", DEVIATIONS: json.dumps(deviations, sort_keys=True)}
    if run.laboratory_seed is None:
        return stated
    return stated | {"laboratory": "drawn", "laboratory_seed": run.laboratory_seed}


def deviation_lines(seed: int | None, deviations: Mapping[str, Any]) -> list[str]:
    """What a person is told of a laboratory.

    Examples
    --------
    >>> deviation_lines(3, {"dry_mass_factor": 1.004, "frequency_factors": [0.99, 1.0]})
    ['3, drawn', 'dry mass factor: +0.40 %', 'frequency factors: -1.00, +0.00 %']
    """
    if seed is None:
        return ["exact, the rig as told"]
    lines = [f"{seed}, drawn"]
    for name, value in deviations.items():
        # shares are no factors about one
        around = 0.0 if "share" in name or name == "rocking" else 1.0
        if isinstance(value, Mapping):
            of_channels = (f"{channel} {100 * (part - around):+.2f} %" for channel, part in value.items())
            lines.append(f"{name.replace('_', ' ')}: {', '.join(of_channels)}")
        else:
            parts = value if isinstance(value, list) else [value]
            numbers = ", ".join(f"{100 * (part - around):+.2f}" for part in parts)
            lines.append(f"{name.replace('_', ' ')}: {numbers} %")
    return lines


def make_campaign_folder(
    folder: Path,
    liquid: str,
    settings: CampaignSettings,
    say: Callable[[str], None],
    *,
    scheduler: str | None = None,
) -> dict[str, Any]:
    """Make the campaign whose liquid follows its law, of which only the seeds can be chosen, or is computed.

    Parameters
    ----------
    folder : Path
    liquid : {'law', 'numerical', 'two_phase'}
    settings : CampaignSettings
    say : callable
        Takes a line for every computed run.
    scheduler : str, optional
        Of a cluster that computes instead of processes of this machine.
    """
    _check_liquid(liquid)
    if liquid != "law":
        settings = replace(settings, with_gas=liquid == "two_phase")
        executor = executor_of(Where(scheduler, settings.n_workers, fresh=True), said=warn)
        return _make_numerical_campaign_folder(folder, settings, say, executor)
    with progress("campaign", 40) as advance:
        manifest = make_campaign(
            folder,
            seed=settings.seed,
            laboratory_seed=settings.laboratory_seed,
            overwrite=settings.overwrite,
            progress=lambda done, of, name: advance(name),
        )
    deviations = campaign_laboratory(settings.laboratory_seed).deviations()
    laboratory = deviation_lines(settings.laboratory_seed, deviations)
    return {
        "lines": [f"manifest: {manifest}", *(f"laboratory: {line}" for line in laboratory)],
        "flags": [],
        "output": str(folder),
        "laboratory_seed": settings.laboratory_seed,
        "laboratory_deviations": deviations,
    }


def _check_liquid(liquid: str) -> None:
    if liquid not in LIQUIDS:
        raise InputError("--liquid", got=repr(liquid), allowed=", ".join(LIQUIDS))


def _make_numerical_campaign_folder(
    folder: Path, settings: CampaignSettings, say: Callable[[str], None], executor: Executor
) -> dict[str, Any]:
    from acquisition.virtual_laboratory.numerical_campaign import make_numerical_campaign

    share, start_s = [0.0], time.monotonic()

    def say_finished(run: FinishedRun) -> None:
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

        summary = make_numerical_campaign(
            folder, settings, progressed=progressed, finished=say_finished, executor=executor
        )
    lines = [f"made: {summary.n_made}, kept: {summary.n_kept}", f"manifest: {summary.manifest}"]
    return {
        "lines": lines,
        "flags": list(summary.flags),
        "output": str(folder),
        "made": summary.n_made,
        "kept": summary.n_kept,
        "laboratory_seed": settings.laboratory_seed,
        "laboratory_deviations": campaign_laboratory(settings.laboratory_seed).deviations(),
    }


def _duration(seconds: float) -> str:
    minutes = round(seconds / 60)
    return f"{seconds:.0f} s" if seconds < 100 else f"{minutes // 60} h {minutes % 60:02d} min"
