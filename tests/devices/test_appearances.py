"""Appearances are found by entry points, those of other packages too, and can be replayed."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from documented_package import installed_from
from independent_host import Heard, take_frame

from acquisition.devices.appearance import APPEARANCES, Appearance, appearance
from acquisition.devices.serial_appearance import SerialAppearance
from acquisition.sources import parse_url, urls
from pipelines.recording.replay import ReplaySettings, replay
from sloshlab import registry
from sloshlab.errors import FaultsError, InputError, SourceError

PATTERN = "pattern:channels=2&sampling_rate_hz=1000&bits=16&duration_s=0.5"


def pattern(n_samples: int, n_channels: int) -> np.ndarray:
    """Counts of 16 bits by splitmix64, as docs/simulated_devices.md has it."""
    mask = 2**64 - 1
    counts = np.empty((n_samples, n_channels), np.int64)
    for sample, channel in np.ndindex(counts.shape):
        z = (256 * sample + channel + 0x9E3779B97F4A7C15) & mask
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & mask
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
        upper = (z ^ (z >> 31)) >> 48
        counts[sample, channel] = upper - 2**16 if upper >= 2**15 else upper
    return counts


@pytest.fixture
def log_package(repository: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The package that docs/simulated_devices.md shows."""
    with installed_from(repository / "docs" / "simulated_devices.md", tmp_path, monkeypatch):
        yield


@pytest.mark.usefixtures("log_package")
def test_an_appearance_of_another_package_is_replayed(tmp_path):
    said: list[str] = []
    path = tmp_path / "frames.log"
    settings = ReplaySettings(PATTERN, [f"log:{path}?device=logged"], speed="max")
    summary = replay(settings, announce=said.append)
    assert said == [f"ready log:{path}"]
    assert summary["devices"]["logged"] == {"samples_taken": 500, "samples_sent": 500, "host_gone": False}
    heard = Heard()
    for run in path.read_bytes().split(b"\0"):
        if run:
            take_frame(heard, run)
    counts = heard.counts_by_counter()
    np.testing.assert_array_equal([counts[k] for k in range(500)], pattern(500, 2))
    assert len(counts) == 500


@pytest.mark.usefixtures("log_package")
@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"wait_clients": 2}, "no socketcand device"),
        ({"samples_per_frame": 2}, "no serial device"),
    ],
)
def test_what_an_appearance_does_not_offer_is_refused(tmp_path, settings, message):
    with pytest.raises(InputError, match=message):
        replay(ReplaySettings(PATTERN, [f"log:{tmp_path}/frames.log"], **settings))


@pytest.mark.usefixtures("log_package")
def test_a_slow_line_that_nobody_simulates_is_refused(tmp_path):
    faults = tmp_path / "faults.toml"
    faults.write_text("[overrun]\nbaud_rate = 9600\n")
    with pytest.raises(FaultsError, match="faults with overrun"):
        replay(ReplaySettings(PATTERN, [f"log:{tmp_path}/frames.log"], faults=[faults]))


@pytest.mark.usefixtures("log_package")
def test_an_unknown_scheme_names_those_there_are():
    with pytest.raises(SourceError, match=r"--as usb:1: got 'usb'; allowed: serial, can, log; remedy: check"):
        appearance(parse_url("usb:1"), number=1)


def test_an_appearance_that_cannot_be_imported_is_one_line(monkeypatch):
    monkeypatch.setitem(APPEARANCES._offered, "bench", ["no_such_package:Bench"])
    with pytest.raises(SourceError, match="appearance no_such_package:Bench that cannot be imported") as caught:
        appearance(parse_url("bench:1"), number=1)
    assert "\n" not in str(caught.value)


def test_an_installation_that_declares_nothing_knows_the_built_in_ones(monkeypatch, tmp_path):
    monkeypatch.setattr(registry, "_offered_by_packages", lambda group, search_path: {})
    made = appearance(parse_url(f"serial:{tmp_path}/tty"), number=1)
    assert isinstance(made, SerialAppearance)
    assert made.device == "device_1"


@pytest.mark.parametrize("built_in", [APPEARANCES, urls.BACKENDS], ids=lambda known: known.kind)
def test_the_built_in_ones_are_those_that_the_package_declares(repository, built_in):
    project = tomllib.loads((repository / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["entry-points"][built_in.group] == built_in.declared


def test_an_appearance_must_say_what_its_frames_and_its_place_are():
    class Nothing(Appearance):
        pass

    with pytest.raises(TypeError, match=r"endpoint.*wire"):
        Nothing(parse_url("nothing:1"), "device")
