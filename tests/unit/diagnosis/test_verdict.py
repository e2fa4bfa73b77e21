"""What a verdict makes of findings whose costs were written by hand, in units of the log-likelihood."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hand_made_findings import (
    ANY_FORCE,
    BASELINE,
    DRAG,
    FRICTION,
    HUM,
    OFFSET,
    PER_NUMBER,
    STRIBECK,
    TIP,
    N,
    findings,
    judged,
    left,
    names,
)

from sloshlab.diagnosis.examination import Examination, examination_facts
from sloshlab.diagnosis.explanation import Explanation
from sloshlab.diagnosis.verdict import verdict_facts, verdict_of, with_place


@pytest.mark.parametrize(
    ("baseline", "kind"),
    [
        pytest.param(left(12.2, 12.2), "named", id="just enough"),
        pytest.param(left(500.0, 11.8), "nothing_missing", id="held-out runs do not ask for it"),
        pytest.param(left(11.8, 500.0), "nothing_missing", id="fitted runs do not ask for it"),
        pytest.param(left(500.0, 500.0, squares=1.48), "nothing_missing", id="less than 0.7 noise floors"),
        pytest.param(left(500.0, 500.0, squares=1.50), "named", id="0.7 noise floors"),
    ],
)
def test_something_is_missing_where_both_kinds_of_runs_ask_for_it_and_it_is_worth_a_word(
    baseline: Explanation, kind: str
) -> None:
    verdict = judged(baseline, [left(0.0, 0.0, FRICTION)])
    assert verdict.kind == kind
    assert (verdict.best is None) == (kind == "nothing_missing")


def test_one_run_alone_names_nothing() -> None:
    """It would be judged by the run that chose it."""
    found = findings(left(500.0, 500.0, rms=2.0), [left(0.0, 0.0, FRICTION)])
    assert verdict_of(found).kind == "named"
    alone = replace(found, split=replace(found.split, fitting=found.split.held_out))
    verdict = verdict_of(alone)
    assert verdict.kind == "unknown"
    assert verdict.statement.startswith("Something is missing that one run alone does not tell, most likely in")
    assert "the nearest known effect is coulomb friction" in verdict.statement
    assert [effect["name"] for effect in verdict_facts(alone, verdict)["effects"]] == ["unknown"]


@pytest.mark.parametrize(("rms", "is_near"), [(1.91, True), (1.93, False)])
def test_what_explains_next_to_nothing_is_not_called_near(rms: float, is_near: bool) -> None:
    """Of 2² − 1², (2² − 1.91²)/3 is 12 %, (2² − 1.93²)/3 is 9 %; ten are needed."""
    ceiling = left(0.0, 0.0, surface="structure")
    verdict = judged(left(500.0, 500.0, rms=2.0), [left(450.0, 450.0, FRICTION, squares=9.0, rms=rms)], [ceiling])
    assert verdict.kind == "unknown"
    assert ("nearest" in verdict.statement) is is_near


@pytest.mark.parametrize(("squares", "kind"), [(1.07, "named"), (1.08, "nothing_missing")])
def test_a_name_must_itself_remove_what_is_worth_a_word(squares: float, kind: str) -> None:
    """√(1.6/1.07 − 1) = 0.704 noise floors; any force removes √0.6 = 0.77."""
    friction = left(20.0, 20.0, FRICTION, squares=squares, rms=1.1)
    verdict = judged(left(500.0, 500.0, squares=1.6), [friction], [ANY_FORCE])
    assert verdict.kind == kind


@pytest.mark.parametrize("which", ["fitted", "held_out"])
def test_gains_count_in_units_of_what_the_best_description_leaves(which: str) -> None:
    """Four times the noise is left by the best: twelve units are 48 of noise."""
    friction = left(1.5 * N, 1.5 * N, FRICTION, squares=4.0)
    for gain, kind in ((47.0, "nothing_missing"), (49.0, "named")):
        gains = {"fitted": 1000.0, "held_out": 1000.0, which: gain}
        verdict = judged(left(1.5 * N + gains["fitted"], 1.5 * N + gains["held_out"]), [friction])
        assert verdict.kind == kind
        assert verdict.gain == pytest.approx(gains["held_out"] / 4)


@pytest.mark.parametrize("better", [0.0, 0.9 * PER_NUMBER])
def test_friction_of_one_number_is_named_before_friction_of_three(better: float) -> None:
    """Stribeck's two numbers more must gain log √n each, over all runs; what includes another is no rival."""
    verdict = judged(BASELINE, [left(0.0, 0.0, STRIBECK), left(better, better, FRICTION)])
    assert verdict.kind == "named"
    assert names(verdict) == [("coulomb_friction",)]


