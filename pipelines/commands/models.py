"""Commands that train and simulate models."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipelines.commands.application import (
    Json,
    OutputFile,
    OutputFolder,
    Overwrite,
    Scheduler,
    app,
    command_as_given,
    finish,
    free_file,
)
from pipelines.commands.completion import NETWORKS, one_of
from sloshlab.configurations import CONFIGURATIONS, SLOSHING
from sloshlab.errors import InputError

Runs = Annotated[
    list[Path],
    typer.Argument(
        metavar="TRAIN.nc... VALID.nc",
        help="Training runs, and one for validation at the end.",
        show_default=False,
    ),
]
ModelRig = Annotated[
    Path, typer.Option("--rig", metavar="RIG.toml", help="Rig that the runs belong to.", show_default=False)
]
Still = Annotated[
    list[Path] | None,
    typer.Option("--still", metavar="RUN.nc", help="Empty or frozen run, for the dry mass.", show_default=False),
]
Test = Annotated[
    list[Path] | None,
    typer.Option(
        "--test",
        metavar="RUN.nc",
        help="Further run for the report only; repeats set the ceiling, sweeps make the maps.",
        show_default=False,
    ),
]
Rate = Annotated[
    float | None,
    typer.Option("--rate-hz", help="Rate of the model; chosen from the runs if not given.", show_default=False),
]
Starts = Annotated[int, typer.Option(min=1, help="Trainings from different starts; the best is kept.")]
StartSeed = Annotated[int, typer.Option("--seed", min=0, help="Of the starts.")]


@app.command()
def train(
    runs: Runs,
    rig: Annotated[
        list[Path],
        typer.Option(
            metavar="RIG.toml",
            help="Rig of the runs; several, filled to different levels: the network sees the fill level.",
            show_default=False,
        ),
    ],
    output: OutputFile,
    *,
    still: Still = None,
    test: Test = None,
    model: Annotated[
        str, typer.Option(help="nfir (no feedback) or noe.", autocompletion=one_of(("nfir", "noe")))
    ] = "nfir",
    delays: Annotated[int, typer.Option(min=1, help="Past velocities that the model sees.")] = 70,
    output_delays: Annotated[int, typer.Option(min=1, help="Past forces fed back, with noe.")] = 2,
    neurons: Annotated[int, typer.Option(min=1, help="Neurons of the hidden layer.")] = 35,
    network: Annotated[
        str, typer.Option(help="normalised_rbf, rbf or multilayer.", autocompletion=one_of(NETWORKS))
    ] = "normalised_rbf",
    rate_hz: Rate = None,
    epochs: Annotated[int, typer.Option(min=1, help="At most so many.")] = 60,
    starts: Starts = 1,
    seed: StartSeed = 0,
    galilean: Annotated[
        bool, typer.Option("--galilean", help="A constant velocity of the tank does not change the force.")
    ] = False,
    weigh_small_motion: Annotated[
        bool, typer.Option("--weigh-small-motion", help="Errors count up to 8 times where the motion is small.")
    ] = False,
    memory_s: Annotated[
        float | None,
        typer.Option(help="Time constant of a slow state that the network sees, too.", show_default=False),
    ] = None,
    sudden_start: Annotated[
        list[Path] | None,
        typer.Option(metavar="RUN.nc", help="Run from rest, for the break-up of the liquid.", show_default=False),
    ] = None,
    ensemble: Annotated[int, typer.Option(min=0, help="Members of an ensemble for intervals.")] = 0,
    no_report: Annotated[bool, typer.Option("--no-report", help="Write the model only.")] = False,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Reduced-order model of the liquid from runs on the shaker, and its validation report."""
    from pipelines.liquid_model.fill_levels import files_of_fills, train_over_fills
    from pipelines.liquid_model.model_settings import ModelSettings
    from pipelines.liquid_model.train import train_and_report
    from pipelines.liquid_model.training_runs import RunFiles
    from sloshlab.reduced_order_model.training import TrainingSettings

    wanted = ModelSettings(
        model,
        delays,
        output_delays,
        neurons,
        network=network,
        rate_hz=rate_hz,
        memory_s=memory_s,
        sudden_starts=tuple(sudden_start or ()),
        n_members=ensemble,
        weighs_small_motion=weigh_small_motion,
    )
    settings = TrainingSettings(n_epochs=epochs, n_starts=starts, seed=seed, galilean=galilean)
    if len(rig) > 1:
        filled = files_of_fills(runs, still or [], rig)
        if test:
            got, remedy = "runs for a report", "give them to sloshlab validate, fill by fill"
            raise InputError("--test with several rigs", got=got, allowed="none", remedy=remedy)
        summary = train_over_fills(
            filled, wanted, settings, output, command=command_as_given(), overwrite=overwrite
        )
        finish(summary, as_json)
        return
    files = RunFiles.of(runs, still or [], rig[0])
    command = None if no_report else command_as_given()
    summary = train_and_report(files, test or [], wanted, settings, output, command=command, overwrite=overwrite)
    finish(summary, as_json)


