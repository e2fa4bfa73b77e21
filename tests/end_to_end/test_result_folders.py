"""The files of one run of a command belong together, and say which run made them."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import netCDF4
import pytest
from short_runs import INPUT_IS_BAD, assert_one_line, contents, leftovers, shaker_arguments

import pipelines.report.result_folder
import pipelines.sweep.report
from pipelines.command_line import run
from pipelines.sweep.sections import planned_sections

pytestmark = pytest.mark.usefixtures("programs_are_forks")

DATA = {"windows.nc", "maps.nc", "result.json"}


@pytest.fixture
def analyse(laboratory: Path) -> Callable[..., int]:
    """`sloshlab shaker` on two runs; a report only if asked for."""

    def shaker(out: Path, *options: str, report: bool = False) -> int:
        runs = [laboratory / "sweep_3g.nc", laboratory / "empty.nc"]
        arguments = [*shaker_arguments(runs, [laboratory / "rig.toml"], out), *options]
        return run([word for word in arguments if word != "--no-report" or not report])

    return shaker


def png_texts(png: bytes) -> dict[bytes, bytes]:
    """Textual chunks, read as the PNG specification has them: length, type, content, checksum."""
    found, place = {}, 8
    while place < len(png):
        length = int.from_bytes(png[place : place + 4], "big")
        kind, content = png[place + 4 : place + 8], png[place + 8 : place + 8 + length]
        if kind == b"tEXt":
            keyword, _, text = content.partition(b"\0")
            found[keyword] = text
        place += 12 + length
    return found


def identifiers(out: Path) -> set[str]:
    """Of every file of a result."""
    found = {json.loads((out / "result.json").read_text())["result_id"]}
    for path in out.rglob("*"):
        if path.suffix == ".nc":
            with netCDF4.Dataset(path) as dataset:
                found.add(dataset.result_id)
        elif path.suffix == ".html":
            found |= set(re.findall(r'<meta name="result_id" content="([0-9a-f]+)">', path.read_text()) or [""])
        elif path.suffix == ".png":
            found.add(png_texts(path.read_bytes()).get(b"result_id", b"").decode())
    return found


def some_figures(monkeypatch: pytest.MonkeyPatch, n_figures: int) -> None:
    """The first of a report, in place of all."""

    def first_section(experiment: Any) -> list[Any]:
        [first, *_] = planned_sections(experiment)
        return [replace(first, figures=first.figures[:n_figures])]

    monkeypatch.setattr(pipelines.sweep.report, "planned_sections", first_section)


def test_every_file_carries_one_identifier_and_an_old_report_goes(analyse, tmp_path: Path, monkeypatch) -> None:
    some_figures(monkeypatch, 6)
    out = tmp_path / "out"
    assert analyse(out, report=True) == 0
    [first] = identifiers(out)
    assert re.fullmatch("[0-9a-f]{16}", first)
    assert len(list((out / "figures").glob("*.png"))) > 5
    (out / "notes.txt").write_text("mine")
    (out / "figures" / "photo.png").write_text("mine, too")
    assert analyse(out, "--m", "12") == 0
    assert set(contents(out) or {}) == {*DATA, "notes.txt", "figures/photo.png"}
    (out / "figures" / "photo.png").unlink()
    [second] = identifiers(out)
    assert second != first


def test_the_identifier_follows_from_inputs_and_settings_not_from_the_place(analyse, tmp_path: Path) -> None:
    for name in ("first", "second"):
        assert analyse(tmp_path / name) == 0
    assert contents(tmp_path / "first") == contents(tmp_path / "second")
    assert analyse(tmp_path / "third", "--boundaries", "law") in (0, 3)
    assert identifiers(tmp_path / "first") != identifiers(tmp_path / "third")


def test_a_folder_in_the_place_of_a_file_costs_nothing(analyse, tmp_path: Path, capsys: Any) -> None:
    out = tmp_path / "out"
    assert analyse(out) == 0
    (out / "windows.nc").unlink()
    (out / "windows.nc").mkdir()
    before = contents(out)
    assert analyse(out, "--m", "12") == INPUT_IS_BAD
    assert_one_line(capsys.readouterr().err, "windows.nc", "a folder in the place of a file")
    assert contents(out) == before


def test_one_that_appears_meanwhile_costs_nothing_either(analyse, tmp_path: Path, monkeypatch, capsys) -> None:
    out = tmp_path / "out"
    assert analyse(out) == 0
    before = contents(out)
    original = pipelines.report.result_folder.require_free_places
    calls = []

    def slow(*arguments: Any) -> None:
        original(*arguments)
        calls.append(arguments)
        if len(calls) == 2:  # after the last look
            (out / "windows.nc").unlink()
            (out / "windows.nc").mkdir()

    monkeypatch.setattr(pipelines.report.result_folder, "require_free_places", slow)
    assert analyse(out, "--m", "12") == INPUT_IS_BAD
    assert_one_line(capsys.readouterr().err, "windows.nc")
    (before or {}).pop("windows.nc")
    assert contents(out) == before
    assert leftovers(out) == []


@pytest.mark.parametrize("is_changed", [True, False])
def test_what_is_no_earlier_result_is_not_replaced(is_changed, analyse, tmp_path: Path, capsys: Any) -> None:
    out = tmp_path / "out"
    out.mkdir()
    if is_changed:
        assert analyse(out) == 0
    (out / "windows.nc").write_bytes(b"a measurement")
    before = contents(out)
    assert analyse(out, "--m", "12") == INPUT_IS_BAD
    assert_one_line(capsys.readouterr().err, "windows.nc", "did not write", "another folder")
    assert contents(out) == before


def test_a_manifest_from_elsewhere_vouches_for_nothing_outside_its_folder(analyse, tmp_path: Path) -> None:
    out, letter = tmp_path / "out", tmp_path / "letter.txt"
    letter.write_text("mine")
    assert analyse(out) == 0
    manifest = json.loads((out / "result.json").read_text())
    digest = pipelines.report.result_folder.sha256_of(letter)
    (out / "link").symlink_to(tmp_path)
    manifest["files"] |= {"../letter.txt": digest, str(letter): digest, "link/letter.txt": digest}
    (out / "result.json").write_text(json.dumps(manifest))
    assert analyse(out, "--m", "12") == 0
    assert letter.read_text() == "mine"


def test_results_are_not_written_through_a_link(analyse, tmp_path: Path, monkeypatch, capsys: Any) -> None:
    some_figures(monkeypatch, 1)
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    out.mkdir()
    elsewhere.mkdir()
    (out / "figures").symlink_to(elsewhere)
    assert analyse(out, report=True) == INPUT_IS_BAD
    assert_one_line(capsys.readouterr().err, "a link in the place of a folder", "another folder")
    assert list(elsewhere.iterdir()) == []
    assert [path.name for path in out.iterdir()] == ["figures"]
