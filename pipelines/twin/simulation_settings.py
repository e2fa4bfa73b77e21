"""What a simulation of a recorded run is asked for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pipelines.inputs.recordings import RunSource
from pipelines.inputs.rigs import RigSource


@dataclass(frozen=True)
class SimulationSettings:
    """What the command is asked to do.

    Attributes
    ----------
    rig : Path or RigInMemory
    run : Path or RecordingInMemory
    output : Path
        Where the simulated recording goes.
    block : str
        ``all``, ``tank`` or ``structure``.
    configuration : str
        Of the liquid, ``sloshing`` being as the rig file describes it.
    twin : Path, optional
        A saved twin instead of that of the rig file.
    save_twin : Path, optional
        Where the twin that ran is saved.
    steps : int, optional
        Integration steps per sample.
    seed : int
        Of the noise of the twin's sensors.
    overwrite : bool
        Whether files that are there may be replaced.
    """

    rig: RigSource
    run: RunSource
    output: Path
    block: str = "all"
    configuration: str = "sloshing"
    twin: Path | None = None
    save_twin: Path | None = None
    steps: int | None = None
    seed: int = 0
    overwrite: bool = False
