"""The blind proof: `trial seal`, `commit`, `check`, `run`, `score` and `compare`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipelines.commands.application import Json, OutputFolder, Scheduler, app, finish
from pipelines.commands.command_help import Application
from pipelines.commands.completion import one_of
from sloshlab.errors import InputError

trial = Application(
    help="The blind proof: hidden cases sealed, diagnosed without the key, and scored.", no_args_is_help=True
)
app.add_typer(trial, name="trial")

Trial = Annotated[
    Path, typer.Argument(metavar="TRIAL", help="Folder made by `seal`, or a challenge.", show_default=False)
]
Challenge = Annotated[
    Path, typer.Argument(metavar="CHALLENGE", help="Folder with cases/NAME/.", show_default=False)
]
Key = Annotated[
    Path | None,
    typer.Option(
        "--key",
        metavar="FILE",
        help="Key that locks truths, outside the folder; made by `seal` and `commit`.",
        show_default=False,
    ),
]
Half = Annotated[
    str | None,
    typer.Option(
        "--half",
        metavar="HALF",
        help="odd: cases that develop; even: cases that judge.",
        show_default=False,
        autocompletion=one_of(("odd", "even")),
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
def commit(
    folder: Challenge,
    truths: Annotated[
        Path, typer.Argument(metavar="TRUTHS", help="TOML, JSON or CSV: what is true.", show_default=False)
    ],
    *,
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="KEPT", help="Truths and salts, for their owner.", show_default=False
        ),
    ],
    key: Key = None,
    as_json: Json = False,
) -> None:
    """Fix the truths of your own cases before anybody answers: commitments into CHALLENGE."""
    from pipelines.diagnosis.challenge import commit_truths

    finish(commit_truths(folder, truths, output, key=key), as_json)


@trial.command()
def check(folder: Challenge, as_json: Json = False) -> None:
    """Say all that is wrong with a challenge, one line per defect; no code of it is run."""
    from pipelines.diagnosis.challenge import check_challenge

    finish(check_challenge(folder), as_json)


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
    trust_code: Annotated[
        bool, typer.Option("--trust-code", help="Run the twins of a challenge, which are programs.")
    ] = False,
    scheduler: Scheduler = None,
    as_json: Json = False,
) -> None:
    """Diagnose every case in a process of its own; goes on where it was stopped."""
    from pipelines.diagnosis.challenge import run_challenge
    from pipelines.diagnosis.trial import run_cases
    from sealed_trial.challenge.challenge_folder import is_challenge
    from sealed_trial.sealing.selection import selection_of

    chosen, options = selection_of(half, cases), () if reports else ("--no-report",)
    if is_challenge(folder):
        summary = run_challenge(
            folder,
            chosen,
            n_workers=workers,
            time_limit_s=time_limit,
            trust_code=trust_code,
            options=options,
            diagnoses=diagnoses,
            perturbation=perturb,
            scheduler=scheduler,
        )
    else:
        summary = run_cases(
            folder,
            chosen,
            n_workers=workers,
            time_limit_s=time_limit,
            options=options,
            diagnoses=diagnoses,
            perturbation=perturb,
            scheduler=scheduler,
        )
    finish(summary, as_json)


@trial.command()
def score(
    folders: Annotated[
        list[Path],
        typer.Argument(metavar="TRIAL...", help="Folders made by `seal`, or one challenge.", show_default=False),
    ],
    *,
    output: OutputFolder,
    key: Key = None,
    truths: Annotated[
        Path | None,
        typer.Option("--truths", metavar="FILE", help="Truths of a challenge.", show_default=False),
    ] = None,
    half: Half = None,
    cases: Cases = None,
    diagnoses: Diagnoses = "diagnoses",
    as_json: Json = False,
) -> None:
    """Open the truths, check the commitments, count."""
    from pipelines.diagnosis.challenge_scores import score_challenge
    from pipelines.diagnosis.trial_scores import score_trials
    from sealed_trial.challenge.challenge_folder import is_challenge
    from sealed_trial.running import DIAGNOSES
    from sealed_trial.sealing.selection import EVERYTHING, selection_of

    chosen = selection_of(half, cases)
    if truths is None and not any(map(is_challenge, folders)):
        finish(score_trials(folders, output, key=key, chosen=chosen, diagnoses=diagnoses), as_json)
        return
    if truths is None or len(folders) != 1 or chosen != EVERYTHING or diagnoses != DIAGNOSES:
        raise InputError(
            "trial score",
            got="a challenge in parts, with others, or no --truths",
            allowed="CHALLENGE --truths FILE -o OUT",
        )
    finish(score_challenge(folders[0], truths, output, key=key), as_json)


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
