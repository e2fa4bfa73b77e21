"""The virtual rig as the signal of a device: counts as written, and the same motion at any other instant."""

import numpy as np
import pytest

from acquisition.devices.virtual_signal import virtual_signal
from acquisition.sources.urls import parse_url
from acquisition.virtual_laboratory.sensors import CHANNELS
from acquisition.virtual_laboratory.shaker_run import virtual_shaker_run
from sloshlab.errors import InputError
from sloshlab.recording import read_recording, write_recording
from sloshlab.rig import Rig


@pytest.fixture
def rig(repository):
    return repository / "raw_data" / "shaker" / "rig_fill_0.50.toml"


def signal(rig, experiment, more="", names=None):
    return virtual_signal(parse_url(f"virtual:{experiment}?rig={rig}&duration_s=12&seed=4{more}"), names)


@pytest.mark.parametrize(("experiment", "direction"), [("shaker_sweep", "down"), ("shaker_vfa", "up")])
def test_values_are_those_of_the_recording_that_is_written(rig, tmp_path, experiment, direction):
    played = signal(rig, experiment, f"&direction={direction}")
    run = virtual_shaker_run(
        Rig.from_toml(rig), experiment=experiment, duration_s=12.0, seed=4, direction=direction
    )
    write_recording(run, tmp_path / "run.nc")
    written = read_recording(tmp_path / "run.nc")
    counts = played.piece(0, played.n_samples).counts
    for k, channel in enumerate(played.channels):
        np.testing.assert_allclose(
            counts[:, k] * channel.scale_factor,
            written[channel.name].values,
            rtol=0,
            atol=0.01 * channel.scale_factor,
        )
    assert tuple(channel.name for channel in played.channels) == CHANNELS


@pytest.mark.parametrize("law", ["octave", "linear"])
@pytest.mark.parametrize("direction", ["up", "down"])
@pytest.mark.parametrize("experiment", ["shaker_sweep", "shaker_vfa"])
def test_at_the_nominal_instants_a_wrong_clock_sees_the_nominal_counts(rig, experiment, direction, law):
    # without noise; a count of difference where rounding falls the other way
    played = signal(rig, experiment, f"&imperfect=no&direction={direction}&law={law}")
    at = np.arange(500, 5500)
    nominal = played.piece(500, 5500).counts
    assert np.abs(played.piece_at(at.astype(float)).counts - nominal).max() <= 1
    assert np.abs(played.piece_at(at + 0.5).counts - nominal).max() > 100


def test_only_the_channels_that_are_asked_for_in_their_order(rig):
    names = ("force_cell_2", "force_cell_1")
    chosen, everything = signal(rig, "shaker_sweep", names=names), signal(rig, "shaker_sweep")
    columns = [CHANNELS.index(name) for name in names]
    np.testing.assert_array_equal(chosen.piece(10, 20).counts, everything.piece(10, 20).counts[:, columns])


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("virtual:shaker_walk?rig={rig}", "shaker_walk"),
        ("virtual:shaker_sweep", "a rig description"),
        ("virtual:shaker_sweep?rig={rig}&duration_s=1e5", "length"),
    ],
)
def test_what_is_no_run_is_refused(rig, text, what):
    with pytest.raises(InputError, match=what):
        virtual_signal(parse_url(text.format(rig=rig)))


def test_a_channel_that_the_rig_does_not_have_is_refused(rig):
    with pytest.raises(InputError, match="force_cell_9"):
        signal(rig, "shaker_sweep", names=["force_cell_9"])
