"""Where compiled loops are kept: beside the source, in the user's cache, or in a folder of the process."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sloshlab.compiled_cache import VARIABLE, keep_compiled_loops, user_cache_folder

REPOSITORY = Path(__file__).resolve().parents[2]
COMPILE = """
import os, sys
from pathlib import Path
from sloshlab.compiled_cache import keep_compiled_loops
keep_compiled_loops(Path(sys.argv[1]), lambda folder: folder != Path(sys.argv[1]))
from numba import njit
exec(compile("@njit(cache=True)\\ndef doubled(x):\\n    return 2 * x\\n", sys.argv[2], "exec"))
print(doubled(21), os.environ["NUMBA_CACHE_DIR"], sep="\\n")
"""


@pytest.fixture(autouse=True)
def untold(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if nobody had told numba where; undone at the end."""
    monkeypatch.setenv(VARIABLE, "told")
    monkeypatch.delenv(VARIABLE)


def test_beside_the_source_where_that_can_be_written(tmp_path: Path) -> None:
    keep_compiled_loops(tmp_path)
    assert VARIABLE not in os.environ


def test_where_a_person_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "mine"))
    keep_compiled_loops(tmp_path, lambda folder: False)
    assert os.environ[VARIABLE] == str(tmp_path / "mine")


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="the variable is one of Linux")
@pytest.mark.parametrize("has_cache", [True, False], ids=["user's cache", "folder of the process"])
def test_an_installation_that_cannot_be_written_compiles(has_cache: bool, tmp_path: Path) -> None:
    """numba ended with "no locator available" where the home could not be written either."""
    home = tmp_path / "home"
    if has_cache:
        home.mkdir()
    else:
        home.write_text("no folder can be made in here")
    # a file of no folder: nothing can be kept beside it
    source = tmp_path / "installed" / "loops.py"
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "XDG_CACHE_HOME": str(home)}
    words = [sys.executable, "-c", COMPILE, str(source.parent), str(source)]
    source.parent.mkdir()
    source.write_text("@njit(cache=True)\ndef doubled(x):\n    return 2 * x\n")
    done = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=300)
    answer, place = done.stdout.splitlines() or [done.stderr, ""]
    assert answer == "42"
    kept = list(home.rglob("*.nbi")) if has_cache else []
    assert len(kept) == int(has_cache)
    assert (Path(place) == home / "sloshlab" / "numba") == has_cache
    assert Path(place).exists() == has_cache


def test_the_cache_of_a_user_is_below_the_home(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    assert tmp_path in user_cache_folder().parents
