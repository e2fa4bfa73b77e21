"""Where and how in one: a decay with dry friction is examined, and told in words and in JSON."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from recorded_oscillators import MASS_KG, NOISE, effect, motion, rig, run_of

from sloshlab.diagnosis.examination import Examination, examination_facts, examined, seen_at
from sloshlab.diagnosis.verdict import Verdict
from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_force.residual_maps import Profile, ResidualMaps
from sloshlab.missing_physics.candidate import known_effects
from sloshlab.missing_physics.evidence import DISSIPATIVE, FORCE_TERMS, SENSOR_TERMS
from sloshlab.missing_physics.extension import NOTHING
from sloshlab.missing_physics.units import named_and_units


@pytest.fixture(scope="module")
def friction(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Examination]:
    """Findings with nothing in them but the baseline and its recordings, and their examination."""
    folder = tmp_path_factory.mktemp("case")
    runs = []
    for i, start in enumerate((0.01, 0.016)):
        _, x, _, a = motion(start, 5.0, friction_n=(0.5, 0.5))
        channels = {"displacement_tank": x, "acceleration_tip": a, "force_interface": MASS_KG * a}
        runs.append(run_of(f"decay_{i}", channels, NOISE, i, initial_displacement_m=start))
    model = RigModel(rig(folder), folder, runs)
    retuned = SimpleNamespace(fit=SimpleNamespace(values=model.believed))
    found: Any = SimpleNamespace(
        split=SimpleNamespace(has_held_out=True),
        model=model,
        fitting=[observations(run, list(run.recording.data_vars)) for run in runs],
        retuned=retuned,
        explanations=[],
        readings=lambda explanation: {
            run.name: model.simulate(run, explanation.fit.values, NOTHING) for run in runs
        },
    )
    return found, examined(found)


def test_the_structure_owns_it(friction: tuple[Any, Examination]) -> None:
    cut = friction[1].cut
    assert cut is not None
    assert {block.block: block.share for block in cut.blocks}["structure"] > 0.8


def test_friction_is_spoken_for_and_a_spring_is_not(friction: tuple[Any, Examination]) -> None:
    examination = friction[1]
    on_friction = examination.evidence_on(effect("structure.coulomb_friction"))
    on_spring = examination.evidence_on(effect("structure.cubic_stiffness"))
    assert DISSIPATIVE in on_friction.speaks_for
    assert not on_friction.speaks_against
    assert len(on_spring.speaks_against) >= 2


def test_the_sentence_says_where_it_is_seen(friction: tuple[Any, Examination]) -> None:
    """A motion that dies out too late lags at every speed: no part of the cycle is named for that."""
    words = seen_at(friction[1], None)
    assert words.startswith("seen below ")
    assert words.endswith(" g")
    unknown = Verdict("unknown", None, [], "Something.", "", {})
    assert unknown.seen(words).statement == f"Something; {words}."
    nothing = Verdict("nothing_missing", None, [], "Nothing is missing.", "", {})
    assert nothing.seen(words) is nothing


@pytest.mark.parametrize(
    ("of_phase", "words"),
    [
        (lambda phase: np.sin(phase) ** 2, "at the largest velocities"),
        (lambda phase: np.cos(phase) ** 4, "at velocity reversals"),
        (lambda phase: np.maximum(np.cos(phase), 0.0) ** 2, "about the lowest point"),
        (lambda phase: np.maximum(-np.cos(phase), 0.0) ** 2, "about the highest point"),
        (lambda phase: 1.0 + 0.2 * np.cos(phase), ""),
    ],
)
def test_the_part_of_the_cycle_in_words(of_phase: Any, words: str) -> None:
    """a = a₀ cos φ upward: largest at the lowest point, the velocity largest at ±π/2."""
    edges = np.linspace(-np.pi, np.pi, 25)
    middles = 0.5 * (edges[1:] + edges[:-1])
    maps = ResidualMaps("acceleration_tip", None, None, Profile(edges, 5.0 * of_phase(middles)))
    sensor: Any = SimpleNamespace(channels=("acceleration_tip",))
    told = seen_at(Examination(None, {}, (), [maps], {"channels": ["acceleration_tip"]}), sensor)
    assert told == (f"seen {words}" if words else "")


@pytest.mark.parametrize(
    ("force", "words"),
    [
        pytest.param(lambda x, v: -0.5 * np.sign(v), "seen at velocity reversals", id="friction"),
        pytest.param(
            lambda x, v: -0.5 * np.sign(v) - 3.0 * v + 8.0 * x,
            "seen at velocity reversals",
            id="and its own block",
        ),
        pytest.param(
            lambda x, v: np.where(np.abs(v) > 0.8, x, 0.0), "seen at the largest velocities", id="where it is fast"
        ),
    ],
)
def test_the_part_of_the_cycle_in_which_a_force_is_no_spring_and_no_damper(force: Any, words: str) -> None:
    """Of x = cos t: F sgn v − 4F v/π is F at the ends and −0.27 F at the largest speed."""
    phase = np.arange(5000) / 250.0
    motion = np.column_stack([np.cos(phase), -np.sin(phase), -np.cos(phase)])
    lacking = SimpleNamespace(motion=motion, force_n=force(motion[:, 0], motion[:, 1]))
    cut: Any = SimpleNamespace(forces=lambda place: [lacking])
    characters: Any = {"structure": SimpleNamespace(exceeds_noise=True)}
    effect_ = SimpleNamespace(effect=SimpleNamespace(block="structure"))
    best: Any = SimpleNamespace(channels=(), fit=SimpleNamespace(candidates=[effect_]))
    assert seen_at(Examination(cut, characters, (), [], {}), best) == words


@pytest.mark.parametrize(
    ("held", "words"),
    [
        ((0.5, 4.0), "below 4 g"),
        ((3.2, 5.3), "from 3.2 to 5.3 g"),
        ((5.0, 8.0), "above 5 g"),
        ((1.0, 8.0), "from 1 to 8 g"),
    ],
)
def test_levels_that_hold_most_of_it_in_words(held: tuple[float, float], words: str) -> None:
    """Of runs up to 8 g; 80 % of the mismatch lies between the two."""
    maps = ResidualMaps("force_interface", None, Profile(np.linspace(0, 8, 11), np.ones(10)), None)
    where = {"channels": ["force_interface"], "acceleration_g": list(held)}
    assert seen_at(Examination(None, {}, (), [maps], where), None) == f"seen {words}"


def test_the_facts_are_strict_json(friction: tuple[Any, Examination]) -> None:
    facts = json.loads(json.dumps(examination_facts(friction[1], friction[0]), allow_nan=False))
    assert facts["interface_cut"]["doubted_channel"] == ""
    structure = next(block for block in facts["interface_cut"]["blocks"] if block["block"] == "structure")
    assert structure["share"]["low"] <= structure["share"]["estimate"] <= structure["share"]["high"]
    questions = [answer["question"] for answer in facts["characters"]["structure"]["answers"]]
    assert {"energy", "state", "history", "onset"} <= set(questions)


def test_every_effect_says_which_tests_speak_for_it() -> None:
    for known_effect in known_effects():
        terms = SENSOR_TERMS if known_effect.block == "sensor" else FORCE_TERMS
        assert known_effect.spoken_for_by, known_effect.name
        assert set(known_effect.spoken_for_by) <= set(terms), known_effect.name


@pytest.mark.parametrize(
    ("name", "words", "units"),
    [
        ("force_n", "force", "N"),
        ("stiffness_n_per_m3", "stiffness", "N/m³"),
        ("damping_n_s_per_m", "damping", "N s/m"),
        ("time_constant_s", "time constant", "s"),
        ("compliance_rad_per_n_m", "compliance", "rad/(N m)"),
        ("rate_kg_per_s", "rate", "kg/s"),
        ("ratio", "ratio", ""),
    ],
)
def test_units_of_a_parameter(name: str, words: str, units: str) -> None:
    assert named_and_units(name) == (words, units)
