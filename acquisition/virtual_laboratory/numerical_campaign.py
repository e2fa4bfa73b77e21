"""The campaign of a computed liquid: hours of computing, in processes, that may be stopped at any time.

Started again it keeps the recordings that the manifest vouches for and goes on with the others from their
checkpoints. The bytes of a recording depend on its run, the seed and the resolution only.
"""

from __future__ import annotations

import contextlib
import fnmatch
import hashlib
import json
import math
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Final

import xarray as xr

from acquisition.numerical_tank import checkpoint as checkpoints
from acquisition.numerical_tank.instability import STOPPED
from acquisition.numerical_tank.tank import TankSetup
from acquisition.two_phase_tank import checkpoint as two_phase_checkpoint
from acquisition.two_phase_tank.setup import TwoPhaseSetup
from acquisition.virtual_laboratory.campaign import (
    CAMPAIGN_LABORATORY,
    MANIFEST_NAME,
    campaign_laboratory,
    file_record,
    laboratory_option,
)
from acquisition.virtual_laboratory.numerical_liquid import NumericalLiquid, numerical_setup, two_phase_setup
from acquisition.virtual_laboratory.numerical_runs import RIG_TEXTS, NumericalRun, numerical_runs
from acquisition.virtual_laboratory.shaker_run import START_TIME_UTC, virtual_shaker_run, write_virtual_run
from acquisition.virtual_laboratory.structure_rig import structure_laboratory
from acquisition.virtual_laboratory.structure_run import virtual_structure_run
from campaigns.executor import Executor
from campaigns.local_executor import LocalExecutor
from campaigns.store import only_one
from campaigns.task import Ending, Task
from campaigns.working import work_through
from sloshlab import atomic_file
from sloshlab._version import __version__
from sloshlab.errors import InputError, RecordingInterruptedError, SloshlabError
from sloshlab.recording import read_attributes
from sloshlab.rig import Rig

CHECKPOINTS_NAME: Final = ".checkpoints"
COMMAND: Final = "sloshlab virtual campaign --liquid {} -o raw_data/{} --layers {} --seed {}"
_SAMPLING_RATE_HZ: Final = 512.0
_FIRST_SEED: Final = 500
"""Other seeds than those of the campaign whose liquid follows a law."""
# of a quarter filled at h/16 four layers would be left; six of h/24 are as many as of 3/8 at h/16
_SHALLOWEST_FILL: Final = 0.375  # a shallower liquid is computed more finely


@dataclass(frozen=True)
class CampaignSettings:
    """How a campaign is made.

    Attributes
    ----------
    seed : int
        Of noise, motion and liquid.
    layers_per_height : int
        Resolution: height of the tank over the distance of the particles, or over the side of a cell; half as fine
        again at α = 0.25.
    n_workers : int
        Processes.
    only : str
        Pattern of the names of the runs to be made, as of files.
    checkpoints : path-like, optional
        Folder of the checkpoints; by default one within the campaign's.
    laboratory_seed : int, optional
        Of the laboratory that serves all runs; None for one that is as the rigs tell.
    overwrite : bool
        Whether recordings may be replaced that the manifest does not name.
    with_gas : bool
        Whether liquid and gas are computed on a grid; else the liquid alone as particles. Only the runs on the
        shaker are then made: a structure carries particles.
    """

    seed: int = 0
    layers_per_height: int = 16
    n_workers: int = 2
    only: str = "*"
    checkpoints: str | os.PathLike[str] | None = None
    laboratory_seed: int | None = CAMPAIGN_LABORATORY
    overwrite: bool = False
    with_gas: bool = False


@dataclass(frozen=True)
class FinishedRun:
    """What a person is told when a run has ended.

    Attributes
    ----------
    name : str
    computing_s : float
        Time that it took, over all sessions.
    n_done, n_runs : int
        Runs of this session.
    flag : str
        What is wrong with it; empty if nothing.
    """

    name: str
    computing_s: float
    n_done: int
    n_runs: int
    flag: str


@dataclass(frozen=True)
class CampaignSummary:
    """What there is in the end.

    Attributes
    ----------
    manifest : Path
    n_kept, n_made : int
        Recordings found good, and made.
    flags : tuple of str
        Runs that failed or became unstable.
    """

    manifest: Path
    n_kept: int
    n_made: int
    flags: tuple[str, ...]


@dataclass(frozen=True)
class _Task:
    run: NumericalRun
    recording: Path
    checkpoint: Path
    seed: int
    layers_per_height: int
    laboratory_seed: int | None
    with_gas: bool


