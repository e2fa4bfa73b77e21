"""Commands of the laboratory: live recording, recovery, simulated devices."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.commands.application import (
    Json,
    OutputFile,
    Overwrite,
    Redundant,
    app,
    finish,
    free_file,
)
from pipelines.commands.completion import (
    ALIGNMENTS,
    device_url,
    one_of,
    replay_source,
    source_url,
)
from pipelines.report.terminal import say

if TYPE_CHECKING:
    from pipelines.live_page.live_page import LivePage
    from pipelines.recording.record import RecordSettings


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
