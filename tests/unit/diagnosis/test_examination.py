"""Where and how in one: a decay with dry friction is examined, and told in words and in JSON."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

import pytest
from recorded_oscillators import MASS_KG, NOISE, effect, motion, rig, run_of

from sloshlab.diagnosis.candidate import known_effects
from sloshlab.diagnosis.evidence import FORCE_TERMS, SENSOR_TERMS, TAKES
from sloshlab.diagnosis.examination import Examination, examination_facts, examined, owning_block, seen_at
from sloshlab.diagnosis.extension import NOTHING
from sloshlab.diagnosis.observations import observations
from sloshlab.diagnosis.rig_model import RigModel
from sloshlab.diagnosis.verdict import Verdict, named_and_units, with_place


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
        model=model,
        fitting=[observations(run, list(run.recording.data_vars)) for run in runs],
        retuned=retuned,
        explanations=[],
        readings=lambda one: {run.name: model.simulate(run, one.fit.values, NOTHING) for run in runs},
    )
    return found, examined(found)


def test_the_structure_owns_it(friction: tuple[Any, Examination]) -> None:
    assert owning_block(friction[1]) == "structure"


def test_friction_is_spoken_for_and_a_spring_is_not(friction: tuple[Any, Examination]) -> None:
    examination = friction[1]
    on_friction = examination.evidence_on(effect("structure.coulomb_friction"))
    on_spring = examination.evidence_on(effect("structure.cubic_stiffness"))
    assert TAKES in on_friction.speaks_for
    assert not on_friction.speaks_against
    assert len(on_spring.speaks_against) >= 2


def test_the_sentence_says_where_it_is_seen(friction: tuple[Any, Examination]) -> None:
    """Sin φ is the velocity: undamped simulation and damped recording differ most where the motion is largest."""
    words = seen_at(friction[1], None)
    assert words.startswith("seen ")
    assert " g" in words
    unknown = Verdict("unknown", None, [], 0.0, 0.0, "Something.", "", {})
    told = with_place(friction[0], unknown, words, "structure")
    assert told.block == "structure"
    assert "in the structure" in told.statement
    assert told.statement.endswith(f"; {words}.")
    nothing = Verdict("nothing_missing", None, [], 0.0, 0.0, "Nothing is missing.", "", {})
    assert with_place(friction[0], nothing, words, "structure") is nothing


def test_the_facts_are_strict_json(friction: tuple[Any, Examination]) -> None:
    facts = json.loads(json.dumps(examination_facts(friction[1], friction[0]), allow_nan=False))
    assert facts["interface_cut"]["doubted_channel"] == ""
    structure = next(one for one in facts["interface_cut"]["blocks"] if one["block"] == "structure")
    assert structure["share"]["low"] <= structure["share"]["estimate"] <= structure["share"]["high"]
    questions = [one["question"] for one in facts["characters"]["structure"]["answers"]]
    assert {"energy", "state", "history", "onset"} <= set(questions)


def test_every_effect_says_which_tests_speak_for_it() -> None:
    for one in known_effects():
        terms = SENSOR_TERMS if one.block == "sensor" else FORCE_TERMS
        assert one.spoken_for_by, one.name
        assert set(one.spoken_for_by) <= set(terms), one.name


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