def make_numerical_campaign(
    folder: str | os.PathLike[str],
    settings: CampaignSettings | None = None,
    *,
    runs: Sequence[NumericalRun] | None = None,
    progressed: Callable[[float], None] | None = None,
    finished: Callable[[FinishedRun], None] | None = None,
    executor: Executor | None = None,
) -> CampaignSummary:
    """Make the recordings that are not there yet.

    Parameters
    ----------
    folder : path-like
        Made if missing. Rig descriptions are written to it, recordings below it, and the manifest.
    settings : CampaignSettings, optional
    runs : sequence of NumericalRun, optional
        Others than those of `numerical_runs`.
    progressed : callable, optional
        Called with the share of the work of this session that is done.
    finished : callable, optional
        Called after every run.
    executor : Executor, optional
        In place of processes of this machine.

    Raises
    ------
    InputError
        If a setting is out of range, no run has such a name, or another campaign works in the folder.
    RecordingInterruptedError
        At Ctrl-C or SIGTERM; checkpoints are safe.
    """
    settings = settings or CampaignSettings()
    target = Path(folder)
    tasks = _tasks(target, settings, numerical_runs() if runs is None else runs)
    with _alone(tasks[0].checkpoint.parent):
        manifest = _Manifest(target, settings)
        if not settings.overwrite:
            manifest.require_own(tasks)
        for name, text in RIG_TEXTS.items():
            atomic_file.write_bytes(target / name, text.encode())
        missing = [task for task in tasks if not manifest.vouches_for(task)]
        # the longest first, or one process would work at it alone at the end
        missing.sort(key=_cost, reverse=True)
        session = _Session(manifest, missing, progressed or (lambda share: None), finished or (lambda run: None))
        try:
            # a process each: what one run leaves behind in it cannot touch another
            where = executor or LocalExecutor(settings.n_workers, fresh=True)
            handed = [_as_task(task) for task in missing]
            work_through(handed, where, progressed=session.progressed, finished=session.finished)
        except KeyboardInterrupt as interrupt:
            raise RecordingInterruptedError(
                f"campaign interrupted: {session.n_done} of {len(missing)} runs done; checkpoints keep what was "
                "computed of the others; give the same command again to go on"
            ) from interrupt
        finally:
            # also when it was interrupted, so that what is finished is vouched for
            manifest.write()
    return CampaignSummary(manifest.path, len(tasks) - len(missing), session.n_made, tuple(session.flags))


def _as_task(task: _Task) -> Task:
    arguments = {
        "run": {**asdict(task.run), "settings": dict(task.run.settings)},
        "recording": str(task.recording.absolute()),
        "checkpoint": str(task.checkpoint.absolute()),
        "seed": task.seed,
        "layers_per_height": task.layers_per_height,
        "laboratory_seed": task.laboratory_seed,
        "with_gas": task.with_gas,
    }
    return Task(task.run.name, "acquisition.virtual_laboratory.numerical_campaign:record_told_run", arguments)


def record_told_run(arguments: Mapping[str, Any], say_share: Callable[[float], None]) -> dict[str, Any]:
    """Make one recording as another process is told it; this is what a worker does.

    Parameters
    ----------
    arguments : mapping
        The ``run``, places of its ``recording`` and ``checkpoint``, seeds and resolution.
    say_share : callable

    Returns
    -------
    dict
        ``computing_s`` and ``flag``.
    """
    task = _Task(
        NumericalRun(**arguments["run"]),
        Path(arguments["recording"]),
        Path(arguments["checkpoint"]),
        arguments["seed"],
        arguments["layers_per_height"],
        arguments["laboratory_seed"],
        arguments["with_gas"],
    )
    return record(task, say_share)


def record(task: _Task, progress: Callable[[float], None]) -> dict[str, Any]:
    """Make one recording.

    Returns
    -------
    dict
        ``computing_s`` and ``flag``.
    """
    _discard_if_damaged(task)
    start_s, computed = time.monotonic(), list[float]()
    liquid = NumericalLiquid(
        task.layers_per_height,
        task.checkpoint,
        progress,
        lambda force: computed.append(force.computing_s),
        task.with_gas,
    )
    recording = _recording(task, liquid)
    write_virtual_run(recording, task.recording)
    # only after the recording has been written
    task.checkpoint.unlink(missing_ok=True)
    computing_s = computed[0] if computed else time.monotonic() - start_s
    return {"computing_s": computing_s, "flag": str(recording.attrs.get(STOPPED, ""))}


def _discard_if_damaged(task: _Task) -> None:
    """A run whose checkpoint cannot be read starts again; the campaign goes on."""
    checkpoint = task.checkpoint
    if checkpoint.exists():
        try:
            (two_phase_checkpoint if task.with_gas else checkpoints).load(checkpoint)
        except InputError:
            # the run starts again; one damaged file must not stop a campaign of hours
            checkpoint.unlink()


