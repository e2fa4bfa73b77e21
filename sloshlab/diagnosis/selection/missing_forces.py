"""The forces that a fit lacks in every run, from which starts of effects are read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from sloshlab.errors import SloshlabError
from sloshlab.identification.diagnosed_model import DiagnosedModel
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.identification.observations import Observation
from sloshlab.missing_force.latent_force import LatentForce, RunForces, run_forces
from sloshlab.missing_physics.candidate import MissingForce, MissingForces, extension_of

FloatArray = NDArray[np.float64]
_N_STRETCHES: Final = 8
"""Of a run, half as many of them overlapping: what is in less than half of these is an event. Pulses in more of
them count as steady, which takes power from all of them alike.
"""


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


def missing_forces(forces: Mapping[str, RunForces], block: str) -> MissingForces:
    """Of every run the latent force at a block, over the whole run; where it is not told there the largest one.

    Parameters
    ----------
    forces : mapping of run to RunForces
    block : str
    """
    found = {
        run: own.at(block) or max(own.forces, key=lambda force: force.power_n2) for run, own in forces.items()
    }
    return {run: MissingForce(_of_whole_run(force), _steady_power(force)) for run, force in found.items()}


def _steady_power(force: LatentForce) -> FloatArray:
    """Power at every frequency of the padded run by the noise of sensors, and by what is there most of the time.

    A slow drift and motion at a resonance that is off by a little are no events; the median over stretches of a
    run does not see what is in few of them.
    """
    n = int(force.run.recording.sizes["time"])
    frequency, known = np.fft.rfftfreq(2 * n), force.noise_power > 0
    of_sensors = np.interp(frequency, frequency[known], force.noise_power[known]) if known.any() else 0.0
    n_per_stretch = max(force.force_n.size // _N_STRETCHES, 2)
    at, density = welch(force.force_n, nperseg=n_per_stretch, detrend=False, average="median")
    # one-sided, per cycle a sample
    return np.asarray(of_sensors + 0.5 * n * np.interp(frequency, at, density))


def _of_whole_run(force: LatentForce) -> FloatArray:
    """A latent force with zeros where its run is tapered."""
    run = force.run
    series = np.zeros(int(run.recording.sizes["time"]))
    start = float(run.recording["time"].values[0])
    first = round((float(force.time_s[0]) - start) * run.attributes.sampling_rate_hz)
    series[first : first + force.force_n.size] = force.force_n
    return series
