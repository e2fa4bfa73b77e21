"""The command that flies an aircraft with tanks through gusts."""

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
from sloshlab.errors import InputError


@app.command()
def aircraft(
    model: Annotated[
        Path, typer.Argument(metavar="MODEL.toml", help="Aircraft that flies freely.", show_default=False)
    ],
    output: OutputFolder,
    *,
    rom: Annotated[
        Path | None,
        typer.Option(
            "--rom", metavar="ROM.nc", help="Trained model of vertical sloshing in its tanks.", show_default=False
        ),
    ] = None,
    ensemble: Annotated[
        Path | None,
        typer.Option(
            "--ensemble", metavar="ENSEMBLE.nc", help="Its ensemble, for ranges of results.", show_default=False
        ),
    ] = None,
    gust_speed: Annotated[
        float | None,
        typer.Option(
            "--gust-speed", metavar="U", help="Speed in m/s; those of the source if not given.", show_default=False
        ),
    ] = None,
    gust: Annotated[
        float | None,
        typer.Option("--gust", metavar="W", help="Amplitude of that gust in m/s.", show_default=False),
    ] = None,
    gust_length: Annotated[
        float | None,
        typer.Option(
            "--gust-length", metavar="L", help="Its length in m; 25 semi-chords if not given.", show_default=False
        ),
    ] = None,
    duration: Annotated[float, typer.Option("--duration", help="Of each simulation, in s.")] = 40.0,
    scan: Annotated[
        Path | None,
        typer.Option(
            "--scan", metavar="SCAN.toml", help="Places of two tanks to look at, too.", show_default=False
        ),
    ] = None,
    first: Annotated[float, typer.Option("--from", metavar="U", help="Lowest speed in m/s.")] = 13.0,
    last: Annotated[float, typer.Option("--to", metavar="U", help="Highest speed in m/s.")] = 50.0,
    speeds: Annotated[int, typer.Option("--speeds", help="How many, evenly.")] = 60,
    cache: GeneralisedForceCache = None,
    no_report: Annotated[bool, typer.Option("--no-report", help="Write netCDF files only.")] = False,
    as_json: Json = False,
) -> None:
    """A flying aircraft whose tanks slosh sideways and vertically: flutter, gusts with four models, report."""
    from pipelines.aircraft.flying_wing import analyse_aircraft
    from pipelines.aircraft.flying_wing_outputs import files_of, write_aircraft
    from pipelines.aircraft.flying_wing_results import AircraftSettings, OneGust
    from pipelines.flutter.analysis import FlutterSettings

    if (gust is None) != (gust_speed is None) or (gust_length is not None and gust is None):
        raise InputError("--gust", got="one of --gust and --gust-speed", allowed="both, or none")
    asked = None if gust is None or gust_speed is None else OneGust(gust_speed, gust, gust_length)
    settings = AircraftSettings(FlutterSettings(first, last, speeds), asked, duration)
    require_result_folder(output, files_of(report=not no_report, scan=scan is not None))
    experiment = analyse_aircraft(model, settings, rom=rom, ensemble=ensemble, scan=scan, cache=cache)
    finish(write_aircraft(experiment, output, command=command_as_given(), report=not no_report), as_json)
