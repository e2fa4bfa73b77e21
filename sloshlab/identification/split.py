"""Split into runs that are fitted and runs that are held out."""

from __future__ import annotations

from dataclasses import dataclass

from sloshlab.identification.case import Case, CaseRun, level


@dataclass(frozen=True, eq=False)
class Split:
    """Runs that are fitted, and held-out runs.

    Attributes
    ----------
    fitting, held_out : tuple of CaseRun
    limits : tuple of str
        What this case cannot decide, for a person.
    """

    fitting: tuple[CaseRun, ...]
    held_out: tuple[CaseRun, ...]
    limits: tuple[str, ...]

    @property
    def has_held_out(self) -> bool:
        """Whether there are runs that chose nothing; one run alone is fitted and held out at once."""
        return self.held_out != self.fitting


def split(case: Case) -> Split:
    """Hold out whole tests, from the middle of each experiment's levels; the smallest and the largest are fitted.

    Parameters
    ----------
    case : Case

    Notes
    -----
    With one or two levels per experiment, the last repeat of each test is held out instead; with one run there is
    nothing to hold out.
    """
    tests = case.tests()
    by_experiment: dict[tuple[str, str], list[tuple[CaseRun, ...]]] = {}
    for test in tests:
        attributes = test[0].attributes
        by_experiment.setdefault((attributes.experiment, attributes.configuration), []).append(test)
    held: list[CaseRun] = []
    for group in by_experiment.values():
        ordered = sorted(group, key=lambda test: level(test[0]))
        # Interpolation between levels is validated, not extrapolation: the smallest and the largest level are
        # fitted.
        if len(ordered) >= 3:
            # Whole tests: repeats of a fitted test share its drive and would judge an effect that was fitted to
            # just that.
            for test in ordered[1:-1:2]:
                held += test
    limits = []
    if not held:
        held = [test[-1] for test in tests if len(test) > 1]
        if held:
            limits.append("held-out runs are repeats of fitted tests: nothing is judged at another level")
        elif len(tests) > 1:
            middle = sorted(tests, key=lambda test: level(test[0]))[-2 if len(tests) > 2 else 0]
            held = list(middle)
            limits.append("few tests: the held-out run leaves few to fit")
        else:
            limits.append("one run alone: no held-out run, so nothing can be named for sure")
    if all(len(test) == 1 for test in tests):
        limits.append("no repeats: the noise floor is that of the sensors")
    fitting = tuple(run for run in case.runs if run not in held)
    return Split(fitting, tuple(held) or fitting, tuple(limits))
