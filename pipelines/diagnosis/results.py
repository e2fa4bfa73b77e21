"""What a report on a diagnosis is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from sloshlab.consistency.finding import ConsistencyExamination
from sloshlab.diagnosis.examination import Examination
from sloshlab.diagnosis.explanation import Explanation, Findings
from sloshlab.diagnosis.verdict import Verdict


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Findings, what they amount to, where and how the baseline misses, and where all of it comes from.

    Attributes
    ----------
    findings, verdict, examination, provenance
    recordings : tuple of ConsistencyExamination
        Whether each recording agrees with itself. What is an effect of a sensor is the diagnosis's own to find.
    """

    findings: Findings
    verdict: Verdict
    examination: Examination
    provenance: Mapping[str, Any] = field(default_factory=dict)
    recordings: tuple[ConsistencyExamination, ...] = ()

    @property
    def flags(self) -> tuple[str, ...]:
        """What a reader must know before using the verdict."""
        return (*self.findings.split.limits, *(flag for one in self.recordings for flag in one.flags))

    @property
    def explanations(self) -> list[Explanation]:
        """Every explanation that was fitted, once, by its best fit; the best on held-out runs first."""
        best: dict[frozenset[str], Explanation] = {}
        for explanation in sorted(self.findings.explanations, key=lambda explanation: explanation.fit.cost):
            best.setdefault(frozenset(explanation.keys), explanation)
        return sorted(best.values(), key=lambda explanation: explanation.held_out)
