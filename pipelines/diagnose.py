"""The command `diagnose`: what physics the simulation of a case left out."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pipelines.progress import amounts
from sloshlab import atomic_file
from sloshlab.diagnosis.case import read_case
from sloshlab.diagnosis.explanation import findings_of
from sloshlab.diagnosis.verdict import verdict_facts, verdict_of


def diagnose_case(folder: Path, output: Path | None) -> dict[str, Any]:
    """Diagnose a case and write ``verdict.json``; return what is to be said.

    Parameters
    ----------
    folder : Path
    output : Path, optional
        ``diagnosis/`` in the case folder by default.
    """
    case = read_case(folder)
    with amounts("diagnosing") as advance:
        found = findings_of(case, lambda what, done, of: advance(done, of))
    verdict = verdict_of(found)
    facts = verdict_facts(found, verdict)
    target = output or folder / "diagnosis"
    target.mkdir(parents=True, exist_ok=True)
    atomic_file.write_bytes(target / "verdict.json", (json.dumps(facts, indent=1) + "\n").encode())
    flags = list(found.split.limits)
    return {
        "lines": [verdict.statement, f"verdict: {verdict.kind}", f"written: {target / 'verdict.json'}"],
        "flags": flags,
        **facts,
    }
