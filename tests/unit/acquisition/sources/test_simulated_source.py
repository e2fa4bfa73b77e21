"""The virtual laboratory live: the counts that `sloshlab virtual` writes, in time."""

import netCDF4
import numpy as np
import pytest
from played_clocks import SteppedClock

from acquisition.sources import End, parse_url
from acquisition.sources.simulated_source import SimulatedSource
from acquisition.virtual_laboratory.campaign import rig_text
from acquisition.virtual_laboratory.shaker_run import virtual_shaker_run, write_virtual_run
from sloshlab.errors import SourceError
from sloshlab.rig import Rig


@pytest.fixture
def rig(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(rig_text(0.5))
    return path


def simulated(rig, query, experiment="shaker_sweep", clock=None):
    clock = clock or SteppedClock()
    return SimulatedSource(parse_url(f"sim:{experiment}?rig={rig}{query}"), **clock.arguments())


def everything(source):
    source.start()
    blocks = []
    for _ in range(100_000):
        for delivery in source.read(1.0):
            if isinstance(delivery, End):
                return np.concatenate(blocks), delivery
            assert delivery.counter == sum(map(len, blocks))
            blocks.append(delivery.counts)
    raise AssertionError("no end")


RUNS = {
    "defaults": ("shaker_sweep", "", {}),
    "sweep": (
        "shaker_sweep",
        "&acceleration_g=5&seed=7&direction=down&law=linear",
        {"acceleration_g": 5.0, "seed": 7, "direction": "down", "law": "linear"},
    ),
    "vfa": (
        "shaker_vfa",
        "&start_hz=6&stop_hz=12&sampling_rate_hz=300",
        {"start_hz": 6.0, "stop_hz": 12.0, "sampling_rate_hz": 300.0},
    ),
    "perfect": (
        "shaker_sweep",
        "&configuration=empty&imperfect=no",
        {"configuration": "empty", "imperfect": False},
    ),
}


@pytest.mark.parametrize(("experiment", "query", "settings"), RUNS.values(), ids=RUNS)
def test_the_counts_are_those_of_the_virtual_laboratory(rig, tmp_path, experiment, query, settings):
    with simulated(rig, f"&duration_s=6&real_time=no{query}", experiment) as source:
        counts, end = everything(source)
        info = source.info
    run = virtual_shaker_run(Rig.from_toml(rig), experiment=experiment, duration_s=6.0, **settings)
    write_virtual_run(run, tmp_path / "run.nc")
    with netCDF4.Dataset(tmp_path / "run.nc") as file:
        file.set_auto_maskandscale(False)
        assert end.n_samples == len(file["time"]) == len(counts)
        assert info.sampling_rate_hz == file.sampling_rate_hz
        for channel, its_counts in zip(info.channels, counts.T, strict=True):
            stored = file[channel.name]
            np.testing.assert_array_equal(its_counts, stored[:])
            assert (channel.scale_factor, channel.missing_count) == (stored.scale_factor, stored._FillValue)
            assert (channel.units, channel.quantity) == (stored.units, stored.quantity)
            assert (channel.range_min, channel.range_max) == (stored.range_min, stored.range_max)
    assert info.device == "virtual_shaker"


def test_it_runs_in_real_time_unless_told_otherwise(rig):
    clock = SteppedClock()
    with simulated(rig, "&duration_s=5", clock=clock) as source:
        source.start()
        begun_ns = clock.now_ns
        n_received = 0
        for _ in range(5000):
            if n_received == 2560:
                break
            n_received += sum(len(block.counts) for block in source.read(1.0))
    # the last of 2560 samples is due 2559 steps after the start
    assert (clock.now_ns - begun_ns) * 1e-9 == pytest.approx(2559 / 512, abs=1e-6)


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("sim:beam?rig=RIG", "got 'beam'; allowed: shaker_sweep, shaker_vfa"),
        ("sim:shaker_sweep", "rig: got none; .*remedy: add rig=RIG.toml"),
        ("sim:shaker_sweep?rig=/nowhere.toml", "nowhere.toml"),
        ("sim:shaker_sweep?rig=RIG&seed=-1", "seed: got '-1'"),
        ("sim:shaker_sweep?rig=RIG&duration_s=1", "duration_s: got 1; allowed: 5"),
        ("sim:shaker_sweep?rig=RIG&sampling_rate_hz=50", "sampling_rate_hz: got 50"),
        ("sim:shaker_sweep?rig=RIG&duration_s=7200&sampling_rate_hz=1e6", "length: got 7200000000 samples"),
        ("sim:shaker_sweep?rig=RIG&law=cubic", "law: got 'cubic'"),
        ("sim:shaker_sweep?rig=RIG&amplitude=3", "amplitude: got '3'"),
    ],
)
def test_settings_out_of_range_are_one_line(rig, url, said):
    with pytest.raises(SourceError, match=said) as caught:
        SimulatedSource(parse_url(url.replace("RIG", str(rig)))).open()
    assert "\n" not in str(caught.value)
