"""Which explanations are listed beside the best one, from findings whose costs were written by hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import pytest
from hand_made_findings import (
    AT,
    AT_ONE_FREQUENCY,
    BASELINE,
    BOTH_SIDES,
    DRAG,
    FRICTION,
    HUM,
    STRIBECK,
    findings,
    judged,
    left,
    names,
)

from sloshlab.diagnosis.candidate import Surroundings
from sloshlab.diagnosis.verdict import verdict_facts, verdict_of


def test_a_wider_effect_does_not_make_a_narrower_one_doubtful_but_a_stranger_does() -> None:
    """Within six of the best after what its numbers cost: Stribeck's is friction too, drag is not."""
    nearly = [left(0.0, 0.0, STRIBECK), left(4.0, 4.0, FRICTION)]
    assert names(judged(BASELINE, nearly)) == [("coulomb_friction",)]
    verdict = judged(BASELINE, [*nearly, left(6.0, 6.0, DRAG)])
    assert verdict.kind == "indistinguishable"
    assert names(verdict) == [("coulomb_friction",), ("quadratic_drag",)]
    assert "decays or sweeps at two or more amplitudes" in verdict.separating_experiment
    assert "cannot be told from quadratic drag" in verdict.statement


DRIVEN = replace(AT, driving=("acceleration_root",))


STIFFER = {"structure.stiffness_change.stiffness_n_per_m": -90.0}


@pytest.mark.parametrize(("behind", "kind"), [(2.9, "indistinguishable"), (3.1, "named")])
def test_another_explanation_is_as_good_within_six(behind: float, kind: str) -> None:
    assert judged(BASELINE, [left(0.0, 0.0, FRICTION), left(behind, behind, DRAG)]).kind == kind


@pytest.mark.parametrize(
    ("squares", "numbers", "at", "kind"),
    [
        pytest.param(1.12, DRAG, DRIVEN, "indistinguishable", id="within scatter"),
        pytest.param(1.13, DRAG, DRIVEN, "named", id="beyond it"),
        pytest.param(1.12, {**STIFFER, **FRICTION}, DRIVEN, "named", id="more effects"),
        pytest.param(1.12, DRAG, AT, "named", id="without a drive"),
    ],
)
def test_what_leaves_no_more_than_scatter_is_as_good(
    squares: float, numbers: dict[str, float], at: Surroundings, kind: str
) -> None:
    """√(1.1225 − 1) is half of what is worth a word; channels that share a noise are surer than they may be."""
    other = left(20.0, 20.0, numbers, squares=squares)
    assert judged(BASELINE, [left(0.0, 0.0, FRICTION), other], at=at).kind == kind


@pytest.mark.parametrize(
    ("behind", "kind"), [(23.9, "indistinguishable"), (24.1, "named")], ids=["may be one noise", "is more"]
)
def test_what_is_worse_in_one_noise_of_all_channels_is_not(behind: float, kind: str) -> None:
    """Twice what chance gives, on both kinds of runs, were all channels one."""
    other = left(behind, behind, DRAG, squares=1.1)
    assert judged(BASELINE, [left(0.0, 0.0, FRICTION), other], at=DRIVEN).kind == kind
    best, twice = (
        replace(explanation, by_run={**explanation.by_run, ("run_1", "another"): 1.0})
        for explanation in (left(0.0, 0.0, FRICTION), left(2 * behind, 2 * behind, DRAG, squares=1.1))
    )
    assert judged(BASELINE, [best, twice], at=DRIVEN).kind == kind


def test_one_effect_within_scatter_of_two_is_no_alternative() -> None:
    """That two are needed was found before."""
    single = left(50.0, 50.0, FRICTION, squares=1.1, rms=1.16)
    both = left(20.0, 20.0, {**FRICTION, **HUM}, rms=1.0)
    verdict = judged(replace(BASELINE, held_out_rms=2.0), [single, both], at=DRIVEN)
    assert names(verdict) == [("coulomb_friction", "mains_hum")]


LIGHTER = {"structure.mass_error.mass_kg": 0.05}


