"""What to record next, and never what the case already holds."""

from __future__ import annotations

from pipelines.diagnosis.results import Diagnosis
from sloshlab.diagnosis.held_experiments import lacking_of, unheld_level
from sloshlab.informative_runs import informative_runs


def next_experiment(diagnosis: Diagnosis) -> str:
    """What tells equals apart, what a name's look-alikes need, or what this case lacks.

    Parameters
    ----------
    diagnosis : Diagnosis
    """
    verdict, found = diagnosis.verdict, diagnosis.findings
    if verdict.separating_experiment:
        return f"to tell them apart, {verdict.separating_experiment}"
    nearest = [] if verdict.best is None else [c.effect.separated_by for c in verdict.best.fit.candidates]
    wanted = lacking_of([words for words in nearest if words], found.case)
    if verdict.has_law:
        return f"{unheld_level(found.case)}, or another frequency, at which the law must hold as well"
    if verdict.kind == "unknown" and wanted:
        return f"to see whether it is the nearest known effect, {'; or '.join(wanted)}"
    if found.split.limits:
        lacking = informative_runs(found.case).lacking
        return f"what this case lacks: {'; '.join(lacking or found.split.limits)}"
    if verdict.kind == "named" and wanted:
        return f"to confirm it, {'; or '.join(wanted)}"
    if verdict.kind == "unknown":
        return f"{unheld_level(found.case)}: what has no name here shows there as something else, or as no more"
    return f"none is needed to say this; {unheld_level(found.case)} widens where it holds"
