"""Truths written by hand in three forms say the same; what is wrong with one is a line that names the place."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sealed_trial.challenge.truths_file import kept_document, read_truths
from sealed_trial.sealing.locked_truths import locked
from sloshlab.errors import InputError

KEY = bytes(range(32))
TOML = """
[quiet]
hidden = "nothing"
[both]
hidden = "effects"
note = "two at once"
[[both.effects]]
block = "structure"
name = "coulomb_friction"
parameters = { force_n = 1 }
[[both.effects]]
block = "sensor"
name = "sensor_delay"
strength = 7.5
parameters = { delay_s = "2.0 ms" }
[alike]
hidden = "look_alikes"
equals = [["coulomb_friction", "constant_force"], ["something"]]
[[alike.effects]]
block = "structure"
name = "asymmetric_friction"
parameters = { force_up_n = 0.5, force_down_n = 0.8 }
[odd]
hidden = "outside"
block = "tank"
"""
JSON = {
    "quiet": {"hidden": "nothing"},
    "both": {
        "hidden": "effects",
        "note": "two at once",
        "effects": [
            {"block": "structure", "name": "coulomb_friction", "parameters": {"force_n": 1.0}},
            {"block": "sensor", "name": "sensor_delay", "strength": 7.5, "parameters": {"delay_s": "2.0 ms"}},
        ],
    },
    "alike": {
        "hidden": "look_alikes",
        "equals": [["coulomb_friction", "constant_force"], ["something"]],
        "effects": [
            {
                "block": "structure",
                "name": "asymmetric_friction",
                "parameters": {"force_up_n": 0.5, "force_down_n": 0.8},
            }
        ],
    },
    "odd": {"hidden": "outside", "effects": [{"block": "tank"}]},
}
CSV = """\
case,hidden,block,effect,parameter,value,units,equals,strength,note
quiet,nothing,,,,,,,,
both,effects,structure,coulomb_friction,force_n,1,,,,two at once
both,effects,sensor,sensor_delay,delay_s,2,ms,,7.5,
alike,look_alikes,structure,asymmetric_friction,force_up_n,0.5,,coulomb_friction + constant_force | something,,
alike,look_alikes,structure,asymmetric_friction,force_down_n,0.8,,,,
odd,outside,tank,,,,,,,
"""


def written(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def test_three_forms_say_the_same(tmp_path) -> None:
    files = [
        written(tmp_path, "t.toml", TOML),
        written(tmp_path, "t.json", json.dumps(JSON)),
        written(tmp_path, "t.csv", CSV),
    ]
    found = [{case: kept.truth.document(case) for case, kept in read_truths(file).items()} for file in files]
    assert found[0] == found[1] == found[2]
    assert found[0]["both"] == {
        "case": "both",
        "hidden": "effects",
        "effects": [
            {"name": "coulomb_friction", "block": "structure", "parameters": {"force_n": 1.0}, "strength": None},
            {"name": "sensor_delay", "block": "sensor", "parameters": {"delay_s": "2.0 ms"}, "strength": 7.5},
        ],
        "equals": [],
        "note": "two at once",
    }
    assert isinstance(found[0]["both"]["effects"][0]["parameters"]["force_n"], float)
    assert found[0]["odd"]["effects"] == [{"name": "unknown", "block": "tank", "parameters": {}, "strength": None}]
    assert found[0]["alike"]["equals"] == [["coulomb_friction", "constant_force"], ["something"]]


def test_what_was_kept_comes_back_and_locked_only_by_its_key(tmp_path) -> None:
    pytest.importorskip("cryptography")
    kept = {case: type(each)(each.truth, bytes([k] * 32)) for k, (case, each) in
            enumerate(read_truths(written(tmp_path, "t.toml", TOML)).items())}  # fmt: skip
    plain = written(tmp_path, "kept.json", json.dumps(kept_document(kept)))
    assert read_truths(plain) == kept
    secret = tmp_path / "kept.locked"
    secret.write_bytes(locked(kept_document(kept), KEY))
    assert b"friction" not in secret.read_bytes()
    assert read_truths(secret, KEY) == kept
    with pytest.raises(InputError, match="locked truths and no key"):
        read_truths(secret)
    with pytest.raises(InputError, match="this key does not open"):
        read_truths(secret, bytes(32))
    with pytest.raises(InputError, match="a key for truths that are not locked"):
        read_truths(plain, KEY)


HIDING = '[a]\nhidden = "effects"\n[[a.effects]]\nblock = "structure"\nname = "mass_error"\n'
WRONG: dict[str, tuple[str, str, str]] = {
    "no such class": ("t.toml", '[a]\nhidden = "friction"', "a: hidden: got 'friction'; allowed: Input should be"),
    "no class": ("t.toml", "[a]\nnote = 'x'", "a: hidden"),
    "a key that means nothing": ("t.toml", '[a]\nhidden = "nothing"\nforce = 3', "a: force: got 3"),
    "no block": ("t.toml", HIDING.replace('block = "structure"\n', ""), "a: effects.0.block"),
    "another block": ("t.toml", HIDING.replace("structure", "beam"), "a: effects.0.block: got 'beam'"),
    "a name with a path": ("t.toml", HIDING.replace("mass_error", "../x"), "a: effects.0.name: got '../x'"),
    "a number that is none": (
        "t.toml",
        HIDING + "parameters = { mass_kg = nan }",
        "a: effects.0.parameters.mass_kg: got nan",
    ),
    "a yes": ("t.toml", HIDING + "parameters = { mass_kg = true }", "a: effects.0.parameters.mass_kg: got True"),
    "effects where nothing is": ("t.toml", HIDING.replace("effects", "nothing", 1), "allowed: 0 effects where"),
    "no effects": ("t.toml", '[a]\nhidden = "effects"', "allowed: 1 or 2 effects where hidden is effects"),
    "one effect twice": (
        "t.toml",
        HIDING + HIDING.partition("\n[[")[2].join(["[[", ""]),
        "allowed: different effects",
    ),
    "alike to nothing": ("t.toml", HIDING.replace("effects", "look_alikes", 1), "lists of names in equals"),
    "equals of a name": (
        "t.toml",
        HIDING.replace('"effects"', '"effects"\nequals = [["b"]]', 1),
        "lists of names in equals where hidden is look_alikes",
    ),
    "a strength below nothing": ("t.toml", HIDING + "strength = -1.0", "a: effects.0.strength: got -1.0"),
    "a case that leads out": ("t.toml", '["../a"]\nhidden = "nothing"', "case '../a': got this name"),
    "no case": ("t.toml", "", "got 0 cases"),
    "no TOML": ("t.toml", "[a", "text that is not TOML"),
    "deep TOML": ("t.toml", "[" + "a." * 50 + "a]", "more than 16 deep"),
    "no JSON": ("t.json", "{", "text that is not JSON"),
    "deep JSON": ("t.json", '{"a":' * 100_000, "text that is not JSON"),
    "a list": ("t.json", "[]", "got list; allowed: an object"),
    "truths of a later version": ("t.json", '{"sloshlab_truths": 2, "cases": {}}', "version 1"),
    "a salt that is none": (
        "t.json",
        '{"sloshlab_truths": 1, "cases": {"a": {"salt": "00", "truth": {"hidden": "nothing"}}}}',
        "a: salt: got '00'",
    ),
    "no salt": ("t.json", '{"sloshlab_truths": 1, "cases": {"a": {}}}', "a: got something else"),
    "columns that mean nothing": (
        "t.csv",
        "case,hidden,colour\na,nothing,red\n",
        "got the columns 'case, hidden, colour'",
    ),
    "no columns": ("t.csv", "", "got the columns"),
    "a cell too few": (
        "t.csv",
        "case,hidden,block\na,nothing\n",
        "row 2: got another number of cells; allowed: 3",
    ),
    "two classes": (
        "t.csv",
        "case,hidden\na,nothing\na,masked\n",
        "row 3: got a masked; allowed: nothing, as above",
    ),
    "an effect without a block": (
        "t.csv",
        "case,hidden,block,effect\na,effects,,mass_error\n",
        "row 2: got effect without a block",
    ),
    "a value without a parameter": (
        "t.csv",
        "case,hidden,block,effect,parameter,value\na,effects,tank,mass_error,,3\n",
        "row 2: got a parameter without a value, or the other way round",
    ),
    "a value that is none": (
        "t.csv",
        "case,hidden,block,effect,parameter,value\na,effects,tank,mass_error,mass_kg,three\n",
        "row 2: value: got 'three'; allowed: a number",
    ),
    "an open quote": ("t.csv", 'case,hidden\n"a,nothing\n', "text that is not CSV"),
    "another ending": ("t.yaml", "a: nothing", "got the ending '.yaml'"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_one_line_that_names_file_and_place(name: str, tmp_path) -> None:
    file, text, said = WRONG[name]
    path = written(tmp_path, file, text)
    with pytest.raises(InputError) as caught:
        read_truths(path)
    assert said in str(caught.value)
    assert str(path) in str(caught.value)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 700


def test_bytes_sizes_and_places_are_looked_at_first(tmp_path) -> None:
    for name in ("t.csv", "t.json", "t.toml"):
        (tmp_path / name).write_bytes(b"\xff\xfe")
        with pytest.raises(InputError, match="not UTF-8"):
            read_truths(tmp_path / name)
        with (tmp_path / name).open("wb") as file:
            file.truncate(8_000_001)
        with pytest.raises(InputError, match="got 8000001 bytes"):
            read_truths(tmp_path / name)
    with pytest.raises(InputError, match="no such file"):
        read_truths(tmp_path / "none.toml")
    with pytest.raises(InputError, match="a folder"):
        read_truths(tmp_path)
