"""Effects of sensors and actuators in files: what is written is what is read, and what cannot be is refused."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import decays, rig, surroundings

from sloshlab.errors import InputError
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, candidates, extension_of
from sloshlab.missing_physics.saved_effects import effect_lines, saved_effects

assert effects.__all__


@pytest.fixture(scope="module")
def pool(tmp_path_factory: pytest.TempPathFactory) -> list[Candidate]:
    folder = tmp_path_factory.mktemp("saved")
    model = RigModel(rig(folder), folder, decays((0.01,), noise={}))
    return candidates(replace(surroundings(model), runs=tuple(run.name for run in model.runs)))


def chosen(pool: list[Candidate], key: str) -> Candidate:
    return next(candidate for candidate in pool if candidate.key.startswith(key))


@pytest.mark.parametrize("key", ["sensor.sensor_gain.", "sensor.sensor_delay.", "sensor.sensor_clipping."])
def test_a_sensor_reads_as_it_was_saved(pool: list[Candidate], key: str) -> None:
    candidate = chosen(pool, key)
    values = candidate.starts()[0]
    loaded = saved_effects(tomllib.loads("\n".join(effect_lines([candidate], values))), "twin")
    [expected], [found] = extension_of([candidate], values).faults, loaded.faults
    assert found.channel == expected.channel
    assert found.key == expected.key
    series = np.sin(np.arange(500) / 7.0) * 3.0
    np.testing.assert_array_equal(
        found.reading(series, 250.0, {}, series), expected.reading(series, 250.0, {}, series)
    )


def test_forces_and_numbers_of_single_runs_stay_out(pool: list[Candidate]) -> None:
    force, drift = chosen(pool, "structure.coulomb_friction"), chosen(pool, "sensor.drift_of_runs.")
    values = {**force.starts()[0], **drift.starts()[0]}
    assert effect_lines([force, drift], values) == []


GAIN = '[[effects]]\nname = "sensor.sensor_gain"\nchannel = "acceleration_tip"\nratio = 0.1\n'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (GAIN.replace("sensor.sensor_gain", "sensor.nonsense"), "the effect 'sensor.nonsense'"),
        (GAIN.replace("sensor.sensor_gain", "structure.coulomb_friction"), "the effect"),
        (GAIN.replace("ratio = 0.1", "ratio = 50.0"), "ratio: got 50.0; allowed: -0.9 … 5"),
        (GAIN.replace("ratio = 0.1", "ratio = nan"), "ratio: got nan"),
        (GAIN.replace("ratio = 0.1", "other = 1.0"), "ratio: got None"),
        (GAIN.replace('"acceleration_tip"', "3"), "channel: got 3"),
        ("effects = 3", "no short list"),
        (GAIN * 101, "no short list"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(text: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as refused:
        saved_effects(tomllib.loads(text), "twin x.toml")
    assert "\n" not in str(refused.value)
    assert str(refused.value).startswith("twin x.toml")


def test_a_twin_without_effects_has_none(tmp_path: Path) -> None:
    assert saved_effects({}, "twin").faults == ()