def _recording(task: _Task, liquid: NumericalLiquid) -> xr.Dataset:
    run = task.run
    start = datetime.fromisoformat(START_TIME_UTC) + timedelta(minutes=10 * run.number)
    common: dict[str, Any] = {
        "seed": task.seed,
        "run_id": Path(run.name).name,
        "rig_name": Path(run.rig).name,
        "start_time_utc": start.strftime("%Y-%m-%dT%H:%M:%SZ"),
    }
    rig = Rig.from_toml_text(RIG_TEXTS[run.rig])
    if run.is_on_shaker:
        laboratory = campaign_laboratory(task.laboratory_seed)
        return virtual_shaker_run(rig, numerical=liquid, laboratory=laboratory, **run.settings, **common)
    rest = structure_laboratory(rig, task.laboratory_seed)
    return virtual_structure_run(rig, numerical=liquid, laboratory=rest, **run.settings, **common)


class _Session:
    """What is done and what is left while processes work."""

    def __init__(
        self,
        manifest: _Manifest,
        tasks: Sequence[_Task],
        progressed: Callable[[float], None],
        finished: Callable[[FinishedRun], None],
    ) -> None:
        self._manifest, self._tasks, self._progressed, self._finished = manifest, tasks, progressed, finished
        self._costs = [_cost(task) for task in tasks]
        self._shares = [0.0] * len(tasks)
        self.n_done, self.n_made, self.flags = 0, 0, list[str]()

    def progressed(self, number: int, share: float) -> None:
        self._shares[number] = share
        done = sum(cost * share for cost, share in zip(self._costs, self._shares, strict=True))
        self._progressed(done / sum(self._costs))

    def finished(self, number: int, ending: Ending) -> None:
        task = self._tasks[number]
        result = ending.result or {"computing_s": 0.0, "flag": f"not made: {ending.line}"}
        self.n_done += 1
        if ending.status == "done":
            self.n_made += 1
            self._manifest.add(task, result)
        if result["flag"]:
            self.flags.append(f"{task.run.name}: {result['flag']}")
        self.progressed(number, 1.0)
        self._finished(
            FinishedRun(task.run.name, result["computing_s"], self.n_done, len(self._tasks), result["flag"])
        )


class _Manifest:
    """`manifest.json`: what each file is, and what it was made of."""

    def __init__(self, folder: Path, settings: CampaignSettings) -> None:
        self.path, self._folder, self._settings = folder / MANIFEST_NAME, folder, settings
        self._runs: dict[str, Any] = {}
        self._files: dict[str, Any] = {}
        # a manifest that is not there, or none, vouches for nothing
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
            known = json.loads(self.path.read_text(encoding="utf-8"))
            self._runs, self._files = dict(known["runs"]), dict(known["files"])

    def vouches_for(self, task: _Task) -> bool:
        """Whether the recording is there, unchanged, and made as it would be made now."""
        run = self._runs.get(task.run.name)
        if not isinstance(run, dict) or run.get("made_of") != _made_of(task) or not task.recording.is_file():
            return False
        # by its content: a recording may have been replaced or cut since
        return bool(self._files.get(self._relative(task.recording)) == file_record(task.recording))

    def require_own(self, tasks: Sequence[_Task]) -> None:
        """Refuse to replace files of no campaign; a recording that was damaged since is made again.

        Raises
        ------
        InputError
        """
        rigs = {self._folder / name: text.encode() for name, text in RIG_TEXTS.items()}
        others = [path for path, text in rigs.items() if path.exists() and path.read_bytes() != text]
        # a campaign that was killed leaves recordings that its manifest does not name yet
        others += [t.recording for t in tasks if os.path.lexists(t.recording) and not _is_of(t)]
        for path in others:
            if self._relative(path) not in self._files:
                raise InputError(
                    f"recording {path}",
                    got="a file that no campaign wrote",
                    remedy="another folder, or --overwrite",
                )

    def add(self, task: _Task, result: Mapping[str, Any]) -> None:
        self._files[self._relative(task.recording)] = file_record(task.recording)
        self._runs[task.run.name] = {
            "seed": task.seed,
            "settings": dict(task.run.settings),
            "rig": task.run.rig,
            **({"layers_per_height": task.layers_per_height} if task.run.is_computed else {}),
            "made_of": _made_of(task),
            "computing_s": round(result["computing_s"], 1),
            **({"flag": result["flag"]} if result["flag"] else {}),
        }
        self.write()

    def write(self) -> None:
        self._files.update({name: file_record(self._folder / name) for name in RIG_TEXTS})
        content = {
            "format": 1,
            "command": _command(self._settings),
            "seed": self._settings.seed,
            "layers_per_height": self._settings.layers_per_height,
            "sloshlab_version": __version__,
            "runs": self._runs,
            "files": self._files,
        }
        atomic_file.write_bytes(self.path, (json.dumps(content, indent=1, sort_keys=True) + "\n").encode())

    def _relative(self, path: Path) -> str:
        return path.relative_to(self._folder).as_posix()