@pytest.mark.parametrize(
    ("friction", "named"),
    [
        pytest.param(left(20.0, 20.0, FRICTION, squares=1.50), "stribeck_friction", id="by 0.7 noise floors"),
        pytest.param(left(20.0, 20.0, FRICTION, squares=1.48), "coulomb_friction", id="by less"),
        pytest.param(left(20.0, 11.0, FRICTION, squares=1.50), "coulomb_friction", id="not on held-out runs"),
        pytest.param(left(24.1, 24.1, FRICTION, squares=1.01), "stribeck_friction", id="surely"),
        pytest.param(left(99.0, 23.9, FRICTION, squares=1.01), "coulomb_friction", id="surely where fitted"),
        pytest.param(
            left(20.0, 20.0, FRICTION, squares=1.0, in_fitted_run=2.98), "stribeck_friction", id="in a fitted run"
        ),
        pytest.param(
            left(20.0, 20.0, FRICTION, squares=1.0, in_fitted_run=2.94), "coulomb_friction", id="by less there"
        ),
    ],
)
def test_friction_of_three_numbers_is_named_where_it_is_better_by_more(friction: Explanation, named: str) -> None:
    """By more than chance on both kinds of runs and by what is worth a word, or surely; else the special case."""
    verdict = judged(BASELINE, [friction, left(0.0, 0.0, STRIBECK)])
    assert (verdict.kind, names(verdict)) == ("named", [(named,)])


@pytest.mark.parametrize(
    ("friction", "kind"),
    [
        pytest.param(left(40.0, 40.0, FRICTION, squares=1.5), "unknown", id="clearly better"),
        pytest.param(left(40.0, 40.0, FRICTION, squares=1.2), "named", id="by too little to speak of"),
        pytest.param(left(40.0, 40.0, FRICTION, in_one_run=1.50), "unknown", id="clearly in one run"),
        pytest.param(left(40.0, 40.0, FRICTION, in_one_run=1.48), "named", id="in one run by too little"),
        pytest.param(left(40.0, 40.0, FRICTION, in_fitted_run=3.0), "unknown", id="clearly in a fitted run"),
        pytest.param(left(40.0, 40.0, FRICTION, in_fitted_run=2.9), "named", id="in a fitted run by too little"),
        pytest.param(left(11.0, 40.0, FRICTION, squares=1.5), "named", id="on held-out runs alone"),
        pytest.param(left(40.0, 11.0, FRICTION, squares=1.5), "named", id="on fitted runs alone"),
        pytest.param(left(5.0, 5.0, FRICTION, rms=1.14), "named", id="within fifteen per cent"),
        pytest.param(left(5.0, 5.0, FRICTION, rms=1.16), "unknown", id="not adequate"),
        pytest.param(left(5.0, 489.0, FRICTION), "unknown", id="without a gain of its own"),
    ],
)
def test_a_nameless_description_that_is_clearly_better_leaves_the_name_unknown(
    friction: Explanation, kind: str
) -> None:
    verdict = judged(BASELINE, [friction], [ANY_FORCE])
    assert verdict.kind == kind
    if kind == "unknown":
        assert verdict.alternatives == []
        assert verdict.best is friction
        assert verdict.probabilities["unknown"] > 0.5


@pytest.mark.parametrize(
    ("left_by_force", "left_by_name", "kind"), [(0.8, 1.14, "named"), (0.8, 1.16, "unknown"), (1.1, 1.25, "named")]
)
def test_what_leaves_no_more_than_the_noise_floor_is_adequate(
    left_by_force: float, left_by_name: float, kind: str
) -> None:
    """However little a freer description leaves, and beside one that leaves more."""
    force = left(0.0, 0.0, squares=1.0, rms=left_by_force, surface="structure")
    assert judged(BASELINE, [left(5.0, 5.0, FRICTION, rms=left_by_name)], [force]).kind == kind


