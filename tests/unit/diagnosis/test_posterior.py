"""Evidence, posterior and decision on likelihoods that are written by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.integrate import quad

from sloshlab.diagnosis.inference import posterior as posterior_module
from sloshlab.diagnosis.inference.decision import decided
from sloshlab.diagnosis.inference.known_runs import KnownRun
from sloshlab.diagnosis.inference.posterior import posterior
from sloshlab.diagnosis.inference.remainder import TEMPERING, Remainder
from sloshlab.diagnosis.inference.run_noise import RunNoise
from sloshlab.diagnosis.inference.scored_model import ScoredModel, complexity
from sloshlab.diagnosis.inference.whitened import WhitenedRun
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, known_effects
from sloshlab.missing_physics.prior import ParameterPrior

assert effects.__all__
N_CELLS = 40


def candidate(key: str) -> Candidate:
    block, name, *channel = key.split(".")
    effect = next(each for each in known_effects() if (each.block, each.name) == (block, name))
    return Candidate(effect, cast(Any, None), *channel)


def model(
    total: float, *keys: str, places: dict[str, float] | None = None, cells: np.ndarray | None = None
) -> ScoredModel:
    """A model with a log-likelihood, all cells alike unless they are given, and that of remainders."""
    candidates = tuple(candidate(key) for key in keys)
    values = {f"{c.key}.{parameter.name}": 1.0 for c in candidates for parameter in c.effect.parameters}
    fit = FreeRunFit(candidates, values, 0.0, 0.0)
    by_cell = np.full(N_CELLS, total / N_CELLS) if cells is None else np.asarray(cells, np.float64)
    of_places = {
        place: np.broadcast_to(np.full(N_CELLS, all_of_it / N_CELLS), (4, N_CELLS))
        for place, all_of_it in (places or {}).items()
    }
    alone = RunNoise(np.ones((1, 4, 1, 1)), {}, {})
    runs = [WhitenedRun(KnownRun([], alone), np.full((1, 1, 4), -total))]
    return ScoredModel(fit, values, runs, Remainder(by_cell, of_places), frozenset(), 0.0)


@pytest.fixture(autouse=True)
def worth_a_word(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(posterior_module, "strength", lambda before, after: 10.0)
    monkeypatch.setattr(posterior_module, "is_worth_a_word", lambda runs: True)


FRICTION, DRAG, DAMPER = "structure.coulomb_friction", "structure.quadratic_drag", "structure.viscous_damping"


def test_models_whose_cells_agree_have_probabilities_by_bayes_theorem() -> None:
    found = posterior([model(0.0), model(5.0, FRICTION)], n_candidates=10, tempering=1.0).by_label()
    # Prior 1/2 for nothing, 1/4 over ten candidates for one of them; e^5 by the recordings.
    odds = np.exp(5.0) * (1 / 40) / (1 / 2)
    assert found["coulomb_friction"] == pytest.approx(odds / (1 + odds), rel=1e-9)
    assert sum(found.values()) == pytest.approx(1.0)


def test_log_likelihoods_are_divided_before_they_are_compared() -> None:
    found = posterior([model(0.0), model(50.0, FRICTION)], n_candidates=10, tempering=10.0).by_label()
    odds = np.exp(50.0 / 10.0) * (1 / 40) / (1 / 2)
    assert found["coulomb_friction"] == pytest.approx(odds / (1 + odds), rel=1e-9)


def test_a_lead_that_rests_on_one_cell_is_no_certainty() -> None:
    one, all_ = np.zeros(N_CELLS), np.full(N_CELLS, 20.0 / N_CELLS)
    one[3] = 20.0
    sure = posterior([model(0.0), model(20.0, FRICTION, cells=all_)], 10, 1.0).by_label()["coulomb_friction"]
    unsure = posterior([model(0.0), model(20.0, FRICTION, cells=one)], 10, 1.0).by_label()["coulomb_friction"]
    assert sure > 0.999
    # Its weight is exponential with mean one: it wins where 20 w exceeds the logarithm of the prior odds of 20.
    assert unsure == pytest.approx(np.exp(-np.log(20.0) / 20.0), abs=0.05)


def test_what_adds_little_to_one_effect_is_that_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    def added(before: ScoredModel, after: ScoredModel) -> float:
        return 0.3 if before.names and len(after.names) == 2 else 10.0

    monkeypatch.setattr(posterior_module, "strength", added)
    found = posterior([model(0.0), model(50.0, FRICTION), model(90.0, FRICTION, DRAG)], 10, 1.0).by_label()
    assert found["coulomb_friction"] > 0.99
    assert "coulomb_friction + quadratic_drag" not in found


def test_a_wider_model_that_predicts_the_same_is_the_simple_one() -> None:
    wider = model(51.0, "structure.stribeck_friction")
    found = posterior([model(0.0), model(50.0, FRICTION), wider], 10, 1.0).by_label()
    # Predictions of these models differ by ½ 4 (51 − 50)².
    assert found["coulomb_friction"] > 0.99


def test_the_occam_factor_is_the_integral_over_the_prior() -> None:
    # y = a x + noise with Σx² = 1: the likelihood of a is normal about its estimate with standard error one.
    estimate, key = 400.0, "structure.coulomb_friction.force_n"
    prior = ParameterPrior(key, 0.1, 1000.0, is_log=True, may_be_negative=False)
    alone = cast(Any, SimpleNamespace(key="structure.coulomb_friction", prior=(prior,)))
    fit = FreeRunFit((alone,), {key: estimate}, 0.0, 0.0, np.eye(1), (key,), np.ones(1))
    integral, _ = quad(lambda a: np.exp(-0.5 * (a - estimate) ** 2 / TEMPERING) / a / np.log(1e4), 350.0, 450.0)
    # Laplace takes 1/a at the estimate; the integral differs by (σ/a)².
    assert complexity(fit) == pytest.approx(-np.log(integral), abs=2e-3)


@pytest.mark.parametrize("correlation", [0.0, 1.0 - 1e-8])
def test_the_occam_factor_beside_a_number_of_the_baseline(correlation: float) -> None:
    # Known to 1/100 of the prior of the baseline: alone by noise, or as well as the baseline's number is believed.
    key = "structure.coulomb_friction.force_n"
    prior = ParameterPrior(key, 0.1, 1e4, is_log=True, may_be_negative=False)
    alone = cast(Any, SimpleNamespace(key="structure.coulomb_friction", prior=(prior,)))
    information, belief = 1e4 * np.array([[1.0, correlation], [correlation, 1.0]]), np.diag([1.0, 0.0])
    covariance = np.linalg.inv(information + TEMPERING * belief)
    fit = FreeRunFit((alone,), {"mass": 0.0, key: 500.0}, 0.0, 0.0, covariance, ("mass", key), np.ones(2))
    variance = np.linalg.inv(information / TEMPERING + belief)[1, 1]
    assert complexity(fit) == pytest.approx(
        np.log(500.0 * np.log(1e5)) - 0.5 * np.log(2 * np.pi * variance), abs=0.05
    )


def test_a_number_that_nothing_tells_costs_nothing() -> None:
    key = "structure.coulomb_friction.force_n"
    prior = ParameterPrior(key, 0.1, 1000.0, is_log=True, may_be_negative=False)
    alone = cast(Any, SimpleNamespace(key="structure.coulomb_friction", prior=(prior,)))
    fit = FreeRunFit((alone,), {key: 1.0}, 0.0, 0.0, 1e6 * np.eye(1), (key,), np.ones(1))
    assert complexity(fit) == 0.0


def test_what_no_model_describes_may_have_a_name_that_was_not_found() -> None:
    # one in ten has no name, and of the others the search misses 6 of 69
    without_name = 0.1 / (0.1 + 0.9 * 6 / 69)
    names = {"tank": ["air_cushion", "ceiling_impact"], "sensor": ["sensor_gain"]}
    found = posterior([model(0.0, places={"tank": 80.0})], 10, 1.0, names=names)
    assert found.by_label()["unknown"] == pytest.approx(1.0)
    stated = found.with_missed()
    assert list(stated) == ["unknown", "air_cushion", "ceiling_impact", "none"]
    assert stated["unknown"] == pytest.approx(without_name, rel=1e-6)
    assert stated["ceiling_impact"] == pytest.approx(0.5 * (1.0 - without_name), rel=1e-6)
    assert sum(stated.values()) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("models", "kind", "names"),
    [
        ([model(0.0)], "nothing_missing", set()),
        ([model(0.0), model(1.0, FRICTION)], "nothing_missing", set()),
        # twenty to one for nothing before; then 0.7 and 0.93 for friction
        ([model(0.0), model(3.85, FRICTION)], "nothing_missing", set()),
        ([model(0.0), model(5.6, FRICTION)], "named", {"coulomb_friction"}),
        ([model(0.0), model(50.0, FRICTION), model(20.0, DRAG)], "named", {"coulomb_friction"}),
        (
            [model(0.0), model(50.0, FRICTION), model(50.0, DRAG)],
            "indistinguishable",
            {"coulomb_friction", "quadratic_drag"},
        ),
        ([model(0.0, places={"tank": 80.0}), model(50.0, FRICTION)], "unknown", set()),
        # both models have friction, which is one of them
        ([model(0.0), model(50.0, FRICTION), model(55.0, FRICTION, DRAG)], "named", {"coulomb_friction"}),
        # three, and none of two effects is in all of them
        (
            [model(0.0), model(50.0, FRICTION), model(50.0, DRAG), model(55.0, FRICTION, DRAG)],
            "indistinguishable",
            {"coulomb_friction", "quadratic_drag"},
        ),
    ],
)  # fmt: skip
def test_decisions(models: list[ScoredModel], kind: str, names: set[str]) -> None:
    decision = decided(posterior(models, 10, 1.0))
    assert decision.kind == kind
    assert {name for each in decision.alternatives for name in each.names} == names


def test_what_may_be_missing_besides_is_said() -> None:
    wider = [model(53.0, FRICTION, DRAG), model(53.0, FRICTION, DAMPER)]
    decision = decided(posterior([model(0.0), model(50.0, FRICTION), *wider], 10, 1.0))
    assert (decision.best is not None and decision.best.keys) == (FRICTION,)
    assert {each.keys for each in decision.wider} == {each.keys for each in wider}


def test_names_that_are_not_sure_enough_tell_the_block_too() -> None:
    # A remainder at either place is an eighth as probable as the name, which so has 0.8 and is not said.
    remainders = 50.0 - np.log(8.0) - np.log(0.1 / 2 / 4)
    models = [
        model(0.0),
        model(50.0, "tank.quadratic_drag", places=dict.fromkeys(("tank", "structure"), remainders)),
    ]
    found = posterior(models, 10, 1.0)
    assert found.by_label()["quadratic_drag"] == pytest.approx(0.8)
    assert found.by_block() == pytest.approx({"tank": 0.9, "structure": 0.1})
    decision = decided(found)
    assert (decision.kind, decision.block) == ("unknown", "tank")


def test_of_equals_in_two_blocks_the_structure_is_said() -> None:
    # The tank is better by what chance makes of two fits of one force.
    models = [model(0.0), model(50.01, "tank.coulomb_friction"), model(50.0, FRICTION)]
    best = decided(posterior(models, 10, 1.0)).best
    assert best is not None
    assert best.keys == (FRICTION,)
    apart = [model(0.0), model(60.0, "tank.coulomb_friction"), model(50.0, FRICTION)]
    assert decided(posterior(apart, 10, 1.0)).best is apart[1]


@pytest.mark.parametrize(("cost", "kind"), [(1.0, "indistinguishable"), (5.0, "named")])
def test_what_needs_an_improbable_baseline_is_no_equal(cost: float, kind: str) -> None:
    """Both predict the same; numbers of the baseline that nobody believes tell them apart as readings do."""
    plain = model(50.0, DRAG)
    models = [
        model(0.0),
        model(50.0, FRICTION),
        replace(plain, fit=replace(plain.fit, cost=2 * TEMPERING * cost), complexity=cost),
    ]
    assert decided(posterior(models, 10, 1.0)).kind == kind


def test_what_has_no_name_is_placed_only_where_one_block_has_the_evidence() -> None:
    both = {"tank": 80.0, "structure": 79.5, "sensor acceleration_tip": 10.0}
    assert decided(posterior([model(0.0, places=both)], 10, 1.0)).block == ""
    assert decided(posterior([model(0.0, places={**both, "tank": 90.0})], 10, 1.0)).block == "tank"


def test_a_remainder_that_is_not_worth_a_word_leaves_the_name_what_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    models = [model(0.0), model(200.0, FRICTION, places={"tank": 300.0})]
    assert posterior(models, 10, 1.0).by_label()["unknown"] > 0.99
    monkeypatch.setattr(posterior_module, "is_worth_a_word", lambda runs: False)
    assert posterior(models, 10, 1.0).by_label()["coulomb_friction"] > 0.99


@pytest.mark.parametrize(("cost", "named"), [(1.0, False), (30.0, True)])
def test_a_baseline_that_nobody_believes_is_no_simpler_than_an_effect(cost: float, named: bool) -> None:
    """Both predict the same: the baseline by numbers that cost so much of its prior, the effect by one more."""
    found = posterior(
        [
            replace(model(0.0), fit=replace(model(0.0).fit, cost=2 * TEMPERING * cost), complexity=cost),
            model(0.0, DRAG),
        ],
        n_candidates=10,
        tempering=1.0,
    )
    odds = np.exp(cost) * (1 / 40) / (1 / 2)
    expected = odds / (1 + odds) if named else 0.0
    assert found.by_label().get("quadratic_drag", 0.0) == pytest.approx(expected, rel=1e-6)


def test_models_are_ranked_by_the_evidence_that_their_probabilities_have() -> None:
    """A lead of 50 is one of 5 in the posterior, and does not pay for 8 more of complexity."""
    simple, wide = model(0.0, FRICTION), replace(model(50.0, DRAG), complexity=8.0)
    assert wide.evidence - simple.evidence == pytest.approx(50.0 / 10.0 - 8.0)
    found = posterior([model(-1000.0), simple, wide], n_candidates=10)
    best, second = sorted((found.best(label) for label in ("coulomb_friction", "quadratic_drag")), key=_rank)
    assert best.model is simple
    assert best.log_evidence - second.log_evidence == pytest.approx(3.0)
    labels = found.by_label()
    assert np.log(labels["coulomb_friction"] / labels["quadratic_drag"]) == pytest.approx(3.0, abs=1e-6)


def _rank(hypothesis: posterior_module.Hypothesis) -> float:
    return -hypothesis.log_evidence


def test_a_sensor_that_shows_as_a_force_does_is_no_place_of_its_own() -> None:
    """Of one channel alone nothing tells the two apart; where the sensor shows otherwise it is a place."""
    for sensor, blocks in ((60.0, {"structure"}), (60.5, {"structure", "sensor"})):
        found = posterior([model(0.0, places={"structure": 60.0, "sensor acceleration_tip": sensor})], 10, 1.0)
        assert set(found.by_block()) == blocks
