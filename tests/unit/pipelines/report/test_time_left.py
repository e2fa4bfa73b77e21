"""The time left of computations whose work is uneven, made here without the estimator.

What counts is the share of moments, after a fifth of the whole time, at which the time left is right within a
factor of two, or within a twentieth of the whole.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from pipelines.report.time_left import TimeLeft, WeightedSteps

N_RUNS = 300


def share_within_a_factor_of_two(moments: Iterator[tuple[float, float, float | None]]) -> float:
    """Share of (time, whole time, told time left) that are right."""
    right = []
    for now, whole, told in moments:
        if now < whole / 5 or now >= whole:
            continue
        left = whole - now
        right.append(told is not None and (left / 2 <= told <= 2 * left or abs(told - left) < whole / 20))
    assert len(right) > 100
    return float(np.mean(right))


def moments_of(
    time_left: TimeLeft, ends: np.ndarray, told: list[tuple[float, float, str]]
) -> Iterator[tuple[float, float, float | None]]:
    """Moments between the ends of steps, from which the estimator hears of nothing."""
    for k, (end, (done, everything, note)) in enumerate(zip(ends, told, strict=True)):
        time_left.at(float(end), done, everything, note)
        until = ends[k + 1] if k + 1 < len(ends) else end
        for now in np.linspace(end, until, 5)[:-1]:
            yield float(now), float(ends[-1]), time_left.seconds(float(now))


def of_files(seed: int, *, weighted: bool) -> Iterator[tuple[float, float, float | None]]:
    """Recordings of 4 … 400 s in order of length, whose analysis takes its time by the second, ± 30 %."""
    draw = np.random.default_rng(seed)
    sizes = np.sort(np.exp(draw.uniform(np.log(4), np.log(400), 24)))
    ends = np.cumsum(sizes * np.exp(draw.normal(0, 0.3, sizes.size)) / 20)
    work = WeightedSteps(list(sizes) if weighted else [1.0] * sizes.size)
    told = [(work.done(k + 1), work.everything, f"run_{k}") for k in range(sizes.size)]
    return moments_of(TimeLeft(0.0), ends, told)


def of_epochs(seed: int) -> Iterator[tuple[float, float, float | None]]:
    """Epochs of training: of one cost in proportion, which grows or shrinks by a third on the way, ± 10 %."""
    draw = np.random.default_rng(seed)
    drift = np.linspace(1.0, np.exp(draw.normal(0, 0.3)), 60)
    ends = np.cumsum(drift * np.exp(draw.normal(0, 0.1, 60)))
    return moments_of(TimeLeft(0.0), ends, [(k + 1, 60, f"epoch {k}") for k in range(60)])


STAGES = {"reading": 10.0, "one effect": 30.0, "swapped": 20.0, "refining": 10.0, "two effects": 30.0}
"""Usual lengths [s]."""
PLAN = [("reading", 0.05), ("one effect", 0.25), ("swapped", 0.5), ("refining", 0.65), ("two effects", 0.85)]
"""The middles of these stages, in shares of the whole."""


def of_stages(seed: int, plan: list[tuple[str, float]]) -> Iterator[tuple[float, float, float | None]]:
    """A search through stages of ten steps, each stage usual in length within ± 40 %."""
    draw = np.random.default_rng(seed)
    lengths = np.array([*STAGES.values()]) * np.exp(draw.normal(0, 0.4, len(STAGES)))
    steps = np.concatenate([np.full(10, length / 10) for length in lengths])
    told = [(k + 1, 10, f"{stage}: {k}") for stage in STAGES for k in range(10)]
    return moments_of(TimeLeft(0.0, plan), np.cumsum(steps), told)


def share_of(kind, *arguments, **options) -> float:
    return share_within_a_factor_of_two(
        moment for seed in range(N_RUNS) for moment in kind(seed, *arguments, **options)
    )


def test_files_of_very_different_length() -> None:
    assert share_of(of_files, weighted=True) > 0.95
    # what the sizes are for: all files alike, the long ones at the end come as a surprise
    assert share_of(of_files, weighted=False) < 0.5


def test_epochs_whose_cost_drifts() -> None:
    assert share_of(of_epochs) > 0.95


def test_stages_that_are_usual_in_length() -> None:
    # a plan knows the middle of a stage only: at the ends of a long one it is off
    assert share_of(of_stages, PLAN) > 0.75
    # without a plan only the end of the present stage is known
    assert share_of(of_stages, []) < 0.5


def test_a_stage_that_is_left_out_shortens_what_is_left() -> None:
    time_left = TimeLeft(0.0, PLAN)
    time_left.at(10.0, 0, 1, "one effect: matching")
    assert time_left.seconds(10.0) == pytest.approx(30.0)
    time_left.at(17.0, 0, 1, "two effects: matching")
    assert time_left.seconds(17.0) == pytest.approx(3.0)


def test_a_stage_does_not_come_back() -> None:
    """What is told of a part of a later stage may begin like an earlier one."""
    again = TimeLeft(0.0, [*PLAN, ("swapped", 0.9)])
    again.at(13.0, 0, 1, "refining")
    again.at(13.0, 0, 1, "swapped before the second one")
    assert again.seconds(13.0) == pytest.approx(7.0)
    again.at(17.0, 0, 1, "two effects")
    again.at(18.0, 0, 1, "swapped once more")
    assert again.seconds(18.0) == pytest.approx(2.0)
    again.at(27.0, 0, 1, "one effect: of the last")
    assert again.seconds(27.0) == pytest.approx(3.0)


def test_nothing_is_told_before_anything_is_known() -> None:
    time_left = TimeLeft(0.0)
    time_left.at(5.0, 0, 10)
    assert time_left.seconds(6.0) is None
    assert TimeLeft(0.0, PLAN).seconds(1.0) is None


def test_another_step_begins_anew() -> None:
    time_left = TimeLeft(0.0)
    time_left.at(10.0, 1, 2)
    assert time_left.seconds(10.0) == pytest.approx(10.0)
    time_left.at(20.0, 0, 8)
    time_left.at(24.0, 2, 8)
    assert time_left.seconds(24.0) == pytest.approx(12.0)
    assert time_left.seconds(30.0) == pytest.approx(6.0)
    assert time_left.seconds(1000.0) is None
