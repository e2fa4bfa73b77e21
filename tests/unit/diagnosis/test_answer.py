"""The answer after fits about other baselines: a pair stands only where each of its effects has a size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
from hand_made_findings import BASELINE, DRAG, FRICTION, STRIBECK, TIP, N, findings, left

from sloshlab.diagnosis import answer
from sloshlab.diagnosis.answer import answered
from sloshlab.diagnosis.explanation import Explanation, Findings
from sloshlab.diagnosis.verdict.interval import interval_excludes_zero

DRAG_NUMBER, FRICTION_NUMBER = (*DRAG, *FRICTION)
PAIR = left(0.0, 0.0, {**FRICTION, **DRAG})


class Without:
    """Runs of which so much log-likelihood is lost, per number that is zero, of effects without their size."""

    lost: ClassVar[Mapping[str, float]] = {}

    def __init__(self, *parts: object) -> None:
        del parts

    def theta_of(self, values: Mapping[str, float]) -> Mapping[str, float]:
        return values

    def residual(self, values: Mapping[str, float]) -> np.ndarray:
        lost = sum(self.lost.get(name, 500.0) for name, value in values.items() if value == 0)
        return np.full(N, np.sqrt(1 + 2 * lost / N))


def drawn(
    monkeypatch: pytest.MonkeyPatch, spread: Mapping[str, float], lost: Mapping[str, float] | None = None
) -> list[tuple[str, ...]]:
    """Let fits about other baselines spread by so much; what was drawn is kept."""
    monkeypatch.setattr(Without, "lost", lost or {})
    monkeypatch.setattr(answer, "FreeRunProblem", Without)
    asked: list[tuple[str, ...]] = []

    def with_randomised_baselines(found: Findings, best: Explanation, told: object) -> Findings:
        asked.append(best.keys)
        own = {name: spread.get(name, 1e-3) for name in best.fit.names}
        return replace(
            found,
            explanations=[
                replace(explanation, spread=own) if explanation is best else explanation
                for explanation in found.explanations
            ],
        )

    monkeypatch.setattr(answer, "with_randomised_baselines", with_randomised_baselines)
    return asked


def test_two_effects_with_sizes_are_named_after_one_draw(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = drawn(monkeypatch, {})
    found, verdict = answered(findings(BASELINE, [PAIR, left(200.0, 200.0, FRICTION, squares=3.0)]))
    assert verdict.kind == "named"
    assert verdict.best is not None
    assert verdict.best.keys == PAIR.keys
    assert verdict.best.spread
    assert asked == [PAIR.keys]
    assert found.failed == {}


@pytest.mark.parametrize(("lost", "named"), [(12.1, PAIR.keys), (11.9, ("structure.coulomb_friction",))])
def test_an_effect_without_which_nothing_changes_has_no_size(
    monkeypatch: pytest.MonkeyPatch, lost: float, named: tuple[str, ...]
) -> None:
    """An effect on one of two sensors that drive gains by leaving the drive to the other one."""
    drawn(monkeypatch, {}, {DRAG_NUMBER: lost})
    single = left(200.0, 200.0, FRICTION, squares=1.9, rms=1.1, repeatable={("run_2", TIP): 0.2})
    _, verdict = answered(findings(BASELINE, [PAIR, single]))
    assert verdict.kind == "named"
    assert verdict.best is not None
    assert verdict.best.keys == named


@pytest.mark.parametrize(
    ("in_common", "kind"),
    [pytest.param(0.2, "named", id="one is enough"), pytest.param(0.3, "unknown", id="it is not")],
)
def test_where_one_of_two_effects_may_be_zero_all_pairs_are_rejected(
    monkeypatch: pytest.MonkeyPatch, in_common: float, kind: str
) -> None:
    """1.645 × 0.5 is more than 0.8 N s²/m², so that the drag may be nothing; the other pair is not tried.

    What the pairs describe better still speaks against one effect, unless repeats share less than 0.25.
    """
    asked = drawn(monkeypatch, {DRAG_NUMBER: 0.5})
    single = left(200.0, 200.0, FRICTION, squares=1.9, rms=1.1, repeatable={("run_2", TIP): in_common})
    other = left(30.0, 30.0, {**STRIBECK, **DRAG})
    found, verdict = answered(findings(BASELINE, [PAIR, other, single]))
    assert verdict.kind == kind
    assert asked == ([PAIR.keys, single.keys] if kind == "named" else [PAIR.keys])
    assert [explanation.keys for explanation in found.explanations] == [single.keys]
    [(pair, why)] = found.failed.items()
    assert pair == " + ".join(PAIR.keys)
    assert "structure.quadratic_drag is not told from nothing" in why


@pytest.mark.parametrize(
    ("squares", "rms", "beside", "is_named"),
    [
        pytest.param(9.9, 1.0, FRICTION, False, id="it may be nothing"),
        pytest.param(10.1, 1.0, FRICTION, True, id="it removes what is clear"),
        pytest.param(9.9, 1.41, FRICTION, False, id="it removes less than half"),
        pytest.param(9.9, 1.42, FRICTION, True, id="it removes half of all"),
        pytest.param(10.1, 1.42, STRIBECK, False, id="nobody knows what it removes"),
    ],
)
def test_one_of_two_effects_that_may_be_zero_stands_where_it_is_clear(
    monkeypatch: pytest.MonkeyPatch, squares: float, rms: float, beside: Mapping[str, float], is_named: bool
) -> None:
    """As for one effect, √(10 − 1) is three noise floors; held against the other effect fitted alone."""
    drawn(monkeypatch, {DRAG_NUMBER: 0.5})
    pair = replace(PAIR, held_out_rms=1.0)
    retuned = left(500.0, 500.0, squares=20.0, rms=5.0)
    found, _ = answered(findings(retuned, [pair, left(200.0, 200.0, beside, squares=squares, rms=rms)]))
    assert any(explanation.keys == PAIR.keys for explanation in found.explanations) is is_named
    assert bool(found.failed) is not is_named


@pytest.mark.parametrize(
    ("spread", "squares", "rms", "kind"),
    [
        pytest.param(1.0, 9.9, 1.0, "unknown", id="it may be nothing"),
        pytest.param(1.0, 10.1, 1.0, "named", id="it removes what is clear"),
        pytest.param(1.0, 9.9, 1.41, "unknown", id="it removes less than half"),
        pytest.param(1.0, 9.9, 1.42, "named", id="it removes half of all"),
        pytest.param(0.1, 9.9, 1.0, "named", id="it has a size"),
    ],
)
def test_one_effect_that_may_be_zero_is_named_only_where_it_is_clear(
    monkeypatch: pytest.MonkeyPatch, spread: float, squares: float, rms: float, kind: str
) -> None:
    """√(10 − 1) is three noise floors, and an error of √2 has twice the mean square of one of 1."""
    drawn(monkeypatch, {FRICTION_NUMBER: spread})
    retuned = left(500.0, 500.0, squares=squares, rms=rms)
    _, verdict = answered(findings(retuned, [left(0.0, 0.0, FRICTION, rms=1.0)]))
    assert verdict.kind == kind


def test_nothing_is_drawn_where_nothing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = drawn(monkeypatch, {})
    assert answered(findings(BASELINE, [left(499.0, 499.0, FRICTION)]))[1].kind == "nothing_missing"
    assert asked == []


@pytest.mark.parametrize(
    ("spread", "is_told"),
    [(0.37 / 1.65, True), (0.37 / 1.64, False), (0.0, True)],
    ids=["just", "just not", "sure"],
)
def test_a_size_is_significant_by_its_interval(spread: float, is_told: bool) -> None:
    """90 % are 1.645 standard deviations; two standard errors of 0.01 and one per cent are beside the spread."""
    own = (spread**2 - 0.02**2 - 0.0037**2) ** 0.5 if spread else 0.0
    explanation = replace(left(0.0, 0.0, FRICTION), spread={FRICTION_NUMBER: own})
    assert interval_excludes_zero(explanation, explanation.fit.candidates[0]) is is_told
