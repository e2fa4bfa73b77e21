"""`study`, `virtual campaign` and `trial run` on a Dask cluster of this machine: the bytes of local ones."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("distributed", reason="needs the extra cluster")

from short_runs import DONE_BUT_FLAGGED, contents, rig_text, short_run
from test_diagnose_command import case, decay

import pipelines.liquid_model.study
from acquisition.virtual_laboratory.shaker_run import write_virtual_run
from pipelines.command_line import run
from pipelines.liquid_model.study_cases import StudyCase
from sealed_trial.sealing.trial_folder import _written
from tests.unit.campaigns.dask_cluster import DaskCluster
from tests.unit.hand_made_trials import truth

# what Dask leaves open when it is cut off is no concern of these tests
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]

STUDIED = (StudyCase("nfir", 4, 0, 2), StudyCase("noe", 2, 1, 2))


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a scheduler with two workers."""
    cluster = DaskCluster(tmp_path_factory.mktemp("cluster"))
    try:
        cluster.start_scheduler()
        cluster.start_worker()
        cluster.start_worker()
        yield cluster.address
    finally:
        cluster.kill()


def test_a_study_on_a_cluster(
    scheduler: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setitem(pipelines.liquid_model.study.CASES, "source", STUDIED)
    (tmp_path / "rig.toml").write_text(rig_text(0.5), encoding="utf-8")
    for seed, name in enumerate(("train", "valid")):
        recording = short_run(duration_s=24.0, run_id=name, experiment="shaker_vfa", acceleration_g=4.0, seed=seed)
        write_virtual_run(recording, tmp_path / f"{name}.nc")
    words = ["study", *(str(tmp_path / f"{name}.nc") for name in ("train", "valid")), "--cases", "source"]
    words += ["--epochs", "2", "--rate-hz", "170", "--rig", str(tmp_path / "rig.toml"), "--json"]
    said = []
    for place, where in (("here", ["--workers", "1"]), ("cluster", ["--scheduler", scheduler])):
        assert run([*words, "-o", str(tmp_path / place), *where]) in (0, DONE_BUT_FLAGGED)
        said.append(json.loads(capsys.readouterr().out.splitlines()[-1]))
    assert said[0]["picked"] == said[1]["picked"]
    assert said[0]["validation_rms_n"] == said[1]["validation_rms_n"]
    for name in ("ROM.nc", *(f"{each.name}/model.nc" for each in STUDIED)):
        assert (tmp_path / "here" / name).read_bytes() == (tmp_path / "cluster" / name).read_bytes(), name


def test_a_computed_campaign_on_a_cluster(scheduler: str, tmp_path: Path, capsys: Any) -> None:
    words = ["virtual", "campaign", "--liquid", "numerical", "--layers", "11", "--only", "sdof/*", "--json"]
    for place, where in (("here", ["--workers", "1"]), ("cluster", ["--scheduler", scheduler])):
        assert run([*words, "-o", str(tmp_path / place), *where]) == 0
        assert json.loads(capsys.readouterr().out.splitlines()[-1])["made"] == 2
    here, far = (without_times(contents(tmp_path / place) or {}) for place in ("here", "cluster"))
    assert far == here
    assert {"sdof/decay_sloshing.nc", "sdof/decay_frozen.nc"} <= here.keys()


def without_times(found: dict[str, bytes]) -> dict[str, Any]:
    """Files of a campaign; its manifest says how long each run took to compute, which no two runs share."""
    manifest = json.loads(found["manifest.json"])
    for told in manifest["runs"].values():
        assert told.pop("computing_s") >= 0
    return {**found, "manifest.json": manifest}


def test_a_trial_on_a_cluster(scheduler: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two cases with nothing hidden, one run each; where a diagnosis ran and how long is no part of the answer."""
    monkeypatch.setattr("sys.argv", ["sloshlab"])
    trial = tmp_path / "trial"
    for number in (1, 2):
        case(trial / "cases" / f"case_00{number}", decay(0.005 * (1 + number), 1.5, seed=number))
    truths = {f"case_00{number}": truth(f"case_00{number}", "nothing", accepted=[[]]) for number in (1, 2)}
    _written(trial, truths, purpose="development", seed=1, key=None, secret=b"secret")
    for place, where in (("diagnoses_here", ["--workers", "1"]), ("diagnoses_far", ["--scheduler", scheduler])):
        words = ["trial", "run", str(trial), "--diagnoses", place, "--time-limit", "900", *where]
        assert run(words) == 0
    here, far = (contents(trial / place) or {} for place in ("diagnoses_here", "diagnoses_far"))
    assert here.keys() == far.keys() >= {"case_001/verdict.json", "case_002/verdict.json"}
    for name in here:
        if name.endswith("outcome.json"):
            ends = [json.loads(found[name]) for found in (here, far)]
            assert [(end["case"], end["status"]) for end in ends] == [(name.partition("/")[0], "done")] * 2
            assert ends[0]["exit_code"] == ends[1]["exit_code"]
        else:
            assert here[name] == far[name], name
