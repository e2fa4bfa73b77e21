"""The blind proof: `trial seal`, `trial run`, `trial score`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipelines.commands.application import Json, OutputFolder, app, finish

trial = typer.Typer(
    help="The blind proof: hidden cases sealed, diagnosed without the key, and scored.", no_args_is_help=True
)
app.add_typer(trial, name="trial")

Trial = Annotated[Path, typer.Argument(metavar="TRIAL", help="Folder made by `seal`.", show_default=False)]
Key = Annotated[
    Path | None,
    typer.Option(
        "--key",
        metavar="FILE",
        help="Key of a sealed trial, outside its folder; made by `seal`.",
        show_default=False,
    ),
]


@trial.command()
def seal(
    output: OutputFolder,
    *,
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything random.")] = 0,
    cases: Annotated[int, typer.Option(help="Number of cases.")] = 60,
    key: Key = None,
    development: Annotated[
        bool, typer.Option("--development", help="Readable truths, disjoint from every sealed trial.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Draw hidden cases, publish commitments, lock the truths away."""
    from pipelines.diagnosis.trial import seal_trial

    finish(seal_trial(output, seed=seed, n_cases=cases, key=key, development=development), as_json)


@trial.command()
def run(
    folder: Trial,
    workers: Annotated[int, typer.Option(help="Cases at once.")] = 2,
    time_limit: Annotated[float, typer.Option(metavar="S", help="Seconds a case may take.")] = 180.0,
    reports: Annotated[bool, typer.Option("--reports", help="Write the report of every case too.")] = False,
    as_json: Json = False,
) -> None:
    """Diagnose every case in a process of its own; goes on where it was stopped."""
    from pipelines.diagnosis.trial import run_cases

    finish(run_cases(folder, n_workers=workers, time_limit_s=time_limit, reports=reports), as_json)


@trial.command()
def score(folder: Trial, output: OutputFolder, key: Key = None, as_json: Json = False) -> None:
    """Open the truths, check the commitments, count."""
    from pipelines.diagnosis.trial import score_trial

    finish(score_trial(folder, output, key=key), as_json)
