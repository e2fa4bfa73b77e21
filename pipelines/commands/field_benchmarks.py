"""The command that runs public benchmarks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipelines.commands.application import Json, app, command_as_given, finish, free_folder
from pipelines.commands.completion import BENCHMARKS, one_of
from pipelines.report.terminal import say


@app.command()
def benchmark(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME...]",
            help="Benchmarks; all whose files are there.",
            show_default=False,
            autocompletion=one_of(BENCHMARKS),
        ),
    ] = None,
    *,
    data: Annotated[
        Path | None,
        typer.Option(
            "--data",
            metavar="FOLDER",
            help="Published files; SLOSHLAB_EXTERNAL_DATA.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="OUT",
            help="Folder for results.",
            show_default=False,
            callback=free_folder,
        ),
    ] = None,
    list_: Annotated[bool, typer.Option("--list", help="Name benchmarks and their files; no -o needed.")] = False,
    diagnose: Annotated[
        bool, typer.Option("--diagnose", help="Search for what each baseline lacks, too; takes minutes.")
    ] = False,
    no_report: Annotated[bool, typer.Option("--no-report", help="Write benchmarks.json only.")] = False,
    as_json: Json = False,
) -> None:
    """Free-run errors of named models on public benchmarks, beside published ones."""
    from pipelines.field_benchmarks.run import listed, run_benchmarks

    if list_:
        for line in listed():
            say(line)
        return
    if output is None:
        raise typer.BadParameter("-o is needed, unless --list is given")
    summary = run_benchmarks(
        names or (), data, output, command=command_as_given(), diagnose=diagnose, report=not no_report
    )
    finish(summary, as_json)
