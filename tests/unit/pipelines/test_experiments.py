"""Targets of make: what they say about a folder in which nothing can be done."""

import sys

import pytest

from pipelines import experiments


@pytest.mark.parametrize("experiment", ["replay"])
def test_an_empty_folder_is_told_in_one_line(tmp_path, monkeypatch, capsys, experiment):
    monkeypatch.setattr(sys, "argv", ["experiments", experiment, str(tmp_path), str(tmp_path / "out")])
    assert experiments.main() == 1
    said = capsys.readouterr().err
    assert said.startswith("sloshlab: ")
    assert said.count("\n") == 1
    assert "no recordings" in said


@pytest.mark.parametrize("experiment", ["rom", "study"])
def test_a_model_needs_two_vfa_runs(tmp_path, monkeypatch, capsys, experiment):
    monkeypatch.setattr(sys, "argv", ["experiments", experiment, str(tmp_path), str(tmp_path / "out")])
    assert experiments.main() == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "0 VFA runs" in said


def test_the_longer_vfa_run_trains_and_the_other_validates(tmp_path):
    for name, size in (("vfa_a", 10), ("vfa_b", 20), ("sweep_3g", 1), ("frozen_3g", 1), ("empty_3g", 1)):
        (tmp_path / f"fill_0.50_{name}.nc").write_bytes(b"0" * size)
    (tmp_path / "rig_fill_0.50.toml").write_text("")
    arguments = experiments.rom_arguments(tmp_path, tmp_path / "out")
    names = [part.rsplit("/", 1)[-1] for part in arguments]
    assert names[:3] == ["train", "fill_0.50_vfa_b.nc", "fill_0.50_vfa_a.nc"]
    assert [names[i + 1] for i, part in enumerate(names) if part == "--still"] == [
        "fill_0.50_empty_3g.nc",
        "fill_0.50_frozen_3g.nc",
    ]
    assert [names[i + 1] for i, part in enumerate(names) if part == "--test"] == ["fill_0.50_sweep_3g.nc"]
    assert experiments.study_arguments(tmp_path, tmp_path / "out")[0] == "study"


def test_an_unknown_experiment_is_a_usage_error(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["experiments", "flight", str(tmp_path), str(tmp_path)])
    assert experiments.main() == 2
    assert "replay" in capsys.readouterr().err
