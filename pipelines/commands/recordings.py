"""Commands that bring recordings in and check them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipelines.commands.application import (
    Json,
    Overwrite,
    Recordings,
    app,
    finish,
    free_file,
    require_recordings,
)


@app.command("import")
def import_(
    sources: Annotated[list[Path], typer.Argument(metavar="SRC...", help="Files of one run.", show_default=False)],
    *,
    channel_map: Annotated[
        Path | None, typer.Option("--map", metavar="MAP.toml", help="Columns to channels.", show_default=False)
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="RUN.nc",
            help="Recording to write.",
            show_default=False,
            callback=free_file,
        ),
    ] = None,
    rig: Annotated[Path | None, typer.Option("--rig", metavar="RIG.toml", help="Rig the run belongs to.")] = None,
    describe: Annotated[
        bool, typer.Option("--describe", help="List columns, units, rates and traps; no map needed.")
    ] = False,
    starter: Annotated[
        Path | None,
        typer.Option(
            "--starter",
            metavar="MAP.toml",
            help="With --describe: write a map to begin with.",
            show_default=False,
        ),
    ] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """CSV, MAT, UFF-58, TDMS, LVM, MF4, CAN logs or netCDF to one recording."""
    from pipelines.recording.importing import describe_sources, import_run

    if describe:
        finish(describe_sources(sources, starter), as_json)
        return
    if starter is not None:
        raise typer.BadParameter("--starter belongs to --describe", param_hint="--starter")
    if channel_map is None or output is None:
        raise typer.BadParameter("--map and -o are needed, unless --describe is given")
    finish(import_run(sources, channel_map, output, rig, overwrite=overwrite), as_json)


@app.command()
def check(runs: Recordings, as_json: Json = False) -> None:
    """Channels, rates, gaps, clipping and the agreement of redundant sensors."""
    require_recordings(runs)
    from pipelines.recording.checking import check_runs

    finish(check_runs(runs), as_json)
