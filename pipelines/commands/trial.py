"""The blind proof: `trial seal`, `trial run`, `trial score`, `trial compare`."""

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
Half = Annotated[
    str | None,
    typer.Option(
        "--half", metavar="HALF", help="odd: cases that develop; even: cases that judge.", show_default=False
    ),
]
Cases = Annotated[
    str | None,
    typer.Option("--cases", metavar="A,B,...", help="Cases by number or name; all.", show_default=False),
]
Diagnoses = Annotated[
    str, typer.Option("--diagnoses", metavar="NAME", help="Folder of the trial that takes the answers.")
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
    *,
    workers: Annotated[int, typer.Option(help="Cases at once.")] = 2,
    time_limit: Annotated[float, typer.Option(metavar="S", help="Seconds a case may take.")] = 180.0,
    half: Half = None,
    cases: Cases = None,
    diagnoses: Diagnoses = "diagnoses",
    perturb: Annotated[
        int | None,
        typer.Option(
            "--perturb",
            metavar="SEED",
            min=0,
            help="Recordings moved by a millionth; answers in DIAGNOSES_perturbed_SEED.",
            show_default=False,
        ),
    ] = None,
    reports: Annotated[bool, typer.Option("--reports", help="Write the report of every case too.")] = False,
    as_json: Json = False,
) -> None:
    """Diagnose every case in a process of its own; goes on where it was stopped."""
    from pipelines.diagnosis.trial import run_cases
    from sealed_trial.sealing.selection import selection_of

    summary = run_cases(
        folder,
        selection_of(half, cases),
        n_workers=workers,
        time_limit_s=time_limit,
        options=() if reports else ("--no-report",),
        diagnoses=diagnoses,
        perturbation=perturb,
    )
    finish(summary, as_json)


@trial.command()
def score(
    folders: Annotated[
        list[Path], typer.Argument(metavar="TRIAL...", help="Folders made by `seal`.", show_default=False)
    ],
    *,
    output: OutputFolder,
    key: Key = None,
    half: Half = None,
    cases: Cases = None,
    diagnoses: Diagnoses = "diagnoses",
    as_json: Json = False,
) -> None:
    """Open the truths, check the commitments, count."""
    from pipelines.diagnosis.trial_scores import score_trials
    from sealed_trial.sealing.selection import selection_of

    chosen = selection_of(half, cases)
    finish(score_trials(folders, output, key=key, chosen=chosen, diagnoses=diagnoses), as_json)


@trial.command()
def compare(
    folders: Annotated[
        list[Path],
        typer.Argument(metavar="A B...", help="Pairs of folders with the answers of a run.", show_default=False),
    ],
    as_json: Json = False,
) -> None:
    """Count the cases that two diagnoses answer alike, and list the others."""
    from pipelines.diagnosis.trial_scores import compare_diagnoses

    finish(compare_diagnoses(folders), as_json)
