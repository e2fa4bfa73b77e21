"""What packages and hosted checks declare is what `pyproject.toml` and the Makefile say."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

from sloshlab import __version__

REPOSITORY = Path(__file__).resolve().parents[2]
PROJECT: dict[str, Any] = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
CONDA_NAMES = {"netCDF4": "netcdf4", "matplotlib": "matplotlib-base"}
"""Packages that conda-forge calls otherwise."""
OF_EXTRAS = {"msgpack-python >=1.1"}
"""Of python-can[multicast]; conda has no extras."""


def loaded(name: str) -> Any:
    return yaml.safe_load((REPOSITORY / name).read_text(encoding="utf-8"))


def test_the_conda_recipe_has_the_same_requirements_version_and_command() -> None:
    recipe = loaded("packaging/conda/recipe.yaml")
    project = PROJECT["project"]
    wanted = [re.fullmatch(r"([\w-]+)(?:\[\w+\])?>=([\d.]+)", line) for line in project["dependencies"]]
    names = {f"{CONDA_NAMES.get(found[1], found[1])} >={found[2]}" for found in wanted if found}
    assert len(names) == len(project["dependencies"])
    assert set(recipe["requirements"]["run"]) == names | OF_EXTRAS | {f"python {project['requires-python']}"}
    assert recipe["context"] == {"name": "sloshlab", "version": __version__}
    [[command, place]] = project["scripts"].items()
    assert recipe["build"]["python"]["entry_points"] == [f"{command} = {place}"]
    assert PROJECT["build-system"]["requires"] == ["setuptools>=77"]
    assert "setuptools >=77" in recipe["requirements"]["host"]


def test_hosted_checks_cover_systems_and_versions() -> None:
    jobs = loaded(".github/workflows/ci.yml")["jobs"]
    matrix = jobs["test"]["strategy"]["matrix"]
    assert {name.removesuffix("-latest") for name in matrix["system"]} == {"ubuntu", "macos", "windows"}
    assert matrix["python"] == ["3.11", "3.12", "3.13", "3.14"]
    assert PROJECT["project"]["requires-python"] == ">=3.11"
    targets = set(re.findall(r"^([a-z-]+):", (REPOSITORY / "Makefile").read_text("utf-8"), flags=re.MULTILINE))
    for job in jobs.values():
        assert job["timeout-minutes"] <= 60
        for step in job["steps"]:
            assert re.fullmatch(r"[\w./-]+@v\d+", step.get("uses", "a/b@v1"))
            for line in step.get("run", "").splitlines():
                assert not line.startswith("make ") or set(line.split()[1:]) <= targets


def test_pre_commit_runs_the_tools_of_make() -> None:
    hooks = {hook["id"]: hook for part in loaded(".pre-commit-config.yaml")["repos"] for hook in part["hooks"]}
    assert {"ruff-check", "ruff-format", "mypy", "import-linter", "markdown-lines"} <= hooks.keys()
    for hook in hooks.values():
        assert hook["language"] == "pygrep" or hook["entry"].startswith(".venv/bin/")


@pytest.mark.parametrize(
    ("line", "is_refused"),
    [("x" * 120, False), ("x" * 121, True), ("- https://example.org/" + "x" * 120, False), ("| a |" * 30, True)],
)
def test_pre_commit_refuses_long_lines_of_markdown(line: str, is_refused: bool) -> None:
    [hook] = [
        hook for hook in loaded(".pre-commit-config.yaml")["repos"][0]["hooks"] if hook["language"] == "pygrep"
    ]
    assert bool(re.search(hook["entry"], line)) == is_refused


def test_every_file_that_is_no_program_is_in_the_package() -> None:
    data = PROJECT["tool"]["setuptools"]["package-data"]
    for package, patterns in data.items():
        folder = REPOSITORY / package
        kept = {path for pattern in patterns for path in folder.glob(pattern)}
        others = {
            path
            for path in folder.rglob("*")
            if path.is_file()
            and path.suffix not in (".py", ".pyc", ".nbi", ".nbc")
            and "archive" not in path.parts
        }
        assert others <= kept
