"""Which run a number belongs to alone: a release, an offset, the instant of a pulse."""

from __future__ import annotations

from collections.abc import Iterable

from sloshlab.identification.baseline_parameter import BaselineParameter
from sloshlab.missing_physics.candidate import Candidate


def owning_runs(parameters: Iterable[BaselineParameter], candidates: Iterable[Candidate]) -> dict[str, str]:
    """Names of runs by the names of numbers that belong to one run alone, named as in a fit.

    Parameters
    ----------
    parameters : iterable of BaselineParameter
    candidates : iterable of Candidate

    Examples
    --------
    >>> release = BaselineParameter("release of run_02", 0.01, 3e-4, "m", run="run_02")
    >>> owning_runs([release, BaselineParameter("carried mass", 1.0, 0.01)], [])
    {'release of run_02': 'run_02'}
    """
    of_baseline = {known.name: known.run for known in parameters if known.run}
    of_effects = {
        name: known.run for candidate in candidates for name, known in candidate.names.items() if known.run
    }
    return of_baseline | of_effects
