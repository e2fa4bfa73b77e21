"""The command `benchmark`: what it writes, and what it says to bad input."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from progress_lines import without_progress
from scipy.io import savemat
from synthetic_files import write_ramps, write_tanks

from pipelines.command_line import INPUT_IS_BAD, USAGE, run
from pipelines.field_benchmarks.catalogue import BENCHMARKS


@pytest.fixture(autouse=True)
def _no_folder_of_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SLOSHLAB_EXTERNAL_DATA", raising=False)


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one line in which a command is refused."""
    assert run(["benchmark", *arguments]) == INPUT_IS_BAD
    said = capsys.readouterr()
    [line] = without_progress(said.err).splitlines()
    return line


@pytest.mark.parametrize("name", [name for name, known in BENCHMARKS.items() if known.files])
def test_a_missing_file_is_one_line_that_says_where_to_get_it(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = refused([name, "--data", str(tmp_path), "-o", str(tmp_path / "out")], capsys)
    assert BENCHMARKS[name].files[0] in line
    assert BENCHMARKS[name].source in line
    assert "--data" in line
    assert not (tmp_path / "out").exists()


def test_no_data_folder_at_all(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = refused(["silverbox", "-o", str(tmp_path / "out")], capsys)
    assert "no data folder" in line
    assert "SLOSHLAB_EXTERNAL_DATA" in line


def test_a_data_folder_that_is_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "no such folder" in refused(["--data", str(tmp_path / "x"), "-o", str(tmp_path / "out")], capsys)


def test_an_unknown_benchmark(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = refused(["goldbox", "-o", str(tmp_path / "out")], capsys)
    assert "goldbox" in line
    assert "silverbox" in line


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ({"V1": [[1.0, 2.0]], "V2": [[1.0, 2.0]]}, "at least 127400"),
        ({"V1": [[1.0, 2.0]]}, "no such variable"),
        ({"V1": [[1.0, 2.0]], "V2": [[1.0, 2.0, 3.0]]}, "one length"),
        ({"V1": [[1.0, float("nan")]], "V2": [[1.0, 2.0]]}, "not finite"),
    ],
)
def test_a_file_with_other_contents(
    content: dict[str, object], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    savemat(tmp_path / "SNLS80mV.mat", content)
    line = refused(["silverbox", "--data", str(tmp_path), "-o", str(tmp_path / "out")], capsys)
    assert told in line
    assert "SNLS80mV.mat" in line


def test_a_damaged_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "SNLS80mV.mat").write_bytes(b"MATLAB 5.0 MAT-file" + bytes(200))
    assert "SNLS80mV.mat" in refused(["silverbox", "--data", str(tmp_path), "-o", str(tmp_path / "out")], capsys)


def test_a_sampling_period_that_is_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_ramps(tmp_path)
    column = [[float(i)] for i in range(1024)]
    savemat(tmp_path / "dataBenchmark.mat", {**dict.fromkeys(("uEst", "yEst", "uVal", "yVal"), column), "Ts": 0.0})
    line = refused(["cascaded_tanks", "--data", str(tmp_path), "-o", str(tmp_path / "out")], capsys)
    assert "Ts: got 0" in line


def test_the_list_names_every_benchmark_and_where_its_files_are(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["benchmark", "--list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in lines] == list(BENCHMARKS)
    for line, known in zip(lines, BENCHMARKS.values(), strict=True):
        assert all(file in line and known.source in line for file in known.files)


def test_without_a_folder_for_results_it_is_usage() -> None:
    assert run(["benchmark", "silverbox"]) == USAGE


def test_files_are_found_in_folders_of_the_data_folder(tmp_path: Path) -> None:
    nested = tmp_path / "CascadedTanks" / "CascadedTanksFiles"
    nested.mkdir(parents=True)
    write_ramps(nested)
    assert BENCHMARKS["cascaded_tanks"].read(tmp_path).tests[0].n_samples == 1024


@pytest.mark.slow
def test_tanks_that_spill_over_from_file_to_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Levels by SciPy's integrator: only the model with brims leaves no more than noise on the unseen record."""
    write_tanks(tmp_path, overflows=True, noise_v=0.01)
    out = tmp_path / "out"
    assert run(["benchmark", "cascaded_tanks", "--data", str(tmp_path), "-o", str(out), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    facts = json.loads((out / "benchmarks.json").read_text(encoding="utf-8"))
    assert summary["result_id"] == facts["result_id"]
    linear, rooted, spilling = (model["errors"]["validation"] for model in facts["cascaded_tanks"]["models"])
    assert min(linear, rooted) > 0.2
    # noise of 0.01 V, whose RMS over 974 samples scatters by 2 %, and what it makes of eight numbers
    assert 0.009 < spilling < 0.012
    assert (out / "figures" / "cascaded_tanks_free_runs.png").read_bytes().startswith(b"\x89PNG")
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "square-root outlets and overflow" in page
    assert BENCHMARKS["cascaded_tanks"].doi in page
