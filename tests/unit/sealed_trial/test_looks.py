"""The list of looks at what judges."""

from __future__ import annotations

import csv
import re
from datetime import UTC, datetime

import pytest

from sealed_trial.scoring import looks
from sealed_trial.scoring.acceptance import Aim
from sloshlab.errors import InputError

AIMS = (
    Aim("wrong names anywhere", 0.0, 0.01, 0.025, 0.004, 0.13, 40, False, "cannot tell"),
    Aim("pairs with both names", 0.8, 1.0, float("nan"), 0.0, 1.0, 0, False, "cannot tell"),
)
AT = datetime(2026, 3, 2, 9, 30, tzinfo=UTC)


def test_every_look_is_a_line(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(looks, "revision", lambda: "v1-3-gabc")
    for half in ("even", "both"):
        path = looks.note_look(tmp_path / "scores", {"trials": "t1 t2", "half": half}, AIMS, at=AT)
    assert path == tmp_path / "looks.csv"
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["half"] for row in rows] == ["even", "both"]
    assert rows[0] == {
        "date_utc": "2026-03-02T09:30:00+00:00",
        "revision": "v1-3-gabc",
        "trials": "t1 t2",
        "half": "even",
        "wrong names anywhere": "0.025 of 40",
        "pairs with both names": "none",
    }


def test_a_list_of_another_version_is_left_alone(tmp_path) -> None:
    (tmp_path / "looks.csv").write_text("date,half\n1,2\n")
    with pytest.raises(InputError, match="other columns"):
        looks.note_look(tmp_path / "scores", {}, AIMS, at=AT)
    assert (tmp_path / "looks.csv").read_text() == "date,half\n1,2\n"


def test_the_revision_is_unknown_where_nobody_can_tell(monkeypatch) -> None:
    assert re.fullmatch(r"unknown|\S*[0-9a-f]{7,}(-dirty)?|v\S+", looks.revision())
    monkeypatch.setenv("PATH", "")
    assert looks.revision() == "unknown"
