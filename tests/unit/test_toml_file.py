"""TOML of strangers: limits of size and depth, and one line whatever it holds."""

from __future__ import annotations

import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.devices.faults import Faults
from acquisition.files.channel_map import read_channel_map
from pipelines.recording.run_attributes import checked_run_attributes
from pipelines.structure.twins import tank_models
from sealed_trial.scoring.rivals import metadata_features
from sloshlab.errors import InputError, RigError
from sloshlab.rig import Rig
from sloshlab.toml_file import DEEPEST, LARGEST_BYTES, parse_toml, read_toml
from sloshlab.twin.storage import load_twin
from sloshlab.user_twin.extended import load_extended

READERS: dict[str, Callable[[Path], Any]] = {
    "rig": Rig.from_toml,
    "import map": read_channel_map,
    "faults": Faults.from_toml,
    "run attributes": lambda path: checked_run_attributes(Path("run.nc"), Path("rig.toml"), path, []),
    "ball": lambda path: tank_models([], [path], path.parent),
    "saved twin": load_twin,
    "extended twin": load_extended,
    "case of a trial": lambda path: metadata_features(path.parent),
}
HOSTILE = {
    "nested tables": "".join(f"[{'a.' * 300}b{i}]\n" for i in range(330)),
    "one dotted key": "a." * 60_000 + "a = 1\n",
    "growing tables": "".join(f"[{'.'.join(['a'] * depth)}]\n" for depth in range(1, 450)),
    "lists in lists": "a = " + "[" * 100_000,
    "tables in tables": "a = " + "{b = " * 50_000,
    "deep after a string": 'a = """\\"""" # " and """ here\nb = """c"""""\n' + "b." * 60_000 + "b = 1\n",
}


@pytest.mark.parametrize("reader", list(READERS))
@pytest.mark.parametrize("what", list(HOSTILE))
def test_hostile_depth_ends_at_once_in_one_line_that_says_it(what: str, reader: str, tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(HOSTILE[what], encoding="utf-8")
    start = time.process_time()
    with pytest.raises(InputError, match=f"rig.toml.*more than {DEEPEST} deep"):
        READERS[reader](tmp_path / "rig.toml")
    # not a measurement of speed: 200 kB of nested tables took the parser 106 s, one key the whole memory
    assert time.process_time() - start < 10


@pytest.mark.parametrize("reader", list(READERS))
def test_size_is_checked_before_parsing(reader: str, tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_bytes(b"#" * (LARGEST_BYTES + 1))
    with pytest.raises(InputError, match=rf"{LARGEST_BYTES + 1} bytes; allowed: ≤ {LARGEST_BYTES}"):
        READERS[reader](tmp_path / "rig.toml")


def test_a_file_without_end_is_not_read_to_its_end() -> None:
    """A device says that it has 0 bytes."""
    with pytest.raises(InputError, match=f"{LARGEST_BYTES + 1} bytes"):
        read_toml("/dev/zero", "endless")


@pytest.mark.parametrize("reader", list(READERS))
@pytest.mark.parametrize(
    ("content", "said"), [(b"\xff\xfe", "UTF-8"), (b"a = [", "not TOML"), (b"a = 1\na = 2", "not TOML")]
)
def test_other_breaches(reader: str, content: bytes, said: str, tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_bytes(content)
    with pytest.raises(InputError, match=said):
        READERS[reader](tmp_path / "rig.toml")


def test_absent_files_and_folders(tmp_path: Path) -> None:
    for path, said in ((tmp_path / "absent", "No such file"), (tmp_path, "directory"), (Path("a\0b"), "null")):
        with pytest.raises(RigError, match=said):
            read_toml(path, "rig", error=RigError)


def test_what_editors_on_windows_write_is_read(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_bytes(b"\xef\xbb\xbf[tank]\r\nheight_m = 1.0\r\n")
    assert read_toml(tmp_path / "rig.toml", "rig") == {"tank": {"height_m": 1.0}}


def test_brackets_and_dots_in_strings_and_comments_do_not_count() -> None:
    many = "[" * 100 + "." * 100 + "{" * 100
    one_line = f'a = "{many}\\"{many}"\nb = \'{many}\'\n# {many}\n'
    text = one_line + f'c = """\n{many}"" \\"""{many}"""\nd = \'\'\'{many}\'\'\'\n'
    assert parse_toml(text, "text") == tomllib.loads(text)
    numbers = f"a = [{', '.join(['1.5'] * 1000)}]\n" + "".join(f"[t{i}]\nx.y = 1.5\n" for i in range(1000))
    assert parse_toml(numbers, "numbers") == tomllib.loads(numbers)


@pytest.mark.parametrize("text", ["a" + ".a" * (DEEPEST - 1) + " = 1", "a = " + "[" * DEEPEST + "]" * DEEPEST])
def test_the_deepest_that_is_allowed_is_read(text: str) -> None:
    assert parse_toml(text, "text") == tomllib.loads(text)
    with pytest.raises(InputError, match="deep"):
        parse_toml(text.replace("a", "a.a", 1).replace("[", "[[").replace("]", "]]"), "text")


def depth_of(tree: Any) -> int:
    children = tree.values() if isinstance(tree, dict) else tree if isinstance(tree, list) else None
    return 0 if children is None else 1 + max((depth_of(child) for child in children), default=0)


PIECES = [
    "[",
    "]",
    "{",
    "}",
    ".",
    "=",
    ",",
    "\n",
    '"',
    '"""',
    "'",
    "'''",
    "\\",
    "#",
    "a",
    "b.c",
    " = 1\n",
    '"d"."e"',
]


@settings(max_examples=500, deadline=None, derandomize=True)
@given(pieces=st.lists(st.sampled_from(PIECES), max_size=30), wrapped=st.integers(0, 40))
def test_nothing_that_is_accepted_is_much_deeper_than_allowed(pieces: list[str], wrapped: int) -> None:
    """However strings and comments begin and end: header, key and value are each at most that deep."""
    text = "".join(pieces) + "\n" + "x = " + "[" * wrapped + "]" * wrapped
    try:
        tree = parse_toml(text, "text")
    except InputError:
        return
    assert depth_of(tree) <= 3 * DEEPEST
