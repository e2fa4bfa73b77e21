"""Maps of work, W̄ and β over frequency and amplitude.

All maps come from two fields, W/(u₀Ω)² and the effective mass, which are smooth while W itself spans
decades. W(f, u₀), W̄(ω̄, ū) and W̄(ω̄, v̄) are one map on three grids. Distances are taken either over
frequency and displacement, as in the source, or over the logarithms of frequency and acceleration;
cross-validation decides.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
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
    # windows without a motion have no place in the logarithms
    used = windows.isel(window=np.flatnonzero(windows["acceleration_g"].values > 0))
    if used.sizes["window"] < 3:
        raise AnalysisError(
            "map",
            got=f"{used.sizes['window']} windows",
            allowed="at least 3",
            remedy="give longer or more runs, or put windows closer together (--m) or make them shorter (--p)",
        )
    frequency, amplitude = used["frequency_hz"].values, used["amplitude_m"].values
    plane = _Plane.spanned_by(frequency, amplitude)
    group = np.unique(used["run"].values.astype(str), return_inverse=True)[1]

    def field(name: str) -> ScatteredField:
        return ScatteredField(plane.at(frequency, amplitude), used[name].values, used[f"{name}_std"].values, group)

    covered = used if extent is None else extent
    grids = _grids(covered["frequency_hz"].values, covered["amplitude_m"].values, rig, n_grid)
    mask = [_measured(plane, used, group, grid) for grid in grids]
    # W/(u₀Ω)², of which W̄ and W are multiples: the same smoothing serves both
    work = field("dissipated_mass_kg")
    chosen = {"work_j": cross_validation(work)}
    variables = _axes(grids, rig)
    variables |= _work_map(grids[0], _on_grids(plane, grids[:1], mask[:1], work, chosen["work_j"])[0], mask[0])
    if rig is not None:
        beta = field("beta")
        chosen |= {"w_bar": _divided(chosen["work_j"], rig.liquid_mass_kg), "beta": cross_validation(beta)}
        w_bar = dataclasses.replace(
            work, values=work.values / rig.liquid_mass_kg, std=work.std / rig.liquid_mass_kg
        )
        for name, scattered in (("w_bar", w_bar), ("beta", beta)):
            variables |= _liquid_maps(name, _on_grids(plane, grids[1:], mask[1:], scattered, chosen[name]))
        variables["measured"] = (("omega_bar", "u_bar"), mask[1].astype(np.int8))
        variables["measured_over_v_bar"] = (("omega_bar", "v_bar"), mask[2].astype(np.int8))
    for name in ("w_bar", "beta") if rig is not None else ("work_j",):
        kinds = ("windows", "runs")
        variables |= {
            f"{name}_left_out_{kind}_rms": ((), getattr(chosen[name], f"left_out_{kind}_rms")) for kind in kinds
        }
    dataset = described(xr.Dataset(variables))
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
                # logarithms: an octave of frequency counts as much as a doubling of the level
                [np.log2(frequency_hz), np.log2(acceleration / GRAVITY_M_PER_S2)]
            ),
            "frequency and displacement": np.column_stack(
                [frequency_hz / self.frequency_span_hz, amplitude_m / self.amplitude_span_m]
            ),
        }


@dataclass(frozen=True)
class _Grid:
    """A grid over frequency and some amplitude; `amplitude_m` is the displacement at its nodes."""

    frequencies_hz: FloatArray
    axis: FloatArray
    amplitude_m: FloatArray

    @property
    def frequency_hz(self) -> FloatArray:
        """Frequency at the nodes, shape (n_frequencies, n_amplitudes)."""
        return np.broadcast_to(self.frequencies_hz[:, None], self.amplitude_m.shape)


def _grids(frequency_hz: FloatArray, amplitude_m: FloatArray, rig: Rig | None, n_grid: int) -> list[_Grid]:
    """Grids over u₀ and, with a tank, over ū and v̄, that cover the given windows."""
    frequencies = np.linspace(frequency_hz.min(), frequency_hz.max(), n_grid)
    # v̄ √(gh) = Ωu₀: along a line of constant v̄ the displacement falls with the frequency
    per_speed = 1 / (2 * np.pi * frequencies)

    def grid(largest: float, metres_per_unit: FloatArray) -> _Grid:
        # without the line at zero, where W̄ is 0/0
        axis = np.linspace(0.0, largest, n_grid + 1)[1:]
        return _Grid(frequencies, axis, np.outer(metres_per_unit, axis))

    displacement_scale = np.ones(n_grid)
    grids = [grid(float(amplitude_m.max()), displacement_scale)]
    if rig is not None:
        height, speed = rig.tank.height_m, rig.velocity_scale_m_per_s
        grids.append(grid(float(amplitude_m.max()) / height, height * displacement_scale))
        grids.append(grid(float((2 * np.pi * frequency_hz * amplitude_m).max()) / speed, speed * per_speed))
    return grids


def _measured(
    plane: _Plane, windows: xr.Dataset, group: npt.NDArray[np.intp], grid: _Grid
) -> npt.NDArray[np.bool_]:
    """Nodes that the windows lie around, judged in the logarithms."""
    own = plane.at(windows["frequency_hz"].values, windows["amplitude_m"].values)
    nodes = plane.at(grid.frequency_hz.ravel(), grid.amplitude_m.ravel())
    # in one kind of coordinates for all maps, whichever the interpolation chose
    inside = inside_measured_region(next(iter(own.values())), group, next(iter(nodes.values())))
    return inside.reshape(grid.amplitude_m.shape)


def _on_grids(
    plane: _Plane,
    grids: Sequence[_Grid],
    masks: Sequence[npt.NDArray[np.bool_]],
    field: ScatteredField,
    chosen: CrossValidation,
) -> list[tuple[FloatArray, FloatArray]]:
    """Values and standard errors on each grid, NaN outside the mask; the weights are found once for all grids."""
    frequency = np.concatenate([grid.frequency_hz[mask] for grid, mask in zip(grids, masks, strict=True)])
    amplitude = np.concatenate([grid.amplitude_m[mask] for grid, mask in zip(grids, masks, strict=True)])
    # solving for the weights costs far more than evaluating them
    edges = np.cumsum([mask.sum() for mask in masks])[:-1]
    both = (
        interpolated(field, plane.at(frequency, amplitude), chosen) if frequency.size else (frequency, amplitude)
    )
    results = []
    for mask, *parts in zip(masks, *(np.split(values, edges) for values in both), strict=True):
        filled = [np.full(mask.shape, np.nan) for _ in parts]
        for whole, part in zip(filled, parts, strict=True):
            whole[mask] = part
        results.append((filled[0], filled[1]))
    return results


def _axes(grids: Sequence[_Grid], rig: Rig | None) -> dict[str, tuple[object, ...]]:
    axes: dict[str, tuple[object, ...]] = {
        "frequency_hz": ("frequency_hz", grids[0].frequencies_hz),
        "amplitude_m": ("amplitude_m", grids[0].axis),
    }
    if rig is not None:
        omega_bar = 2 * np.pi * grids[1].frequencies_hz / rig.frequency_scale_rad_per_s
        axes |= {
            "omega_bar": ("omega_bar", omega_bar),
            "u_bar": ("u_bar", grids[1].axis),
            "v_bar": ("v_bar", grids[2].axis),
        }
    return axes


def _work_map(
    grid: _Grid, dissipated_mass: tuple[FloatArray, FloatArray], mask: npt.NDArray[np.bool_]
) -> dict[str, tuple[object, ...]]:
    """W = (u₀Ω)² × W/(u₀Ω)²."""
    speed2 = (2 * np.pi * grid.frequency_hz * grid.amplitude_m) ** 2
    value, std = dissipated_mass
    dimensions = ("frequency_hz", "amplitude_m")
    return {
        "work_j": (dimensions, value * speed2),
        "work_j_std": (dimensions, std * speed2),
        "measured_work_j": (dimensions, mask.astype(np.int8)),
    }


def _liquid_maps(
    name: str, over_u_and_v: Sequence[tuple[FloatArray, FloatArray]]
) -> dict[str, tuple[object, ...]]:
    (value_u, std_u), (value_v, std_v) = over_u_and_v
    return {
        name: (("omega_bar", "u_bar"), value_u),
        f"{name}_std": (("omega_bar", "u_bar"), std_u),
        f"{name}_over_v_bar": (("omega_bar", "v_bar"), value_v),
        f"{name}_over_v_bar_std": (("omega_bar", "v_bar"), std_v),
    }
