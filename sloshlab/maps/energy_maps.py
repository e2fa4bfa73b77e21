"""Maps of work, W̄ and β over frequency and amplitude.

All maps come from two fields, W/(u₀Ω)² and the effective mass, interpolated over the logarithms of
frequency and acceleration: in these coordinates the runs of a campaign are straight lines and the
fields are smooth, while W itself spans decades. W(f, u₀), W̄(ω̄, ū) and W̄(ω̄, v̄) are then one map
on three grids.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import AnalysisError
from sloshlab.maps.interpolation import CrossValidation, ScatteredField, cross_validation, interpolated
from sloshlab.maps.measured_region import inside_measured_region
from sloshlab.quantities import described
from sloshlab.rig import Rig

FloatArray = npt.NDArray[np.float64]

N_GRID = 81
"""Points along each axis of a grid."""


@dataclass(frozen=True)
class EnergyMaps:
    """Maps of one fill level, or of a rig without a tank.

    Attributes
    ----------
    dataset : xarray.Dataset
        ``work_j(frequency_hz, amplitude_m)`` and, with a tank, ``w_bar`` and ``beta`` over
        ``(omega_bar, u_bar)`` and over ``(omega_bar, v_bar)``; each with ``…_std``, and ``measured``
        masks. Outside the measured region all are NaN.
    validation : dict
        Name of the field → its `CrossValidation`.
    """

    dataset: xr.Dataset
    validation: dict[str, CrossValidation]


def energy_maps(
    windows: xr.Dataset, rig: Rig | None = None, *, extent: xr.Dataset | None = None, n_grid: int = N_GRID
) -> EnergyMaps:
    """Interpolate windows to maps.

    Parameters
    ----------
    windows : xarray.Dataset
        From `sloshlab.sweep.windows.evaluate_windows`, runs of one rig concatenated.
    rig : Rig, optional
        Gives the liquid's scales; without it only W(f, u₀) is mapped.
    extent : xarray.Dataset, optional
        Windows whose range the grids cover; the same for several fill levels makes their maps comparable.
    n_grid : int
        Points along each axis.

    Returns
    -------
    EnergyMaps

    Raises
    ------
    AnalysisError
        If there are fewer than three windows.
    """
    used = windows.isel(window=np.flatnonzero(windows["acceleration_g"].values > 0))
    if used.sizes["window"] < 3:
        raise AnalysisError(
            "map", got=f"{used.sizes['window']} windows", allowed="at least 3", remedy="give longer or more runs"
        )
    frequency, amplitude = used["frequency_hz"].values, used["amplitude_m"].values
    points = _coordinates(frequency, amplitude)
    group = np.unique(used["run"].values.astype(str), return_inverse=True)[1]
    work = ScatteredField(points, used["dissipated_mass_kg"].values, used["dissipated_mass_kg_std"].values, group)
    covered = used if extent is None else extent
    builder = _Builder(points, group, n_grid, covered["frequency_hz"].values, covered["amplitude_m"].values)
    validations = {"work_j": cross_validation(work)}
    variables = _work_map(builder, work, validations["work_j"].smoothing)
    if rig is not None:
        beta = ScatteredField(points, used["beta"].values, used["beta_std"].values, group)
        validations["w_bar"] = _divided(validations["work_j"], rig.liquid_mass_kg)
        validations["beta"] = cross_validation(beta)
        variables |= _liquid_maps(builder, rig, work, beta, validations)
    dataset = described(xr.Dataset(variables))
    dataset.attrs = {
        f"{name}_left_out_{kind}_rms": getattr(result, f"left_out_{kind}_rms")
        for name, result in validations.items()
        for kind in ("windows", "runs")
        if name != "work_j" or rig is None
    }
    return EnergyMaps(dataset, validations)


def _coordinates(frequency_hz: FloatArray, amplitude_m: FloatArray) -> FloatArray:
    """log₂ of frequency and of acceleration; shape (n, 2)."""
    acceleration = np.maximum(amplitude_m * (2 * np.pi * frequency_hz) ** 2, 1e-12)
    return np.column_stack([np.log2(frequency_hz), np.log2(acceleration / GRAVITY_M_PER_S2)])


def _divided(validation: CrossValidation, by: float) -> CrossValidation:
    return CrossValidation(
        validation.left_out_windows_rms / by, validation.left_out_runs_rms / by, validation.smoothing
    )


@dataclass(frozen=True)
class _Builder:
    """The measured region, and the grids over the range of frequencies and amplitudes."""

    points: FloatArray
    group: npt.NDArray[np.intp]
    n_grid: int
    frequency_hz: FloatArray
    amplitude_m: FloatArray

    def frequencies(self) -> FloatArray:
        return np.linspace(self.frequency_hz.min(), self.frequency_hz.max(), self.n_grid)

    def amplitudes(self, largest: float) -> FloatArray:
        return np.linspace(0.0, largest, self.n_grid + 1)[1:]

    def on_grid(
        self,
        amplitudes: FloatArray,
        displacement: Callable[[FloatArray, FloatArray], FloatArray],
        fields: list[tuple[ScatteredField, float]],
    ) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_], list[tuple[FloatArray, FloatArray]]]:
        """Frequencies, displacements and mask on the grid, and values with errors of each field."""
        frequency, amplitude = np.meshgrid(self.frequencies(), amplitudes, indexing="ij")
        u0 = displacement(frequency, amplitude)
        at = _coordinates(frequency.ravel(), u0.ravel())
        mask = inside_measured_region(self.points, self.group, at)
        results = []
        for field, smoothing in fields:
            value, std = np.full(at.shape[0], np.nan), np.full(at.shape[0], np.nan)
            if mask.any():
                value[mask], std[mask] = interpolated(field, at[mask], smoothing)
            results.append((value.reshape(frequency.shape), std.reshape(frequency.shape)))
        return frequency, u0, mask.reshape(frequency.shape), results


def _work_map(builder: _Builder, work: ScatteredField, smoothing: float) -> dict[str, tuple[object, ...]]:
    amplitudes = builder.amplitudes(float(builder.amplitude_m.max()))
    frequency, u0, mask, [(value, std)] = builder.on_grid(amplitudes, lambda f, a: a, [(work, smoothing)])
    speed2 = (2 * np.pi * frequency * u0) ** 2
    dimensions = ("frequency_hz", "amplitude_m")
    return {
        "frequency_hz": ("frequency_hz", builder.frequencies()),
        "amplitude_m": ("amplitude_m", amplitudes),
        "work_j": (dimensions, value * speed2),
        "work_j_std": (dimensions, std * speed2),
        "measured_work_j": (dimensions, mask.astype(np.int8)),
    }


def _liquid_maps(
    builder: _Builder,
    rig: Rig,
    work: ScatteredField,
    beta: ScatteredField,
    validations: dict[str, CrossValidation],
) -> dict[str, tuple[object, ...]]:
    height, omega_scale = rig.tank.height_m, rig.frequency_scale_rad_per_s
    fields = [(work, validations["work_j"].smoothing), (beta, validations["beta"].smoothing)]
    u_bar = builder.amplitudes(float(builder.amplitude_m.max()) / height)
    speed = 2 * np.pi * builder.frequency_hz * builder.amplitude_m / rig.velocity_scale_m_per_s
    v_bar = builder.amplitudes(float(speed.max()))
    variables: dict[str, tuple[object, ...]] = {
        "omega_bar": ("omega_bar", 2 * np.pi * builder.frequencies() / omega_scale),
        "u_bar": ("u_bar", u_bar),
        "v_bar": ("v_bar", v_bar),
    }
    over_u = builder.on_grid(u_bar, lambda f, a: a * height, fields)
    over_v = builder.on_grid(v_bar, lambda f, a: a * rig.velocity_scale_m_per_s / (2 * np.pi * f), fields)
    for (_, _, mask, results), suffix, axis in ((over_u, "", "u_bar"), (over_v, "_over_v_bar", "v_bar")):
        dimensions = ("omega_bar", axis)
        for name, (value, std), scale in zip(("w_bar", "beta"), results, (rig.liquid_mass_kg, 1.0), strict=True):
            variables[name + suffix] = (dimensions, value / scale)
            variables[name + suffix + "_std"] = (dimensions, std / scale)
        variables["measured" + suffix] = (dimensions, mask.astype(np.int8))
    return variables
