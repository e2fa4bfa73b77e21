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


def test_an_unknown_experiment_is_a_usage_error(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["experiments", "flight", str(tmp_path), str(tmp_path)])
    assert experiments.main() == 2
    assert "replay" in capsys.readouterr().err
