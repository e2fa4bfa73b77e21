"""Table and page of a campaign: every task in a row, names of files are text and nothing else."""

from __future__ import annotations

import csv
import io

import pytest

from campaigns.outcome import Outcome
from campaigns.stored_task import StoredTask
from pipelines.campaign.run import failure_lines
from pipelines.campaign.summary_page import MOST_ROWS, CarriedOut, page_of
from pipelines.campaign.summary_tables import summary_csv, timings_csv
from pipelines.report.page import drawn_sections, page_html

HOSTILE = '<script>alert("1")</script>'
ENDS = {
    "a": Outcome("done", "k", seconds=2.0, numbers={"windows": 7}, flags=("one", "two"), made_by={"host": "h"}),
    HOSTILE: Outcome("failed", "k", line="=HYPERLINK(1)\nand more", seconds=1.0),
    "-c": Outcome("died", "k", line="its process was ended by SIGKILL", attempts=3, seconds=0.5),
    "d": Outcome("done", "k", seconds=4.0, numbers={"damping_ratio": 0.01234}, made_by={"host": "h"}),
}


def carried(ends=ENDS) -> CarriedOut:
    return CarriedOut(tuple(StoredTask(name, "f") for name in ends), ends, 1)


def html(found: CarriedOut) -> str:
    page = page_of(found, {"command": "sloshlab campaign"})
    return page_html(page, drawn_sections(page.plans))


def test_the_table_has_a_row_for_every_task():
    found = carried()
    rows = list(csv.DictReader(io.StringIO(summary_csv(found.tasks, found.outcomes).decode())))
    assert [row["status"] for row in rows] == ["done", "failed", "died", "done"]
    assert [(row["windows"], row["damping_ratio"]) for row in rows] == [
        ("7", ""),
        ("", ""),
        ("", ""),
        ("", "0.01234"),
    ]
    assert (rows[0]["n_flags"], rows[0]["flags"]) == ("2", "one; two")
    # a spreadsheet takes neither for a formula
    assert (rows[1]["reason"], rows[2]["task"]) == ("'=HYPERLINK(1) and more", "'-c")
    timings = list(csv.DictReader(io.StringIO(timings_csv(found.tasks, found.outcomes).decode())))
    assert [(row["seconds"], row["attempts"]) for row in timings][2] == ("0.5", "3")


def test_a_name_that_is_no_unicode_does_not_stop_the_table_nor_the_page():
    name = b"run_\xff".decode(errors="surrogateescape")
    found = carried({name: ENDS["a"]})
    assert rb"run_\udcff" in summary_csv(found.tasks, found.outcomes)
    assert "run_" in html(found)


def test_the_page_says_what_failed_and_no_name_is_markup():
    text = html(carried())
    assert "2 of 4 tasks are done." in text
    assert "1 died: its process ended, as often as it was tried." in text
    assert "<script>" not in text
    assert "&lt;script&gt;" in text
    assert "SIGKILL" in text


def test_a_page_of_very_many_tasks_shows_some_and_says_so():
    text = html(carried({f"t{number}": ENDS["a"] for number in range(MOST_ROWS + 5)}))
    assert f"The first {MOST_ROWS} of {MOST_ROWS + 5}; summary.csv has all." in text
    assert f"<td>t{MOST_ROWS - 1}</td>" in text
    assert f"<td>t{MOST_ROWS}</td>" not in text


def test_every_failure_is_a_line():
    lines = failure_lines(carried().tasks, ENDS)
    assert lines[1] == "-c died: its process was ended by SIGKILL"
    assert len(lines) == 2


@pytest.mark.parametrize("seconds", [0.0, 1e-9])
def test_tasks_that_took_no_time_have_a_page(seconds):
    assert "1 of 1" in html(carried({"a": Outcome("done", "k", seconds=seconds)}))
