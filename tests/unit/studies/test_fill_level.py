"""The study of the fill level: motion within the stroke, what a network can reach, what stands in the table."""

import numpy as np
import pytest

from studies.fill_level.campaign import FILLS, ComputedRun, FilledRun, compute
from studies.fill_level.motion import STROKE_M, TEST, TRAINING, VALIDATION
from studies.fill_level.networks import (
    FillError,
    Workshop,
    compared,
    model_run,
    other_seed_errors,
    table,
    trainings,
)


@pytest.mark.parametrize("motion", [TRAINING, VALIDATION, TEST], ids=lambda motion: motion.name)
def test_motion_is_within_stroke_and_level_and_acceleration_is_its_slope(motion):
    time = np.arange(0, motion.duration_s, 1e-3)
    velocity, acceleration = motion.velocity_m_per_s(time), motion.acceleration_m_per_s2(time)
    slope = (velocity[2:] - velocity[:-2]) / 2e-3
    assert np.abs(slope - acceleration[1:-1]).max() < 2e-3 * np.abs(acceleration).max()
    assert np.abs(acceleration).max() < 6.05 * 9.81
    displacement = np.cumsum(velocity) * 1e-3
    # half of the range within a cycle at 7 Hz
    cycles = displacement[: displacement.size // 143 * 143].reshape(-1, 143)
    assert (np.ptp(cycles, axis=1) / 2).max() < 1.05 * STROKE_M
    assert motion.velocity_m_per_s([-1.0]) == 0


def computed(fill, motion, seed=0, factor=1.0):
    """A damper whose strength is the fill, and a mass."""
    time = np.arange(round(motion.duration_s * 256)) / 256
    velocity = motion.velocity_m_per_s(time)
    force = -factor * (40 * fill * velocity + 0.2 * motion.acceleration_m_per_s2(time))
    run = FilledRun(fill, motion, seed)
    return run, ComputedRun(run, velocity, force)


def test_energy_error_is_that_of_the_damper_and_the_floor_that_of_two_computations(tmp_path):
    runs = dict(computed(fill, TEST, seed, 1 + 0.1 * seed) for fill in FILLS for seed in (0, 1))
    workshop = Workshop(tmp_path, runs)
    test = workshop.run(0.5, TEST)
    # half of the damper is missing, the mass is right
    lacking = test.y + 20 * 0.5 * test.x
    _, energy = compared(lacking, test)
    assert energy == pytest.approx(-0.5, abs=0.01)
    # a second computation a tenth larger: 0.1/√2
    assert other_seed_errors(workshop)[0.5] == pytest.approx(0.1 / np.sqrt(2), rel=1e-6)


def test_a_fill_that_is_left_out_trains_nothing_that_is_asked_about_it():
    for fill in FILLS:
        asked = trainings(fill, 0)
        assert all(fill not in asked[way].fills for way in ("left out", "nearest", "without fill"))
        assert asked["own"].fills == (fill,)
    assert trainings(8 / 12, 0)["nearest"].fills == (9 / 12,)


def test_runs_are_at_the_rate_of_the_models_and_tell_their_fill():
    _, each = computed(0.75, VALIDATION)
    run = model_run(each)
    assert run.fill_level == 0.75
    assert run.x.size == round(VALIDATION.duration_s * 128)
    time, inner = np.arange(run.x.size) / 128, slice(64, -64)
    assert run.x[inner] == pytest.approx(VALIDATION.velocity_m_per_s(time)[inner], abs=2e-3)


def test_the_table_has_means_over_starts():
    found = [
        FillError(way, fill, 0.2 + 0.1 * seed, -0.1)
        for way in ("own", "left out", "nearest", "without fill", "all")
        for fill in FILLS
        for seed in (0, 1)
    ]
    lines = table(found, {0.5: 0.12})
    assert lines[4].startswith("| 0.500 | 25 % (−10 %) |")
    assert lines[4].endswith("| 12 % |")
    assert "an end" in lines[2]


def test_what_was_computed_is_not_computed_again(tmp_path, monkeypatch):
    run = FilledRun(0.5, VALIDATION)
    monkeypatch.setattr("studies.fill_level.campaign.specific_force", lambda run: np.array([1.0, 2.0]))
    first = compute(tmp_path, [run])
    monkeypatch.setattr("studies.fill_level.campaign.specific_force", lambda run: pytest.fail("again"))
    again = compute(tmp_path, [run])
    assert again[run].specific_force_m_per_s2.tolist() == first[run].specific_force_m_per_s2.tolist() == [1.0, 2.0]
