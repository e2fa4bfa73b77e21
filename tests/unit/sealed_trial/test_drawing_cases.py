"""Cases tell nothing of what they hide but by their signals."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sealed_trial import case_drawing
from sealed_trial.case_drawing import CaseDrawing, _motion, _scaled, class_order
from sealed_trial.composition import SINGLES, class_sizes, possible
from sealed_trial.hidden_physics.effect import Change, DrawnEffect, Scales
from sealed_trial.hidden_physics.sensor_effects import cross_talk, gain
from sealed_trial.hidden_physics.structure_effects import asymmetric
from sealed_trial.hidden_physics.unknown_physics import UNKNOWN_PHYSICS
from sealed_trial.laboratory.hidden_rig import drawn_rig, rig_text, wrongly_believed
from sealed_trial.laboratory.recorder import drawn_recorder
from sealed_trial.laboratory.recording_file import run_attributes
from sealed_trial.laboratory.test_plan import PLANS, drawn_plan
from sealed_trial.look_alikes import possible_look_alikes
from sealed_trial.scoring.rivals import commonest, metadata_classifier
from sealed_trial.strength import magnitude_for

VOCABULARY = {
    "viscous_damping", "coulomb_friction", "asymmetric_friction", "stribeck_friction", "quadratic_drag",
    "structural_damping", "hysteresis", "cubic_stiffness", "quadratic_stiffness", "clearance",
    "missing_mode", "mass_error", "constant_force", "liquid_sloshing", "effective_mass", "ceiling_impact",
    "breakup_delay", "high_g_saturation", "faraday_wave", "lateral_mode", "liquid_loss", "air_cushion",
    "base_rocking", "sensor_gain", "sensor_delay", "sensor_high_pass", "sensor_clipping", "sensor_drift",
    "mains_hum", "clock_skew", "cross_talk", "sample_and_hold", "actuator_saturation", "external_force",
    "friction_behind_play",
}  # fmt: skip


def metadata(number: int) -> dict[str, float]:
    """Numbers of rig file and attributes of a case of a number, drawn as a trial draws them."""
    generator = np.random.default_rng([7, number, 2, 0])
    name = PLANS[int(np.random.default_rng([7, number]).integers(len(PLANS)))]
    rig = drawn_rig(name.partition("_")[0], generator)
    plan = drawn_plan(name, rig, generator)
    features = {name: 1.0}
    for line in rig_text(rig).splitlines():
        key, _, value = line.partition(" = ")
        if value.replace(".", "").isdigit():
            features[key] = float(value)
    for k, run in enumerate(plan.runs):
        for key, value in run_attributes(k, run, plan).items():
            features[f"{k} {key}" if not isinstance(value, str) else f"{k} {key} = {value}"] = (
                1.0 if isinstance(value, str) else float(value)
            )
    return features


def test_a_classifier_on_metadata_alone_scores_at_chance() -> None:
    classes = class_order(180, np.random.default_rng([7, 0]))
    rival = metadata_classifier([metadata(number) for number in range(180)], classes)
    assert rival.low < commonest(classes).value


def test_every_effect_of_the_vocabulary_can_be_hidden() -> None:
    generator = np.random.default_rng(1)
    found = set()
    for name in PLANS:
        for _ in range(6):
            rig = drawn_rig(name.partition("_")[0], generator)
            plan = drawn_plan(name, rig, generator)
            found |= {effect.name for effect in possible(SINGLES, plan, rig)}
            looks = possible_look_alikes(plan, rig)
            found |= {look.truth.name for look in looks}
            assert looks
            assert len({effect.block for effect in possible(SINGLES, plan, rig)}) > 1
            assert possible(UNKNOWN_PHYSICS, plan, rig)
            for look in looks:
                assert (look.truth.name,) in look.equals
    assert found == VOCABULARY


@pytest.mark.parametrize("n", [6, 24, 60, 61, 100])
def test_classes_are_in_proportion(n: int) -> None:
    sizes = class_sizes(n)
    assert sum(sizes.values()) == n
    for name, size in class_sizes(240).items():
        assert abs(sizes[name] - size * n / 240) < 1


def test_the_class_of_a_case_changes_neither_rig_nor_plan_nor_sensors() -> None:
    cases = {}
    for kind in ("nothing", "retunable", "single", "outside"):
        drawing = CaseDrawing([11, 12])
        drawing._plans = ["shaker_one_frequency"]
        cases[kind] = drawing.case(0, "case_001", kind)
    plain = cases["nothing"]
    for other in (cases["single"], cases["outside"]):
        assert other.laboratory == plain.laboratory
        assert other.sensors == plain.sensors
    wrong = cases["retunable"]
    assert wrong.truth.accepted == [[]]
    assert wrong.truth.effects == []
    assert wrong.sensors == plain.sensors
    # what the laboratory believes, does and records is the same
    assert replace(wrong.laboratory, rig=plain.laboratory.rig) == plain.laboratory
    assert replace(wrong.laboratory.rig, factors=plain.laboratory.rig.factors) == plain.laboratory.rig
    assert cases["single"].truth.accepted == [[cases["single"].truth.effects[0]["name"]]]
    assert cases["outside"].truth.accepted == [["unknown"]]
    assert cases["single"].truth.effects[0]["strength"] >= 3.0
    for other in (cases["single"], cases["outside"]):
        changed = [
            not np.array_equal(ours[name], theirs[name])
            for ours, theirs in zip(other.signals, plain.signals, strict=True)
            for name in ours
        ]
        assert any(changed) or other.late


def test_where_nothing_of_a_class_fits_a_plan_another_plan_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    drawing, tried = CaseDrawing([11, 12]), []

    def fits_one_frequency_only(number: int, attempt: int, name: str, kind: str, plan: str) -> str:
        tried.append(plan)
        if plan != "shaker_one_frequency":
            raise LookupError(plan)
        return plan

    monkeypatch.setattr(drawing, "_attempted", fits_one_frequency_only)
    drawing._plans = ["beam_decays"]
    assert drawing.case(0, "case_001", "single") == "shaker_one_frequency"
    assert tried[0] == "beam_decays"
    monkeypatch.setattr(drawing, "_attempted", lambda *told: (_ for _ in ()).throw(LookupError()))
    with pytest.raises(ArithmeticError, match="no draw of class single"):
        drawing.case(1, "case_002", "single")


def test_effects_that_cannot_be_as_strong_as_wanted_come_last_in_the_same_case() -> None:
    effects = [SimpleNamespace(name=name, block=name) for name in ("a", "b", "c")]
    drawing = CaseDrawing([1])
    drawing._failed["a"] += 1
    drawing._used.update({"b": 1, "c": 2})
    first = [drawing._chosen(effects, 1, np.random.default_rng(k))[0].name for k in range(5)]  # type: ignore[arg-type]
    assert first == ["b"] * 5


def scales() -> Scales:
    channels = (
        "acceleration_control",
        "acceleration_roof_1",
        "acceleration_root",
        "force_cell_1",
        "force_interface",
    )
    return Scales(0.01, 0.5, 3.0, 900.0, 1.2, 30.0, 0.2, 0.02, 0.0, dict.fromkeys(channels, 1.0), {})


def test_a_gain_is_never_that_of_a_force_which_a_mass_would_change_alike() -> None:
    drawn = {gain(scales(), np.random.default_rng(k)).channel for k in range(60)}
    assert drawn == {"acceleration_control", "acceleration_roof_1"}


@pytest.mark.parametrize("moving_g", [0.0, 0.02, 1.0, 30.0])
def test_no_more_leaks_from_one_accelerometer_to_another_than_cables_let(moving_g: float) -> None:
    """A fifth of a reading, or a tenth of the source into a base at rest."""
    rms = {"acceleration_root": moving_g, "acceleration_tip": 1.0}
    signals = {name: np.full(4, value) for name, value in rms.items()}
    for seed in range(12):
        drawn = cross_talk(replace(scales(), rms=rms), np.random.default_rng(seed))
        change = drawn.change(drawn.most)
        assert change.distortion is not None
        leaked = float(abs(change.distortion(signals, 500.0, 0)[drawn.channel] - signals[drawn.channel]).max())
        own, rests = rms[drawn.channel], drawn.channel == "acceleration_root"
        assert leaked <= max(0.2 * own, 0.1 if rests else 0.0) * (1 + 1e-9)
        assert leaked > 0.0


def test_what_makes_friction_asymmetric_is_half_of_what_it_differs_by() -> None:
    effect = asymmetric(scales(), np.random.default_rng(2))
    assert effect.essential is not None
    up, down = (effect.change(3.0).parameters[f"force_{side}_n"] for side in ("up", "down"))
    [constant] = effect.essential(3.0).kernel.values()
    assert abs(constant) == pytest.approx(0.5 * abs(up - down))
    # what drags more on the way up pulls down at the mean, as an equal friction with a constant force does
    assert np.sign(constant) == np.sign(down - up)


def test_an_effect_whose_essential_part_is_hidden_is_not_drawn() -> None:
    laboratory = SimpleNamespace(
        plan=SimpleNamespace(sampling_rate_hz=100.0), signals=lambda changes, relative_tolerance: changes
    )
    floor = SimpleNamespace(
        start_anew=lambda: None, strength=lambda changed, damping_is_known: changed[0].parameters["size"]
    )

    def effect(share: float) -> DrawnEffect:
        return DrawnEffect(
            "asymmetric_friction",
            "structure",
            lambda m: Change({"size": 10.0 * m}),
            essential=lambda m: Change({"size": 10.0 * share * m}),
        )

    _, reached = _scaled(effect(0.4), 10.0, laboratory, floor, [])  # type: ignore[arg-type]
    assert reached == pytest.approx(10.0)
    with pytest.raises(LookupError, match="does not show what makes it"):
        _scaled(effect(0.3), 10.0, laboratory, floor, [])  # type: ignore[arg-type]


class FloorWithFewBaselines:
    """A strength, as large as its size, about three baselines: beyond a factor of two of all it seems more."""

    def __init__(self) -> None:
        self.start_anew()

    def start_anew(self) -> None:
        self._near: list[float] = []

    def strength(self, changed: list[Change], *, damping_is_known: bool) -> float:
        assert not damping_is_known
        size = changed[0].parameters["size"]
        if len(self._near) < 3:
            self._near.append(size)
        return size if min(abs(np.log(size / near)) for near in self._near) < np.log(2.0) else 20.0 * size


@pytest.mark.parametrize("wanted", [5.0, 20.0, 3000.0])
def test_a_strength_is_that_about_baselines_near_the_magnitude(wanted: float) -> None:
    laboratory = SimpleNamespace(
        plan=SimpleNamespace(sampling_rate_hz=100.0), signals=lambda changes, relative_tolerance: changes
    )
    effect = DrawnEffect("base_rocking", "excitation", lambda m: Change({"size": 1e4 * m}), least=1e-8, most=1e8)
    change, reached = _scaled(effect, wanted, laboratory, FloorWithFewBaselines(), [])  # type: ignore[arg-type]
    assert change.parameters["size"] == pytest.approx(reached, rel=1e-12)
    assert reached == pytest.approx(wanted, rel=0.09)


def test_the_motion_of_a_tank_is_relative_to_its_base() -> None:
    """A shaker has no structure between the two."""
    base = np.sin(np.arange(200.0))
    runs = [
        {"acceleration_tip": base + size * np.cos(np.arange(200.0)), "acceleration_root": base} for size in (1, 3)
    ]
    assert _motion(runs) == pytest.approx(np.sqrt(5 / 2), rel=0.01)
    assert _motion([{"acceleration_roof_1": base}]) == 1.0


@pytest.mark.parametrize(("least", "stuck"), [(0.99, False), (1.01, True)])
def test_what_moves_less_than_it_must_is_not_drawn(
    least: float, stuck: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is hidden, so that the motion is that without anything hidden."""
    monkeypatch.setattr(case_drawing, "_LEAST_MOTION", least)
    drawn = CaseDrawing([5])
    if stuck:
        with pytest.raises(LookupError, match="no motion to speak of"):
            drawn._attempted(0, 0, "case_001", "nothing", "sdof_one_frequency")
    else:
        assert drawn._attempted(0, 0, "case_001", "nothing", "sdof_one_frequency").truth.effects == []


