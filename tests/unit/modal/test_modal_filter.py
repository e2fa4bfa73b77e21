"""The modal filter: exact for enough sensors, honest about the rest."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.errors import AnalysisError
from sloshlab.modal.modal_filter import modal_filter

GENERATOR = np.random.default_rng(11)
SHAPES = np.array([[1.0, 1.0, 1.0], [0.62, -0.31, -0.6], [0.25, -0.7, 0.55], [0.1, -0.4, 0.8]])
NAMES = ("tip", "outer", "middle", "inner")


@pytest.mark.parametrize("n_sensors", [3, 4])
def test_modal_accelerations_are_exact_for_at_least_as_many_sensors_as_modes(n_sensors: int) -> None:
    modal = GENERATOR.normal(size=(3, 500))
    sensors = sum(np.outer(SHAPES[:n_sensors, n], modal[n]) for n in range(3))
    result = modal_filter(SHAPES[:n_sensors], sensor_names=NAMES[:n_sensors]).apply(sensors, 500.0)
    np.testing.assert_allclose(result.acceleration_m_per_s2, modal, rtol=0, atol=1e-12)
    assert (result.residual_rms_m_per_s2 < 1e-12).all()


def test_what_the_modes_do_not_explain_is_reported_per_sensor() -> None:
    # a motion of length 2 across all mode shapes: the null space of Ψᵀ
    outside = np.linalg.svd(SHAPES)[0][:, 3]
    signal = np.sqrt(2) * np.sin(2 * np.pi * np.arange(1000) / 50)
    result = modal_filter(SHAPES, sensor_names=NAMES).apply(np.outer(2 * outside, signal), 500.0)
    assert result.acceleration_m_per_s2 == pytest.approx(0, abs=1e-12)
    assert result.residual_rms_m_per_s2 == pytest.approx(2 * np.abs(outside), rel=1e-9)
    assert result.residual_share == pytest.approx(1.0)


def test_visibility_is_the_inverse_of_the_gain_of_noise() -> None:
    sensors = modal_filter(SHAPES, sensor_names=NAMES)
    noise = GENERATOR.normal(size=(4, 200_000))
    scatter = sensors.apply(noise, 500.0).acceleration_m_per_s2.std(axis=1)
    assert 1 / sensors.visibility == pytest.approx(scatter, rel=0.01)


def test_visibility_is_over_the_largest_deflection() -> None:
    sensors = modal_filter(np.diag([0.5, 0.5]), sensor_names=("a", "b"), largest_deflection=np.array([0.5, -2.0]))
    assert sensors.visibility == pytest.approx([1.0, 0.25])
    with pytest.raises(AnalysisError, match=r"cannot see mode 2: got visibility 0\.01;"):
        modal_filter(np.eye(2), sensor_names=("a", "b"), largest_deflection=np.array([1.0, 100.0]))


def test_conditioning_of_orthogonal_and_of_similar_shapes() -> None:
    assert modal_filter(np.eye(2), sensor_names=("a", "b")).condition_number == pytest.approx(1.0)
    # the scale of a mode says nothing of how well it is told from others
    assert modal_filter(np.diag([1.0, 50.0]), sensor_names=("a", "b")).condition_number == pytest.approx(1.0)
    # columns at an angle of 0.1 rad: singular values √2 cos 0.05 and √2 sin 0.05
    similar = np.array([[1.0, np.cos(0.1)], [0.0, np.sin(0.1)]])
    assert modal_filter(similar, sensor_names=("a", "b")).condition_number == pytest.approx(1 / np.tan(0.05))


@pytest.mark.parametrize(
    ("shapes", "match"),
    [
        (np.array([[1.0, 0.001], [0.5, 0.0]]), r"sensors tip, outer cannot see second bending: .*remedy"),
        (np.array([[1.0, 1.0], [0.5, 0.5]]), "cannot see first bending and second bending"),
        (np.array([[1.0, 0.4]]), "second bending cannot be told from the others"),
        (np.array([[1.0, np.nan], [0.5, 0.1]]), "mode shapes"),
    ],
)
def test_sensors_that_cannot_see_a_mode_are_refused_with_its_name(shapes: np.ndarray, match: str) -> None:
    with pytest.raises(AnalysisError, match=match) as error:
        modal_filter(shapes, sensor_names=NAMES[: shapes.shape[0]], mode_names=("first bending", "second bending"))
    assert "\n" not in str(error.value)


def test_another_number_of_channels_is_refused() -> None:
    with pytest.raises(AnalysisError, match="one row for each of tip, outer"):
        modal_filter(np.eye(2), sensor_names=("tip", "outer")).apply(np.zeros((3, 10)), 100.0)


def test_gaps_stay_gaps() -> None:
    values = np.ones((4, 3))
    values[2, 1] = np.nan
    result = modal_filter(SHAPES, sensor_names=NAMES).apply(values, 100.0)
    assert np.isnan(result.acceleration_m_per_s2[:, 1]).all()
    assert np.isfinite(result.residual_rms_m_per_s2).all()
    assert result.to_dataset().modal_acceleration_m_per_s2.attrs["units"] == "m s-2"
