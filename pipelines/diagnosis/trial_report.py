"""The page of a blind trial: rates, confusion, detection against strength, gains, and every failure."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from pipelines.diagnosis.trial_figures import FIGURES
from pipelines.diagnosis.trial_page import page_text
from pipelines.report.outputs import RESULT_ID
from pipelines.report.page import with_png_text
from pipelines.report.result_folder import result_folder
from sealed_trial.scoring.score import Score
from sloshlab import atomic_file

__all__ = ["FILES", "write_report"]


FILES: Final = ("blind_trial.md", "scores.json")
"""What is written for certain."""


def write_report(score: Score, folder: Path, provenance: Mapping[str, Any], about: str = "") -> None:
    """Write `blind_trial.md`, its figures and `scores.json`, all together or none."""
    with result_folder(folder, provenance) as complete:
        drawn = {name: draw(score) for name, draw in FIGURES.items()}
        for name, png in drawn.items():
            if png is not None:
                stamped = with_png_text(png, RESULT_ID, provenance[RESULT_ID])
                atomic_file.write_bytes(complete / "figures" / f"{name}.png", stamped)
        shown = [name for name, png in drawn.items() if png is not None]
        atomic_file.write_bytes(complete / "blind_trial.md", page_text(score, shown, about).encode())
        document = json.dumps({RESULT_ID: provenance[RESULT_ID], **score.to_document()}, indent=1, sort_keys=True)
        atomic_file.write_bytes(complete / "scores.json", f"{document}\n".encode())