@pytest.mark.parametrize(
    ("repeats", "rms", "more"),
    [
        pytest.param(True, 1.26, True, id="more than repeats differ by"),
        pytest.param(True, 1.24, False, id="as repeats differ"),
        pytest.param(False, 1.9, False, id="without repeats the noise is a guess"),
    ],
)
def test_what_leaves_more_than_repeats_differ_by_is_unknown(repeats: bool, rms: float, more: bool) -> None:
    """With a name and without: a name that is as good as any, and a baseline on which nothing gains."""
    named = judged(BASELINE, [left(0.0, 0.0, FRICTION, rms=rms)], repeats=repeats)
    assert named.kind == ("unknown" if more else "named")
    assert named.adequacy == 1.0
    nothing = judged(left(0.0, 0.0, rms=rms), [left(0.0, 0.0, FRICTION)], repeats=repeats)
    assert nothing.kind == ("unknown" if more else "nothing_missing")


@pytest.mark.parametrize(
    ("in_common", "left_in_common", "kind"),
    [
        pytest.param(0.49, 0.0, "nothing_missing", id="neither shared nor large"),
        pytest.param(0.51, 0.0, "named", id="takes away what repeats share"),
        pytest.param(0.9, 0.51, "unknown", id="leaves what repeats share"),
    ],
)
def test_what_repeats_share_is_something_however_small(in_common: float, left_in_common: float, kind: str) -> None:
    """A gain beyond chance without a size worth a word."""
    baseline = left(500.0, 500.0, squares=1.4, repeatable={("run_2", TIP): in_common})
    friction = left(0.0, 0.0, FRICTION, squares=1.0, repeatable={("run_2", TIP): left_in_common})
    assert judged(baseline, [friction], repeats=True).kind == kind


@pytest.mark.parametrize(
    ("before", "after", "squares", "kind"),
    [
        pytest.param(1.9, 1.6, 1.0, "nothing_missing", id="little left, little removed"),
        pytest.param(2.1, 1.9, 1.0, "named", id="made complete"),
        pytest.param(2.3, 2.1, 1.0, "unknown", id="much left, little removed"),
        pytest.param(2.3, 2.1, 4.0, "named", id="much left, much removed"),
    ],
)
def test_without_repeats_a_small_name_must_make_it_complete(
    before: float, after: float, squares: float, kind: str
) -> None:
    baseline = left(500.0, 500.0, squares=1.4 * squares, rms=before)
    assert judged(baseline, [left(0.0, 0.0, FRICTION, squares=1.0, rms=after)]).kind == kind


@pytest.mark.parametrize(("rms", "kind"), [(1.9, "nothing_missing"), (2.1, "unknown")])
def test_without_repeats_twice_the_noise_is_not_nothing_and_a_name_may_leave_it(rms: float, kind: str) -> None:
    assert judged(left(0.0, 0.0, rms=rms), [left(0.0, 0.0, FRICTION)]).kind == kind
    assert judged(BASELINE, [left(0.0, 0.0, FRICTION, rms=rms)]).kind == "named"


@pytest.mark.parametrize(
    ("repeatable", "more"),
    [
        pytest.param({("run_2", TIP): 0.49}, False, id="noise of the held-out test"),
        pytest.param({("run_2", TIP): 0.51}, True, id="common to its repeats"),
        pytest.param({("run_1", TIP): 0.51}, True, id="common to repeats of a fitted test"),
        pytest.param({("run_1", TIP): 1.48, ("run_1", "force"): -0.5}, False, id="in one channel of two"),
        pytest.param({("run_1", TIP): 1.52, ("run_1", "force"): -0.54}, True, id="much in one channel of two"),
        pytest.param({("run_1", TIP): 0.9, ("run_2", TIP): 0.0, ("run_2", "force"): 0.0}, True, id="by test"),
    ],
)
@pytest.mark.parametrize("rms", [1.0, 1.45])
def test_what_repeats_share_of_a_remainder_is_missing_and_nothing_else(
    repeatable: dict[tuple[str, str], float], more: bool, rms: float
) -> None:
    """A sensor that stands in for a quieter one leaves more noise; physics is missing alike each time."""
    if not any(test == "run_2" for test, _ in repeatable):
        repeatable = {**repeatable, ("run_2", TIP): 0.0}
    loud = left(0.0, 0.0, FRICTION, rms=rms, repeatable=repeatable)
    assert judged(BASELINE, [loud], repeats=True).kind == ("unknown" if more else "named")
    quiet = left(0.0, 0.0, rms=rms, repeatable=repeatable)
    assert judged(quiet, [], repeats=True).kind == ("unknown" if more else "nothing_missing")


