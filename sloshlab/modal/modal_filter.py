"""Modal coordinates from sensors along a structure: the pseudo-inverse of the mode shapes (2.25).

Accelerations at the sensors are a = Ψ q̈ + what no kept mode explains. The least-squares answer is Ψ⁺ a; how well
the sensors tell the modes apart and what is left over are reported with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.errors import AnalysisError
from sloshlab.quantities import described

FloatArray = npt.NDArray[np.float64]

SMALLEST_VISIBILITY = 0.02
"""Below this the noise of a sensor appears more than 50-fold in the modal coordinate."""


@dataclass(frozen=True)
class ModalResponse:
    """Accelerations in modal coordinates.

    Attributes
    ----------
    mode_names, sensor_names : tuple of str
        Rows of the arrays below.
    acceleration_m_per_s2 : ndarray, shape (n_modes, n_samples)
        q̈, upward positive, in the scale of the mode shapes.
    residual_rms_m_per_s2 : ndarray, shape (n_sensors,)
        RMS of what the kept modes do not explain; zero by necessity with as many modes as sensors.
    residual_share : ndarray, shape (n_sensors,)
        The same over the RMS of the sensor.
    sampling_rate_hz : float
        Samples per second.
    """

    mode_names: tuple[str, ...]
    sensor_names: tuple[str, ...]
    acceleration_m_per_s2: FloatArray
    residual_rms_m_per_s2: FloatArray
    residual_share: FloatArray
    sampling_rate_hz: float

    def to_dataset(self) -> xr.Dataset:
        """Modal accelerations over ``mode`` and ``sample_time_s``, residuals over ``sensor``."""
        n_samples = self.acceleration_m_per_s2.shape[1]
        variables = {
            "modal_acceleration_m_per_s2": (("mode", "sample_time_s"), self.acceleration_m_per_s2),
            "modal_residual_m_per_s2": ("sensor", self.residual_rms_m_per_s2),
            "modal_residual_share": ("sensor", self.residual_share),
        }
        coordinates = {
            "mode": ("mode", np.array(self.mode_names, dtype=object)),
            "sensor": ("sensor", np.array(self.sensor_names, dtype=object)),
            "sample_time_s": ("sample_time_s", np.arange(n_samples) / self.sampling_rate_hz),
        }
        return described(xr.Dataset(variables, coordinates))


@dataclass(frozen=True)
class ModalFilter:
    """Pseudo-inverse of the mode shapes at the sensors.

    Attributes
    ----------
    mode_names, sensor_names : tuple of str
        Columns and rows of the mode shapes.
    mode_shapes : ndarray, shape (n_sensors, n_modes)
        Ψ.
    weights : ndarray, shape (n_modes, n_sensors)
        Ψ⁺.
    visibility : ndarray, shape (n_modes,)
        Length of the part of a mode's shape at the sensors that no other mode can make, over the mode's largest
        deflection; its inverse is the gain of white sensor noise into the modal coordinate.
    condition_number : float
        Of the mode shapes, columns scaled to length 1.
    """

    mode_names: tuple[str, ...]
    sensor_names: tuple[str, ...]
    mode_shapes: FloatArray
    weights: FloatArray
    visibility: FloatArray
    condition_number: float

    def apply(self, accelerations_m_per_s2: FloatArray, sampling_rate_hz: float) -> ModalResponse:
        """Modal accelerations of a recording.

        Parameters
        ----------
        accelerations_m_per_s2 : ndarray, shape (n_sensors, n_samples)
            Absolute or relative, all alike; gaps (NaN) stay gaps in every mode.
        sampling_rate_hz : float
            Samples per second.

        Returns
        -------
        ModalResponse

        Raises
        ------
        AnalysisError
            If there is not one row per sensor.
        """
        values = np.asarray(accelerations_m_per_s2, dtype=np.float64)
        if values.ndim != 2 or values.shape[0] != len(self.sensor_names):
            raise AnalysisError(
                "modal filter",
                got=f"accelerations of shape {values.shape}",
                allowed=f"one row for each of {', '.join(self.sensor_names)}",
            )
        # q̈ = Ψ⁺ a (2.25)
        coordinates = self.weights @ values
        residual = _rms(values - self.mode_shapes @ coordinates)
        # what is left over is the only sign of a mode that was not kept, or of a sensor that is wrong
        share = residual / np.maximum(_rms(values), np.finfo(float).tiny)
        return ModalResponse(self.mode_names, self.sensor_names, coordinates, residual, share, sampling_rate_hz)


def modal_filter(
    mode_shapes: FloatArray,
    *,
    sensor_names: Sequence[str],
    mode_names: Sequence[str] | None = None,
    largest_deflection: FloatArray | None = None,
) -> ModalFilter:
    """Modal filter from mode shapes at the sensors.

    Parameters
    ----------
    mode_shapes : ndarray, shape (n_sensors, n_modes)
        Ψ, in any scale; for a cantilever with ψ = 1 at the tip from `sloshlab.modal.cantilever`.
    sensor_names : sequence of str
        Names of the channels.
    mode_names : sequence of str, optional
        Default: ``mode 1``, ``mode 2`` …
    largest_deflection : ndarray, shape (n_modes,), optional
        Largest |ψ| anywhere on the structure, against which visibility is measured; default 1.

    Returns
    -------
    ModalFilter

    Raises
    ------
    AnalysisError
        If there are fewer sensors than modes, or a mode that the sensors cannot see; the message names it.

    Examples
    --------
    >>> tip_and_middle = modal_filter(np.array([[1.0, 1.0], [0.5, -0.7]]), sensor_names=("tip", "middle"))
    >>> tip_and_middle.apply(np.array([[3.0], [-0.6]]), 1000.0).acceleration_m_per_s2.round(12).tolist()
    [[1.25], [1.75]]
    """
    shapes = np.atleast_2d(np.asarray(mode_shapes, dtype=np.float64))
    n_sensors, n_modes = shapes.shape
    names = tuple(mode_names or (f"mode {n}" for n in range(1, n_modes + 1)))
    if len(names) != n_modes or len(sensor_names) != n_sensors or not np.isfinite(shapes).all():
        raise AnalysisError(
            "mode shapes",
            got=f"shape {shapes.shape} for {len(sensor_names)} sensors and {len(names)} modes",
            allowed="finite values, one row per sensor, one column per mode",
        )
    if n_sensors < n_modes:
        raise AnalysisError(
            "modal filter",
            got=f"{n_sensors} sensors for {n_modes} modes; {names[n_sensors]} cannot be told from the others",
            allowed="at least as many sensors as modes",
            remedy="keep fewer modes or add sensors",
        )
    # against the largest deflection: a shape scaled to 1 at the tip may be larger elsewhere
    scale = np.ones(n_modes) if largest_deflection is None else np.abs(np.asarray(largest_deflection))
    visibility = np.asarray(_own_lengths(shapes) / scale, dtype=np.float64)
    _refuse_invisible(visibility, names, sensor_names)
    lengths = np.linalg.norm(shapes, axis=0)
    # the scale of the shapes is free and must not enter
    condition = float(np.linalg.cond(shapes / lengths))
    return ModalFilter(
        names,
        tuple(sensor_names),
        shapes,
        np.asarray(np.linalg.pinv(shapes), dtype=np.float64),
        visibility,
        condition,
    )


def _rms(values: FloatArray) -> FloatArray:
    present = np.isfinite(values)
    squares = np.where(present, values, 0.0) ** 2
    return np.asarray(np.sqrt(squares.sum(axis=1) / np.maximum(present.sum(axis=1), 1)))


def _own_lengths(shapes: FloatArray) -> FloatArray:
    """Length of the part of each column that is orthogonal to all other columns."""
    lengths = []
    for mode in range(shapes.shape[1]):
        others = np.delete(shapes, mode, axis=1)
        own = shapes[:, mode]
        if others.shape[1]:
            # the condition number alone does not name the mode that the sensors miss
            own = own - others @ np.linalg.lstsq(others, own, rcond=None)[0]
        lengths.append(float(np.linalg.norm(own)))
    return np.array(lengths)


def _refuse_invisible(visibility: FloatArray, names: Sequence[str], sensors: Sequence[str]) -> None:
    worst = int(np.argmin(visibility))
    if visibility[worst] < SMALLEST_VISIBILITY:
        hidden = [name for name, seen in zip(names, visibility, strict=True) if seen < SMALLEST_VISIBILITY]
        raise AnalysisError(
            f"sensors {', '.join(sensors)} cannot see {' and '.join(hidden)}",
            got=f"visibility {visibility[worst]:.2g}",
            allowed=f"≥ {SMALLEST_VISIBILITY:g}",
            remedy="move a sensor off the node, or leave the mode out",
        )
