"""What a report on a diagnosis is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pipelines.diagnosis.tolerance_bounds import at_their_bounds
from pipelines.report.outputs import RESULT_ID
from sloshlab.consistency.finding import ConsistencyExamination
from sloshlab.diagnosis.examination import Examination, examination_facts
from sloshlab.diagnosis.findings import Findings
from sloshlab.diagnosis.inference.scored_model import ScoredModel
from sloshlab.diagnosis.verdict import Verdict, verdict_facts
from sloshlab.user_twin import UserTwinModel


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Findings, what they amount to, where and how the baseline misses, and where all of it comes from.

    Attributes
    ----------
    findings, verdict, examination, provenance
    recordings : tuple of ConsistencyExamination
        Whether each recording agrees with itself. What is an effect of a sensor is the diagnosis's own to find.
    remarks : tuple of str
        What was done to the case before the search: runs that were cut, effects of a user's own.
    """

    findings: Findings
    verdict: Verdict
    examination: Examination
    provenance: Mapping[str, Any] = field(default_factory=dict)
    recordings: tuple[ConsistencyExamination, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def after(self) -> ScoredModel | None:
        """The model that is shown beside the retuned baseline: named, a law that holds, or the nearest one."""
        return self.verdict.model if self.verdict.has_law else self.verdict.best

    @property
    def flags(self) -> tuple[str, ...]:
        """What a reader must know before using the verdict."""
        of_recordings = (flag for one in self.recordings for flag in one.flags)
        return (*self.findings.split.limits, *of_recordings, *self._of_tolerances)

    @property
    def _of_tolerances(self) -> tuple[str, ...]:
        # a rig has the tolerances of the format, a twin of a user those that its author chose
        if not isinstance(self.findings.model, UserTwinModel):
            return ()
        shown = self.verdict.model or self.findings.retuned
        return at_their_bounds(self.findings.model.parameters, shown.values)

    @property
    def facts(self) -> dict[str, Any]:
        """The content of ``verdict.json``."""
        return {
            RESULT_ID: self.provenance[RESULT_ID],
            **verdict_facts(self.findings, self.verdict),
            **examination_facts(self.examination, self.findings),
        }
