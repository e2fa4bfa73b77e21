"""The page of a blind trial: rates, confusion, detection against strength, gains, and every failure."""

from __future__ import annotations

import json
from pathlib import Path

from pipelines.diagnosis.trial_figures import FIGURES
from pipelines.diagnosis.trial_page import page_text
from sealed_trial.scoring.score import Score
from sloshlab import atomic_file

__all__ = ["write_report"]


def write_report(score: Score, folder: Path) -> None:
    """Write `blind_trial.md`, its figures and `scores.json`, all together or none."""
    with atomic_file.filled_folder(folder) as complete:
        drawn = {name: draw(score) for name, draw in FIGURES.items()}
        for name, png in drawn.items():
            if png is not None:
                atomic_file.write_bytes(complete / "figures" / f"{name}.png", png)
        shown = [name for name, png in drawn.items() if png is not None]
        atomic_file.write_bytes(complete / "blind_trial.md", page_text(score, shown).encode())
        document = json.dumps(score.to_document(), indent=1, sort_keys=True)
        atomic_file.write_bytes(complete / "scores.json", f"{document}\n".encode())
