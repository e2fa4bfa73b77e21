"""From recordings to a ball: free decays by ζ(a), sweeps by W̄ at one frequency."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pipelines.ball.decay_stages import ball_from_decays
from pipelines.ball.decays import are_decays
from pipelines.ball.line_stages import ball_from_shaker
from pipelines.ball.results import BallExperiment
from pipelines.ball.settings import BallSettings
from sloshlab.errors import AnalysisError
from sloshlab.experiments import EXPERIMENTS
from sloshlab.recording import read_attributes
from sloshlab.rig import Rig


def analyse_ball(paths: Sequence[Path], rig_path: Path, settings: BallSettings) -> BallExperiment:
    """Identify a ball from the sloshing runs of one rig.

    Parameters
    ----------
    paths : sequence of Path
        Free decays of a guided tank (`sdof_free`), frozen ones for what its guide does; or runs on the shaker,
        empty and frozen ones for the dry mass.
    rig_path : Path
    settings : BallSettings

    Raises
    ------
    InputError
        If the runs are of different experiments, or one is bad.
    """
    rig = Rig.from_toml(rig_path)
    described = [(path, read_attributes(path)) for path in paths]
    experiments = [EXPERIMENTS[run.experiment] for _, run in described]
    decays = are_decays(described)
    if not decays and not all(known.moves == "shaker" for known in experiments):
        raise AnalysisError(
            "runs for a ball",
            got=", ".join(sorted({run.experiment for _, run in described})),
            allowed="sdof_free alone, or shaker_sweep and shaker_vfa",
            remedy="give the runs of one experiment",
        )
    if decays:
        return ball_from_decays(described, rig, rig_path, settings)
    return ball_from_shaker(paths, rig, rig_path, settings)
