"""Writes the commit into what is built, for `sloshlab info`; everything else stands in pyproject.toml."""

from __future__ import annotations

import subprocess
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

ROOT = Path(__file__).resolve().parent


def git(*words: str) -> str:
    """What git says."""
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout


def write_commit(package: Path) -> None:
    """Write `commit.txt` into a package; a source distribution, which is no checkout, brings its own."""
    if not (ROOT / ".git").exists():
        return
    words = (["git", "rev-parse", "HEAD"], ["git", "status", "--porcelain", "--untracked-files=no"])
    try:
        found, changes = (
            subprocess.run(w, cwd=ROOT, capture_output=True, text=True, check=True).stdout for w in words
        )
    except (OSError, subprocess.CalledProcessError):
        return
    (package / "commit.txt").write_text(f"{found.strip()}{', changed' if changes else ''}\n", encoding="ascii")


class BuildWithCommit(build_py):
    """Builds the packages and writes the commit."""

    def run(self) -> None:
        """Build."""
        super().run()
        # an editable installation runs the checkout, which tells its commit itself
        if not self.editable_mode:
            write_commit(Path(self.build_lib) / "sloshlab")


class SourcesWithCommit(sdist):
    """Packs the sources and writes the commit."""

    def make_release_tree(self, base_dir: str, files: list[str]) -> None:
        """Pack."""
        super().make_release_tree(base_dir, files)
        write_commit(Path(base_dir) / "sloshlab")


setup(cmdclass={"build_py": BuildWithCommit, "sdist": SourcesWithCommit})
