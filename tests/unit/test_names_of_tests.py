"""Names of test files: folders without packages share one space of names."""

from __future__ import annotations

from collections import Counter
from pathlib import Path


def test_no_two_test_files_have_one_name(repository: Path) -> None:
    # pytest collects only the first of them and ends the whole run at the second
    names = Counter(path.name for path in (repository / "tests").rglob("test_*.py"))
    assert not [name for name, count in names.items() if count > 1]
