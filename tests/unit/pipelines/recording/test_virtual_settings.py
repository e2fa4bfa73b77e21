"""Which options of `sloshlab virtual` reach the virtual laboratory, by experiment."""

from __future__ import annotations

import pytest

from pipelines.recording.virtual import VirtualRun, virtual_experiments

COMMON = {"experiment", "configuration", "seed"}


def settings(experiment: str, **given: object) -> dict[str, object]:
    options = {
        "configuration": "sloshing", "seed": 1, "liquid": "law", "layers": 16, "acceleration_g": 2.5,
        "direction": "down", "law": "linear", "frequency_hz": 11.0, "second_frequency_hz": 14.0,
        "duration_s": None, "sampling_rate_hz": None, "initial_displacement_m": None, "rms_g": 0.3,
    }  # fmt: skip
    return VirtualRun(experiment=experiment, **{**options, **given}).settings()


@pytest.mark.parametrize(
    ("experiment", "own"),
    [
        ("shaker_sweep", {}),
        ("shaker_vfa", {}),
        ("sudden_start", {"start_hz": 11.0}),
        # random motion below 8 Hz would use up the stroke of the shaker
        ("shaker_random", {"start_hz": 8.0}),
        ("shaker_two_tone", {"start_hz": 11.0, "stop_hz": 14.0}),
    ],
)
def test_on_the_shaker(experiment: str, own: dict[str, float]) -> None:
    shaken = {"acceleration_g": 2.5, "direction": "down", "law": "linear"}
    found = settings(experiment)
    assert {name: value for name, value in found.items() if name not in COMMON} == {**shaken, **own}


@pytest.mark.parametrize("experiment", ["beam_free", "beam_random", "sdof_free"])
def test_on_a_structure(experiment: str) -> None:
    found = settings(experiment, initial_displacement_m=0.01, duration_s=3.0)
    own = {"initial_displacement_m": 0.01, "rms_g": 0.3, "duration_s": 3.0}
    assert {name: value for name, value in found.items() if name not in COMMON} == own


def test_every_experiment_but_other_can_be_run() -> None:
    assert virtual_experiments() == (
        "shaker_sweep", "shaker_vfa", "sudden_start", "shaker_random", "shaker_two_tone", "beam_free",
        "beam_random", "sdof_free",
    )  # fmt: skip
