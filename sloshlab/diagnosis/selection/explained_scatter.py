"""Noise where a model explains what repeats of a test differ by, such as pulses at other instants in each.

What repeats differ by about the simulation is noise of the channels. A model with numbers of its own in each run
may explain it: what scatters about that model is then less, and shows what else is missing. Without this the one
hides the other, as the first is counted as noise wherever it acts.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import SloshlabError
from sloshlab.identification.diagnosed_model import DiagnosedModel
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.identification.observations import (
    Observation,
    with_scatter,
    with_typical_scatter,
    without_scatter,
)
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics.candidate import extension_of

FloatArray = NDArray[np.float64]


def with_explained_scatter(
    model: DiagnosedModel, runs: Sequence[Sequence[Observation]], tests: Sequence[Sequence[str]], fit: FreeRunFit
) -> list[list[Observation]]:
    """Observations known to what repeats of their test scatter about a fit, and others as these.

    The same where a simulation does not reach its end, and of runs of a liquid that fluctuates by itself.

    Parameters
    ----------
    model : DiagnosedModel
    runs : sequence of sequences of Observation
        Per run.
    tests : sequence of sequences of str
        Names of the runs of every test.
    fit : FreeRunFit
        With the numbers of all these runs.
    """
    quiet = [without_scatter(run) for run in runs]
    place = {run[0].run.name: i for i, run in enumerate(runs) if run}
    found = [list(run) for run in runs]
    repeated: list[Observation] = []
    alone = set(range(len(runs)))
    with suppress(SloshlabError):
        for test in tests:
            group = [place[name] for name in test if name in place]
            if len(group) < 2:
                continue
            alone -= set(group)
            left = [_residual(model, runs[i], fit) for i in group]
            for i, observed in zip(group, with_scatter([quiet[i] for i in group], left), strict=True):
                found[i] = [_where_told(old, new) for old, new in zip(runs[i], observed, strict=True)]
                repeated += found[i]
        for i in sorted(alone) if repeated else ():
            run = runs[i]
            if run and not (isinstance(model, RigModel) and model.liquid_fluctuates(run[0].run)):
                typical = with_typical_scatter(quiet[i], repeated)
                found[i] = [_where_told(old, new) for old, new in zip(run, typical, strict=True)]
        return found
    return [list(run) for run in runs]


def _residual(model: DiagnosedModel, run: Sequence[Observation], fit: FreeRunFit) -> dict[str, FloatArray]:
    """Unweighted, per channel."""
    names = [each.channel for each in run]
    readings = model.simulate(run[0].run, fit.values, extension_of(fit.candidates, fit.values), names)
    return {each.channel: each.spectra - each.of(readings[each.channel]) for each in run}


def _where_told(old: Observation, new: Observation) -> Observation:
    """Coefficients that are ignored stay so."""
    if old.ignored is None:
        return new
    return replace(new, variance=np.where(old.ignored, old.variance, new.variance))