@pytest.mark.parametrize(
    ("single_rms", "pair_rms", "gain", "baseline_rms", "named"),
    [
        pytest.param(
            1.16, 1.14, 30.0, 2.0, ("coulomb_friction", "mains_hum"), id="two reach the ceiling, one not"
        ),
        pytest.param(1.14, 1.0, 30.0, 2.0, ("coulomb_friction",), id="one reaches it"),
        pytest.param(1.16, 1.14, 11.0, 2.0, (), id="two gain no more than chance"),
        pytest.param(1.2, 1.16, 30.0, 2.0, (), id="neither reaches it"),
        pytest.param(1.16, 1.14, 30.0, 1.6, (), id="two explain less than half"),
    ],
)
def test_two_effects_are_named_where_one_does_not_reach_the_ceiling(
    single_rms: float, pair_rms: float, gain: float, baseline_rms: float, named: tuple[str, ...]
) -> None:
    """The second effect removes too little to be clear by itself."""
    single = left(20.0 + gain, 20.0 + gain, FRICTION, squares=1.1, rms=single_rms)
    both = left(20.0, 20.0, {**FRICTION, **HUM}, rms=pair_rms)
    baseline = replace(BASELINE, held_out_rms=baseline_rms)
    verdict = judged(baseline, [single, both], [left(19.0, 19.0, surface="structure")])
    assert (verdict.best.names if verdict.best and verdict.kind == "named" else ()) == named


@pytest.mark.parametrize(
    ("left_by_pair", "gain", "in_fitted_run", "baseline_rms", "named"),
    [
        pytest.param(0.0, 200.0, 3.0, 2.0, ("coulomb_friction", "mains_hum"), id="what one leaves, two explain"),
        pytest.param(0.6, 200.0, 3.0, 2.0, (), id="two leave as much"),
        pytest.param(0.0, 11.0, 3.0, 2.0, (), id="two gain no more than chance"),
        pytest.param(0.0, 200.0, 2.9, 2.0, (), id="the second removes nothing worth a word"),
        pytest.param(0.0, 200.0, 3.0, 1.5, (), id="two explain less than half"),
    ],
)
def test_two_effects_are_named_where_one_does_not_pass_the_gates(
    left_by_pair: float, gain: float, in_fitted_run: float, baseline_rms: float, named: tuple[str, ...]
) -> None:
    """One is as good on held-out runs as any force, but leaves what repeats have in common."""
    in_common = {("run_1", TIP): 0.6}
    single = left(gain, gain, FRICTION, squares=1.2, in_fitted_run=in_fitted_run, rms=1.14, repeatable=in_common)
    both = left(0.0, 0.0, {**FRICTION, **HUM}, rms=1.1, repeatable={("run_1", TIP): left_by_pair})
    baseline = replace(BASELINE, held_out_rms=baseline_rms)
    verdict = judged(baseline, [single, both], repeats=True)
    assert (verdict.best.names if verdict.best and verdict.kind == "named" else ()) == named


@pytest.mark.parametrize(("in_common", "kind"), [(0.24, "named"), (0.26, "unknown")])
def test_what_the_best_description_adds_must_be_left_to_repeats_alike(in_common: float, kind: str) -> None:
    """A fifth more error than the best description leaves, which only one run of two happened to have."""
    friction = left(20.0, 20.0, FRICTION, squares=1.1, rms=1.2, repeatable={("run_2", TIP): in_common})
    assert judged(BASELINE, [friction], [left(19.0, 19.0, surface="structure")], repeats=True).kind == kind


