"""Noise by forces that jump between samples: how finely simulation and recorder resolve friction and contact.

A force that jumps by J somewhere between two samples may be anything between at one of them. What a recorder reads
there depends on its filter, and no parameter of a model says so: it is noise of single samples, white over all
bands, at the place of the force.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis.inference.places import transfers_of
from sloshlab.errors import SloshlabError
from sloshlab.identification.diagnosed_model import DiagnosedModel, Request
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.identification.observations import Observation
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics.candidate import extension_of

FloatArray = NDArray[np.float64]
_LOW_BANDS: Final = 4
"""Part of the bands, the lowest, left out: above it a step has as much power as an error of half its size."""


def with_sampled_jumps(
    model: DiagnosedModel, runs: Sequence[Sequence[Observation]], fits: Sequence[FreeRunFit]
) -> list[list[Observation]]:
    """Observations with the noise of jumps that fall between samples, the largest of some fits.

    It is the same for all models that are compared: jumps of one of them would otherwise be its advantage. No more
    of it is believed than the recording shows.

    Parameters
    ----------
    model : DiagnosedModel
        What a user's own twin computes between samples is not known: it has no such noise.
    runs : sequence of sequences of Observation
        Per run.
    fits : sequence of FreeRunFit
    """
    if not isinstance(model, RigModel):
        return [list(run) for run in runs]
    return [_with_jumps(model, run, fits) if run else [] for run in runs]


def _with_jumps(model: RigModel, run: Sequence[Observation], fits: Sequence[FreeRunFit]) -> list[Observation]:
    added = [np.zeros(each.spectra.shape) for each in run]
    for fit in fits:
        extension = extension_of(fit.candidates, fit.values)
        with suppress(SloshlabError):
            transfers = transfers_of(model, run, fit.values)
            for place, uncertain in jumps_of(model, Request(run[0].run, fit.values, extension)).items():
                gains = [np.abs(transfers[place][:, i]) ** 2 for i in range(len(run))]
                power = np.minimum(
                    # Errors of single samples are white: their mean square is the variance of a coefficient.
                    np.mean(run[0].of(uncertain) ** 2, axis=1),
                    np.min([_recorded(each, gain) for each, gain in zip(run, gains, strict=True)], axis=0),
                )
                added = [
                    np.maximum(known, power[:, None] * gain) for known, gain in zip(added, gains, strict=True)
                ]
    return [
        replace(each, variance=each.variance + more) if more.any() else each
        for each, more in zip(run, added, strict=True)
    ]


def jumps_of(model: RigModel, request: Request) -> dict[str, FloatArray]:
    """How uncertain forces that jump are as they are sampled, per place, shape (n,); none without such forces.

    A force that jumps by J between two samples may be anything between at one of them, so that it is known to
    J/√3. Halved second differences have about that power, J²/2, and next to none where a force is smooth.

    Parameters
    ----------
    model : RigModel
    request : Request

    Raises
    ------
    AnalysisError
        If the simulation does not reach its end.
    """
    if not any(term.jumps for term in (*model.twin.terms, *request.extension.terms_in(request.run.name))):
        return {}
    simulation = model.whole_simulation(request)
    found: dict[str, FloatArray] = {}
    for term, force in zip(simulation.twin.terms, simulation.forces_n.T, strict=True):
        if term.jumps:
            uncertain = np.zeros(force.size)
            uncertain[1:-1] = force[1:-1] - 0.5 * (force[:-2] + force[2:])
            found[term.place] = found.get(term.place, 0.0) + uncertain
    return found


def _recorded(observation: Observation, gain: FloatArray) -> FloatArray:
    """White force at a place that the bands of a channel allow, per block; infinite where it is not seen."""
    first = observation.spectra.shape[1] // _LOW_BANDS
    size = float(gain[first:].mean())
    shown = np.mean(observation.spectra[:, first:] ** 2, axis=1)
    return np.asarray(shown / size if size > 0 else np.full(shown.size, np.inf))
