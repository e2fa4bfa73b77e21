"""The analysis of a beam or a guided tank together with twins of its sloshing runs."""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Sequence
from pathlib import Path

from pipelines.inputs.recordings import RunSource
from pipelines.inputs.rigs import RigSource
from pipelines.structure.analysis import analyse_beam
from pipelines.structure.network_uncertainty import network_uncertainty
from pipelines.structure.results import BeamExperiment, BeamSettings
from pipelines.structure.twins import tank_models, twins_of_runs
from sloshlab.errors import InputError


def analyse_beam_with_twins(
    runs: Sequence[RunSource],
    rig: RigSource,
    settings: BeamSettings,
    *,
    roms: Sequence[Path] = (),
    balls: Sequence[Path] = (),
    ensemble: Path | None = None,
) -> tuple[BeamExperiment, dict[str, bytes]]:
    """Simulate the sloshing runs with frozen liquid, dampers and more, and analyse everything together.

    Parameters
    ----------
    runs : sequence of Path
        Recordings; those that are no files are refused, as twins name what drove them.
    rig : Path
        The rig that all of them belong to.
    settings : BeamSettings
    roms, balls : sequence of Path
        Models of `sloshlab train` and files of `sloshlab ball` to simulate the runs with, too.
    ensemble : Path, optional
        Of `sloshlab train --ensemble`: its members are simulated, too, and only their ζ₁ is kept.

    Returns
    -------
    BeamExperiment
        Simulated runs come first.
    dict of str to bytes
        Rig files of the twins and what they simulated, by file name.

    Raises
    ------
    InputError
        If a run, the rig, a model or their combination is bad.
    """
    files = [run for run in runs if isinstance(run, Path)]
    if len(files) < len(runs) or not isinstance(rig, Path):
        raise InputError(
            "twins",
            got="recordings or a rig in memory",
            allowed="files",
            remedy="write the recordings with sloshlab.write_recording, and the rig as TOML",
        )
    with tempfile.TemporaryDirectory(prefix="sloshlab-twins-") as place:
        folder = Path(place)
        models = tank_models(roms, balls, folder)
        made = twins_of_runs(files, rig, folder, models)
        experiment = analyse_beam([*made, *files], rig, settings)
        if ensemble is not None:
            uncertain = network_uncertainty(ensemble, files, rig, settings)
            experiment = dataclasses.replace(
                experiment,
                network_uncertainty=uncertain,
                inputs=(*experiment.inputs, ensemble),
                flags=(*experiment.flags, *(f"{ensemble.name}: {which} ran away" for which in uncertain.ran_away)),
            )
        return experiment, {path.name: path.read_bytes() for path in sorted(folder.iterdir())}
