"""Descriptions of faults: what is accepted, what is refused, and that the documentation has every key."""

import re
from pathlib import Path

import pytest
from pydantic import BaseModel

from acquisition.devices.faults import Faults
from acquisition.samples.channel import Channel
from sloshlab.errors import FaultsError


def test_an_empty_description_is_a_device_without_faults():
    assert Faults.from_toml_text("") == Faults()


def test_the_example_of_the_documentation_is_read(repository):
    faults = Faults.from_toml(Path(repository, "docs/examples/faults.toml"))
    assert faults.clock.drift_ppm == 100.0
    assert faults.reorder.distance == 3
    assert faults.overrun is not None
    assert faults.overrun.stalls[0].for_s == 0.2
    assert faults.swapped[0].announced


def globals_of_faults():
    import acquisition.devices.faults as module

    return {
        name: item
        for name, item in vars(module).items()
        if isinstance(item, type) and issubclass(item, BaseModel) and item is not BaseModel
    }


def test_every_key_is_documented(repository):
    text = Path(repository, "docs/simulated_devices.md").read_text()
    rows = [line for line in text.partition("## Faults")[2].splitlines() if line.startswith("|")]
    documented = {
        word for row in rows for quoted in re.findall(r"`([^`]+)`", row) for word in re.findall(r"\w+", quoted)
    }
    known = {key for model in globals_of_faults().values() for key in model.model_fields}
    assert {"drift_ppm", "at_counters", "for_s", "queue_frames"} <= known
    assert known - documented == set()


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("[drop]\nprobability = 1.5", "drop.probability"),
        ("[drop]\nprobabilty = 0.5", "unknown key"),
        ("[clock]\noffset_s = -1", "clock.offset_s"),
        ("[clock]\noffset_s = nan", "clock.offset_s"),
        ("[corrupt]\nn_bits = 0", "corrupt.n_bits"),
        ("[[disconnect]]\nat_s = 1", "disconnect.0.for_s"),
        ("[[disconnect]]\nat_s = 1\nfor_s = 2\n[[disconnect]]\nat_s = 2\nfor_s = 1", "begins before"),
        ("[[stuck]]\nchannel = 'a'\nfrom_s = 2\nto_s = 1", "before to_s"),
        ("[[swapped]]\nchannels = ['a', 'a']", "two channels"),
        ("drop = [", "TOML"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(text, what):
    with pytest.raises(FaultsError, match=re.escape(what)) as raised:
        Faults.from_toml_text(text, name="f.toml")
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("text", "can_announce", "what"),
    [
        ("[[stuck]]\nchannel = 'force_b'", True, "force_b"),
        ("[[swapped]]\nchannels = ['force_a', 'voltage_a']", True, "one quantity"),
        ("[[swapped]]\nchannels = ['force_a', 'force_c']\nannounced = true", False, "announced"),
    ],
)
def test_what_the_device_cannot_do_is_refused(text, can_announce, what):
    channels = [
        Channel("force_a", "force", "N"),
        Channel("force_c", "force", "N"),
        Channel("voltage_a", "voltage", "V"),
    ]
    with pytest.raises(FaultsError, match=what):
        Faults.from_toml_text(text).require_channels(channels, can_announce=can_announce)


def test_a_file_that_is_not_there_is_one_clear_line(tmp_path):
    with pytest.raises(FaultsError, match="No such file"):
        Faults.from_toml(tmp_path / "none.toml")
