"""The command that flies a wing with tanks through gusts and finds its limit cycles."""

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
def wing(
    model: Annotated[Path, typer.Argument(metavar="MODEL.toml", help="Wing, tanks and air.", show_default=False)],
    output: OutputFolder,
    *,
    rom: Annotated[
        Path,
        typer.Option("--rom", metavar="ROM.nc", help="Trained model, of sloshlab train.", show_default=False),
    ],
    maps: Annotated[
        Path | None,
        typer.Option(
            "--maps", metavar="MAPS.nc", help="Of sloshlab shaker: energy maps and dampers.", show_default=False
        ),
    ] = None,
    calibrate: Annotated[
        bool, typer.Option("--calibrate", help="Solve the stiffness for the targets of the file anew.")
    ] = False,
    match_fold: Annotated[
        float | None,
        typer.Option(
            "--match-fold",
            metavar="U",
            help="A second wing with tanks so small that its limit cycle ends at U m/s.",
            show_default=False,
        ),
    ] = None,
    first: Annotated[float, typer.Option("--from", metavar="U", help="Lowest speed of limit cycles.")] = 316.0,
    last: Annotated[float, typer.Option("--to", metavar="U", help="Highest speed of limit cycles.")] = 340.0,
    speeds: Annotated[int, typer.Option("--speeds", help="How many of them, evenly.")] = 13,
    duration: Annotated[float, typer.Option("--duration", metavar="S", help="Of each gust.")] = 20.0,
    patience: Annotated[
        float, typer.Option("--patience", metavar="S", help="Simulated at most for a limit cycle at each speed.")
    ] = 60.0,
    gust_length: Annotated[
        float | None,
        typer.Option("--gust-length", metavar="M", help="25 semi-chords unless stated.", show_default=False),
    ] = None,
    cache: GeneralisedForceCache = None,
    no_report: Annotated[bool, typer.Option("--no-report", help="Write data only.")] = False,
    as_json: Json = False,
) -> None:
    """A wing whose tanks slosh: flutter, gusts, limit cycles, energy maps, dampers, landing, and a report."""
    from pipelines.wing.analysis import analyse_wing
    from pipelines.wing.outputs import files_of, write_wing
    from pipelines.wing.results import WingSettings

    settings = WingSettings(
        calibrate=calibrate,
        match_fold_m_per_s=match_fold,
        duration_s=duration,
        gust_length_m=gust_length,
        first_m_per_s=first,
        last_m_per_s=last,
        n_bifurcation=speeds,
        longest_s=patience,
    )
    names = files_of(report=not no_report, maps=maps is not None, matched=match_fold is not None)
    require_result_folder(output, names)
    experiment = analyse_wing(model, rom, maps, settings, cache=cache)
    finish(write_wing(experiment, output, command=command_as_given(), report=not no_report), as_json)
