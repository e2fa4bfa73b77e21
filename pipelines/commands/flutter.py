"""The command that finds where a wing or an aircraft flutters."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipelines.commands.application import (
    GeneralisedForceCache,
    Json,
    OutputFolder,
    app,
    command_as_given,
    finish,
)
from pipelines.report.result_folder import require_result_folder


@app.command()
def flutter(
    model: Annotated[
        Path, typer.Argument(metavar="MODEL.toml", help="Wing or aircraft, and air.", show_default=False)
    ],
    output: OutputFolder,
    *,
    first: Annotated[float, typer.Option("--from", metavar="U", help="Lowest speed in m/s.")] = 13.0,
    last: Annotated[float, typer.Option("--to", metavar="U", help="Highest speed in m/s.")] = 45.0,
    models: Annotated[
        str | None,
        typer.Option(
            "--models",
            metavar="LIST",
            help="Liquids of an aircraft: frozen, lateral; those that it can have unless stated.",
            show_default=False,
        ),
    ] = None,
    speeds: Annotated[int, typer.Option("--speeds", help="How many, evenly.")] = 60,
    cache: GeneralisedForceCache = None,
    no_report: Annotated[bool, typer.Option("--no-report", help="Write stability.nc only.")] = False,
    as_json: Json = False,
) -> None:
    """Flutter and divergence of a wing or an aircraft with tanks: root locus over the speed, p-k, report."""
    from pipelines.flutter.analysis import FlutterSettings, analyse_flutter
    from pipelines.flutter.outputs import files_of, write_flutter

    chosen = () if models is None else tuple(name.strip() for name in models.split(","))
    settings = FlutterSettings(first, last, speeds, chosen)
    require_result_folder(output, files_of(report=not no_report))
    experiment = analyse_flutter(model, settings, cache=cache)
    finish(write_flutter(experiment, output, command=command_as_given(), report=not no_report), as_json)
