"""The campaign: complete, listed with its hashes, repeatable, and free of the truth."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from acquisition.virtual_laboratory.campaign import (
    ACCELERATIONS_G,
    FILL_LEVELS,
    campaign_laboratory,
    campaign_runs,
    make_campaign,
    record_campaign_run,
)
from sloshlab.errors import InputError
from sloshlab.recording import read_recording
from sloshlab.rig import Rig

COMMITTED = Path(__file__).parents[4] / "raw_data" / "shaker"


@pytest.fixture(scope="module")
def manifest():
    return json.loads((COMMITTED / "manifest.json").read_text())


def test_the_manifest_matches_the_committed_recordings(manifest):
    on_disk = {path.name for path in COMMITTED.iterdir()} - {"manifest.json"}
    assert set(manifest["files"]) == on_disk
    for name, stated in manifest["files"].items():
        content = (COMMITTED / name).read_bytes()
        assert hashlib.sha256(content).hexdigest() == stated["sha256"], name
        assert len(content) == stated["bytes"], name
    assert sum(stated["bytes"] for stated in manifest["files"].values()) < 25e6


def test_the_campaign_has_the_published_family_of_runs():
    assert FILL_LEVELS == (0.25, 0.50, 0.75)
    assert ACCELERATIONS_G == (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0)
    names = {run.name for run in campaign_runs()}
    assert len(names) == len(campaign_runs())
    for fill_level in ("0.25", "0.50", "0.75"):
        assert f"fill_{fill_level}_empty_3.00g" in names
        assert f"fill_{fill_level}_frozen_3.00g" in names
        for level in ("0.25", "0.50", "1.00", "1.50", "2.00", "3.00", "4.00", "5.00", "6.00"):
            assert f"fill_{fill_level}_sweep_{level}g" in names
    assert {"fill_0.50_sweep_3.00g_repeat_2", "fill_0.50_sweep_down_3.00g", "fill_0.50_vfa_6.00g"} <= names


def test_every_committed_run_reads_and_agrees_with_its_name(manifest):
    n_lost = n_clipped = 0
    for name in sorted(manifest["files"]):
        if not name.endswith(".nc"):
            continue
        run = read_recording(COMMITTED / name)
        assert run.attrs["run_id"] == Path(name).stem
        assert f"{run.attrs['acceleration_g']:.2f}g" in name
        assert run.attrs["configuration"] == next((c for c in ("empty", "frozen") if c in name), "sloshing")
        rig = Rig.from_toml(COMMITTED / run.attrs["rig"])
        assert f"fill_{rig.liquid.fill_level:.2f}" in name
        assert rig.tank.height_m == 0.0272
        assert run.attrs["sampling_rate_hz"] >= 25 * 20
        assert run.sizes["time"] == run.attrs["sampling_rate_hz"] * run.attrs["sweep_duration_s"]
        if "quality" in run:
            n_lost += bool((run["quality"].values & 1).any())
            n_clipped += bool((run["quality"].values & 2).any())
    assert n_lost == 1
    assert n_clipped == 1


def test_a_run_recorded_again_is_the_committed_one(tmp_path, manifest):
    index, run = next((i, run) for i, run in enumerate(campaign_runs()) if run.name == "fill_0.75_frozen_3.00g")
    record_campaign_run(
        run, tmp_path / "again.nc", index=index, seed=manifest["seed"], laboratory=campaign_laboratory()
    )
    again, committed = read_recording(tmp_path / "again.nc"), read_recording(COMMITTED / f"{run.name}.nc")
    assert again.attrs == committed.attrs
    for channel in ("force_cell_1", "force_cell_2", "acceleration_control"):
        # another machine's sine may differ in the last bit, which can turn a rounding
        step = committed[channel].attrs["noise_std"] / 0.6
        difference = np.abs(again[channel].values - committed[channel].values)
        assert difference.max() < 1.01 * step
        assert (difference > 0).mean() < 1e-3


def test_a_campaign_made_twice_has_the_same_bytes(tmp_path):
    progress = []
    for name in ("first", "second"):
        make_campaign(
            tmp_path / name,
            seed=3,
            only=lambda run: run.name == "fill_0.25_empty_3.00g",
            progress=lambda *step: progress.append(step),
        )
    names = sorted(path.name for path in (tmp_path / "first").iterdir())
    assert names == [
        "fill_0.25_empty_3.00g.nc",
        "manifest.json",
        "rig_fill_0.25.toml",
        "rig_fill_0.50.toml",
        "rig_fill_0.75.toml",
    ]
    for name in names:
        assert (tmp_path / "first" / name).read_bytes() == (tmp_path / "second" / name).read_bytes()
    assert progress == [(1, 1, "fill_0.25_empty_3.00g")] * 2
    other = make_campaign(tmp_path / "third", seed=4, only=lambda run: run.name == "fill_0.25_empty_3.00g")
    runs = [read_recording(folder / "fill_0.25_empty_3.00g.nc") for folder in (tmp_path / "first", other.parent)]
    moved = [run["acceleration_control"].values for run in runs]
    assert abs(np.corrcoef(*moved)[0, 1]) < 0.98  # another shaker run, not only other gains and noise


def test_the_truth_is_not_in_the_recordings(manifest):
    truth = campaign_laboratory()
    for path in sorted(COMMITTED.glob("*.nc"))[:3]:
        run = read_recording(path)
        told = [str(value) for source in (run, *run.data_vars.values()) for value in source.attrs.values()]
        for value in (*truth.gain.values(), truth.dry_mass_factor, truth.cell_1_share):
            assert not any(f"{value:.5g}" in text for text in told)


def test_a_negative_seed_is_refused(tmp_path):
    with pytest.raises(InputError, match="seed"):
        make_campaign(tmp_path / "none", seed=-1)
    assert not (tmp_path / "none").exists()
