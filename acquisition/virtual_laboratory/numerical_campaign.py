"""The campaign of a computed liquid: hours of computing, in processes, that may be stopped at any time.

Started again it keeps the recordings that the manifest vouches for and goes on with the others from their
checkpoints. The bytes of a recording depend on its run, the seed and the resolution only.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import xarray as xr

from acquisition.numerical_tank import checkpoint as checkpoints
from acquisition.numerical_tank.instability import STOPPED
from acquisition.two_phase_tank import checkpoint as two_phase_checkpoint
from acquisition.virtual_laboratory.campaign import (
    campaign_laboratory,
)
from acquisition.virtual_laboratory.numerical_campaign_manifest import Manifest
from acquisition.virtual_laboratory.numerical_campaign_tasks import (
    CampaignSettings,
    CampaignTask,
    campaign_tasks,
    cost_of,
)
from acquisition.virtual_laboratory.numerical_liquid import NumericalLiquid
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
from sloshlab.errors import InputError, RecordingInterruptedError
from sloshlab.rig import Rig


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
    tasks = campaign_tasks(target, settings, numerical_runs() if runs is None else runs)
    with _alone(tasks[0].checkpoint.parent):
        manifest = Manifest(target, settings)
        if not settings.overwrite:
            manifest.require_own(tasks)
        for name, text in RIG_TEXTS.items():
            atomic_file.write_bytes(target / name, text.encode())
        missing = [task for task in tasks if not manifest.vouches_for(task)]
        # the longest first, or one process would work at it alone at the end
        missing.sort(key=cost_of, reverse=True)
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


def _as_task(task: CampaignTask) -> Task:
    arguments = {
        "run": {**asdict(task.run), "settings": dict(task.run.settings)},
        "recording": str(task.recording.absolute()),
        "checkpoint": str(task.checkpoint.absolute()),
        "seed": task.seed,
        "layers_per_height": task.layers_per_height,
        "laboratory_seed": task.laboratory_seed,
        "with_gas": task.with_gas,
    }
    return Task(task.run.name, "acquisition.virtual_laboratory.numerical_campaign:record_run_of_task", arguments)


def record_run_of_task(arguments: Mapping[str, Any], say_share: Callable[[float], None]) -> dict[str, Any]:
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
    task = CampaignTask(
        NumericalRun(**arguments["run"]),
        Path(arguments["recording"]),
        Path(arguments["checkpoint"]),
        arguments["seed"],
        arguments["layers_per_height"],
        arguments["laboratory_seed"],
        arguments["with_gas"],
    )
    return record(task, say_share)


def record(task: CampaignTask, progress: Callable[[float], None]) -> dict[str, Any]:
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


def _discard_if_damaged(task: CampaignTask) -> None:
    """A run whose checkpoint cannot be read starts again; the campaign goes on."""
    checkpoint = task.checkpoint
    if checkpoint.exists():
        try:
            (two_phase_checkpoint if task.with_gas else checkpoints).load(checkpoint)
        except InputError:
            # the run starts again; one damaged file must not stop a campaign of hours
            checkpoint.unlink()


def _recording(task: CampaignTask, liquid: NumericalLiquid) -> xr.Dataset:
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
        manifest: Manifest,
        tasks: Sequence[CampaignTask],
        progressed: Callable[[float], None],
        finished: Callable[[FinishedRun], None],
    ) -> None:
        self._manifest, self._tasks, self._progressed, self._finished = (
            manifest,
            tasks,
            progressed,
            finished,
        )
        self._costs = [cost_of(task) for task in tasks]
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


@contextlib.contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Make the folder of the checkpoints, keep a second campaign out of it, remove it when it is empty."""
    folder.mkdir(parents=True, exist_ok=True)
    with only_one(folder / "lock", f"{folder}", remedy="wait for it, or name other --checkpoints"):
        yield
    with contextlib.suppress(OSError):  # checkpoints are in it yet
        folder.rmdir()
