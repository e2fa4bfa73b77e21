"""The command of the virtual laboratory: runs, repeats and levels of one, campaigns, flights."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.commands.application import (
    Json,
    Overwrite,
    Scheduler,
    app,
    finish,
    free_folder,
)
from pipelines.commands.completion import LABORATORIES, LIQUIDS, SWEEP_LAWS, one_of
from pipelines.report.free_place import require_free_folder, require_free_place
from pipelines.report.terminal import say
from sloshlab.configurations import CONFIGURATIONS, SLOSHING
from sloshlab.errors import InputError
from sloshlab.experiments import experiment_names

if TYPE_CHECKING:
    from acquisition.virtual_laboratory.numerical_campaign_tasks import CampaignSettings
    from pipelines.recording.virtual import VirtualRun

_VIRTUAL = experiment_names(lambda experiment: bool(experiment.virtual_run))
"""Experiments that the virtual laboratory can run."""


@app.command()
def virtual(
    experiment: Annotated[
        str,
        typer.Argument(
            help=f"{', '.join(_VIRTUAL)}; campaign for a whole folder of raw_data; flight for a wing.",
            autocompletion=one_of((*_VIRTUAL, "campaign", "flight")),
        ),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="File to write.", show_default=False)
    ],
    *,
    rig: Annotated[Path | None, typer.Option("--rig", metavar="RIG.toml", help="Rig of the experiment.")] = None,
    configuration: Annotated[
        str, typer.Option(help=f"One of {', '.join(CONFIGURATIONS)}.", autocompletion=one_of(CONFIGURATIONS))
    ] = SLOSHING,
    acceleration_g: Annotated[float, typer.Option(help="Level of the sweep in g.")] = 3.0,
    direction: Annotated[str, typer.Option(help="up or down.", autocompletion=one_of(("up", "down")))] = "up",
    law: Annotated[
        str,
        typer.Option(help="octave, linear or stepped.", autocompletion=one_of(SWEEP_LAWS)),
    ] = "octave",
    frequency_hz: Annotated[float, typer.Option(help="Of a sudden start or the first tone, in Hz.")] = 11.4,
    second_frequency_hz: Annotated[float, typer.Option(help="Of the second tone, in Hz.")] = 14.7,
    initial_displacement_m: Annotated[
        float | None, typer.Option(help="Deflection from which a free run starts, in m.", show_default=False)
    ] = None,
    rms_g: Annotated[float, typer.Option(help="Of the random motion of the root, in g.")] = 0.2,
    duration_s: Annotated[
        float | None, typer.Option(help="Duration in seconds; on the shaker 240.", show_default=False)
    ] = None,
    sampling_rate_hz: Annotated[
        float | None, typer.Option(help="Sampling rate in Hz; on the shaker 512.", show_default=False)
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of noise, drive and liquid.")] = 0,
    repeats: Annotated[
        int, typer.Option(min=1, help="Runs of every level, each with the next seed; the output is a folder.")
    ] = 1,
    levels: Annotated[
        str,
        typer.Option(
            metavar="A,B,...",
            help="Levels in g, or deflections in m; the output is a folder.",
            show_default=False,
        ),
    ] = "",
    laboratory: Annotated[
        str,
        typer.Option(
            help="exact: the rig as told, or drawn: masses, gains, frequencies a little off.",
            show_default=False,
            autocompletion=one_of(LABORATORIES),
        ),
    ] = "",
    laboratory_seed: Annotated[
        int | None, typer.Option(help="Which laboratory is drawn.", show_default=False)
    ] = None,
    liquid: Annotated[
        str,
        typer.Option(
            help="law, or computed, which takes long: numerical, or two_phase.", autocompletion=one_of(LIQUIDS)
        ),
    ] = "law",
    layers: Annotated[int, typer.Option(help="Layers of particles, or cells, over the height of the tank.")] = 16,
    contact_angles: Annotated[
        str,
        typer.Option(
            metavar="ADVANCING,RECEDING",
            help="Degrees between which the contact line of liquid and gas sticks.",
            show_default=False,
        ),
    ] = "",
    checkpoint: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Where a computation is saved; by default beside the recording.",
        ),
    ] = None,
    workers: Annotated[int, typer.Option(help="Processes of a computed campaign.")] = 2,
    scheduler: Scheduler = None,
    only: Annotated[
        str, typer.Option(metavar="PATTERN", help="Runs of a computed campaign, as a pattern of file names.")
    ] = "*",
    checkpoints: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Where a computed campaign is saved; by default within the output.",
            callback=free_folder,
        ),
    ] = None,
    model: Annotated[
        Path | None, typer.Option("--model", metavar="MODEL.toml", help="Wing of a flight.", show_default=False)
    ] = None,
    hide: Annotated[
        str,
        typer.Option(
            metavar="NAME=VALUE,...", help="What a flight hides; its output is a folder.", show_default=False
        ),
    ] = "",
    cases: Annotated[
        int | None,
        typer.Option(metavar="N", help="So many drawn flights, as a challenge.", show_default=False),
    ] = None,
    truths: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Where truths of drawn flights go.", show_default=False),
    ] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """A run of the virtual laboratory, or repeats and levels of one."""
    from pipelines.recording.virtual import CAMPAIGN, FLIGHT, VirtualRun, laboratory_seed_of

    if contact_angles and experiment in (CAMPAIGN, FLIGHT):
        raise InputError("--contact-angles", got=f"with {experiment}", allowed="a single run, or its repeats")
    if experiment == FLIGHT:
        finish(_flown(model, output, seed=seed, hide=hide, n_cases=cases, truths=truths), as_json)
        return
    of_laboratory = laboratory_seed_of(laboratory, laboratory_seed, is_campaign=experiment == CAMPAIGN)
    if experiment == CAMPAIGN:
        from acquisition.virtual_laboratory.numerical_campaign_tasks import CampaignSettings

        computed = CampaignSettings(seed, layers, workers, only, checkpoints, of_laboratory, overwrite)
        finish(_campaign_made(output, liquid, computed, scheduler), as_json)
        return
    run = VirtualRun(
        experiment=experiment,
        configuration=configuration,
        seed=seed,
        liquid=liquid,
        layers=layers,
        acceleration_g=acceleration_g,
        direction=direction,
        law=law,
        frequency_hz=frequency_hz,
        duration_s=duration_s,
        sampling_rate_hz=sampling_rate_hz,
        initial_displacement_m=initial_displacement_m,
        rms_g=rms_g,
        second_frequency_hz=second_frequency_hz,
        laboratory_seed=of_laboratory,
        contact_angles=contact_angles,
    )
    made = (
        _repeats_made(
            run, rig, output, n_repeats=repeats, levels=levels, checkpoint=checkpoint, overwrite=overwrite
        )
        if repeats > 1 or levels
        else _run_made(run, rig, output, checkpoint, overwrite=overwrite)
    )
    finish(made, as_json)


def _flown(
    model: Path | None, output: Path, *, seed: int, hide: str, n_cases: int | None, truths: Path | None
) -> dict[str, Any]:
    """One flight, or a challenge of so many."""
    from pipelines.recording.virtual_flight import make_flight, make_flight_challenge

    if n_cases is None:
        return make_flight(model, output, seed=seed, hide=hide)
    return make_flight_challenge(model, output, truths, n_cases=n_cases, seed=seed)


def _campaign_made(folder: Path, liquid: str, settings: CampaignSettings, scheduler: str | None) -> dict[str, Any]:
    from pipelines.recording.virtual import make_campaign_folder

    require_free_folder(folder, f"--output {folder}")
    return make_campaign_folder(folder, liquid, settings, say, scheduler=scheduler)


def _repeats_made(
    run: VirtualRun,
    rig: Path | None,
    folder: Path,
    *,
    n_repeats: int,
    levels: str,
    checkpoint: Path | None,
    overwrite: bool,
) -> dict[str, Any]:
    """Repeats and levels of a run."""
    from pipelines.recording.virtual_repeats import make_repeats, parsed_levels

    if checkpoint is not None:
        raise InputError(
            "--checkpoint", got="with --repeats or --levels", allowed="one run", remedy="leave it out"
        )
    chosen = parsed_levels(levels) if levels else ()
    return make_repeats(run, rig, folder, n_repeats=n_repeats, levels=chosen, overwrite=overwrite)


def _run_made(
    run: VirtualRun, rig: Path | None, output: Path, checkpoint: Path | None, *, overwrite: bool
) -> dict[str, Any]:
    from pipelines.recording.virtual import make_virtual_run

    require_free_place(output, overwrite=overwrite, described="--output")
    return make_virtual_run(run, rig, output, checkpoint, overwrite=overwrite)
