"""What a campaign costs beside its work: overhead, gain by a second process, memory of a scheduler."""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from campaigns.campaign import run_campaign
from campaigns.local_executor import LocalExecutor
from campaigns.store import Store
from campaigns.stored_task import StoredTask
from campaigns.task import Task
from campaigns.working import work_through
from tests.benchmarks.own_process import measured_apart

OVERHEAD_LABEL = "campaign: overhead per task [ms]"
RATIO_LABEL = "campaign: time of one process over that of two"
PLAN_LABEL = "campaign: 10 000 tasks found done, per task [ms]"
DASK_OVERHEAD_LABEL = "campaign: overhead per task on a Dask cluster [ms]"
DASK_MEMORY_LABEL = "campaign: memory of a Dask scheduler for 10 000 tasks [MB]"
DASK_GROWTH_LABEL = "… of which the second half of them added [MB]"
N_LOCAL, N_WORKED, N_CLUSTER = 1000, 24, 10_000
_WORK_S = 0.5


def stub(folder: Path, files: Any, arguments: Any, say_share: Any) -> dict[str, Any]:
    """Write a line, as quickly as can be."""
    (folder / "result.txt").write_text("nothing")
    return {}


def told_stub(arguments: Any, say_share: Any) -> int:
    """Do nothing at all."""
    return 1


def worked(folder: Path, files: Any, arguments: Any, say_share: Any) -> dict[str, Any]:
    """Keep one core busy for half a second of processor time."""
    until, value = time.process_time() + _WORK_S, 0.0
    while time.process_time() < until:
        value += sum(range(1000))
    (folder / "result.txt").write_text("worked")
    return {}


def _tasks(folder: Path, n_tasks: int, function: str) -> list[StoredTask]:
    recording = folder / "recording.bin"
    recording.write_bytes(b"0" * 100_000)
    return [
        StoredTask(f"task_{number:06d}", f"tests.benchmarks.campaigns:{function}", {"recording": [recording]})
        for number in range(n_tasks)
    ]


def _seconds(tasks: list[StoredTask], store: Path, n_workers: int) -> float:
    # a first task of each process, which starts it
    began: list[float] = []
    run_campaign(
        tasks,
        Store(store),
        LocalExecutor(n_workers),
        finished=lambda *told: began.append(time.monotonic()),
    )
    return began[-1] - began[n_workers - 1]


def local_figures(folder: Path) -> dict[str, float]:
    """Overhead, gain by a second process, and what it costs to find that all is done.

    Parameters
    ----------
    folder : Path
        For results.
    """
    stubs = _tasks(folder, N_LOCAL, "stub")
    overhead_s = _seconds(stubs, folder / "stubs", 1) / (N_LOCAL - 1)
    busy = _tasks(folder, N_WORKED, "worked")
    one, two = (_seconds(busy, folder / f"busy_{n}", n) / (N_WORKED - n) for n in (1, 2))
    many = _tasks(folder, 10 * N_LOCAL, "stub")
    for task in many[N_LOCAL:]:
        place = folder / "stubs" / "results" / task.name
        place.mkdir()
        for name in ("outcome.json", "result.txt"):
            (place / name).write_bytes((folder / "stubs/results/task_000000" / name).read_bytes())
    began = time.monotonic()
    run_campaign(many, Store(folder / "stubs"), LocalExecutor(1))
    found_s = (time.monotonic() - began) / len(many)
    return {OVERHEAD_LABEL: 1e3 * overhead_s, RATIO_LABEL: one / two, PLAN_LABEL: 1e3 * found_s}


def cluster_figures(folder: Path, n_tasks: int = N_CLUSTER) -> dict[str, float]:
    """Overhead on a Dask cluster of this machine, and what its scheduler holds more at the end than at the start.

    Parameters
    ----------
    folder : Path
        For what the cluster says.
    n_tasks : int
    """
    if importlib.util.find_spec("distributed") is None:
        print("no Dask: install the extra cluster for its figures")
        return {}
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit" / "campaigns"))
    from dask_cluster import DaskCluster

    from campaigns.dask_executor import DaskExecutor

    cluster = DaskCluster(folder)
    try:
        cluster.start_scheduler()
        cluster.start_worker()
        peak, ended = [_resident_mb(cluster.scheduler_pid)], list[float]()

        def finished(number: int, ending: Any) -> None:
            ended.append(time.monotonic())
            assert ending.status == "done", ending
            if number % 100 == 0:
                peak.append(_resident_mb(cluster.scheduler_pid))

        tasks = (Task(str(n), "tests.benchmarks.campaigns:told_stub") for n in range(n_tasks))
        work_through(tasks, DaskExecutor(cluster.address, connect_s=120), finished=finished)
        overhead_s = (ended[-1] - ended[99]) / (len(ended) - 100)
        half = max(peak[: len(peak) // 2])
        return {
            DASK_OVERHEAD_LABEL: 1e3 * overhead_s,
            DASK_MEMORY_LABEL: max(peak) - peak[0],
            DASK_GROWTH_LABEL: max(peak) - half,
        }
    finally:
        cluster.kill()


def _resident_mb(pid: int) -> float:
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def campaign_figures() -> dict[str, float]:
    """All figures, in a process of their own, which may use two cores."""
    print("campaigns of stubs …", flush=True)
    return measured_apart("tests.benchmarks.campaigns")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=("local", "cluster"))
    only = parser.parse_args().only
    figures: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as name:
        if only != "cluster":
            figures |= local_figures(Path(name))
        if only != "local":
            figures |= cluster_figures(Path(name))
    print(json.dumps(figures))