def _command(settings: CampaignSettings) -> str:
    """The command that makes the same campaign."""
    names = ("two_phase", "two_phase_tank") if settings.with_gas else ("numerical", "numerical_tank")
    made = COMMAND.format(*names, settings.layers_per_height, settings.seed)
    return made + laboratory_option(settings.laboratory_seed)


def _is_of(task: _Task) -> bool:
    """Whether the recording of a task says of itself that it is one."""
    try:
        attributes = read_attributes(task.recording)
    except SloshlabError:
        return False
    more = attributes.model_extra or {}
    return attributes.run_id == Path(task.run.name).name and "liquid" in more and more.get("seed") == task.seed


def _tasks(folder: Path, settings: CampaignSettings, runs: Sequence[NumericalRun]) -> list[_Task]:
    for name, number in (("seed", settings.seed), ("laboratory seed", settings.laboratory_seed or 0)):
        if number < 0:
            raise InputError(f"{name} of the campaign", got=str(number), allowed="≥ 0")
    chosen = [run for run in runs if fnmatch.fnmatchcase(run.name, settings.only)]
    if settings.with_gas:
        chosen = [run for run in chosen if run.is_on_shaker]
    if not chosen:
        names = ", ".join(run.name for run in runs[:2])
        raise InputError("--only", got=repr(settings.only), allowed=f"a pattern of names such as {names}")
    return [_task(folder, settings, run) for run in chosen]


def _task(folder: Path, settings: CampaignSettings, run: NumericalRun) -> _Task:
    """What a worker is told; what cannot be computed is refused here, before hours are spent on others."""
    task = _Task(
        run,
        folder / f"{run.name}.nc",
        Path(),
        1000 * settings.seed + _FIRST_SEED + run.number,
        _layers_per_height(settings, run),
        settings.laboratory_seed,
        settings.with_gas,
    )
    kept_in = Path(settings.checkpoints or folder / CHECKPOINTS_NAME)
    # the hash in the name, so that a checkpoint of other settings is not taken up, nor lost
    checkpoint = kept_in / f"{run.name.replace('/', '_')}_{_made_of(task)[:12]}.checkpoint"
    return replace(task, checkpoint=checkpoint)


def _layers_per_height(settings: CampaignSettings, run: NumericalRun) -> int:
    """A shallow liquid is computed more finely, so that it is as many particles deep as one that fills 3/8."""
    fill_level = Rig.from_toml_text(RIG_TEXTS[run.rig]).liquid.fill_level
    return max(settings.layers_per_height, math.ceil(_SHALLOWEST_FILL * settings.layers_per_height / fill_level))


def _setup(task: _Task) -> TankSetup | TwoPhaseSetup | None:
    """The computed tank of a run; None where no liquid moves."""
    if not task.run.is_computed:
        return None
    rig = Rig.from_toml_text(RIG_TEXTS[task.run.rig])
    common: dict[str, Any] = {"seed": task.seed, "sampling_rate_hz": _SAMPLING_RATE_HZ}
    if task.with_gas:
        return two_phase_setup(rig, cells_per_height=task.layers_per_height, **common)
    return numerical_setup(rig, layers_per_height=task.layers_per_height, **common)


def _cost(task: _Task) -> float:
    """Steps of particles or cells, about proportional to the time of computing."""
    setup, duration_s = _setup(task), float(task.run.settings["duration_s"])
    if setup is None:
        return duration_s * 1e4
    n = setup.n_along * setup.n_up if isinstance(setup, TwoPhaseSetup) else setup.n_particles
    return duration_s * n / setup.step_s


def _made_of(task: _Task) -> str:
    """Hash of all that a recording follows from."""
    setup = _setup(task)
    content = {
        "rig": RIG_TEXTS[task.run.rig],
        "run": asdict(task.run),
        "seeds": [task.seed, task.laboratory_seed],
        "tank": None if setup is None else asdict(setup),
        # another version may compute another liquid: its recordings are made again
        "version": __version__,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


@contextlib.contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Make the folder of the checkpoints, keep a second campaign out of it, remove it when it is empty."""
    folder.mkdir(parents=True, exist_ok=True)
    with only_one(folder / "lock", f"{folder}", remedy="wait for it, or name other --checkpoints"):
        yield
    with contextlib.suppress(OSError):  # checkpoints are in it yet
        folder.rmdir()
