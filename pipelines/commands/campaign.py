"""Hundreds of recordings, cases or trainings by one command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipelines.commands.application import Json, OutputFolder, Scheduler, app, command_as_given, finish


@app.command()
def campaign(
    source: Annotated[
        Path, typer.Argument(metavar="FOLDER|PLAN.toml", help="What to work through.", show_default=False)
    ],
    output: OutputFolder,
    *,
    kind: Annotated[
        str | None,
        typer.Option(
            help="sweep, beam, train, diagnose or trial; of a folder, by default what it holds.",
            show_default=False,
        ),
    ] = None,
    workers: Annotated[int, typer.Option(help="Processes, or jobs of the queue.")] = 2,
    scheduler: Scheduler = None,
    time_limit: Annotated[
        float | None, typer.Option(metavar="S", help="Seconds a task may take.", show_default=False)
    ] = None,
    retries: Annotated[
        int | None,
        typer.Option(min=0, max=100, help="Of a task whose process died; 2 or the plan's.", show_default=False),
    ] = None,
    failed_again: Annotated[
        bool, typer.Option("--failed-again", help="Also tasks that failed or took too long before.")
    ] = False,
    no_report: Annotated[bool, typer.Option("--no-report", help="Write the tables only.")] = False,
    as_json: Json = False,
) -> None:
    """Analyses, trainings, diagnoses over a folder or a plan; goes on where it was stopped."""
    from campaigns.where import Where
    from pipelines.campaign.run import CampaignOptions, carry_out

    if time_limit is not None and not time_limit > 0:
        raise typer.BadParameter(f"{time_limit:g} is not above 0", param_hint="--time-limit")
    options = CampaignOptions(
        kind, Where(scheduler, workers), time_limit, retries, failed_again, report=not no_report
    )
    finish(carry_out(source, output, options, command=command_as_given()), as_json)