@pytest.mark.parametrize(
    ("at", "other", "in_one_run", "kind"),
    [
        pytest.param(AT_ONE_FREQUENCY, LIGHTER, 1.9, "indistinguishable", id="look-alikes"),
        pytest.param(AT_ONE_FREQUENCY, LIGHTER, 2.1, "named", id="told by more than the noise in one run"),
        pytest.param(AT_ONE_FREQUENCY, DRAG, 1.0, "named", id="strangers"),
        pytest.param(replace(AT_ONE_FREQUENCY, n_modes=2), LIGHTER, 1.9, "named", id="told by another mode"),
        pytest.param(AT, LIGHTER, 1.0, "named", id="several frequencies"),
    ],
)
def test_beginnings_and_ends_do_not_separate_look_alikes_of_one_frequency(
    at: Surroundings, other: Mapping[str, float], in_one_run: float, kind: str
) -> None:
    """Fifty units of likelihood between a mass and a spring, but less than the noise anywhere."""
    other_one = left(50.0, 50.0, other, in_one_run=in_one_run)
    verdict = verdict_of(findings(BASELINE, [left(0.0, 0.0, STIFFER), other_one], at=at))
    assert verdict.kind == kind
    if kind == "indistinguishable":
        assert names(verdict) == [("stiffness_change",), ("mass_error",)]
        assert verdict.separating_experiment == "a known mass added to the tank"


@pytest.mark.parametrize(("in_one_run", "kind"), [(5.8, "indistinguishable"), (6.1, "named")])
def test_nor_does_a_twentieth_of_what_they_explain(in_one_run: float, kind: str) -> None:
    """101 noise floors before, one after: another that leaves less than 1 + 0.05 × 100 is as good."""
    baseline = left(500.0, 500.0, squares=101.0)
    described = [left(0.0, 0.0, STIFFER), left(50.0, 50.0, LIGHTER, in_one_run=in_one_run)]
    assert verdict_of(findings(baseline, described, at=AT_ONE_FREQUENCY)).kind == kind


@pytest.mark.parametrize(("squares", "kind"), [(1.4, "indistinguishable"), (1.6, "named")])
def test_a_nested_model_that_is_clearly_worse_is_no_rival_at_one_frequency(squares: float, kind: str) -> None:
    """A mode that is missing moves by itself, whichever block the mass is in that would stand in for it."""
    mode = {
        "structure.missing_mode.frequency_hz": 9.0,
        "structure.missing_mode.damping_ratio": 0.02,
        "structure.missing_mode.participation": 0.1,
    }
    described = [left(0.0, 0.0, mode), left(50.0, 50.0, {"tank.mass_error.mass_kg": -0.1}, squares=squares)]
    assert verdict_of(findings(BASELINE, described, at=AT_ONE_FREQUENCY)).kind == kind


@pytest.mark.parametrize(("squares", "kind"), [(1.4, "indistinguishable"), (1.6, "named")])
def test_nor_is_a_nesting_model_that_is_clearly_worse(squares: float, kind: str) -> None:
    """Friction that is made to differ by direction, at one amplitude of one frequency."""
    described = [left(0.0, 0.0, FRICTION), left(50.0, 50.0, BOTH_SIDES, squares=squares)]
    assert verdict_of(findings(BASELINE, described, at=AT_ONE_FREQUENCY)).kind == kind


def test_one_name_in_two_blocks_is_two_explanations() -> None:
    damper = [{f"{block}.viscous_damping.damping_n_s_per_m": 0.6} for block in ("structure", "tank")]
    found = findings(BASELINE, [left(0.0, 0.0, damper[0]), left(1.0, 1.0, damper[1])])
    verdict = verdict_of(found)
    assert verdict.kind == "indistinguishable"
    assert [alternative.names_with_blocks for alternative in verdict.alternatives] == [
        ("structure.viscous_damping",),
        ("tank.viscous_damping",),
    ]
    assert verdict_facts(found, verdict)["alternatives"] == [["viscous_damping"]]


