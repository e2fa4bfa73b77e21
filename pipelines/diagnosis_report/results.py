"""What a report on a diagnosis is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from sloshlab.diagnosis.examination import Examination
from sloshlab.diagnosis.explanation import Findings
from sloshlab.diagnosis.verdict import Verdict


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Findings, what they amount to, where and how the baseline misses, and where all of it comes from."""

    findings: Findings
    verdict: Verdict
    examination: Examination
    provenance: Mapping[str, Any] = field(default_factory=dict)
