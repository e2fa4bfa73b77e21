"""The command `demo`: the diagnosis shown on physics that is hidden from it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipelines.commands.application import Json, app, finish, free_folder
from pipelines.commands.completion import DEMONSTRATIONS, one_of
from pipelines.report.terminal import say


@app.command()
def demo(
    name: Annotated[
        str,
        typer.Argument(
            metavar="[NAME]",
            help="What is hidden; see --list.",
            autocompletion=one_of(DEMONSTRATIONS),
        ),
    ] = "friction",
    *,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="DIR",
            help="Folder for case, truth and results; demo/NAME.",
            show_default=False,
            callback=free_folder,
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Draw another case than the ready-made one.", show_default=False)
    ] = None,
    no_open: Annotated[bool, typer.Option("--no-open", help="Do not open the page in a browser.")] = False,
    list_them: Annotated[bool, typer.Option("--list", help="List all demonstrations and exit.")] = False,
    as_json: Json = False,
) -> None:
    """Hide physics in a laboratory run, find it, show the truth beside the answer: within a minute."""
    from pipelines.demonstration.demonstrate import demonstrate, list_lines

    if list_them:
        finish({"lines": list_lines()}, as_json)
        return
    finish(demonstrate(name, output or Path("demo") / name, say, seed=seed, opens_page=not no_open), as_json)
