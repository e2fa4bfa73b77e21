"""What `make setup` installs is pinned, with hashes, and what pyproject.toml asks for is in it."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

REPOSITORY = Path(__file__).parents[2]
PROJECT: dict[str, Any] = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
INSTALLED_EXTRAS = ("formats", "interactive", "dev", "docs", "trial", "live", "aircraft")
WANTED = [
    *PROJECT["project"]["dependencies"],
    *(line for extra in INSTALLED_EXTRAS for line in PROJECT["project"]["optional-dependencies"][extra]),
    *PROJECT["build-system"]["requires"],
]


def locked() -> list[tuple[Requirement, list[str]]]:
    """Every entry of the lock file with its hashes."""
    text = (REPOSITORY / "requirements.lock").read_text(encoding="utf-8")
    joined = re.sub(r"\\\n\s*", "", text)
    entries = []
    for line in joined.splitlines():
        if line.strip() and not line.startswith("#"):
            requirement, *hashes = line.split(" --hash=")
            entries.append((Requirement(requirement), [value.strip() for value in hashes]))
    return entries


def test_everything_is_pinned_to_one_version_with_hashes() -> None:
    entries = locked()
    assert len(entries) > 50
    for requirement, hashes in entries:
        assert re.fullmatch(r"==[^,*]+", str(requirement.specifier)), requirement
        assert hashes, requirement
        assert all(re.fullmatch(r"sha256:[0-9a-f]{64}", value) for value in hashes), requirement


@pytest.mark.parametrize("line", WANTED)
def test_what_the_project_asks_for_is_in_the_lock_file_and_new_enough(line: str) -> None:
    wanted = Requirement(line)
    name = canonicalize_name(wanted.name)
    found = [requirement for requirement, _ in locked() if canonicalize_name(requirement.name) == name]
    assert found, f"{name} is not locked; run make lock"
    for requirement in found:
        version = str(requirement.specifier).removeprefix("==")
        assert wanted.specifier.contains(version, prereleases=True), f"{name} {version}; run make lock"


@pytest.mark.skipif(shutil.which("make") is None, reason="no make")
@pytest.mark.parametrize(("options", "is_locked"), [([], True), (["LOCK="], False)])
def test_setup_installs_what_is_locked_unless_told_otherwise(
    options: list[str], is_locked: bool, tmp_path: Path
) -> None:
    made = subprocess.run(
        ["make", "--dry-run", "setup", f"VENV={tmp_path / 'venv'}", *options],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=True,
    )
    assert ("--require-hashes --requirement requirements.lock" in made.stdout) is is_locked
    extras = f".[{','.join(INSTALLED_EXTRAS)}]"
    # what is locked must not be resolved once more, nor the tools that build the package
    assert ("--no-deps --no-build-isolation" in made.stdout) is is_locked
    assert (extras in made.stdout) is not is_locked


@pytest.mark.skipif(shutil.which("make") is None, reason="no make")
def test_the_newest_are_tried_in_an_environment_of_their_own() -> None:
    made = subprocess.run(
        ["make", "--dry-run", "test-newest"], cwd=REPOSITORY, capture_output=True, text=True, check=True
    )
    assert "requirements.lock" not in made.stdout
    assert ".venv-newest/bin/python -m pytest" in made.stdout
    assert " .venv/" not in made.stdout