@pytest.mark.parametrize(
    ("repeatable", "kind"),
    [
        ({("run_2", TIP): 0.24}, "named"),
        ({("run_2", TIP): 0.26}, "unknown"),
        ({("run_1", TIP): 0.0}, "unknown"),
        ({}, "unknown"),
    ],
)
def test_what_any_force_adds_to_a_name_must_be_left_to_repeats_alike(
    repeatable: dict[tuple[str, str], float], kind: str
) -> None:
    friction = left(40.0, 40.0, FRICTION, squares=2.0, repeatable=repeatable)
    assert judged(BASELINE, [friction], [ANY_FORCE]).kind == kind


def test_a_pair_that_has_its_gain_from_one_effect_and_its_size_from_the_other_shows_nothing() -> None:
    """The gain of a small leak that is everywhere, the size of a drift in one run that gains nothing elsewhere."""
    gaining = left(450.0, 470.0, HUM, squares=10.0)
    large = left(470.0, 499.0, OFFSET, squares=10.0, in_one_run=2.0)
    both = left(420.0, 450.0, {**HUM, **OFFSET}, squares=10.0, in_one_run=2.0)
    assert judged(BASELINE, [gaining, large, both]).kind == "nothing_missing"
    assert judged(BASELINE, [gaining, both]).kind != "nothing_missing"


def test_of_each_run_counts_what_the_best_fit_of_the_same_effects_leaves() -> None:
    """Friction makes local minima: one fit suits one run, one another."""
    first = left(0.0, 0.0, FRICTION, squares=1.0, in_one_run=2.0)
    second = left(30.0, 30.0, FRICTION, squares=1.0, in_fitted_run=3.0, in_one_run=1.0)
    more = left(-40.0, -40.0, {**FRICTION, **OFFSET}, squares=1.0, in_one_run=1.0)
    found = judged(BASELINE, [first, second, more])
    assert (found.kind, found.best) == ("named", first)
    assert judged(BASELINE, [first, more]).kind == "unknown"
    ceiling = left(-40.0, -40.0, surface="structure")
    assert judged(BASELINE, [first, second], [ceiling]).kind == "named"
    assert judged(BASELINE, [first], [ceiling]).kind == "unknown"


def test_what_has_no_name_at_all_is_unknown_in_the_block_that_a_force_helps() -> None:
    found = findings(BASELINE, [], [ANY_FORCE, left(-5.0, -5.0, surface="tank")])
    verdict = verdict_of(found)
    assert (verdict.kind, verdict.best) == ("unknown", None)
    assert "most likely in the tank" in verdict.statement
    [told] = verdict_facts(found, verdict)["effects"]
    assert (told["name"], told["block"], told["parameters"]) == ("unknown", "tank", {})
    placed = with_place(found, verdict, "seen below 2 g", "structure")
    assert (
        placed.statement
        == "Something is missing that has no name here, most likely in the structure; seen below 2 g."
    )
    assert verdict_facts(found, placed)["effects"][0]["block"] == "structure"


@pytest.mark.parametrize(
    ("ratio", "names_"), [(0.2, [("quadratic_drag",)]), (0.19, [("missing_mode",)])], ids=["at a bound", "inside"]
)
def test_a_number_at_its_bound_is_no_name(ratio: float, names_: list[tuple[str, ...]]) -> None:
    """A mode that is damped as much as a mode may be is none."""
    mode = {f"structure.missing_mode.{name}": value for name, value in
            (("frequency_hz", 9.0), ("damping_ratio", ratio), ("participation", 0.1))}  # fmt: skip
    verdict = judged(BASELINE, [left(0.0, 0.0, mode), left(10.0, 10.0, DRAG)])
    assert names(verdict) == names_


@pytest.mark.parametrize(
    ("exponent", "gap_m", "rests"),
    [
        pytest.param(1.0, 0.01, False, id="least exponent"),
        pytest.param(3.0, 0.01, False, id="largest exponent"),
        pytest.param(2.0, 1.0, True, id="largest gap"),
    ],
)
def test_an_exponent_may_rest_at_its_bound_and_a_gap_may_not(exponent: float, gap_m: float, rests: bool) -> None:
    loop = {"stiffness_n_per_m": 100.0, "beta_gamma": 80.0, "beta_delta": 40.0, "exponent": exponent}
    stop = {"gap_m": gap_m, "stiffness_n_per_m": 500.0}
    numbers = {f"structure.hysteresis.{name}": size for name, size in loop.items()}
    numbers |= {f"structure.clearance.{name}": size for name, size in stop.items()}
    assert left(0.0, 0.0, numbers).has_effect_at_bound == rests


