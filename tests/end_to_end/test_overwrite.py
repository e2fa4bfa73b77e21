"""One rule for every command that writes a file: what is there stays, unless --overwrite is given."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from short_runs import DONE_BUT_FLAGGED, INPUT_IS_BAD, assert_one_line, contents, short_run

import pipelines.recording.virtual
from acquisition.virtual_laboratory.campaign import campaign_runs, make_campaign, rig_text
from acquisition.virtual_laboratory.shaker_run import write_virtual_run
from pipelines.command_line import run
from sloshlab.errors import InputError
from sloshlab.recording import read_attributes

MAP = """
[run]
run_id = "bench"
experiment = "other"
configuration = "sloshing"
start_time_utc = "2026-01-31T12:00:00Z"
[source]
time = "t"
[channels.acceleration_tip]
column = "a"
units = "m s-2"
"""
TRAINED = ["--delays", "6", "--neurons", "3", "--epochs", "2", "--rate-hz", "170"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("inputs")
    (made / "rig.toml").write_text(rig_text(0.5))
    (made / "bench.csv").write_text("t,a\n" + "".join(f"{0.01 * k},{k % 7}\n" for k in range(200)))
    (made / "bench.toml").write_text(MAP)
    for name, seed in (("train", 1), ("valid", 2)):
        write_virtual_run(short_run(run_id=name, seed=seed, duration_s=12.0), made / f"{name}.nc")
    return made


def imported(folder: Path, output: Path) -> list[str]:
    return ["import", str(folder / "bench.csv"), "--map", str(folder / "bench.toml"), "-o", str(output)]


def virtual(folder: Path, output: Path) -> list[str]:
    return ["virtual", "shaker_sweep", "--rig", str(folder / "rig.toml"), "--duration-s", "6", "-o", str(output)]


def simulated(folder: Path, output: Path) -> list[str]:
    return ["simulate", "--rig", str(folder / "rig.toml"), "--input", str(folder / "train.nc"), "-o", str(output)]


def trained(folder: Path, output: Path) -> list[str]:
    runs = [str(folder / f"{name}.nc") for name in ("train", "valid")]
    return ["train", *runs, "--rig", str(folder / "rig.toml"), "-o", str(output), *TRAINED, "--no-report"]


COMMANDS = [imported, virtual, simulated, trained]


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("is_link", [False, True])
def test_what_is_there_stays_unless_it_may_go(
    command: Callable[[Path, Path], list[str]], is_link: bool, folder: Path, tmp_path: Path, capsys: Any
) -> None:
    output, measured = tmp_path / "out.nc", tmp_path / "measured.nc"
    measured.write_bytes(b"a measurement")
    if is_link:
        output.symlink_to(measured)
    else:
        output.write_bytes(b"a measurement")
    before = contents(tmp_path)
    assert run(command(folder, output)) == INPUT_IS_BAD
    assert_one_line(capsys.readouterr().err, "out.nc", "a file that is there already", "--overwrite")
    assert contents(tmp_path) == before
    assert run([*command(folder, output), "--overwrite"]) in (0, DONE_BUT_FLAGGED)
    assert not output.is_symlink()
    assert output.stat().st_size > 1000
    assert measured.read_bytes() == b"a measurement"


@pytest.mark.parametrize("command", COMMANDS)
def test_a_link_that_leads_nowhere_is_something_there(
    command: Callable[[Path, Path], list[str]], folder: Path, tmp_path: Path, capsys: Any
) -> None:
    output = tmp_path / "out.nc"
    output.symlink_to(tmp_path / "nowhere.nc")
    assert run(command(folder, output)) == INPUT_IS_BAD
    assert_one_line(capsys.readouterr().err, "--overwrite")
    assert not (tmp_path / "nowhere.nc").exists()


def test_a_measurement_that_comes_while_a_run_is_computed_stays(folder, tmp_path, monkeypatch, capsys) -> None:
    output = tmp_path / "out.nc"
    original = pipelines.recording.virtual.write_virtual_run

    def written(*arguments: Any) -> None:
        original(*arguments)
        output.write_bytes(b"a measurement")

    monkeypatch.setattr(pipelines.recording.virtual, "write_virtual_run", written)
    assert run(virtual(folder, output)) == INPUT_IS_BAD
    assert_one_line(capsys.readouterr().err, "out.nc")
    assert contents(tmp_path) == {"out.nc": b"a measurement"}


def test_the_twin_that_is_saved_and_the_truth_of_a_replay_stay_too(folder, tmp_path, capsys) -> None:
    (tmp_path / "twin.toml").write_text("mine")
    saved = [*simulated(folder, tmp_path / "out.nc"), "--save-twin", str(tmp_path / "twin.toml")]
    assert run(saved) == INPUT_IS_BAD
    assert_one_line(capsys.readouterr().err, "twin.toml", "--overwrite")
    assert contents(tmp_path) == {"twin.toml": b"mine"}
    played = ["replay", str(folder / "train.nc"), "--as", f"serial:{tmp_path / 'tty'}"]
    assert run([*played, "--truth", str(tmp_path / "twin.toml")]) == INPUT_IS_BAD
    assert_one_line(capsys.readouterr().err, "twin.toml", "--overwrite")
    assert run([*saved, "--overwrite"]) == 0
    # a frozen twin of a run that sloshes is drawn, too
    assert set(contents(tmp_path) or {}) == {"twin.toml", "out.nc", "out.png"}
    assert b"sloshlab_twin" in (tmp_path / "twin.toml").read_bytes()


def test_recording_and_twin_of_a_simulation_appear_together(folder, tmp_path, capsys) -> None:
    saved = tmp_path / "twins" / "twin.toml"
    saved.parent.mkdir()
    arguments = [*simulated(folder, saved.with_name("twin.txt")), "--save-twin", str(saved), "--overwrite"]
    (tmp_path / "twins" / "twin.toml").mkdir()
    assert run(arguments) == INPUT_IS_BAD
    assert_one_line(capsys.readouterr().err, "twin.toml")
    assert contents(tmp_path) == {}


@pytest.mark.slow
def test_a_new_training_takes_the_report_and_ensemble_of_the_old_one_away(folder, tmp_path) -> None:
    output = tmp_path / "ROM.nc"
    first = [word for word in trained(folder, output) if word != "--no-report"]
    assert run([*first, "--ensemble", "2"]) in (0, DONE_BUT_FLAGGED)
    (tmp_path / "ROM" / "notes.txt").write_text("mine")
    assert {"ROM.nc", "ROM_ensemble.nc", "ROM/report.html"} <= set(contents(tmp_path) or {})
    assert run([*trained(folder, output), "--overwrite"]) in (0, DONE_BUT_FLAGGED)
    assert set(contents(tmp_path) or {}) == {"ROM.nc", "ROM/notes.txt"}


def test_a_campaign_replaces_what_a_campaign_wrote_and_nothing_else(tmp_path) -> None:
    def only(run: Any) -> bool:
        return bool(run.name == campaign_runs()[0].name)

    name = f"{campaign_runs()[0].name}.nc"
    make_campaign(tmp_path, only=only)
    made = contents(tmp_path)
    make_campaign(tmp_path, only=only)
    assert contents(tmp_path) == made
    (tmp_path / name).write_bytes(b"a measurement")
    before = contents(tmp_path)
    with pytest.raises(InputError, match="no campaign wrote"):
        make_campaign(tmp_path, only=only)
    assert contents(tmp_path) == before
    make_campaign(tmp_path, only=only, overwrite=True)
    assert read_attributes(tmp_path / name).run_id == campaign_runs()[0].name
