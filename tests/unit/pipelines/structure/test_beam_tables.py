"""Damping of a recording and of its twin, compared over the same amplitudes."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.structure.results import group_of
from pipelines.structure.tables import mean_at_common_amplitudes
from sloshlab.modal.instantaneous_damping import InstantaneousDamping
from sloshlab.recording import RunAttributes


def reading(amplitude: np.ndarray, damping: np.ndarray) -> InstantaneousDamping:
    n = amplitude.size
    return InstantaneousDamping(
        method="local sine fit",
        time_s=np.arange(n, dtype=float),
        acceleration_amplitude_m_per_s2=amplitude,
        damping_ratio=damping,
        damping_ratio_std=np.full(n, 1e-4),
        frequency_hz=np.full(n, 10.0),
        frequency_hz_std=np.full(n, 1e-4),
        coverage_factor=np.full(n, 1.65),
        trust=np.full(n, "used"),
    )


def test_only_amplitudes_that_both_pass_through_count_and_each_once() -> None:
    """Thirty stretches at 1 m/s² count as one; those at 1000 m/s² are not reached by the twin."""
    measured = reading(
        np.concatenate([[1000.0, 100.0, 10.0], np.ones(30)]),
        np.concatenate([[0.9, 0.03, 0.02], np.full(30, 0.01)]),
    )
    # 5 % at 100 and 1 % at 1 m/s²: 3 % at 10 m/s², half way on the logarithm
    twin = reading(np.array([100.0, 1.0]), np.array([0.05, 0.01]))
    assert mean_at_common_amplitudes(measured, twin) == pytest.approx((0.02, 0.03))


def test_without_a_common_amplitude_there_is_no_mean() -> None:
    apart = reading(np.array([100.0]), np.array([0.05])), reading(np.array([1.0]), np.array([0.01]))
    assert np.isnan(mean_at_common_amplitudes(*apart)).all()


@pytest.mark.parametrize(
    ("rig", "forces", "name"),
    [
        ("frozen.toml", "", "twin frozen"),
        ("rig_beam.toml", "coulomb (structure)", "twin rig_beam: frozen"),
        ("c1.toml", "viscous_damping (tank), coulomb (structure)", "twin c1: viscous damping"),
    ],
)
def test_a_twin_is_named_by_its_rig_and_the_forces_of_its_liquid(rig: str, forces: str, name: str) -> None:
    attributes = RunAttributes(
        run_id="one",
        experiment="beam_free",
        configuration="frozen",
        rig=rig,
        sampling_rate_hz=1024.0,
        start_time_utc="2026-01-12T09:00:00Z",
        sloshlab_format="1",
        simulated_from="decay.nc",
        simulated_forces=forces,
    )
    assert group_of(attributes) == name
