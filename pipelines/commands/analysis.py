"""Commands that analyse recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipelines.commands.application import (
    HalfWidth,
    Json,
    NoReport,
    OutputFolder,
    Recordings,
    RigOption,
    Spacing,
    app,
    command_as_given,
    finish,
    require_recordings,
)
from pipelines.commands.completion import one_of
from pipelines.report.result_folder import require_result_folder


@app.command()
def analyse(runs: Recordings, rig: RigOption, output: OutputFolder, as_json: Json = False) -> None:
    """Recordings by the pipeline of their experiment, with its usual settings."""
    require_recordings(runs)
    from pipelines.recording.analysing import analyse_runs

    finish(analyse_runs(runs, rig, output, command_as_given()), as_json)


@app.command()
def shaker(
    runs: Recordings,
    rig: RigOption,
    output: OutputFolder,
    *,
    p: HalfWidth = 6,
    m: Spacing = 24,
    boundaries: Annotated[
        str,
        typer.Option(
            help="Cycle boundaries from the 'measured' phase or from the sweep 'law'.",
            autocompletion=one_of(("measured", "law")),
        ),
    ] = "measured",
    allow_incomplete: Annotated[
        bool, typer.Option("--allow-incomplete", help="Analyse a sweep that stops early up to where it stops.")
    ] = False,
    no_report: NoReport = False,
    as_json: Json = False,
) -> None:
    """Sweeps or VFA runs of a tank on the shaker: windows, maps and a report."""
    require_recordings(runs)
    from pipelines.sweep.outputs import files_of, write_experiment
    from pipelines.sweep.shaker import ShakerSettings, analyse_shaker

    if boundaries not in ("measured", "law"):
        raise typer.BadParameter(f"{boundaries!r} is neither 'measured' nor 'law'", param_hint="--boundaries")
    require_result_folder(output, files_of(report=not no_report))
    settings = ShakerSettings.checked(
        p=p, m=m, boundaries=boundaries, allow_incomplete=allow_incomplete, has_report=not no_report
    )
    experiment = analyse_shaker(runs, rig, settings)
    finish(write_experiment(experiment, output, command=command_as_given(), report=not no_report), as_json)


@app.command()
def work(
    runs: Recordings,
    output: OutputFolder,
    force: Annotated[str, typer.Option(help="Channel of the force on the structure.", show_default=False)],
    *,
    acceleration: Annotated[str, typer.Option(help="Channel of the motion, as acceleration.")] = "",
    velocity: Annotated[str, typer.Option(help="Channel of the motion, as velocity.")] = "",
    displacement: Annotated[str, typer.Option(help="Channel of the motion, as displacement.")] = "",
    phase_reference: Annotated[
        str, typer.Option(help="Channel whose phase counts the cycles; the motion if not given.")
    ] = "",
    p: HalfWidth = 6,
    m: Spacing = 24,
    no_report: NoReport = False,
    as_json: Json = False,
) -> None:
    """Any sweep with one force and one motion channel, no tank needed."""
    require_recordings(runs)
    from pipelines.sweep.outputs import files_of, write_experiment
    from pipelines.sweep.work import WorkSettings, analyse_work

    motions = {"acceleration": acceleration, "velocity": velocity, "displacement": displacement}
    if sum(map(bool, motions.values())) != 1:
        raise typer.BadParameter("name exactly one of --acceleration, --velocity, --displacement")
    require_result_folder(output, files_of(report=not no_report))
    settings = WorkSettings.checked(p=p, m=m, force=force, motions=motions, phase_reference=phase_reference)
    experiment = analyse_work(runs, settings)
    finish(write_experiment(experiment, output, command=command_as_given(), report=not no_report), as_json)


@app.command()
def beam(
    runs: Recordings,
    rig: Annotated[
        Path, typer.Option("--rig", metavar="RIG.toml", help="Rig that the runs belong to.", show_default=False)
    ],
    output: OutputFolder,
    *,
    modes: Annotated[
        int | None, typer.Option(help="Modes that are kept; all of the rig if not given.", show_default=False)
    ] = None,
    cycles: Annotated[int, typer.Option(help="Cycles per stretch of a decay.")] = 4,
    segment_s: Annotated[
        float | None,
        typer.Option(help="Segments of random runs in s; a sixth of the run if not given.", show_default=False),
    ] = None,
    rom: Annotated[
        list[Path] | None,
        typer.Option("--rom", metavar="ROM.nc", help="Model to simulate the runs with.", show_default=False),
    ] = None,
    ball_table: Annotated[
        list[Path] | None,
        typer.Option("--ball", metavar="ball.toml", help="Ball to simulate the runs with.", show_default=False),
    ] = None,
    ensemble: Annotated[
        Path | None,
        typer.Option(metavar="ENSEMBLE.nc", help="Models whose spread is carried into ζ₁.", show_default=False),
    ] = None,
    twins: Annotated[
        bool, typer.Option("--twins", help="Simulate the sloshing runs with frozen liquid and dampers, too.")
    ] = False,
    no_report: Annotated[bool, typer.Option("--no-report", help="Write modal.nc and spectra.nc only.")] = False,
    as_json: Json = False,
) -> None:
    """Beam or guided tank, frozen and sloshing: modal accelerations, damping, spectra and a report."""
    require_recordings(runs)
    from pipelines.structure.analysis import analyse_beam, checked_settings
    from pipelines.structure.outputs import files_of, write_beam
    from pipelines.structure.with_twins import analyse_beam_with_twins

    settings = checked_settings(modes=modes, n_cycles=cycles, segment_s=segment_s)
    require_result_folder(output, files_of(report=not no_report))
    simulated: dict[str, bytes] = {}
    if twins or rom or ball_table or ensemble:
        experiment, simulated = analyse_beam_with_twins(
            runs, rig, settings, roms=rom or [], balls=ball_table or [], ensemble=ensemble
        )
    else:
        experiment = analyse_beam(runs, rig, settings)
    summary = write_beam(experiment, output, command=command_as_given(), report=not no_report, twins=simulated)
    finish(summary, as_json)


@app.command()
def ball(
    runs: Recordings,
    rig: Annotated[
        Path, typer.Option("--rig", metavar="RIG.toml", help="Rig that the runs belong to.", show_default=False)
    ],
    output: OutputFolder,
    *,
    omega_bar: Annotated[float, typer.Option(help="On the shaker: ω̄ at which W̄ is matched.")] = 4.0,
    damper: Annotated[
        str,
        typer.Option(
            help="The ball's damper acts in 'contact' or 'always'.", autocompletion=one_of(("contact", "always"))
        ),
    ] = "contact",
    lowest_acceleration_g: Annotated[
        float, typer.Option(help="Of a decay: smallest amplitude that is matched, in g.")
    ] = 0.3,
    generations: Annotated[int, typer.Option(help="Of the global search.")] = 40,
    seed: Annotated[int, typer.Option(help="Seed of the global search.")] = 0,
    no_report: Annotated[bool, typer.Option("--no-report", help="Write ball.toml and ball.nc only.")] = False,
    as_json: Json = False,
) -> None:
    """A bouncing ball in place of the liquid, from free decays or from runs on the shaker."""
    if damper not in ("contact", "always"):
        raise typer.BadParameter(f"{damper!r} is neither 'contact' nor 'always'", param_hint="--damper")
    require_recordings(runs)
    from pipelines.ball.outputs import files_of, write_ball
    from pipelines.ball.settings import BallSettings
    from pipelines.ball.stages import analyse_ball
    from sloshlab.bouncing_ball.identification import SearchSettings

    search = SearchSettings(n_generations=generations, seed=seed)
    settings = BallSettings(omega_bar, 1.0 if damper == "always" else 0.0, lowest_acceleration_g, search)
    require_result_folder(output, files_of(report=not no_report))
    experiment = analyse_ball(runs, rig, settings)
    finish(write_ball(experiment, output, command=command_as_given(), report=not no_report), as_json)


@app.command("ball-network")
def ball_network(
    runs: Recordings,
    rig: Annotated[
        Path, typer.Option("--rig", metavar="RIG.toml", help="Rig that the runs belong to.", show_default=False)
    ],
    ball_table: Annotated[
        Path, typer.Option("--ball", metavar="ball.toml", help="Ball that the network learns.", show_default=False)
    ],
    output: OutputFolder,
    *,
    duration_s: Annotated[float, typer.Option(help="Length of the run of the ball that it learns from.")] = 200.0,
    rate_hz: Annotated[float, typer.Option(help="Rate of that run and of the network.")] = 1000.0,
    delays: Annotated[int, typer.Option(min=1, help="Past velocities that the network sees.")] = 50,
    layers: Annotated[int, typer.Option(min=1, help="Hidden layers.")] = 7,
    neurons: Annotated[int, typer.Option(min=1, help="Neurons of each.")] = 35,
    steps: Annotated[int, typer.Option(min=1, help="Of the training, at most so many.")] = 1500,
    every: Annotated[int, typer.Option(min=1, help="One sample in so many is a target of the training.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Of the start.")] = 0,
    no_report: Annotated[bool, typer.Option("--no-report", help="Write ROM.nc and network.nc only.")] = False,
    as_json: Json = False,
) -> None:
    """A network that learns from a bouncing ball, in place of the liquid of free decays (Appendix C)."""
    require_recordings(runs)
    from pipelines.ball.network_outputs import files_of, write_ball_network
    from pipelines.ball.network_results import BallNetworkSettings
    from pipelines.ball.network_stages import network_of_ball
    from sloshlab.reduced_order_model.gradient_training import GradientSettings

    require_result_folder(output, files_of(report=not no_report))
    training = GradientSettings(n_steps=steps, every=every, seed=seed)
    settings = BallNetworkSettings(duration_s, rate_hz, delays, layers, neurons, training)
    learnt = network_of_ball(runs, rig, ball_table, settings)
    summary = write_ball_network(learnt, output, command=command_as_given(), report=not no_report)
    finish(summary, as_json)