def test_the_same_effect_on_another_channel_is_no_other_explanation() -> None:
    gains = [{f"sensor.sensor_gain.{name}.ratio": -0.06} for name in ("acceleration_tip", "force_interface")]
    verdict = judged(BASELINE, [left(0.0, 0.0, gains[0]), left(1.0, 1.0, gains[1])])
    assert (verdict.kind, len(verdict.alternatives)) == ("named", 1)


def test_the_same_force_under_another_name_is_always_listed() -> None:
    found = findings(BASELINE, [left(0.0, 0.0, BOTH_SIDES), left(300.0, 300.0, FRICTION, squares=1.5)])
    verdict = verdict_of(found)
    assert verdict.kind == "indistinguishable"
    assert verdict_facts(found, verdict)["alternatives"] == [
        ["asymmetric_friction"],
        ["constant_force", "coulomb_friction"],
    ]


@pytest.mark.parametrize(
    ("up", "down", "listed"),
    [
        pytest.param(0.55, 0.2, True, id="more upward"),
        pytest.param(0.2, 0.55, True, id="more downward"),
        pytest.param(0.48, 0.2, False, id="not clearly more than 0.37 upward"),
        pytest.param(0.55, 0.26, False, id="not clearly less than 0.37 downward"),
        pytest.param(0.38, 0.36, False, id="nearly the special case"),
    ],
)
def test_friction_of_two_directions_is_a_rival_where_it_clearly_has_two(
    up: float, down: float, listed: bool
) -> None:
    """As good as friction without a direction, from which less than twice as much one way does not differ."""
    numbers = {f"structure.asymmetric_friction.force_{way}_n": size for way, size in (("up", up), ("down", down))}
    found = findings(BASELINE, [left(0.0, 0.0, FRICTION), left(0.0, 0.0, numbers)])
    verdict = verdict_of(found)
    assert verdict.kind == ("indistinguishable" if listed else "named")
    rivals = [["asymmetric_friction"], ["constant_force", "coulomb_friction"]] if listed else []
    assert verdict_facts(found, verdict)["alternatives"] == [["coulomb_friction"], *rivals]


@pytest.mark.parametrize(
    ("squares", "listed"), [(1.12, True), (1.13, False)], ids=["by little", "by half of what is worth a word"]
)
def test_a_rival_of_two_directions_is_given_up_where_friction_of_one_is_clearly_better(
    squares: float, listed: bool
) -> None:
    rival = left(40.0, 40.0, BOTH_SIDES, squares=squares)
    verdict = judged(BASELINE, [left(0.0, 0.0, FRICTION), rival])
    assert (("asymmetric_friction",) in names(verdict)) == listed


def test_an_alternative_explains_something_itself() -> None:
    """At one frequency look-alikes may differ by less than the noise floor where both are as small."""
    baseline = left(60.0, 60.0, squares=1.5)
    stiffer = left(0.0, 0.0, STIFFER, squares=1.0)
    idle = left(59.0, 59.0, LIGHTER, squares=1.49)
    nearly = left(20.0, 25.0, LIGHTER, squares=1.1)
    assert names(judged(baseline, [stiffer, idle], at=AT_ONE_FREQUENCY)) == [("stiffness_change",)]
    assert ("mass_error",) in names(judged(baseline, [stiffer, nearly], at=AT_ONE_FREQUENCY))


@pytest.mark.parametrize(
    ("fade_g", "listed"), [(17.0, True), (16.0, False)], ids=["never", "at five times the level"]
)
def test_an_effective_mass_that_never_fades_is_a_mass(fade_g: float, listed: bool) -> None:
    """The tank moves with 32 m/s², 3.26 g."""
    fading = {
        "tank.fading_mass.beta": -0.7,
        "tank.fading_mass.fade_g": fade_g,
        "tank.fading_mass.averaging_s": 1.0,
    }
    verdict = judged(BASELINE, [left(0.0, 0.0, fading)])
    assert verdict.kind == ("indistinguishable" if listed else "named")
    assert ("cannot be told from mass error" in verdict.statement) == listed
