"""The command line: what to read, what to write, and how it ends.

Exit codes: 0 done; 1 the input is bad, one line on stderr; 2 usage; 3 done, but data were lost or a
result is flagged; 130 interrupted, nothing half-written. Commands import what they need when they
run, so that ``sloshlab --help`` stays quick.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from sloshlab import __version__
from sloshlab.errors import RecordingInterruptedError, SloshlabError

INPUT_IS_BAD, USAGE, DONE_BUT_FLAGGED, INTERRUPTED = 1, 2, 3, 130

# typer brings its own click or uses the installed one; either way this is the root of its usage errors
_UsageError = next(base for base in typer.BadParameter.__mro__ if base.__name__ == "ClickException")

app = typer.Typer(
    name="sloshlab",
    help="Energy, effective mass and damping of shaken, partly filled tanks.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Recordings = Annotated[list[Path], typer.Argument(metavar="RUN.nc...", help="Recordings.", show_default=False)]
RigOption = Annotated[
    list[Path],
    typer.Option("--rig", metavar="RIG.toml", help="Rig description; once per fill level.", show_default=False),
]
OutputFolder = Annotated[
    Path, typer.Option("-o", "--output", metavar="OUT", help="Folder for results.", show_default=False)
]
OutputFile = Annotated[
    Path, typer.Option("-o", "--output", metavar="FILE", help="File to write.", show_default=False)
]
Json = Annotated[bool, typer.Option("--json", help="Print a machine-readable summary as the last line.")]
HalfWidth = Annotated[int, typer.Option("--p", min=1, help="P: a window averages 2P cycles.")]
Spacing = Annotated[int, typer.Option("--m", min=1, help="M: cycles between the centres of windows.")]
Redundant = Annotated[
    list[str] | None,
    typer.Option(
        "--redundant", metavar="A:B", help="Channels of two devices that show the same motion.", show_default=False
    ),
]
NoReport = Annotated[bool, typer.Option("--no-report", help="Write windows.nc and maps.nc only.")]


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    if version:
        typer.echo(__version__)
        raise typer.Exit


@app.command()
def shaker(
    runs: Recordings,
    rig: RigOption,
    output: OutputFolder,
    p: HalfWidth = 6,
    m: Spacing = 24,
    boundaries: Annotated[
        str, typer.Option(help="Cycle boundaries from the 'measured' phase or from the sweep 'law'.")
    ] = "measured",
    allow_incomplete: Annotated[
        bool, typer.Option("--allow-incomplete", help="Analyse a sweep that stops early up to where it stops.")
    ] = False,
    no_report: NoReport = False,
    as_json: Json = False,
) -> None:
    """Sweeps or VFA runs of a tank on the shaker: windows, maps and a report."""
    from pipelines.outputs import write_experiment
    from pipelines.shaker import ShakerSettings, analyse_shaker

    if boundaries not in ("measured", "law"):
        raise typer.BadParameter(f"{boundaries!r} is neither 'measured' nor 'law'", param_hint="--boundaries")
    settings = ShakerSettings.checked(p=p, m=m, boundaries=boundaries, allow_incomplete=allow_incomplete)
    experiment = analyse_shaker(runs, rig, settings)
    _finish(write_experiment(experiment, output, command=_command(), report=not no_report), as_json)


@app.command()
def work(
    runs: Recordings,
    output: OutputFolder,
    force: Annotated[str, typer.Option(help="Channel of the force on the structure.", show_default=False)],
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
    from pipelines.outputs import write_experiment
    from pipelines.work import WorkSettings, analyse_work

    motions = {"acceleration": acceleration, "velocity": velocity, "displacement": displacement}
    if sum(map(bool, motions.values())) != 1:
        raise typer.BadParameter("name exactly one of --acceleration, --velocity, --displacement")
    settings = WorkSettings.checked(p=p, m=m, force=force, motions=motions, phase_reference=phase_reference)
    experiment = analyse_work(runs, settings)
    _finish(write_experiment(experiment, output, command=_command(), report=not no_report), as_json)


@app.command()
def beam(
    runs: Recordings,
    rig: Annotated[
        Path, typer.Option("--rig", metavar="RIG.toml", help="Rig that the runs belong to.", show_default=False)
    ],
    output: OutputFolder,
    modes: Annotated[
        int | None, typer.Option(help="Modes that are kept; all of the rig if not given.", show_default=False)
    ] = None,
    cycles: Annotated[int, typer.Option(help="Cycles per stretch of a decay.")] = 4,
    segment_s: Annotated[
        float | None,
        typer.Option(help="Segments of random runs in s; a sixth of the run if not given.", show_default=False),
    ] = None,
    no_report: Annotated[bool, typer.Option("--no-report", help="Write modal.nc and spectra.nc only.")] = False,
    as_json: Json = False,
) -> None:
    """Beam or guided tank, frozen and sloshing: modal accelerations, damping, spectra and a report."""
    from pipelines.beam import analyse_beam, checked_settings
    from pipelines.beam_outputs import write_beam

    settings = checked_settings(modes=modes, n_cycles=cycles, segment_s=segment_s)
    experiment = analyse_beam(runs, rig, settings)
    _finish(write_beam(experiment, output, command=_command(), report=not no_report), as_json)


@app.command()
def ball(
    runs: Recordings,
    rig: Annotated[
        Path, typer.Option("--rig", metavar="RIG.toml", help="Rig that the runs belong to.", show_default=False)
    ],
    output: OutputFolder,
    omega_bar: Annotated[float, typer.Option(help="On the shaker: ω̄ at which W̄ is matched.")] = 4.0,
    damper: Annotated[str, typer.Option(help="The ball's damper acts in 'contact' or 'always'.")] = "contact",
    lowest_acceleration_g: Annotated[
        float, typer.Option(help="Of a decay: smallest amplitude that is matched, in g.")
    ] = 0.3,
    generations: Annotated[int, typer.Option(help="Of the global search.")] = 40,
    seed: Annotated[int, typer.Option(help="Seed of the global search.")] = 0,
    no_report: Annotated[bool, typer.Option("--no-report", help="Write ball.toml and ball.nc only.")] = False,
    as_json: Json = False,
) -> None:
    """A bouncing ball in place of the liquid, from free decays or from runs on the shaker."""
    from pipelines.bouncing_ball.outputs import write_ball
    from pipelines.bouncing_ball.settings import BallSettings
    from pipelines.bouncing_ball.stages import analyse_ball
    from sloshlab.bouncing_ball.identification import SearchSettings

    if damper not in ("contact", "always"):
        raise typer.BadParameter(f"{damper!r} is neither 'contact' nor 'always'", param_hint="--damper")
    search = SearchSettings(n_generations=generations, seed=seed)
    settings = BallSettings(omega_bar, 1.0 if damper == "always" else 0.0, lowest_acceleration_g, search)
    experiment = analyse_ball(runs, rig, settings)
    _finish(write_ball(experiment, output, command=_command(), report=not no_report), as_json)


@app.command("import")
def import_(
    sources: Annotated[list[Path], typer.Argument(metavar="SRC...", help="Files of one run.", show_default=False)],
    channel_map: Annotated[
        Path | None, typer.Option("--map", metavar="MAP.toml", help="Columns to channels.", show_default=False)
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="RUN.nc", help="Recording to write.", show_default=False),
    ] = None,
    rig: Annotated[Path | None, typer.Option("--rig", metavar="RIG.toml", help="Rig the run belongs to.")] = None,
    describe: Annotated[
        bool, typer.Option("--describe", help="List columns, units, rates and traps; no map needed.")
    ] = False,
    as_json: Json = False,
) -> None:
    """CSV, MAT, UFF-58, TDMS, LVM, MF4, CAN logs or netCDF to one recording."""
    from pipelines.importing import describe_sources, import_run

    if describe:
        _finish(describe_sources(sources), as_json)
        return
    if channel_map is None or output is None:
        raise typer.BadParameter("--map and -o are needed, unless --describe is given")
    _finish(import_run(sources, channel_map, output, rig), as_json)


@app.command()
def check(runs: Recordings, as_json: Json = False) -> None:
    """Channels, rates, gaps, clipping and the agreement of redundant sensors."""
    from pipelines.checking import check_runs

    _finish(check_runs(runs), as_json)


@app.command()
def virtual(
    experiment: Annotated[
        str,
        typer.Argument(
            help="shaker_sweep, shaker_vfa, sudden_start, beam_free, beam_random, sdof_free, "
            "or campaign for a whole folder of raw_data."
        ),
    ],
    output: OutputFile,
    rig: Annotated[Path | None, typer.Option("--rig", metavar="RIG.toml", help="Rig of the experiment.")] = None,
    configuration: Annotated[str, typer.Option(help="sloshing, frozen or empty.")] = "sloshing",
    acceleration_g: Annotated[float, typer.Option(help="Level of the sweep in g.")] = 3.0,
    direction: Annotated[str, typer.Option(help="up or down.")] = "up",
    law: Annotated[str, typer.Option(help="octave, linear or stepped.")] = "octave",
    frequency_hz: Annotated[float, typer.Option(help="Of a sudden start, in Hz.")] = 11.4,
    initial_displacement_m: Annotated[
        float | None, typer.Option(help="Deflection from which a free run starts, in m.", show_default=False)
    ] = None,
    rms_g: Annotated[float, typer.Option(help="Of the random motion of the root, in g.")] = 0.2,
    duration_s: Annotated[
        float | None, typer.Option(help="Duration in seconds; on the shaker 240.", show_default=False)
    ] = None,
    sampling_rate_hz: Annotated[
        float | None, typer.Option(help="Sampling rate in Hz; on the shaker 512.", show_default=False)
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of everything random.")] = 0,
    liquid: Annotated[str, typer.Option(help="law, or numerical: computed, takes long.")] = "law",
    layers: Annotated[int, typer.Option(help="Layers of particles over the height of the tank.")] = 16,
    checkpoint: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Where a computation is saved; by default beside the recording."),
    ] = None,
    workers: Annotated[int, typer.Option(help="Processes of a computed campaign.")] = 2,
    only: Annotated[
        str, typer.Option(metavar="PATTERN", help="Runs of a computed campaign, as a pattern of file names.")
    ] = "*",
    checkpoints: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Where a computed campaign is saved; by default within the output."),
    ] = None,
    as_json: Json = False,
) -> None:
    """A run of the virtual laboratory."""
    from acquisition.virtual_laboratory.numerical_campaign import CampaignSettings
    from pipelines import virtual as laboratory

    if experiment == "campaign":
        computed = CampaignSettings(seed, layers, workers, only, checkpoints)
        _finish(laboratory.make_campaign_folder(output, liquid, computed, typer.echo), as_json)
        return
    run = laboratory.VirtualRun(
        experiment=experiment,
        configuration=configuration,
        seed=seed,
        liquid=liquid,
        layers=layers,
        acceleration_g=acceleration_g,
        direction=direction,
        law=law,
        frequency_hz=frequency_hz,
        duration_s=duration_s,
        sampling_rate_hz=sampling_rate_hz,
        initial_displacement_m=initial_displacement_m,
        rms_g=rms_g,
    )
    _finish(laboratory.make_virtual_run(run, rig, output, checkpoint), as_json)


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
    _finish(simulate_run(settings), as_json)


@app.command()
def record(
    sources: Annotated[
        list[str],
        typer.Option("--source", metavar="URL", help="A device; the first is the time base.", show_default=False),
    ],
    rig: Annotated[
        Path, typer.Option("--rig", metavar="RIG.toml", help="Rig the run belongs to.", show_default=False)
    ],
    output: OutputFile,
    duration: Annotated[
        float | None,
        typer.Option(metavar="S", help="Seconds of samples; until the end if not given.", show_default=False),
    ] = None,
    run_table: Annotated[
        Path | None, typer.Option("--run", metavar="RUN.toml", help="Attributes of the run.", show_default=False)
    ] = None,
    attribute: Annotated[
        list[str] | None, typer.Option(metavar="KEY=VALUE", help="An attribute of the run.", show_default=False)
    ] = None,
    align: Annotated[str, typer.Option(help="Clocks of several devices: host, device or counter.")] = "host",
    redundant: Redundant = None,
    keep_journal: Annotated[bool, typer.Option("--keep-journal", help="Keep RUN.journal.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a recording that is there.")] = False,
    as_json: Json = False,
) -> None:
    """Live devices – serial, CAN, simulated – to one recording, through a crash-safe journal."""
    from pipelines.live_view import LiveView
    from pipelines.record import RecordSettings
    from pipelines.record import record as record_run

    settings = RecordSettings(
        sources=tuple(sources),
        rig=rig,
        output=output,
        duration_s=duration,
        run=run_table,
        attributes=tuple(attribute or ()),
        align=align,
        redundant=tuple(redundant or ()),
        keep_journal=keep_journal,
        overwrite=overwrite,
    )
    with LiveView(output.absolute().parent, len(sources)) as view:
        summary = record_run(settings, view)
    _finish(summary, as_json)


@app.command()
def recover(
    journal: Annotated[
        Path, typer.Argument(metavar="RUN.journal", help="Journal of a recorder.", show_default=False)
    ],
    output: OutputFile,
    align: Annotated[
        str | None,
        typer.Option(help="host, device or counter; as it was recorded if not given.", show_default=False),
    ] = None,
    redundant: Redundant = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a recording that is there.")] = False,
    as_json: Json = False,
) -> None:
    """A journal left by a crash to a recording: everything up to the last complete block."""
    from pipelines.recover import recover as recover_journal

    summary = recover_journal(journal, output, overwrite, align=align, redundant=redundant or ())
    _finish(summary, as_json)


@app.command()
def replay(
    source: Annotated[
        str,
        typer.Argument(
            metavar="RUN.nc",
            help="A recording, virtual:EXPERIMENT?rig=RIG.toml or pattern:channels=8.",
            show_default=False,
        ),
    ],
    urls: Annotated[
        list[str], typer.Option("--as", metavar="URL", help="Where a device appears.", show_default=False)
    ],
    channels: Annotated[
        list[str] | None, typer.Option(metavar="A,B", help="Channels; once per --as.", show_default=False)
    ] = None,
    speed: Annotated[str, typer.Option(help="Factor of real time, or 'max'.")] = "1",
    faults: Annotated[
        list[Path] | None,
        typer.Option(metavar="FAULTS.toml", help="Faults or 'none'; once per --as.", show_default=False),
    ] = None,
    samples_per_frame: Annotated[int | None, typer.Option(help="Of a serial device.", show_default=False)] = None,
    expose: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Listen here, for more than this computer: whoever reaches it reads every sample.",
        ),
    ] = "",
    free_run: Annotated[bool, typer.Option("--free-run", help="Begin without being started by a host.")] = False,
    wait_clients: Annotated[int, typer.Option(min=1, help="Clients a socketcand device waits for.")] = 1,
    seed: Annotated[int, typer.Option(help="Seed of everything random.")] = 0,
    loop_duration: Annotated[
        float | None, typer.Option(help="Repeat the recording up to so many seconds.", show_default=False)
    ] = None,
    truth: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Write what each fault touched.", show_default=False)
    ] = None,
    as_json: Json = False,
) -> None:
    """A recording, the virtual rig or a test pattern, played as serial or CAN devices."""
    from pipelines.replay import ReplaySettings
    from pipelines.replay import replay as play

    settings = ReplaySettings(
        source=source,
        urls=urls,
        channels=channels or (),
        speed=speed,
        faults=[None if str(path) == "none" else path for path in faults or ()],
        samples_per_frame=samples_per_frame,
        expose=expose or None,
        free_run=free_run,
        wait_clients=wait_clients,
        seed=seed,
        loop_duration_s=loop_duration,
        truth=truth,
    )
    _finish(play(settings), as_json)


def _finish(summary: dict[str, Any], as_json: bool) -> None:
    """Say what a command has to say: ``lines`` for people; ``flags`` make the exit code 3."""
    for line in summary.pop("lines", []):
        typer.echo(line)
    flags = summary.get("flags", [])
    for flag in flags:
        typer.echo(f"flagged: {flag}", err=True)
    if as_json:
        typer.echo(json.dumps(summary, sort_keys=True, default=str))
    if flags:
        raise typer.Exit(DONE_BUT_FLAGGED)


def _command() -> str:
    return " ".join(["sloshlab", *(Path(word).name if os.sep in word else word for word in sys.argv[1:])])


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    try:
        code = int(app(args=list(arguments) if arguments is not None else None, standalone_mode=False) or 0)
        if code == INTERRUPTED:  # some versions of typer turn Ctrl-C into this code without a word
            raise KeyboardInterrupt
        return code
    except RecordingInterruptedError as error:
        print(f"sloshlab: {error}", file=sys.stderr)  # noqa: T201
        return INTERRUPTED
    except SloshlabError as error:
        print(f"sloshlab: {error}", file=sys.stderr)  # noqa: T201
        return INPUT_IS_BAD
    except _UsageError as error:
        error.show()
        return USAGE
    except (KeyboardInterrupt, typer.Abort):
        print("sloshlab: interrupted; nothing half-written", file=sys.stderr)  # noqa: T201
        return INTERRUPTED
    except OSError as error:
        what = f"{error.filename}: " if error.filename else ""
        remedy = "check that the path can be written, and that a folder or file of this name is not in the way"
        print(f"sloshlab: {what}got {error.strerror or error}; remedy: {remedy}", file=sys.stderr)  # noqa: T201
        return INPUT_IS_BAD


def main() -> NoReturn:
    """Entry point of the ``sloshlab`` command."""
    sys.exit(run())


if __name__ == "__main__":
    main()
