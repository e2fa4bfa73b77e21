"""What is installed: version, commit, Python, platform, and the versions of everything that sloshlab stands on."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import re
import subprocess
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from sloshlab import __version__

_PACKAGE: Final = Path(__file__).resolve().parents[2] / "sloshlab"
COMMIT_FILE: Final = "commit.txt"
"""In the package; `setup.py` writes it into what it builds."""
_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")
_EXTRA: Final = re.compile(r"""extra\s*==\s*["']([^"']+)["']""")
UNKNOWN: Final = "unknown"


@dataclass(frozen=True)
class Installation:
    """What is installed here.

    Attributes
    ----------
    version, commit : str
        Of sloshlab; the commit ends with ``, changed`` where files differ from it, and is ``unknown`` where
        nothing tells.
    python, platform, processors : str, str, int
    dependencies : dict of str to str
        Versions by package; ``not installed`` where it is absent.
    extras : dict of str to list of str
        What of each extra is absent.
    """

    version: str
    commit: str
    python: str
    platform: str
    processors: int
    dependencies: dict[str, str]
    extras: dict[str, list[str]]

    def lines(self) -> list[str]:
        """The same for people, ready to be pasted."""
        extras = [
            f"{name} (without {', '.join(absent)})" if absent else name for name, absent in self.extras.items()
        ]
        return [
            f"sloshlab {self.version}, commit {self.commit}",
            f"Python {self.python} on {self.platform}, {self.processors} processors",
            *(f"  {name} {version}" for name, version in self.dependencies.items()),
            f"extras: {'; '.join(extras) or 'not known, since the package is not installed'}",
        ]

    def facts(self) -> dict[str, Any]:
        """The same for programs."""
        return asdict(self)


def installation() -> Installation:
    """What is installed here."""
    required, optional = _requirements()
    extras = {
        name: [package for package in packages if _version_of(package) is None]
        for name, packages in optional.items()
    }
    return Installation(
        __version__,
        commit(),
        f"{platform.python_version()} ({platform.python_implementation()})",
        platform.platform(),
        os.cpu_count() or 1,
        {package: _version_of(package) or "not installed" for package in required},
        extras,
    )


def version_lines() -> list[str]:
    """The version on a line of its own, for programs; then what it stands on."""
    required, _ = _requirements()
    versions = ", ".join(f"{package} {_version_of(package) or 'not installed'}" for package in required)
    return [__version__, f"commit {commit()}, Python {platform.python_version()}", versions]


def commit(package: Path = _PACKAGE) -> str:
    """Commit of a git checkout, or the one that the package was built from.

    Parameters
    ----------
    package : Path
        Folder of the package `sloshlab`.
    """
    written = package / COMMIT_FILE
    if written.is_file():
        return written.read_text(encoding="ascii").strip() or UNKNOWN
    # a package that lies in somebody else's checkout, such as a virtual environment, is none of it
    if not (package.parent / ".git").exists():
        return UNKNOWN
    try:
        found = _git(package.parent, "rev-parse", "HEAD")
        changed = ", changed" if _git(package.parent, "status", "--porcelain", "--untracked-files=no") else ""
    except (OSError, subprocess.SubprocessError):
        return UNKNOWN
    return f"{found}{changed}"


def _git(folder: Path, *words: str) -> str:
    done = subprocess.run(
        ["git", "-C", str(folder), *words], capture_output=True, text=True, check=True, timeout=10
    )
    return done.stdout.strip()


def _version_of(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _requirements() -> tuple[list[str], dict[str, list[str]]]:
    """Packages that are always needed, and those of each extra, as the installed package declares them."""
    required: list[str] = []
    optional: dict[str, list[str]] = {}
    for line in _declared():
        name, extra = _NAME.match(line), _EXTRA.search(line)
        if name and extra:
            optional.setdefault(extra[1], []).append(name[0])
        elif name:
            required.append(name[0])
    return required, optional


def _declared() -> Iterator[str]:
    try:
        yield from importlib.metadata.requires("sloshlab") or ()
    except importlib.metadata.PackageNotFoundError:  # run from a folder without being installed
        return
