"""Where tasks are carried out: processes of this machine, a Dask cluster, or jobs of a queue."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from campaigns.executor import Executor
from campaigns.local_executor import LocalExecutor
from campaigns.task import MOST_WORKERS
from sloshlab.errors import InputError

SLURM: Final = "slurm"
ADDRESSES: Final = ("tcp://", "tls://", "ucx://")


@dataclass(frozen=True)
class Where:
    """Where tasks are carried out.

    Attributes
    ----------
    scheduler : str, optional
        Address of a Dask scheduler, or ``slurm``; None for processes of this machine.
    n_workers : int
        Processes, or jobs of the queue; a cluster has the workers that it has.
    one_core : bool
        Whether libraries compute on one core in each process.
    fresh : bool
        Whether every task has a process of its own on this machine.
    """

    scheduler: str | None = None
    n_workers: int = 2
    one_core: bool = True
    fresh: bool = False


def executor_of(
    where: Where, slurm: Mapping[str, Any] | None = None, *, said: Callable[[str], None] = lambda line: None
) -> Executor:
    """An executor, which is to be closed.

    Parameters
    ----------
    where : Where
    slurm : mapping, optional
        What a job asks for; see `campaigns.slurm`.
    said : callable
        Takes a line when a cluster is lost.

    Raises
    ------
    InputError
        If the scheduler is none, or there are no workers or too many.
    ClusterError
        If it cannot be reached.
    MissingExtraError
        If the packages for clusters are not installed.
    """
    if where.scheduler is None:
        return LocalExecutor(where.n_workers, one_core=where.one_core, fresh=where.fresh)
    if not 1 <= where.n_workers <= MOST_WORKERS:
        raise InputError("--workers", got=str(where.n_workers), allowed=f"1 … {MOST_WORKERS}")
    if where.scheduler == SLURM:
        from campaigns.slurm import SlurmExecutor

        return SlurmExecutor(where.n_workers, slurm or {}, one_core=where.one_core)
    if not where.scheduler.startswith(ADDRESSES):
        raise InputError(
            "--scheduler", got=repr(where.scheduler)[:120], allowed="tcp://HOST:PORT, tls://HOST:PORT or slurm"
        )
    from campaigns.dask_executor import DaskExecutor

    return DaskExecutor(where.scheduler, one_core=where.one_core, said=said)
