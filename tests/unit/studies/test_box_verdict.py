"""The third dimension among the effects: means over starts, and what the rules of the verdict say of it."""

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from studies.steady_state import MeanOverCycles
from studies.two_phase_verification import box_verdict
from studies.two_phase_verification.effects import KEPT
from studies.two_phase_verification.shaken import Shaking

MOTIONS = ((0.5, 11.4, 48), (4.0, 11.4, 24), (2.04, 10.7, 24))
LABORATORY = (0.0, 1.65, 1.38)
PAGES = Path(box_verdict.__file__).parents[2] / "docs"


def kept(values: tuple[float, ...], cells: int = 12, **changed: Any) -> dict[str, Any]:
    """Two starts at each of the three points."""
    cases = [
        (Shaking(*motion, cells, seed=seed, **changed), w_bar)
        for motion, w_bar in zip(MOTIONS, values, strict=True)
        for seed in range(2)
    ]
    return {
        case.name: {"case": asdict(case), "w_bar": w_bar, "w_bar_error": 0.02, "beta": -0.1, "beta_error": 0.01}
        for case, w_bar in cases
    }


def test_the_mean_of_starts_errs_by_its_cycles_or_by_how_far_starts_are_apart() -> None:
    alike = box_verdict.mean_of_starts([MeanOverCycles(1.0, 0.03), MeanOverCycles(1.001, 0.04)])
    assert alike.standard_error == pytest.approx(0.025)
    apart = box_verdict.mean_of_starts([MeanOverCycles(value, 0.01) for value in (0.9, 1.0, 1.1)])
    assert apart.value == pytest.approx(1.0)
    assert apart.standard_error == pytest.approx(0.1 / math.sqrt(3))


def test_cells_are_told_apart_and_what_is_changed_is_left_out() -> None:
    coarse, fine = kept((0.5, 1.3, 1.2)), kept((0.5, 1.4, 1.25), 16)
    plane = {**kept((0.4, 0.8, 0.9)), **kept((9.0, 9.0, 9.0), surface_tension_n_per_m=0.0)}
    first, second = box_verdict.compared({**coarse, **dict(list(fine.items())[2:])}, plane)
    assert list(first.named()) == ["plane, h/12", "third dimension, h/12"]
    assert [of.w_bar.value for of in first.plane.values()] == pytest.approx([0.8, 0.9, 0.4])
    assert [of.w_bar.value for of in first.box.values()] == pytest.approx([1.3, 1.2, 0.5])
    assert [of.w_bar.value for of in second.box.values()] == pytest.approx([1.4, 1.25])


def test_the_finest_counts_that_was_computed_everywhere() -> None:
    plane = {**kept((0.4, 0.8, 0.9)), **kept((0.4, 0.8, 0.9), 16)}
    coarse, fine = kept((0.4, 0.8, 0.9)), kept(LABORATORY, 16)
    said = box_verdict.judged(box_verdict.compared({**coarse, **fine}, plane), {})
    assert said.answer == "named"
    missing = {name: run for name, run in fine.items() if run["case"]["acceleration_g"] != 0.5}
    said = box_verdict.judged(box_verdict.compared({**coarse, **missing}, plane), {})
    assert said.answer == "unknown"


@pytest.mark.parametrize(
    ("box", "answer"),
    [
        (LABORATORY, "named"),
        # it chooses well and gains nothing where nothing was chosen
        ((0.0, 1.65, 0.9), "unknown"),
        # a gain beyond chance that does not reach what was measured
        ((0.1, 1.5, 1.1), "unknown"),
    ],
)
def test_the_rules_of_the_verdict(box: tuple[float, ...], answer: str) -> None:
    pairs = box_verdict.compared(kept(box), kept((0.4, 0.8, 0.9)))
    rival = {"another": box_verdict.liquid_of(kept((0.3, 1.0, 1.38)), 12)}
    said = box_verdict.judged(pairs, rival)
    assert said.answer == answer
    assert said.names == ("third dimension",)
    assert said.gain == pytest.approx(0.48 - abs(box[2] - 1.38))


def test_the_page_has_the_tables_of_what_is_kept() -> None:
    box, plane, effects = (json.loads(path.read_text()) for path in (box_verdict.BOX, box_verdict.PLANE, KEPT))
    rows = box_verdict.tables(box, plane, effects)
    page = (PAGES / "what_our_tank_left_out.md").read_text(encoding="utf-8").splitlines()
    told = [row for row in rows if " g, " in row or row.startswith(("| plane", "| third"))]
    assert len(told) > 7
    assert [row for row in told if row not in page] == []
