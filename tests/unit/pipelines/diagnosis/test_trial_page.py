"""The page of a trial: names of anybody end no row and open no tag; a strength that nobody states is none."""

from __future__ import annotations

import math

from pipelines.diagnosis.trial_figures import detection
from pipelines.diagnosis.trial_page import TITLES, page_text
from sealed_trial.running import Outcome
from sealed_trial.scoring.answer import Answer
from sealed_trial.scoring.score import Score, scored

HOSTILE = "a | b\n<img src=x>\x1b[2J"


def score(strength: float) -> Score:
    effect = {"name": "coulomb_friction", "block": "structure", "parameters": {}, "strength": strength}
    truth = {"case": "a", "kind": "single", "effects": [effect], "accepted": [["coulomb_friction"]]}
    answer = Answer("named", frozenset({HOSTILE}), {HOSTILE: "structure"})
    outcome = Outcome("a", "done", 0, 1.0, 1.0, 1.0, "")
    return scored("challenge", {"a": truth}, {"a": answer}, {"a": outcome}, {})


def test_a_name_of_anybody_stays_in_its_cell() -> None:
    page = page_text(score(4.0), [])
    [row] = [line for line in page.splitlines() if line.startswith("| a ")]
    assert row == "| a | one effect | coulomb_friction | 4.0 | a \\| b?&lt;img src=x>?[2J | wrong name |"
    assert "<" not in page


def test_a_strength_that_nobody_stated_is_clear_and_on_no_axis() -> None:
    found = score(math.nan)
    assert found.rates["clear single effects named in the right block"].n == 1
    assert found.curve is None
    assert detection(found) is None
    assert "| a | one effect | coulomb_friction | – |" in page_text(found, [])
    assert found.to_document()["marks"][0]["strength"] is None


def test_no_line_of_a_page_with_every_figure_is_longer_than_120_characters() -> None:
    page = page_text(score(4.0), list(TITLES))
    assert max(map(len, page.splitlines())) <= 120
    assert page.count("(figures/") == len(TITLES)
