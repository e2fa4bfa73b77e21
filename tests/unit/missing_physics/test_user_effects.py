"""Effects of a user's own: loaded where they are named, replaced when loaded again, refused in one line."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import decays, rig, surroundings

from sloshlab.errors import InputError
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics.candidate import (
    Candidate,
    Effect,
    EffectParameter,
    candidates,
    known_effects,
    register,
    withdraw,
)
from sloshlab.missing_physics.extension import Extension
from sloshlab.missing_physics.user_effects import load_user_effects

PAGE = Path(__file__).resolve().parents[3] / "docs" / "adding_an_effect.md"
EXAMPLES = dict(
    re.findall(r"^`([\w.]+\.py)`:\n\n```py\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
)


@pytest.fixture(autouse=True)
def _as_before():  # type: ignore[no-untyped-def]
    before = known_effects()
    yield
    for effect in known_effects():
        if effect not in before:
            withdraw(effect)


def example(folder: Path, name: str) -> Path:
    file = folder / name
    file.write_text(EXAMPLES[name], encoding="utf-8")
    return file


def test_the_examples_of_the_page_take_thirty_lines_at_most() -> None:
    assert set(EXAMPLES) == {"leaking_damper.py", "sticky_ladder.py"}
    for text in EXAMPLES.values():
        assert len([line for line in text.splitlines() if line.strip()]) <= 30


def test_a_force_of_the_page_is_a_candidate_and_acts_as_it_says(tmp_path: Path) -> None:
    [own] = load_user_effects(example(tmp_path, "leaking_damper.py"))
    model = RigModel(rig(tmp_path), tmp_path, decays((0.01,), 2.0))
    at = surroundings(model)
    assert own in [candidate.effect for candidate in candidates(at)]
    [run] = model.runs
    slow = Candidate(own, at).extension({"damping_n_s_per_m": 1.0, "speed_m_per_s": 50.0})
    viscous = next(
        effect for effect in known_effects() if (effect.block, effect.name) == ("structure", "viscous_damping")
    )
    same = Candidate(viscous, at).extension({"damping_n_s_per_m": 1.0})
    leaking = Candidate(own, at).extension({"damping_n_s_per_m": 1.0, "speed_m_per_s": 0.05})
    x = [
        model.simulate(run, model.believed, extension)["displacement_tank"] for extension in (slow, same, leaking)
    ]
    np.testing.assert_allclose(x[0], x[1], atol=1e-9)
    assert np.abs(x[2][-100:]).max() > 1.05 * np.abs(x[1][-100:]).max()


def test_a_sensor_of_the_page_reads_in_steps(tmp_path: Path) -> None:
    [own] = load_user_effects(example(tmp_path, "sticky_ladder.py"))
    model = RigModel(rig(tmp_path), tmp_path, decays((0.01,), 1.0))
    candidate = Candidate(own, surroundings(model), "acceleration_tip")
    read = model.simulate(model.runs[0], model.believed, candidate.extension({"step": 0.5}))["acceleration_tip"]
    np.testing.assert_allclose(read, 0.5 * np.round(read / 0.5), atol=1e-9)
    assert len(np.unique(read)) > 10


def test_the_same_file_replaces_what_it_registered_before(tmp_path: Path) -> None:
    file = example(tmp_path, "leaking_damper.py")
    [first] = load_user_effects(file)
    [second] = load_user_effects(file)
    assert first is not second
    assert second in known_effects()
    assert first not in known_effects()


REFUSED = {
    "nothing.txt": ("", "no such Python file"),
    "empty.py": ("x = 1\n", "no effect.*register"),
    "broken.py": ("\nraise RuntimeError('not\\nready')\n", r"RuntimeError in line 2: not ready"),
    "syntax.py": ("def f(:\n", "SyntaxError"),
    "quits.py": ("raise SystemExit(3)\n", "SystemExit"),
    "taken.py": (
        EXAMPLES["sticky_ladder.py"].replace('"coarse_steps"', '"sensor_gain"'),
        "sensor_gain: got a name that is taken",
    ),
    "nowhere.py": (EXAMPLES["sticky_ladder.py"].replace('        "sensor",', '        "roof",'), "block.*'roof'"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_module_that_is_none_is_refused_in_one_line_and_leaves_nothing(tmp_path: Path, name: str) -> None:
    text, message = REFUSED[name]
    file = tmp_path / name
    file.write_text(text, encoding="utf-8")
    before = known_effects()
    with pytest.raises(InputError, match=message) as error:
        load_user_effects(file)
    assert name in str(error.value)
    assert "\n" not in str(error.value)
    assert known_effects() == before


def test_a_module_that_fails_half_way_leaves_nothing(tmp_path: Path) -> None:
    file = tmp_path / "half.py"
    file.write_text(EXAMPLES["sticky_ladder.py"] + "\nraise ValueError('later')\n", encoding="utf-8")
    before = known_effects()
    with pytest.raises(InputError, match=r"ValueError.*later"):
        load_user_effects(file)
    assert known_effects() == before


UNSOUND = [
    (lambda at: [{"other": 1.0}], lambda n, at, c: Extension(), "a start: got other; allowed: size"),
    (lambda at: [], lambda n, at, c: Extension(), "1 and 0"),
    (lambda at: [{"size": at.no_such_thing}], lambda n, at, c: Extension(), "AttributeError"),
    (lambda at: [{"size": 1.0}], lambda n, at, c: n["sise"], "KeyError: 'sise'"),
]


@pytest.mark.parametrize(("starts", "extension", "message"), UNSOUND)
def test_an_effect_that_contradicts_itself_is_named(tmp_path: Path, starts, extension, message) -> None:  # type: ignore[no-untyped-def]
    model = RigModel(rig(tmp_path), tmp_path, decays((0.01,), 1.0))
    register(Effect("muddle", "structure", "?", (EffectParameter("size", 0.0, 1.0),), starts, extension))
    with pytest.raises(InputError, match=f"effect structure.muddle.*{message}"):
        candidates(surroundings(model))


def test_modules_written_for_former_names_still_run(tmp_path: Path) -> None:
    """A user's effect does not care where the project keeps its vocabulary."""
    former = EXAMPLES["leaking_damper.py"].replace("sloshlab.missing_physics", "sloshlab.diagnosis")
    assert "sloshlab.diagnosis.prior" in former
    (tmp_path / "former.py").write_text(former)
    added = load_user_effects(tmp_path / "former.py")
    assert [effect.name for effect in added] == ["leaking_damper"]
    withdraw(added[0])
