"""`sloshlab virtual` with the computed liquid: recordings, refusals, interruption, unstable runs, the campaign."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from progress_lines import without_progress
from short_runs import DONE_BUT_FLAGGED, INPUT_IS_BAD, INTERRUPTED, assert_one_line, leftovers, refusal

from acquisition.numerical_tank.computed_force import ComputedForce
from acquisition.virtual_laboratory.campaign import rig_text
from acquisition.virtual_laboratory.numerical_runs import RIG_TEXTS, SDOF_RIG
from pipelines.command_line import run
from pipelines.recording import virtual
from sloshlab.recording import read_recording

pytestmark = pytest.mark.usefixtures("programs_are_forks")

COARSE = ["--liquid", "numerical", "--layers", "8", "--duration-s", "5"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With a rig and a recording, ``sweep.nc``, of the command below."""
    made = tmp_path_factory.mktemp("numerical")
    (made / "rig.toml").write_text(rig_text(0.5), encoding="utf-8")
    assert run(sweep(made, made / "sweep.nc")) == 0
    return made


def sweep(folder: Path, output: Path, *more: str) -> list[str]:
    return ["virtual", "shaker_sweep", "--rig", str(folder / "rig.toml"), *COARSE, "-o", str(output), *more]


def test_a_computed_sweep_is_a_recording_and_nothing_else_is_left(folder: Path) -> None:
    recording = read_recording(folder / "sweep.nc")
    assert recording.sizes["time"] == 5 * 512
    assert recording.attrs["liquid"] == "numerical_tank"
    assert sorted(path.name for path in folder.iterdir()) == ["rig.toml", "sweep.nc"]
    assert run(["check", str(folder / "sweep.nc")]) == 0


@pytest.mark.parametrize("named", [False, True])
def test_interrupted_and_typed_again_it_ends_with_the_same_bytes(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any, named: bool
) -> None:
    checkpoint = tmp_path / ("kept.here" if named else "run.checkpoint")
    command = sweep(folder, tmp_path / "run.nc", *(["--checkpoint", str(checkpoint)] if named else []))

    @contextlib.contextmanager
    def impatient(description: str) -> Iterator[Any]:
        def advance(done: int, everything: int) -> None:
            if done > 300:
                raise KeyboardInterrupt

        yield advance

    with monkeypatch.context() as patched:
        patched.setattr(virtual, "amounts", impatient)
        assert run(command) == INTERRUPTED
    said = capsys.readouterr().err
    assert_one_line(said, "interrupted at 1.", f"of 5 s; {checkpoint.name} keeps", "give the same command again")
    assert [path.name for path in tmp_path.iterdir()] == [checkpoint.name]
    assert run(command) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["run.nc"]
    assert (tmp_path / "run.nc").read_bytes() == (folder / "sweep.nc").read_bytes()


