"""What `import sloshlab` offers: light, complete, and typed as it is."""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import sloshlab

STUB = Path(sloshlab.__file__).with_suffix(".pyi")


def names_of_the_stub() -> dict[str, str]:
    """Module of every name that the stub re-exports."""
    tree = ast.parse(STUB.read_text(encoding="utf-8"))
    imports = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    return {alias.asname or alias.name: str(node.module) for node in imports for alias in node.names}


def test_the_stub_has_the_names_that_are_offered_and_no_other() -> None:
    assert set(names_of_the_stub()) == set(sloshlab.__all__)


@pytest.mark.parametrize("name", sloshlab.__all__)
def test_every_name_is_what_the_stub_says(name: str) -> None:
    assert getattr(sloshlab, name) is getattr(importlib.import_module(names_of_the_stub()[name]), name)
    assert name in dir(sloshlab)


def test_other_names_are_refused_as_python_does() -> None:
    with pytest.raises(AttributeError, match=r"module 'sloshlab' has no attribute 'analyse_everything'"):
        _ = sloshlab.analyse_everything  # type: ignore[attr-defined]


def modules_after(code: str) -> set[str]:
    """Top-level modules of a fresh interpreter that has run `code`."""
    shown = f"{code}\nimport sys\nprint(*{{name.partition('.')[0] for name in sys.modules}})"
    done = subprocess.run([sys.executable, "-c", shown], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_importing_loads_nothing_heavy() -> None:
    loaded = modules_after("import sloshlab as sl; dir(sl)")
    assert "sloshlab" in loaded
    assert not {"numpy", "scipy", "pandas", "xarray", "matplotlib", "numba", "pydantic", "pipelines"} & loaded


def test_reading_and_analysing_load_no_drawing() -> None:
    loaded = modules_after(
        "import sloshlab as sl; sl.open_recording, sl.Rig, sl.analyse_sweep, sl.train, sl.diagnose"
    )
    assert "xarray" in loaded
    assert "matplotlib" not in loaded
