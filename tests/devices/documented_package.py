"""The package of another author that a page of the documentation shows, installed as far as Python looks."""

from __future__ import annotations

import contextlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest


@contextlib.contextmanager
def installed_from(page: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Install the entry point of a page and the code that it shows with it, until the end."""
    text = page.read_text(encoding="utf-8")
    ((group, entry, package, module, code),) = re.findall(
        r'^```toml\n\[project\.entry-points\."(.+)"\]\n(\w+ = "(\w+)\.(\w+):\w+")\n```\n\n```python\n(.*?)^```',
        text,
        re.MULTILINE | re.DOTALL,
    )
    (folder / package).mkdir()
    (folder / package / f"{module}.py").write_text(code, encoding="utf-8")
    metadata = folder / f"{package}-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(f"[{group}]\n{entry.replace(chr(34), '')}\n")
    monkeypatch.syspath_prepend(folder)
    yield
    for name in (f"{package}.{module}", package):
        sys.modules.pop(name, None)
