"""Jobs of Slurm: a Dask scheduler in this program, its workers started by ``sbatch`` (dask-jobqueue)."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from typing import Any, Final

from campaigns.dask_executor import DaskExecutor
from campaigns.task import ClusterError
from sloshlab.errors import MissingExtraError

_USUAL: Final = {"cores": 1, "memory": "4 GB"}
"""Where neither the plan nor the configuration of dask-jobqueue says anything."""


class SlurmExecutor(DaskExecutor):
    """Jobs in the queue of Slurm, which come and go as there is room.

    Parameters
    ----------
    n_jobs : int
        How many are asked for.
    asked : mapping
        What a job asks for; the configuration of dask-jobqueue says the rest.
    one_core : bool
        Whether libraries compute on one core in each process.

    Raises
    ------
    ClusterError
        If there is no Slurm, or it refuses.
    MissingExtraError
        If dask-jobqueue is not installed.
    """

    def __init__(self, n_jobs: int, asked: Mapping[str, Any], *, one_core: bool = True) -> None:
        try:
            from dask_jobqueue import SLURMCluster
        except ImportError as error:
            raise MissingExtraError("dask-jobqueue", extra="cluster", purpose="jobs of Slurm") from error
        if shutil.which("sbatch") is None:
            raise ClusterError("scheduler slurm: got no command sbatch; remedy: use a node that submits jobs")
        try:
            self._cluster: Any = SLURMCluster(**_settings(asked))
            self._cluster.scale(jobs=n_jobs)
        except (OSError, RuntimeError, ValueError, TypeError) as error:
            line = " ".join(str(error).split())[:300]
            raise ClusterError(f"scheduler slurm: got {line}; remedy: see [slurm] of the plan") from error
        super().__init__("slurm", one_core=one_core)

    def _target(self) -> Any:
        return self._cluster

    def close(self) -> None:
        """End all jobs."""
        super().close()
        self._cluster.close(timeout=10)


def _settings(asked: Mapping[str, Any]) -> dict[str, Any]:
    """What was asked for, over the configuration of dask-jobqueue, over what is usual."""
    import dask

    usual = {
        name: value for name, value in _USUAL.items() if dask.config.get(f"jobqueue.slurm.{name}", None) is None
    }
    given = {name: list(value) if isinstance(value, tuple) else value for name, value in asked.items()}
    return {**usual, **given}
