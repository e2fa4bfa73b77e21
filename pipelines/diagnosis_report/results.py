"""What a report on a diagnosis is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from sloshlab.diagnosis.explanation import Findings
from sloshlab.diagnosis.verdict import Verdict


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Findings, what they amount to, and where they come from."""

    findings: Findings
    verdict: Verdict
    provenance: Mapping[str, Any] = field(default_factory=dict)
