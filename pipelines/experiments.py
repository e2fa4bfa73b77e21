"""The experiments that make runs, each on a folder of recordings with its rigs beside them."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Final

from pipelines.command_line import run
from pipelines.commands.application import DONE_BUT_FLAGGED, INPUT_IS_BAD
from pipelines.report.terminal import say
from pipelines.sweep.folder import recordings_and_rigs
from sloshlab.errors import InputError, SloshlabError
from sloshlab.experiments import experiment_names

_MINUTES_PER_BALL: Final = 1


def shaker_arguments(folder: Path, output: Path, rigs_folder: Path | None = None) -> list[str]:
    """Arguments of `sloshlab shaker` for all runs and rigs of a folder; the rig filled half comes first."""
    recordings, rigs = recordings_and_rigs(folder, rigs_folder)
    options = [part for rig in rigs for part in ("--rig", str(rig))]
    return ["shaker", *map(str, recordings), *options, "-o", str(output)]


def main() -> int:
    """Run ``EXPERIMENT FOLDER OUTPUT``; ``replay`` takes ``--patience S``, too."""
    parser = argparse.ArgumentParser(prog="python -m pipelines.experiments", description=__doc__)
    parser.add_argument("experiment")
    parser.add_argument("folder", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("--patience", type=float, metavar="S", help="of replay: how long a device may be silent")
    given = parser.parse_args()
    experiment, folder, output = given.experiment, given.folder, given.output
    if given.patience is not None and experiment != "replay":
        parser.error("--patience is an option of replay only")
    analysed = experiment_names(lambda known: bool(known.pipeline))
    if experiment not in (*_FOLDERS, *analysed):
        allowed = ", ".join((*_FOLDERS, *analysed))
        say(f"unknown experiment {experiment!r}; allowed: {allowed}", error=True)
        return 2
    try:
        if given.patience is not None:
            return _replay(folder, output, given.patience)
        return _FOLDERS.get(experiment, _any)(folder, output)
    except SloshlabError as error:
        say(f"sloshlab: {error}", error=True)
        return INPUT_IS_BAD


def _shaker(folder: Path, output: Path) -> int:
    """Maps and report; a flagged result is a result."""
    code = run(shaker_arguments(folder, output))
    if code in (0, DONE_BUT_FLAGGED):
        say(f"The report is {(output / 'report.html').resolve()}")
        return 0
    return code


def beam_arguments(folder: Path, output: Path) -> list[str]:
    """Arguments of `sloshlab beam` for all runs of a folder and the rig beside them.

    Raises
    ------
    InputError
        If there is not one rig and at least one recording.
    """
    if not folder.is_dir():
        raise InputError(
            f"{folder}", got="no such folder", remedy="make it with `make tank-campaign`, which computes for hours"
        )
    recordings, rigs = sorted(folder.glob("*.nc")), sorted(folder.glob("rig*.toml"))
    if not recordings or len(rigs) != 1:
        raise InputError(
            f"{folder}",
            got=f"{len(recordings)} recordings and {len(rigs)} rig files",
            allowed="recordings and one rig*.toml",
            remedy="make them with `make tank-campaign`, or name the files to `sloshlab beam`",
        )
    return ["beam", *map(str, recordings), "--rig", str(rigs[0]), "-o", str(output)]


def _beam(folder: Path, output: Path) -> int:
    """Damping, modes, twins of the sloshing runs, and report; a flagged result is a result."""
    code = run([*beam_arguments(folder, output), "--twins"])
    if code in (0, DONE_BUT_FLAGGED):
        say(f"The report is {(output / 'report.html').resolve()}")
        return 0
    return code


def _ball(folder: Path, output: Path) -> int:
    """Balls by both dampers from what is there of the folder: decays, and both shakers filled half."""
    whole = folder / "numerical_tank"
    found = {
        "decay": (sorted((whole / "sdof").glob("*.nc")), whole / "sdof" / "rig_sdof.toml"),
        "shaker": (sorted((folder / "shaker").glob("fill_0.50_*.nc")), folder / "shaker" / "rig_fill_0.50.toml"),
        "numerical_tank": (
            sorted((whole / "shaker").glob("fill_0.50_*.nc")),
            whole / "shaker" / "rig_fill_0.50.toml",
        ),
    }
    if not any(runs for runs, _ in found.values()):
        raise InputError(f"{folder}", got="no recordings", remedy="make them with `make campaign`")
    tasks = [(name, damper) for name in found for damper in ("contact", "always")]
    say(f"{len(tasks)} balls, about {_MINUTES_PER_BALL:g} minutes each on one core")
    for number, (name, damper) in enumerate(tasks, 1):
        runs, rig = found[name]
        if not runs:
            say(f"{name}: no recordings; make them with `make tank-campaign`")
            continue
        begin, place = time.monotonic(), output / f"{name}_{damper}"
        say(f"{number} of {len(tasks)}: {name}, the damper acts {damper}")
        code = run(["ball", *map(str, runs), "--rig", str(rig), "--damper", damper, "-o", str(place)])
        if code not in (0, DONE_BUT_FLAGGED):
            return code
        minutes = (time.monotonic() - begin) / 60
        say(f"The report is {(place / 'report.html').resolve()}; {minutes:.1f} minutes")
    return 0


def rom_arguments(folder: Path, output: Path) -> list[str]:
    """Arguments of `sloshlab train` for the runs of the tank filled half in a folder.

    The longest VFA run trains, the shortest validates, still runs identify the dry mass, sweeps are tests.

    Raises
    ------
    InputError
        If there are not two VFA runs and a rig.
    """
    runs, rig, options = _rom_files(folder)
    sweeps = [part for path in sorted(folder.glob("fill_0.50_sweep_*.nc")) for part in ("--test", str(path))]
    return ["train", *runs, "--rig", str(rig), *options, *sweeps, "-o", str(output / "ROM.nc")]


def study_arguments(folder: Path, output: Path) -> list[str]:
    """Arguments of `sloshlab study` for the runs of the tank filled half in a folder."""
    runs, rig, options = _rom_files(folder)
    return ["study", *runs, "--rig", str(rig), *options, "-o", str(output)]


def _rom_files(folder: Path) -> tuple[list[str], Path, list[str]]:
    """Training and validation run, rig, and options for the still runs."""
    vfa = sorted(folder.glob("fill_0.50_vfa_*.nc"), key=lambda path: (-path.stat().st_size, path.name))
    rig = folder / "rig_fill_0.50.toml"
    if len(vfa) < 2 or not rig.is_file():
        raise InputError(
            f"{folder}",
            got=f"{len(vfa)} VFA runs filled half and {'a' if rig.is_file() else 'no'} rig file {rig.name}",
            allowed="two VFA runs and the rig",
            remedy="make them with `make tank-campaign`, or name the files to `sloshlab train`",
        )
    still = [path for kind in ("empty", "frozen") for path in sorted(folder.glob(f"fill_0.50_{kind}_*.nc"))]
    return [str(vfa[0]), str(vfa[-1])], rig, [part for path in still for part in ("--still", str(path))]


def _rom(folder: Path, output: Path) -> int:
    """The reduced-order model and its report; a flagged result is a result."""
    # a model of an earlier `make rom`
    code = run([*rom_arguments(folder, output), "--overwrite"])
    return 0 if code == DONE_BUT_FLAGGED else code


def _study(folder: Path, output: Path) -> int:
    """The sensitivity study; it goes on where it was stopped."""
    code = run(study_arguments(folder, output))
    return 0 if code == DONE_BUT_FLAGGED else code


def _replay(folder: Path, output: Path, patience_s: float | None = None) -> int:
    """Every recording through simulated devices; any difference is a failure."""
    from pipelines.recording.replayed_campaign import LEAST_PATIENCE_S, replayed_campaign

    least_s = LEAST_PATIENCE_S if patience_s is None else patience_s
    summary = replayed_campaign(folder, output, least_patience_s=least_s)
    for line in [*summary["lines"], *(f"differs: {flag}" for flag in summary["flags"])]:
        say(line)
    return 1 if summary["flags"] else 0


def _any(folder: Path, output: Path) -> int:
    """All runs of a folder by the pipeline of their experiment; a flagged result is a result."""
    recordings, rigs = recordings_and_rigs(folder)
    options = [part for rig in rigs for part in ("--rig", str(rig))]
    code = run(["analyse", *map(str, recordings), *options, "-o", str(output)])
    return 0 if code == DONE_BUT_FLAGGED else code


_FOLDERS: Final = {
    "shaker": _shaker,
    "beam": _beam,
    "sdof": _beam,
    "ball": _ball,
    "rom": _rom,
    "study": _study,
    "replay": _replay,
}
"""What the make targets run; an experiment of the registry with a pipeline needs no line here."""


if __name__ == "__main__":
    sys.exit(main())
