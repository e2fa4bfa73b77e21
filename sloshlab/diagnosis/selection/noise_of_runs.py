"""Noise of runs as it follows what a search has found: what it explains of scatter, what it makes of drives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from sloshlab.diagnosis.selection.explained_scatter import with_explained_scatter
from sloshlab.diagnosis.selection.fitted_runs import values_of_runs
from sloshlab.identification.diagnosed_model import DiagnosedModel
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.identification.noise_floor import with_noise_through
from sloshlab.identification.observations import Observation
from sloshlab.missing_physics.candidate import extension_of


class NoiseOfRuns:
    """Runs whose noise follows what is found of them: of their repeats' scatter, and of what drives.

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
        """Take what the noise of drives makes beside a fit from here on; whether it is another than before.

        Contacts and dry friction magnify it until motions part: what they leave then is no noise
        (`DivergingMotions`).

        Parameters
        ----------
        before : FreeRunFit
            Of the baseline, beside which it is known.
        fit : FreeRunFit
        """
        known = [each for run in (*self.fitting, *self.held_out) for each in run]
        extension = extension_of(fit.candidates, fit.values)
        every = self._of_scatter
        if not any(term.jumps for run in every for term in extension.terms_in(run[0].run.name)):
            every = with_noise_through(self._model, every, self._tests, before, fit)
        self._take(every)
        return any(new is not old for new, old in zip((each for run in every for each in run), known, strict=True))

    def _take(self, every: Sequence[Sequence[Observation]]) -> None:
        n = len(self.fitting)
        self.fitting, self.held_out = [list(run) for run in every[:n]], [list(run) for run in every[n:]]
