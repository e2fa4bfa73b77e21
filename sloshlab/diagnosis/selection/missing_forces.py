"""The forces that a fit lacks in every run, from which starts of effects are read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import SloshlabError
from sloshlab.identification.diagnosed_model import DiagnosedModel
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.identification.observations import Observation
from sloshlab.missing_force.latent_force import LatentForce, RunForces, run_forces
from sloshlab.missing_physics.candidate import MissingForces, extension_of

FloatArray = NDArray[np.float64]


def latent_forces(
    model: DiagnosedModel, runs: Sequence[Sequence[Observation]], fit: FreeRunFit
) -> dict[str, RunForces]:
    """Latent forces of every run beside a fit; none of runs of which the simulation does not reach its end.

    Parameters
    ----------
    model : DiagnosedModel
    runs : sequence of sequences of Observation
        Per run.
    fit : FreeRunFit
    """
    found: dict[str, RunForces] = {}
    for observed in runs:
        with suppress(SloshlabError):
            extension = extension_of(fit.candidates, fit.values)
            forces = run_forces(model, observed, fit.values, extension=extension)
            if forces.forces:
                found[observed[0].run.name] = forces
    return found


def missing_forces(forces: Mapping[str, RunForces]) -> MissingForces:
    """Of every run the largest of its latent forces, over the whole run.

    Parameters
    ----------
    forces : mapping of run to RunForces
    """
    return {run: _of_whole_run(max(own.forces, key=lambda force: force.power_n2)) for run, own in forces.items()}


def _of_whole_run(force: LatentForce) -> FloatArray:
    """A latent force with zeros where its run is tapered."""
    run = force.run
    series = np.zeros(int(run.recording.sizes["time"]))
    start = float(run.recording["time"].values[0])
    first = round((float(force.time_s[0]) - start) * run.attributes.sampling_rate_hz)
    series[first : first + force.force_n.size] = force.force_n
    return series
