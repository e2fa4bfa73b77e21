"""Maps of work, W̄ and β over frequency and amplitude.

All maps come from two fields, W/(u₀Ω)² and the effective mass, which are smooth while W itself spans
decades. W(f, u₀), W̄(ω̄, ū) and W̄(ω̄, v̄) are one map on three grids. Distances are taken either over
frequency and displacement, as in the source, or over the logarithms of frequency and acceleration;
cross-validation decides.
"""

from __future__ import annotations

import dataclasses
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
    plane = _Plane.spanned_by(frequency, amplitude)
    group = np.unique(used["run"].values.astype(str), return_inverse=True)[1]

    def field(name: str) -> ScatteredField:
        return ScatteredField(plane.at(frequency, amplitude), used[name].values, used[f"{name}_std"].values, group)

    covered = used if extent is None else extent
    builder = _Builder(
        plane, used, group, n_grid, covered["frequency_hz"].values, covered["amplitude_m"].values
    )  # fmt: skip
    work = field("dissipated_mass_kg")
    chosen = {"work_j": cross_validation(work)}
    variables = _work_map(builder, work, chosen["work_j"])
    if rig is not None:
        beta = field("beta")
        chosen |= {"w_bar": _divided(chosen["work_j"], rig.liquid_mass_kg), "beta": cross_validation(beta)}
        variables |= _liquid_maps(builder, rig, work, beta, chosen)
    dataset = described(xr.Dataset(variables))
    dataset.attrs = {
        f"{name}_left_out_{kind}_rms": getattr(result, f"left_out_{kind}_rms")
        for name, result in chosen.items()
        for kind in ("windows", "runs")
        if name != "work_j" or rig is None
    }
    return EnergyMaps(dataset, chosen)


def _divided(validation: CrossValidation, by: float) -> CrossValidation:
    return dataclasses.replace(
        validation,
        left_out_windows_rms=validation.left_out_windows_rms / by,
        left_out_runs_rms=validation.left_out_runs_rms / by,
    )


@dataclass(frozen=True)
class _Plane:
    """Coordinates of the plane of frequency and amplitude."""

    frequency_span_hz: float
    amplitude_span_m: float

    @classmethod
    def spanned_by(cls, frequency_hz: FloatArray, amplitude_m: FloatArray) -> _Plane:
        return cls(max(float(np.ptp(frequency_hz)), 1e-9), max(float(np.ptp(amplitude_m)), 1e-12))

    def at(self, frequency_hz: FloatArray, amplitude_m: FloatArray) -> dict[str, FloatArray]:
        """Both kinds of coordinates, shape (n, 2); the logarithmic ones come first."""
        acceleration = np.maximum(amplitude_m * (2 * np.pi * frequency_hz) ** 2, 1e-12)
        return {
            "logarithms of frequency and acceleration": np.column_stack(
                [np.log2(frequency_hz), np.log2(acceleration / GRAVITY_M_PER_S2)]
            ),
            "frequency and displacement": np.column_stack(
                [frequency_hz / self.frequency_span_hz, amplitude_m / self.amplitude_span_m]
            ),
        }


@dataclass(frozen=True)
class _Builder:
    """The measured region, and the grids over the range of frequencies and amplitudes."""

    plane: _Plane
    windows: xr.Dataset
    group: npt.NDArray[np.intp]
    n_grid: int
    frequency_hz: FloatArray
    amplitude_m: FloatArray

    def measured(self, at: dict[str, FloatArray]) -> npt.NDArray[np.bool_]:
        """Where the windows lie around, judged in the logarithms."""
        own = self.plane.at(self.windows["frequency_hz"].values, self.windows["amplitude_m"].values)
        return inside_measured_region(next(iter(own.values())), self.group, next(iter(at.values())))

    def frequencies(self) -> FloatArray:
        return np.linspace(self.frequency_hz.min(), self.frequency_hz.max(), self.n_grid)

    def amplitudes(self, largest: float) -> FloatArray:
        return np.linspace(0.0, largest, self.n_grid + 1)[1:]

    def on_grid(
        self,
        amplitudes: FloatArray,
        displacement: Callable[[FloatArray, FloatArray], FloatArray],
        fields: list[tuple[ScatteredField, CrossValidation]],
    ) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_], list[tuple[FloatArray, FloatArray]]]:
        """Frequencies, displacements and mask on the grid, and values with errors of each field."""
        frequency, amplitude = np.meshgrid(self.frequencies(), amplitudes, indexing="ij")
        u0 = displacement(frequency, amplitude)
        at = self.plane.at(frequency.ravel(), u0.ravel())
        mask = self.measured(at)
        inside = {name: points[mask] for name, points in at.items()}
        results = []
        for field, chosen in fields:
            value, std = np.full(mask.size, np.nan), np.full(mask.size, np.nan)
            if mask.any():
                value[mask], std[mask] = interpolated(field, inside, chosen)
            results.append((value.reshape(frequency.shape), std.reshape(frequency.shape)))
        return frequency, u0, mask.reshape(frequency.shape), results


def _work_map(builder: _Builder, work: ScatteredField, chosen: CrossValidation) -> dict[str, tuple[object, ...]]:
    amplitudes = builder.amplitudes(float(builder.amplitude_m.max()))
    frequency, u0, mask, [(value, std)] = builder.on_grid(amplitudes, lambda f, a: a, [(work, chosen)])
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
    chosen: dict[str, CrossValidation],
) -> dict[str, tuple[object, ...]]:
    height, omega_scale = rig.tank.height_m, rig.frequency_scale_rad_per_s
    fields = [(work, chosen["work_j"]), (beta, chosen["beta"])]
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
