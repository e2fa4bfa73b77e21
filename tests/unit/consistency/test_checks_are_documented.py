"""The page on consistency names every check, and no other."""

from __future__ import annotations

import re
from pathlib import Path

from sloshlab.consistency.samples import SAMPLE_CHECKS

ROOT = Path(__file__).parents[3]


def test_every_check_is_in_the_table():
    code = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "sloshlab/consistency").glob("*.py"))
    named = set(re.findall(r'contradiction\(\s*"([^"]+)"', code)) - {"gain"} | set(SAMPLE_CHECKS)
    page = (ROOT / "docs/consistency.md").read_text(encoding="utf-8")
    table = page.split("## What is examined")[1].split("###")[0]
    assert set(re.findall(r"^\| `([^`]+)` \|", table, flags=re.MULTILINE)) == named
