"""Recordings of the numerical tank in raw_data: complete, as the manifest says, and of the runs that are named."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from slow_cases import slow_but

from acquisition.virtual_laboratory.numerical_campaign import make_numerical_campaign
from acquisition.virtual_laboratory.numerical_campaign_tasks import CampaignSettings
from acquisition.virtual_laboratory.numerical_runs import RIG_TEXTS, numerical_runs
from sloshlab.recording import read_recording
from sloshlab.rig import Rig

RAW_DATA = Path(__file__).parents[4] / "raw_data"
COMMITTED = RAW_DATA / "numerical_tank"


STILL = ("shaker/fill_0.25_frozen_3.00g", "beam/decay_frozen")


@pytest.fixture(scope="module")
def manifest() -> dict:
    return json.loads((COMMITTED / "manifest.json").read_text())


def test_manifest_matches_the_committed_files(manifest) -> None:
    on_disk = {path.relative_to(COMMITTED).as_posix() for path in COMMITTED.rglob("*") if path.is_file()}
    assert set(manifest["files"]) == on_disk - {"manifest.json"}
    for name, stated in manifest["files"].items():
        content = (COMMITTED / name).read_bytes()
        assert hashlib.sha256(content).hexdigest() == stated["sha256"], name
        assert len(content) == stated["bytes"], name


def test_every_run_is_there_and_none_failed(manifest) -> None:
    names = {run.name for run in numerical_runs()}
    assert set(manifest["runs"]) == names
    assert {f"{name}.nc" for name in names} | set(RIG_TEXTS) == set(manifest["files"])
    assert not [name for name, run in manifest["runs"].items() if "flag" in run]


def test_raw_data_stays_small_enough_for_a_checkout() -> None:
    assert sum(path.stat().st_size for path in RAW_DATA.rglob("*") if path.is_file()) <= 60e6


@pytest.mark.parametrize("run", slow_but(numerical_runs()[::4], numerical_runs()), ids=lambda run: run.name)
def test_recording_is_of_the_run_that_its_name_says(run) -> None:
    recording = read_recording(COMMITTED / f"{run.name}.nc")
    assert recording.attrs["run_id"] == Path(run.name).name
    known = run.settings["experiment"] not in ("sudden_start", "shaker_random", "shaker_two_tone")
    assert recording.attrs["experiment"] == (run.settings["experiment"] if known else "other")
    assert recording.attrs["configuration"] == run.settings["configuration"]
    rig_path = (COMMITTED / run.name).with_name(recording.attrs["rig"])
    rig = Rig.from_toml(rig_path)
    if run.is_on_shaker:
        assert f"fill_{rig.liquid.fill_level:.2f}" in run.name
        assert recording.attrs["acceleration_g"] == run.settings["acceleration_g"]
    duration_s = recording.sizes["time"] / recording.attrs["sampling_rate_hz"]
    assert duration_s == pytest.approx(run.settings["duration_s"], abs=0.01)
    assert "numerical_tank_stopped" not in recording.attrs
    for channel in recording.data_vars.values():
        if channel.attrs.get("units") in {"N", "m/s^2", "m s-2", "m/s2"}:
            assert np.isfinite(channel.values).all()


@pytest.mark.parametrize("name", slow_but([STILL[0]], STILL))
def test_still_runs_made_again_are_the_committed_ones(name, tmp_path, manifest) -> None:
    """A sine of another processor may differ in the last bit, which can turn a rounding."""
    settings = CampaignSettings(
        seed=manifest["seed"], layers_per_height=manifest["layers_per_height"], n_workers=1
    )
    still = [run for run in numerical_runs() if run.name == name]
    make_numerical_campaign(tmp_path / "again", settings, runs=still)
    for run in still:
        again = read_recording(tmp_path / "again" / f"{run.name}.nc")
        committed = read_recording(COMMITTED / f"{run.name}.nc")
        assert again.attrs == committed.attrs
        for name, channel in committed.data_vars.items():
            if name == "quality":
                continue
            difference = np.abs(again[name].values - channel.values)
            assert (difference > 0).mean() < 1e-2, name
            assert difference.max() <= 1e-3 * np.abs(channel.values).max(), name