def test_a_bound_of_zero_is_a_size_like_others() -> None:
    assert not left(0.0, 0.0, {"structure.viscous_damping.damping_n_s_per_m": 0.0}).has_effect_at_bound
    assert left(0.0, 0.0, {"structure.viscous_damping.damping_n_s_per_m": 1e4}).has_effect_at_bound


@pytest.mark.parametrize(
    ("friction", "named"),
    [
        pytest.param(left(13.0, 13.0, FRICTION, squares=1.5), 2, id="better"),
        pytest.param(left(11.0, 13.0, FRICTION, squares=1.5), 1, id="not on fitted runs"),
        pytest.param(left(13.0, 11.0, FRICTION, squares=1.5), 1, id="not on held-out runs"),
        pytest.param(left(13.0, 13.0, FRICTION, squares=1.2), 1, id="too little to speak of"),
    ],
)
def test_two_effects_are_named_where_the_second_is_worth_it(friction: Explanation, named: int) -> None:
    verdict = judged(BASELINE, [friction, left(0.0, 0.0, {**FRICTION, **HUM})])
    assert verdict.best is not None
    assert len(verdict.best.keys) == named


def test_an_explanation_that_does_not_run_on_held_out_runs_is_none() -> None:
    broken = Explanation(left(0.0, 0.0, DRAG).fit, np.inf, np.inf)
    verdict = judged(BASELINE, [broken, left(1.0, 1.0, FRICTION)])
    assert names(verdict) == [("coulomb_friction",)]
    assert "quadratic_drag" not in verdict.probabilities


def test_no_form_of_an_effect_hides_why_another_could_not_be_fitted() -> None:
    reasons = {"tank.effective_mass": "does not run", "tank.fading_mass": "ends early"}
    found = findings(BASELINE, [left(0.0, 0.0, FRICTION)], failed=reasons)
    assert verdict_facts(found, verdict_of(found))["failed"] == {"tank.effective_mass": "does not run; ends early"}


def test_two_lines_of_the_mains_are_one_name_for_programs() -> None:
    """Whatever the verdict: what is tried at 50 and at 60 Hz is called mains_hum in every place."""
    cell = "sensor.mains_hum_60.force_interface"
    for ceilings, kind in (([], "named"), ([left(-500.0, -500.0, surface="structure", squares=0.1)], "unknown")):
        baseline = left(500.0, 500.0, rms=2.0)
        found = findings(baseline, [left(0.0, 0.0, HUM, squares=1.5)], ceilings, {cell: "does not run"})
        verdict = verdict_of(found)
        assert verdict.kind == kind
        examination = Examination(None, {}, (), [], {"channels": ["acceleration_tip"]})
        facts = {**verdict_facts(found, verdict), **examination_facts(examination, found)}
        assert "mains_hum_60" not in json.dumps(facts)
        assert facts["failed"] == {"sensor.mains_hum.force_interface": "does not run"}
        assert "mains hum of acceleration_tip" in facts["statement"]
        assert max(facts["probabilities"], key=facts["probabilities"].get) in ("mains_hum", "unknown")


def test_probabilities_sum_to_one_and_follow_the_held_out_runs() -> None:
    """Half by what was decided, two as good as each other; of the rest, ratios are those of likelihoods."""
    verdict = judged(BASELINE, [left(0.0, 0.0, FRICTION), left(0.0, 2.0, DRAG)], [left(0.0, -5.0, surface="tank")])
    shares = verdict.probabilities
    assert sum(shares.values()) == pytest.approx(1.0, abs=1e-3)
    friction, drag = (shares[name] - 0.25 for name in ("coulomb_friction", "quadratic_drag"))
    assert friction / drag == pytest.approx(np.exp(2.0))
    assert friction / shares["unknown"] == pytest.approx(np.exp(2 * PER_NUMBER - 5.0))


def test_any_force_beside_a_name_makes_the_name_no_less_probable() -> None:
    """The numbers of what has a name count on both sides."""
    known = left(110, 110, STRIBECK)
    verdict = judged(left(2000, 2000), [known], [left(109, 107, STRIBECK, surface="structure")])
    assert verdict.kind == "named"
    assert verdict.probabilities["stribeck_friction"] > 0.9
