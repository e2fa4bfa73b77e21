"""Case folders: whole or not at all, every defect in a line of its own, and what the runs can decide."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest
import xarray as xr

from pipelines.diagnosis.case_builder import check_case, new_case
from sloshlab.errors import InputError
from sloshlab.identification.case import read_case


@pytest.fixture
def given(repository: Path, tmp_path: Path) -> Path:
    """A rig file and four recordings of one rig, in a folder of their own."""
    folder = tmp_path / "given"
    shutil.copytree(repository / "raw_data" / "cases" / "nothing-hidden" / "case", folder)
    return folder


def changed(path: Path, **attributes: Any) -> None:
    """Write a recording anew with other global attributes; None takes one away."""
    with xr.open_dataset(path, mask_and_scale=False, decode_times=False) as opened:
        recording = opened.load()
    for name, value in attributes.items():
        if value is None:
            del recording.attrs[name]
        else:
            recording.attrs[name] = value
    encoding = {str(name): {"_FillValue": None} for name in recording.variables}
    recording.to_netcdf(path, format="NETCDF4", engine="netcdf4", encoding=encoding)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("link", [False, True])
def test_a_case_is_what_was_given_copied_or_linked(given: Path, tmp_path: Path, link: bool) -> None:
    summary = new_case(tmp_path / "case", given / "rig.toml", [given / "recordings"], link=link)
    assert summary["defects"] == []
    assert contents(tmp_path / "case") == contents(given)
    places = sorted((tmp_path / "case" / "recordings").iterdir())
    assert [place.is_symlink() for place in places] == [link] * 4
    assert [run.name for run in read_case(tmp_path / "case").runs] == ["run_01", "run_02", "run_03", "run_04"]


def test_what_the_runs_can_decide_and_what_is_lacking_is_said(given: Path, tmp_path: Path) -> None:
    runs = [given / "recordings" / name for name in ("run_01.nc", "run_03.nc")]
    summary = new_case(tmp_path / "case", given / "rig.toml", runs)
    assert any(line.startswith("2 runs of sdof_free, sloshing: ") for line in summary["lines"])
    assert "how far the rig repeats itself" in summary["impossible"]
    assert "run_01 once more, nothing changed" in summary["lacking"]
    whole = new_case(tmp_path / "whole", given / "rig.toml", [given / "recordings"])
    assert "how far the rig repeats itself" in whole["possible"]


def test_every_defect_is_one_line_and_nothing_is_made(given: Path, tmp_path: Path) -> None:
    recordings = given / "recordings"
    (recordings / "run_02.nc").write_bytes(b"no netCDF")
    changed(recordings / "run_03.nc", experiment="beam_free")
    changed(recordings / "run_04.nc", sampling_rate_hz=None)
    shutil.copyfile(recordings / "run_01.nc", recordings / "run_01_again.nc")
    (given / "rig.toml").write_text("[tank]\nheight_m = -1\n")
    summary = new_case(tmp_path / "case", given / "rig.toml", [recordings, given / "lost.nc"])
    beginnings = ("rig.toml", "run_01_again.nc", "run_02.nc", "run_04.nc", "lost.nc")
    for part in beginnings:
        [line] = [line for line in summary["defects"] if part in line.partition(": got")[0]]
        assert "allowed: " in line
        assert "\n" not in line
    assert len(summary["defects"]) == len(beginnings)
    assert not (tmp_path / "case").exists()


@pytest.mark.parametrize(
    ("change", "fragments"),
    [
        ({"experiment": "beam_free"}, ("experiment: got beam_free on a rig whose structure is sdof", "remedy: ")),
        ({"rig": "other.toml"}, ("got of 2 rigs: other.toml, rig.toml", "allowed: one rig per case")),
    ],
)
def test_a_recording_of_another_rig_is_refused(
    change: dict[str, str], fragments: tuple[str, ...], given: Path, tmp_path: Path
) -> None:
    changed(given / "recordings" / "run_03.nc", **change)
    [defect] = new_case(tmp_path / "case", given / "rig.toml", [given / "recordings"])["defects"]
    assert all(fragment in defect for fragment in fragments)
    assert not (tmp_path / "case").exists()


def test_a_twin_of_another_size_is_refused_before_a_search(given: Path) -> None:
    text = (given / "rig.toml").read_text()
    line = next(line for line in text.splitlines() if line.startswith("stiffness_n_per_m"))
    (given / "rig.toml").write_text(text.replace(line, "stiffness_n_per_m = 1.0"))
    [defect] = check_case(given)["defects"]
    assert "where the twin of the rig reads" in defect


def test_two_recordings_of_one_file_name_are_refused(given: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    shutil.copyfile(given / "recordings" / "run_02.nc", other / "run_01.nc")
    files = [given / "recordings" / "run_01.nc", other / "run_01.nc"]
    [defect] = new_case(tmp_path / "case", given / "rig.toml", files)["defects"]
    assert "remedy: rename one of them" in defect


def test_files_that_the_twin_names_are_taken_along_or_missed(given: Path, tmp_path: Path) -> None:
    text = (given / "rig.toml").read_text().replace('tank_model = "frozen"', 'tank_model = "rom"')
    (given / "rig.toml").write_text(text + '[twin.parameters]\nrom = "ROM.nc"\n')
    [defect] = new_case(tmp_path / "case", given / "rig.toml", [given / "recordings"])["defects"]
    assert "twin.parameters.rom: got ROM.nc; allowed: a file beside the rig file" in defect


def test_a_folder_in_use_is_left_as_it_is(given: Path, tmp_path: Path) -> None:
    (tmp_path / "case").mkdir()
    (tmp_path / "case" / "thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="allowed: a new or empty one"):
        new_case(tmp_path / "case", given / "rig.toml", [given / "recordings"])
    assert contents(tmp_path / "case") == {"thesis.txt": b"mine"}


def test_a_good_case_is_checked_without_a_word_of_blame(given: Path) -> None:
    before = contents(given)
    summary = check_case(given)
    assert summary["defects"] == []
    assert summary["lines"][0].endswith(": no defect")
    assert contents(given) == before


@pytest.mark.parametrize(("gone", "match"), [("", "no such folder"), ("recordings", "no recordings")])
def test_a_folder_that_is_no_case_is_refused(gone: str, match: str, given: Path) -> None:
    shutil.rmtree(given / gone)
    with pytest.raises(InputError, match=match):
        check_case(given)
