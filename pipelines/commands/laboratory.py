"""Commands of the laboratory: virtual runs, live recording, recovery, simulated devices."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.commands.application import (
    Json,
    OutputFile,
    Overwrite,
    Redundant,
    Scheduler,
    app,
    finish,
    free_file,
    free_folder,
)
from pipelines.commands.completion import (
    ALIGNMENTS,
    LABORATORIES,
    LIQUIDS,
    SWEEP_LAWS,
    device_url,
    one_of,
    replay_source,
    source_url,
)
from pipelines.report.free_place import require_free_folder, require_free_place
from pipelines.report.terminal import say
from sloshlab.configurations import CONFIGURATIONS, SLOSHING
from sloshlab.errors import InputError
from sloshlab.experiments import experiment_names

if TYPE_CHECKING:
    from acquisition.virtual_laboratory.numerical_campaign import CampaignSettings
    from pipelines.live_page.live_page import LivePage
    from pipelines.recording.record import RecordSettings
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

    if experiment == FLIGHT:
        finish(_flown(model, output, seed=seed, hide=hide, n_cases=cases, truths=truths), as_json)
        return
    of_laboratory = laboratory_seed_of(laboratory, laboratory_seed, is_campaign=experiment == CAMPAIGN)
    if experiment == CAMPAIGN:
        from acquisition.virtual_laboratory.numerical_campaign import CampaignSettings

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


@app.command()
def record(
    sources: Annotated[
        list[str],
        typer.Option(
            "--source",
            metavar="URL",
            help="A device; the first is the time base.",
            show_default=False,
            autocompletion=source_url,
        ),
    ],
    rig: Annotated[
        Path, typer.Option("--rig", metavar="RIG.toml", help="Rig the run belongs to.", show_default=False)
    ],
    output: OutputFile,
    *,
    duration: Annotated[
        float | None,
        typer.Option(metavar="S", help="Seconds of samples; until the end if not given.", show_default=False),
    ] = None,
    run_table: Annotated[
        Path | None, typer.Option("--run", metavar="RUN.toml", help="Attributes of the run.", show_default=False)
    ] = None,
    attribute: Annotated[
        list[str] | None, typer.Option(metavar="KEY=VALUE", help="An attribute of the run.", show_default=False)
    ] = None,
    align: Annotated[
        str,
        typer.Option(
            help="Clocks of several devices: host, device or counter.", autocompletion=one_of(ALIGNMENTS)
        ),
    ] = "host",
    redundant: Redundant = None,
    keep_journal: Annotated[bool, typer.Option("--keep-journal", help="Keep RUN.journal.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a recording that is there.")] = False,
    trigger: Annotated[
        list[str] | None,
        typer.Option(
            "--trigger",
            metavar="CONDITION",
            help="Begin when it is met; CHANNEL>LEVEL and others.",
            show_default=False,
        ),
    ] = None,
    pre_seconds: Annotated[
        float | None,
        typer.Option(
            "--pre-seconds", metavar="S", help="Seconds kept from before the trigger.", show_default=False
        ),
    ] = None,
    page: Annotated[bool, typer.Option("--page", help="Serve a live page to a browser.")] = False,
    page_port: Annotated[
        int,
        typer.Option("--page-port", metavar="N", min=0, max=65535, help="Port of the page; 0 is any free."),
    ] = 0,
    page_host: Annotated[
        str, typer.Option("--page-host", metavar="HOST", help="Address that the page is served on.")
    ] = "127.0.0.1",
    as_json: Json = False,
) -> None:
    """Live devices – serial, CAN, simulated – to one recording, through a crash-safe journal."""
    from pipelines.live_page.live_page import LivePage, PageSettings
    from pipelines.recording.record import RecordSettings

    _require_trigger(trigger or [], pre_seconds, page=page)
    settings = RecordSettings(
        sources=tuple(sources),
        rig=rig,
        output=output,
        duration_s=duration,
        run=run_table,
        attributes=tuple(attribute or ()),
        align=align,
        redundant=tuple(redundant or ()),
        trigger=tuple(trigger or ()),
        pre_s=pre_seconds or 0.0,
        keep_journal=keep_journal,
        overwrite=overwrite,
    )
    if not page:
        finish(_recorded(settings, None), as_json)
        return
    page_settings = PageSettings(output.absolute().parent, rig, page_host, page_port)
    with LivePage(page_settings, lambda line, is_warning: say(line, error=is_warning)) as live_page:
        say(f"page {live_page.url}")
        summary = _recorded(settings, live_page)
        live_page.finished(summary)
    finish(summary, as_json)


def _require_trigger(trigger: list[str], pre_seconds: float | None, *, page: bool) -> None:
    """Refuse options that need another one."""
    if pre_seconds is not None and not trigger:
        raise typer.BadParameter("--pre-seconds needs --trigger")
    if "mark" in trigger and not page:
        raise typer.BadParameter("--trigger mark needs --page, where the mark is set")


def _recorded(settings: RecordSettings, live_page: LivePage | None) -> dict[str, Any]:
    """Record, watched on the terminal and, if there is one, on the live page."""
    from acquisition.recorder.status import SeveralWatching
    from pipelines.recording.live_view import LiveView
    from pipelines.recording.record import record as record_run

    with LiveView(settings.output.absolute().parent, len(settings.sources)) as view:
        if live_page is None:
            return record_run(settings, view)
        return record_run(settings, SeveralWatching(view, live_page), listener=live_page)


@app.command()
def recover(
    journal: Annotated[
        Path, typer.Argument(metavar="RUN.journal", help="Journal of a recorder.", show_default=False)
    ],
    output: OutputFile,
    *,
    align: Annotated[
        str | None,
        typer.Option(
            help="host, device or counter; as it was recorded if not given.",
            show_default=False,
            autocompletion=one_of(ALIGNMENTS),
        ),
    ] = None,
    redundant: Redundant = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a recording that is there.")] = False,
    as_json: Json = False,
) -> None:
    """A journal left by a crash to a recording: everything up to the last complete block."""
    from pipelines.recording.recover import recover as recover_journal

    summary = recover_journal(journal, output, overwrite, align=align, redundant=redundant or ())
    finish(summary, as_json)


@app.command()
def replay(
    source: Annotated[
        str,
        typer.Argument(
            metavar="RUN.nc",
            help="A recording, virtual:EXPERIMENT?rig=RIG.toml or pattern:channels=8.",
            show_default=False,
            autocompletion=replay_source,
        ),
    ],
    urls: Annotated[
        list[str],
        typer.Option(
            "--as", metavar="URL", help="Where a device appears.", show_default=False, autocompletion=device_url
        ),
    ],
    *,
    channels: Annotated[
        list[str] | None, typer.Option(metavar="A,B", help="Channels; once per --as.", show_default=False)
    ] = None,
    speed: Annotated[str, typer.Option(help="Factor of real time, or 'max'.")] = "1",
    faults: Annotated[
        list[Path] | None,
        typer.Option(metavar="FAULTS.toml", help="Faults or 'none'; once per --as.", show_default=False),
    ] = None,
    samples_per_frame: Annotated[int | None, typer.Option(help="Of a serial device.", show_default=False)] = None,
    expose: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Listen here, for more than this computer: whoever reaches it reads every sample.",
        ),
    ] = "",
    free_run: Annotated[bool, typer.Option("--free-run", help="Begin without being started by a host.")] = False,
    wait_clients: Annotated[int, typer.Option(min=1, help="Clients a socketcand device waits for.")] = 1,
    seed: Annotated[int, typer.Option(help="Seed of everything random.")] = 0,
    loop_duration: Annotated[
        float | None, typer.Option(help="Repeat the recording up to so many seconds.", show_default=False)
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.json",
            help="Write what each fault touched.",
            show_default=False,
            callback=free_file,
        ),
    ] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """A recording, the virtual rig or a test pattern, played as serial or CAN devices."""
    from pipelines.recording.replay import ReplaySettings
    from pipelines.recording.replay import replay as play

    settings = ReplaySettings(
        source=source,
        urls=urls,
        channels=channels or (),
        speed=speed,
        faults=[None if str(path) == "none" else path for path in faults or ()],
        samples_per_frame=samples_per_frame,
        expose=expose or None,
        free_run=free_run,
        wait_clients=wait_clients,
        seed=seed,
        loop_duration_s=loop_duration,
        truth=truth,
        overwrite=overwrite,
    )
    finish(play(settings), as_json)
