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

from sloshlab.diagnosis.selection.fitted_runs import values_of_runs
from sloshlab.errors import SloshlabError
from sloshlab.identification.diagnosed_model import DiagnosedModel
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.identification.noise_floor import with_noise_through
from sloshlab.identification.observations import (
    Observation,
    with_scatter,
    with_typical_scatter,
    without_scatter,
)
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics.candidate import extension_of

FloatArray = NDArray[np.float64]


class ExplainedScatter:
    """Runs whose noise follows what is found of them.

    Held-out runs tell what repeats differ by as fitted ones do; they choose nothing by it.

    Parameters
    ----------
    model : DiagnosedModel
    fitting, held_out : sequence of sequences of Observation
        Per run.
    tests : sequence of sequences of str
        Names of the runs of every test.

    Attributes
    ----------
    fitting, held_out : list of list of Observation
        With the noise about the last fit that explained some of it, or made more of the noise of drives.
    """

    def __init__(
        self,
        model: DiagnosedModel,
        fitting: Sequence[Sequence[Observation]],
        held_out: Sequence[Sequence[Observation]],
        tests: Sequence[Sequence[str]],
    ) -> None:
        self._model, self._tests = model, tests
        self.fitting, self.held_out = [list(run) for run in fitting], [list(run) for run in held_out]
        self._of_scatter = [*self.fitting, *self.held_out]

    def may_explain(self, fit: FreeRunFit) -> bool:
        """Whether a fit may explain what repeats differ by: where an effect has numbers of its own in single runs.

        Parameters
        ----------
        fit : FreeRunFit
        """
        return any(known.run for candidate in fit.candidates for known in candidate.effect.parameters)

    def renew(self, fit: FreeRunFit) -> bool:
        """Take the noise about a fit from here on, if it may explain what repeats differ by; whether it may.

        Parameters
        ----------
        fit : FreeRunFit
        """
        if not self.may_explain(fit):
            return False
        everywhere = replace(fit, values=values_of_runs(self._model, self.held_out, fit))
        self._of_scatter = with_explained_scatter(self._model, self._of_scatter, self._tests, everywhere)
        self._take(self._of_scatter)
        return True

    def renew_drive(self, before: FreeRunFit, fit: FreeRunFit) -> bool:
        """Take what the noise of drives makes beside a fit from here on; whether it is more than before.

        Parameters
        ----------
        before : FreeRunFit
            Of the baseline, beside which it is known.
        fit : FreeRunFit
        """
        known = [each for run in (*self.fitting, *self.held_out) for each in run]
        every = with_noise_through(self._model, self._of_scatter, self._tests, before, fit)
        self._take(every)
        return any(new is not old for new, old in zip((each for run in every for each in run), known, strict=True))

    def _take(self, every: Sequence[Sequence[Observation]]) -> None:
        n = len(self.fitting)
        self.fitting, self.held_out = [list(run) for run in every[:n]], [list(run) for run in every[n:]]


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