def test_one_or_two_numbers_are_off_by_two_to_three_tolerances_and_losses_are_smaller() -> None:
    generator = np.random.default_rng(8)
    sizes = []
    for k in range(200):
        rig = drawn_rig(("sdof", "beam", "shaker")[k % 3], generator)
        wrong = wrongly_believed(rig, generator)
        assert rig_text(wrong) == rig_text(rig)
        off = {name: (factor - 1) / rig.tunable[name] for name, factor in wrong.factors.items()}
        far = {name: size for name, size in off.items() if abs(size) > 1.0}
        assert 1 <= len(far) <= 2
        for name, size in far.items():
            assert 2.0 <= abs(size) <= 3.0
            assert size < 0 or not name.startswith(("damping", "coulomb", "tank_damping"))
        sizes += list(far.values())
    assert min(sizes) < -2.8
    assert max(sizes) > 2.8


def test_some_recorders_filter_and_some_begin_early_whatever_the_class() -> None:
    generator = np.random.default_rng(9)
    drawn = [drawn_recorder(generator) for _ in range(1000)]
    # four in ten of each, three standard deviations of a thousand draws
    assert abs(np.mean([recorder.filters for recorder in drawn]) - 0.4) < 0.05
    assert abs(np.mean([recorder.lead_samples > 0 for recorder in drawn]) - 0.4) < 0.05
    kinds = ("nothing", "retunable", "outside")
    recorders = []
    for kind in kinds:
        drawing = CaseDrawing([11, 13])
        drawing._plans = ["shaker_one_frequency"]
        recorders.append(drawing.case(0, "case_001", kind).laboratory.recorder)
    assert recorders[1:] == recorders[:-1]


def test_the_same_seed_draws_the_same_case() -> None:
    first, second = (CaseDrawing([5]).case(3, "case_004", "nothing") for _ in range(2))
    assert first.truth == second.truth
    for signal, other in zip(first.signals, second.signals, strict=True):
        assert all(np.array_equal(signal[name], other[name]) for name in signal)


@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
def test_magnitudes_are_found_for_a_wanted_strength(power: float) -> None:
    magnitude, reached = magnitude_for(lambda m: 4 * m**power, 12.0, 1e-4, 1e3)
    assert reached == pytest.approx(12.0, rel=0.09)
    assert 4 * magnitude**power == pytest.approx(reached)
    # where the bounds do not reach it, the nearer bound
    assert magnitude_for(lambda m: 4 * m, 12.0, 0.1, 2.0) == (2.0, 8.0)
