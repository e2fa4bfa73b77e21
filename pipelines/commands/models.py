"""Commands that train and simulate models."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipelines.commands.application import (
    Json,
    OutputFile,
    app,
    finish,
)


@app.command()
def train(
    runs: Annotated[
        list[Path],
        typer.Argument(
            metavar="TRAIN.nc... VALID.nc",
            help="Training runs, and one for validation at the end.",
            show_default=False,
        ),
    ],
    rig: Annotated[
        Path, typer.Option("--rig", metavar="RIG.toml", help="Rig that the runs belong to.", show_default=False)
    ],
    output: OutputFile,
    still: Annotated[
        list[Path] | None,
        typer.Option(
            "--still", metavar="RUN.nc", help="Empty or frozen run, for the dry mass.", show_default=False
        ),
    ] = None,
    model: Annotated[str, typer.Option(help="nfir (no feedback) or noe.")] = "nfir",
    delays: Annotated[int, typer.Option(min=1, help="Past velocities that the model sees.")] = 70,
    output_delays: Annotated[int, typer.Option(min=1, help="Past forces fed back, with noe.")] = 2,
    neurons: Annotated[int, typer.Option(min=1, help="Neurons of the hidden layer.")] = 35,
    network: Annotated[str, typer.Option(help="normalised_rbf, rbf or multilayer.")] = "normalised_rbf",
    rate_hz: Annotated[
        float | None,
        typer.Option(help="Rate of the model; chosen from the runs if not given.", show_default=False),
    ] = None,
    epochs: Annotated[int, typer.Option(min=1, help="At most so many.")] = 60,
    starts: Annotated[int, typer.Option(min=1, help="Trainings from different starts; the best is kept.")] = 1,
    seed: Annotated[int, typer.Option(min=0, help="Of the starts.")] = 0,
    as_json: Json = False,
) -> None:
    """Reduced-order model of the liquid from runs on the shaker."""
    from pipelines.train import ModelSettings, trained_model, write_model
    from sloshlab.errors import InputError
    from sloshlab.reduced_order_model.training import TrainingSettings

    if len(runs) < 2:
        raise InputError(
            "runs", got="one", allowed="TRAIN.nc... VALID.nc", remedy="give another run for validation"
        )
    wanted = ModelSettings(model, delays, output_delays, neurons, network, rate_hz)
    settings = TrainingSettings(n_epochs=epochs, n_starts=starts, seed=seed)
    finish(write_model(trained_model(runs[:-1], runs[-1:], still or [], rig, wanted, settings), output), as_json)


@app.command()
def simulate(
    rig: Annotated[
        Path, typer.Option("--rig", metavar="RIG.toml", help="Rig whose twin runs.", show_default=False)
    ],
    run_file: Annotated[
        Path, typer.Option("--input", metavar="RUN.nc", help="Recording that drives it.", show_default=False)
    ],
    output: OutputFile,
    block: Annotated[
        str, typer.Option(help="'all' together, or 'tank' or 'structure' alone on its measured input.")
    ] = "all",
    configuration: Annotated[
        str, typer.Option(help="Liquid: sloshing (as described), frozen, empty.")
    ] = "sloshing",
    twin: Annotated[
        Path | None,
        typer.Option(metavar="TWIN.toml", help="A saved twin instead of that of the rig.", show_default=False),
    ] = None,
    save_twin: Annotated[
        Path | None, typer.Option(metavar="TWIN.toml", help="Save the twin that ran.", show_default=False)
    ] = None,
    steps: Annotated[
        int | None,
        typer.Option(min=1, max=1000, help="Integration steps per sample.", show_default=False),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise of the twin's sensors.")] = 0,
    as_json: Json = False,
) -> None:
    """The twin of a rig file, driven by the motion, the base motion or the release of a recorded run."""
    from pipelines.simulate import SimulationSettings, simulate_run

    settings = SimulationSettings(rig, run_file, output, block, configuration, twin, save_twin, steps, seed)
    finish(simulate_run(settings), as_json)
