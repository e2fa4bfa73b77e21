"""Diagnosing the cases one after the other, and comparing what was answered with what is right."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from studies.other_laboratories.case_files import RightAnswer

RECORD: Final = "answer.json"
_REFUSED: Final = 1


def diagnose(home: Path) -> Mapping[str, Any]:
    """Run ``sloshlab diagnose`` on one case; keep and return exit code, seconds, verdict and last line.

    Parameters
    ----------
    home : Path
        Folder of the case as `write_case` made it.
    """
    command = [sys.executable, "-m", "pipelines.command_line", "diagnose", str(home / "case"), "--no-report"]
    command += ["-o", str(home / "diagnosis")]
    if (home / "twin.py").exists():
        command += ["--twin", str(home / "twin.py")]
    began = time.monotonic()
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    seconds = time.monotonic() - began
    said = ended.stderr.strip().splitlines()
    file = home / "diagnosis" / "verdict.json"
    refused = ended.returncode == _REFUSED
    verdict = {} if refused or not file.exists() else json.loads(file.read_text(encoding="utf-8"))
    record = {
        "exit_code": ended.returncode,
        "seconds": round(seconds, 1),
        "verdict": verdict,
        "line": said[-1] if said else "",
    }
    (home / RECORD).write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    return record


def is_right(right: RightAnswer, record: Mapping[str, Any]) -> bool:
    """Whether an answer is one that is right.

    Parameters
    ----------
    right : RightAnswer
    record : mapping
        As `diagnose` returns it.
    """
    if right.verdict == "refused":
        return record["exit_code"] == _REFUSED and right.says in record["line"]
    facts = record["verdict"]
    if facts.get("verdict") != right.verdict or right.says not in facts.get("statement", ""):
        return False
    effects = facts.get("effects", [])
    if right.verdict == "unknown":
        return not right.block or {effect["block"] for effect in effects} <= {right.block}
    named = [{effect["name"] for effect in effects}]
    if right.verdict == "indistinguishable":
        named += [set(names) for names in facts.get("alternatives", [])]
    # A statement that a believed number is refuted may come with any name.
    return bool(right.says) or right.verdict == "nothing_missing" or set(right.effects) in named


def row(home: Path) -> str:
    """Case – right – answered – seconds, as a row of a table."""
    truth = json.loads((home / "truth.json").read_text(encoding="utf-8"))
    right = [RightAnswer(**{**answer, "effects": tuple(answer["effects"])}) for answer in truth["right"]]
    wanted = " or ".join(dict.fromkeys(_words(answer) for answer in right))
    file = home / RECORD
    if not file.exists():
        return f"| {home.name} | {wanted} | not diagnosed | – | – |"
    record = json.loads(file.read_text(encoding="utf-8"))
    good = any(is_right(answer, record) for answer in right)
    return (
        f"| {home.name} | {wanted} | {_answered(record)} | {'yes' if good else 'NO'} | {record['seconds']:.0f} |"
    )


def table(folder: Path) -> list[str]:
    """Rows of all cases of a folder, and how many were right."""
    rows = [row(file.parent) for file in sorted(folder.glob("*/truth.json"))]
    n_right = sum("| yes |" in line for line in rows)
    head = ["| case | right | answered | is right | seconds |", "|---|---|---|---|---|"]
    return [*head, *rows, "", f"right: {n_right} of {len(rows)}"]


def _words(answer: RightAnswer) -> str:
    of = " + ".join(answer.effects) or answer.block or answer.says
    if answer.verdict in ("named", "indistinguishable") and answer.effects:
        return of
    return f"{answer.verdict} ({of})" if of else answer.verdict


def _answered(record: Mapping[str, Any]) -> str:
    facts = record["verdict"]
    if not facts:
        return f"exit code {record['exit_code']}: {record['line'][:160]}".replace("|", "/")
    effects = " + ".join(f"{effect['block']}.{effect['name']}" for effect in facts.get("effects", []))
    return f"{facts['verdict']} {effects}".strip()
