"""What benchmarks keep: one entry per revision and machine, and how much of each aim was used."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import pytest

from tests.benchmarks.__main__ import AIMS, AT_LEAST, GROUPS
from tests.benchmarks.history import HISTORY, described, draw, keep, machine, over_aims, with_entry
from tests.benchmarks.own_process import MeasurementError, measured_apart
from tests.benchmarks.table import ROWS, table
from tests.benchmarks.twin import RIVAL_LABEL


def run(revision: str, **figures: float) -> dict[str, object]:
    return {"revision": revision, "date": "2026-01-01", "machine": "m", "figures": figures}


def test_groups_of_one_run_share_an_entry_and_others_keep_theirs() -> None:
    history = with_entry([], run("a", x=1.0, y=2.0))
    history = with_entry(history, run("b", x=3.0))
    history = with_entry(history, run("a", y=20.0, z=math.inf))
    assert [(entry["revision"], entry["figures"]) for entry in history] == [
        ("b", {"x": 3.0}),
        ("a", {"x": 1.0, "y": 20.0}),
    ]
    other = with_entry(history, {**run("a", x=5.0), "machine": "another"})
    assert len(other) == 3


def test_figures_above_and_below_their_aims_are_told_apart() -> None:
    history = [run("a", time=3.0, ratio=25.0), run("b", time=1.5, ratio=100.0, lost=0.0)]
    used = over_aims(history, {"time": 2.0, "lost": 0.0, "absent": 1.0}, {"ratio": 50.0})
    assert used == {"time": [1.5, 0.75], "ratio": [2.0, 0.5]}


def test_a_run_is_kept_with_its_machine_and_groups_are_joined(tmp_path: Path) -> None:
    path = tmp_path / "results" / "bench.json"
    about = {"revision": "a", "date": "2026-01-01", "machine": machine()}
    keep({"x": 1.0}, about, path)
    keep({"y": 2.0}, about, path)
    found = json.loads(path.read_text(encoding="utf-8"))
    assert found["figures"] == {"x": 1.0, "y": 2.0}
    assert "cores" in found["machine"]
    keep({"z": 3.0}, about | {"revision": "b"}, path)
    assert json.loads(path.read_text(encoding="utf-8"))["figures"] == {"z": 3.0}
    assert all(described().values())


def test_the_kept_history_knows_every_aim_that_it_is_drawn_with(tmp_path: Path) -> None:
    history = json.loads(HISTORY.read_text(encoding="utf-8"))
    for entry in history:
        assert set(entry) == {"revision", "date", "machine", "figures"}
        assert all(math.isfinite(value) for value in entry["figures"].values())
    assert over_aims(history, AIMS, AT_LEAST)
    draw(history, tmp_path / "history.png")
    assert (tmp_path / "history.png").stat().st_size > 10_000


def test_a_group_that_is_not_there_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    from tests.benchmarks.__main__ import main

    monkeypatch.setattr("sys.argv", ["benchmarks", "twins"])
    with pytest.raises(SystemExit, match=r"got twins; allowed: analysis, twin"):
        main()
    assert {"analysis", "formats", "flights", "scaling"} <= set(GROUPS)


def test_a_group_that_fails_is_named_and_the_others_are_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from tests.benchmarks import __main__ as bench

    def crashed() -> dict[str, float]:
        return measured_apart("timeit", "-n", "1", "-r", "1", "raise ValueError('the sensor fell off')")

    def left() -> dict[str, float]:
        sys.exit("nobody recorded")

    groups = {"first": crashed, "second": lambda: {"seconds": 1.0}, "third": left, "last": lambda: {"ratio": 2.0}}
    monkeypatch.setattr(bench, "GROUPS", groups)
    monkeypatch.setattr("sys.argv", ["benchmarks"])
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        bench.main()
    assert ended.value.code == 1
    assert json.loads(Path("results/bench.json").read_text(encoding="utf-8"))["figures"] == {
        "seconds": 1.0,
        "ratio": 2.0,
    }
    said = capsys.readouterr().out.splitlines()
    assert said[-2:] == ["first: FAILED: ValueError: the sensor fell off", "third: FAILED: nobody recorded"]
    assert any(line.split() == ["ratio", "2"] for line in said)


def test_figures_of_a_process_are_its_last_line_and_anything_else_is_an_error() -> None:
    assert measured_apart("tests.benchmarks.measurements", "blas")["product_s"] > 0
    with pytest.raises(MeasurementError, match="printed no figures"):
        measured_apart("this")


def test_a_run_without_misses_and_failures_ends_well(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tests.benchmarks import __main__ as bench

    monkeypatch.setattr(bench, "GROUPS", {"only": lambda: {"seconds": 1.0}})
    monkeypatch.setattr("sys.argv", ["benchmarks", "only"])
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        bench.main()
    assert ended.value.code == 0


def test_the_table_gives_a_reason_where_an_aim_is_missed_and_nowhere_else() -> None:
    rival = RIVAL_LABEL.format("DOP853")
    cells = {
        line.split(" | ")[0][2:]: [cell.strip(" |") for cell in line.split(" | ")]
        for line in table({rival: 49.0, "networks": 1.0, "10 × longer recording costs": 10.0}).splitlines()[2:]
    }
    reasons = {row.work: row.reason for row in ROWS}
    assert cells["the same, DOP853"][1:] == ["33.8", "≥ 50", "49", reasons["the same, DOP853"]]
    assert cells["ten times the recording over one"][1:] == ["8.68", "≤ 10", "10", ""]
    assert cells["10 s of beam and model 60 × 20 [s]"][2:4] == ["≤ 0.012", "not measured"]
    assert table({rival: 51.0}).count(reasons["the same, DOP853"]) == 0
    # a label that no figure has would never be filled
    assert {row.label for row in ROWS} <= set(AIMS) | set(AT_LEAST)