@app.command()
def validate(
    rom: Annotated[Path, typer.Argument(metavar="ROM.nc", help="Model.", show_default=False)],
    runs: Annotated[
        list[Path],
        typer.Argument(metavar="RUN.nc...", help="Runs that it was not trained on.", show_default=False),
    ],
    rig: ModelRig,
    output: OutputFolder,
    *,
    still: Still = None,
    test: Test = None,
    as_json: Json = False,
) -> None:
    """Validation report of a model that is there already, on runs that it was not trained on."""
    from pipelines.liquid_model.train import validate_model
    from pipelines.liquid_model.training_runs import RunFiles

    files = RunFiles((), tuple(runs), tuple(still or []), rig)
    finish(validate_model(rom, files, test or [], output, command_as_given()), as_json)


@app.command()
def study(
    runs: Runs,
    rig: ModelRig,
    output: OutputFolder,
    *,
    still: Still = None,
    cases: Annotated[
        str,
        typer.Option(
            help="'source': its 24 NFIR and 3 NOE, or 'all': more.", autocompletion=one_of(("source", "all"))
        ),
    ] = "all",
    rate_hz: Rate = None,
    epochs: Annotated[int, typer.Option(min=1, help="Of each case, at most so many.")] = 20,
    starts: Starts = 1,
    seed: StartSeed = 0,
    workers: Annotated[int, typer.Option(min=1, max=256, help="Processes, one case each.")] = 2,
    scheduler: Scheduler = None,
    as_json: Json = False,
) -> None:
    """Sensitivity study: many models, picked by validation error; goes on where it was stopped."""
    from pipelines.liquid_model.study import StudySettings
    from pipelines.liquid_model.study import study as carried_out
    from pipelines.liquid_model.training_runs import RunFiles
    from sloshlab.reduced_order_model.training import TrainingSettings

    files = RunFiles.of(runs, still or [], rig)
    settings = TrainingSettings(n_epochs=epochs, n_starts=starts, seed=seed)
    wanted = StudySettings(cases, rate_hz, workers, scheduler)
    finish(carried_out(files, output, wanted, settings, command=command_as_given()), as_json)


@app.command()
def simulate(
    rig: Annotated[
        Path, typer.Option("--rig", metavar="RIG.toml", help="Rig whose twin runs.", show_default=False)
    ],
    run_file: Annotated[
        Path, typer.Option("--input", metavar="RUN.nc", help="Recording that drives it.", show_default=False)
    ],
    output: OutputFile,
    *,
    block: Annotated[
        str,
        typer.Option(
            help="'all' together, or 'tank' or 'structure' alone on its measured input.",
            autocompletion=one_of(("all", "tank", "structure")),
        ),
    ] = "all",
    configuration: Annotated[
        str,
        typer.Option(
            help="Liquid: sloshing (as described), frozen, empty.", autocompletion=one_of(CONFIGURATIONS)
        ),
    ] = SLOSHING,
    twin: Annotated[
        Path | None,
        typer.Option(metavar="TWIN.toml", help="A saved twin instead of that of the rig.", show_default=False),
    ] = None,
    save_twin: Annotated[
        Path | None,
        typer.Option(metavar="TWIN.toml", help="Save the twin that ran.", show_default=False, callback=free_file),
    ] = None,
    steps: Annotated[
        int | None,
        typer.Option(min=1, max=1000, help="Integration steps per sample.", show_default=False),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise of the twin's sensors.")] = 0,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """The twin of a rig file, driven by the motion, the base motion or the release of a recorded run."""
    from pipelines.twin.simulate import simulate_run
    from pipelines.twin.simulation_settings import SimulationSettings

    settings = SimulationSettings(
        rig, run_file, output, block, configuration, twin, save_twin, steps, seed, overwrite
    )
    finish(simulate_run(settings), as_json)