def test_an_unstable_run_is_written_and_flagged(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    def unstable(*arguments: Any, **options: Any) -> ComputedForce:
        return ComputedForce(np.zeros(1000), 1.0, "numerical tank: a particle moves faster than sound at 1.98 s")

    monkeypatch.setattr("acquisition.virtual_laboratory.numerical_liquid.computed_force", unstable)
    assert run(sweep(folder, tmp_path / "run.nc")) == DONE_BUT_FLAGGED
    captured = capsys.readouterr()
    said = without_progress(captured.err)
    assert said == "flagged: numerical tank: a particle moves faster than sound at 1.98 s\n"
    assert "(1000 samples at 512 Hz)" in captured.out
    assert "at 1.98 s" in read_recording(tmp_path / "run.nc").attrs["numerical_tank_stopped"]


@pytest.mark.parametrize(
    ("changed", "fragments"),
    [
        (["--liquid", "water"], ["--liquid: got 'water'; allowed: law, numerical"]),
        (["--layers", "3"], ["layers of particles in the liquid: got 2; allowed: at least 4"]),
        (["--layers", "0"], ["layers of particles", "allowed: 1"]),
        (["--layers", "100000"], ["layers of particles", "10000"]),
        (["--law", "constant"], ["law: got 'constant'; allowed: octave, linear, stepped"]),
        (["--duration-s", "1"], ["duration_s: got 1; allowed: 5"]),
        (
            ["--checkpoint", "nowhere/run.checkpoint"],
            ["--checkpoint nowhere/run.checkpoint", "folder that exists"],
        ),
        (["--seed", "-1"], ["seed: got -1"]),
    ],
)
def test_bad_options_are_refused_before_anything_is_computed(
    folder: Path, tmp_path: Path, capsys: Any, changed: list[str], fragments: list[str]
) -> None:
    refusal(capsys, sweep(folder, tmp_path / "run.nc", *changed), tmp_path / "run.nc", *fragments)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("fill_level", ["0.0", "1.0"])
def test_a_tank_without_liquid_or_without_gas_is_refused(tmp_path: Path, capsys: Any, fill_level: str) -> None:
    text = rig_text(0.5).replace("fill_level = 0.50", f"fill_level = {fill_level}")
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    refusal(capsys, sweep(tmp_path, tmp_path / "run.nc"), tmp_path / "run.nc", "liquid.fill_level", fill_level)


def test_a_sudden_start_keeps_to_the_stroke(folder: Path, tmp_path: Path, capsys: Any) -> None:
    command = ["virtual", "sudden_start", *sweep(folder, tmp_path / "run.nc")[2:], "--acceleration-g", "3"]
    refusal(capsys, [*command, "--frequency-hz", "7"], tmp_path / "run.nc", "got 15.21 mm", "at most 12.5 mm")
    assert run([*command, "--frequency-hz", "9", "--configuration", "frozen"]) == 0
    recording = read_recording(tmp_path / "run.nc")
    assert recording.attrs["experiment"] == "other"
    assert recording.attrs["sweep_start_hz"] == recording.attrs["sweep_stop_hz"] == 9.0


def test_a_checkpoint_of_another_run_is_refused_and_kept(folder: Path, tmp_path: Path, capsys: Any) -> None:
    checkpoint = tmp_path / "run.checkpoint"
    checkpoint.write_bytes(b"something else")
    refusal(capsys, sweep(folder, tmp_path / "run.nc"), tmp_path / "run.nc", "run.checkpoint: got another file")
    assert checkpoint.read_bytes() == b"something else"


def test_a_structure_that_carries_a_frozen_tank(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(RIG_TEXTS[SDOF_RIG], encoding="utf-8")
    command = ["virtual", "sdof_free", "--rig", str(tmp_path / "rig.toml"), "-o", str(tmp_path / "run.nc")]
    assert (
        run([*command, "--configuration", "frozen", "--duration-s", "1", "--initial-displacement-m", "0.03"]) == 0
    )
    recording = read_recording(tmp_path / "run.nc")
    assert recording.attrs["experiment"] == "sdof_free"
    assert recording.attrs["initial_displacement_m"] == 0.03
    assert leftovers(tmp_path) == []


def test_the_campaign_tells_each_run_and_keeps_what_it_has(tmp_path: Path, capsys: Any) -> None:
    command = ["virtual", "campaign", "--liquid", "numerical", "-o", str(tmp_path / "tank"), "--workers", "1"]
    chosen = [*command, "--only", "*/fill_0.50_empty_*", "--json"]
    assert run(chosen) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("1 of 1: shaker/fill_0.50_empty_3.00g, computed for ")
    assert lines[0].endswith("; 100 % of the work, 0 s left")
    summary = json.loads(lines[-1])
    assert summary["laboratory_deviations"].keys() >= {"dry_mass_factor", "gain"}
    told = {name: summary[name] for name in ("flags", "kept", "made", "output", "laboratory_seed")}
    assert told == {"flags": [], "kept": 0, "made": 1, "output": str(tmp_path / "tank"), "laboratory_seed": 0}
    assert read_recording(tmp_path / "tank" / "shaker" / "fill_0.50_empty_3.00g.nc").attrs["liquid"] == "empty"
    assert leftovers(tmp_path) == []
    assert run(chosen) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["kept"] == 1


@pytest.mark.parametrize(
    ("options", "fragment"),
    [
        (["--only", "nothing"], "--only: got 'nothing'"),
        (["--seed", "-2"], "seed of the campaign: got -2"),
        (["--layers", "8"], "layers of particles in the liquid: got 3; allowed: at least 4"),
        (["--liquid", "beer"], "--liquid: got 'beer'"),
    ],
)
def test_bad_campaigns_are_refused(tmp_path: Path, capsys: Any, options: list[str], fragment: str) -> None:
    command = ["virtual", "campaign", "--liquid", "numerical", "-o", str(tmp_path / "tank"), *options]
    assert run(command) == INPUT_IS_BAD
    assert_one_line(capsys.readouterr().err, fragment)
    assert list(tmp_path.iterdir()) == []
