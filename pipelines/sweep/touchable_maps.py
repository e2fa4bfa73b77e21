"""Maps whose points show their loop, their window of signals and their spectrum."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.interactive.contents import Quantity, Window, WindowMap
from pipelines.report.numbers import prefixed_unit
from pipelines.report.style import WORK_COLOURS, negative_colours
from pipelines.sweep import figures_maps
from pipelines.sweep.figures_maps import MapField, scaled_field, work_field
from pipelines.sweep.selection import level_text, rig_text
from sloshlab.constants import GRAVITY_M_PER_S2

if TYPE_CHECKING:
    from pipelines.sweep.results import RigResult, RunResult
    from pipelines.sweep.window_signals import WindowSignals
    from sloshlab.maps.energy_maps import EnergyMaps

FloatArray = npt.NDArray[np.float64]

_N_COLOURS: Final = 64
_MOST_WINDOWS: Final = 200
"""Of a report: a campaign has thousands, and each takes three to five kilobytes of the page."""
_HOW: Final = (
    " A click on a circle, or its choice in the list, shows its loop, one period after the other from dark to "
    "light, its window of signals and the amplitudes of its force over multiples of the frequency of the motion. "
    "Dots are windows whose signals the page does not carry."
)


def w_bar_map(name: str, rig: RigResult, runs: Sequence[RunResult], counterpart: str, n_maps: int) -> ReportFigure:
    """W̄ over ū and ω̄; on a screen β, too, and every window."""
    still = figures_maps.scaled_map(name, rig, runs, quantity="w_bar", counterpart=counterpart)
    return dataclasses.replace(still, touch=scaled_window_map(rig, runs, n_maps))


def work_map(name: str, maps: EnergyMaps, runs: Sequence[RunResult], counterpart: str) -> ReportFigure:
    """W over amplitude and frequency; on a screen every window."""
    still = figures_maps.work_map(name, maps, runs, counterpart, with_points=False)
    return dataclasses.replace(still, touch=work_window_map(maps, runs))


def scaled_window_map(rig: RigResult, runs: Sequence[RunResult], n_maps: int = 1) -> WindowMap | None:
    """The windows of one fill level on the plane of ū and ω̄; None where no signals were kept.

    Parameters
    ----------
    rig : RigResult
    runs : sequence of RunResult
        Its runs, with windows.
    n_maps : int
        Maps of the same report, which share what room there is.
    """
    every = _windows_with_signals(runs)
    if not every:
        return None
    shown, others = thinned(every, max(1, _MOST_WINDOWS // n_maps), "w_bar")
    mass_kg = rig.rig.liquid_mass_kg
    fields = {label: scaled_field(rig.maps.dataset, name, rig.rig, label) for name, label in _SCALED.items()}
    quantities = [
        _quantity(field, _values(shown, name), signed=name == "beta")
        for (name, _), field in zip(_SCALED.items(), fields.values(), strict=True)
    ]
    windows = []
    for each in shown:
        inertia_n = mass_kg * each.value("acceleration_g") * GRAVITY_M_PER_S2
        windows.append(_window(each, 1 / inertia_n, 1 / each.value("amplitude_m")))
    plane = next(iter(fields.values())).plane
    return WindowMap(
        f"W̄ and β, {rig_text(rig)}",
        f"Work per cycle W̄ or sloshing-effective mass β for {rig_text(rig)}: the map within the measured region, "
        f"and the windows as circles in the same colours.{_HOW}",
        plane.abscissa_label,
        plane.ordinate_label,
        _values(shown, "u_bar"),
        _values(shown, "omega_bar"),
        _values(others, "u_bar"),
        _values(others, "omega_bar"),
        _extent(next(iter(fields.values()))),
        tuple(quantities),
        tuple(windows),
        "F_S/(m_l a₀)",
        "u/u₀",
        "amplitude of F_S [N]",
        first=int(np.nanargmax(quantities[0].values)),
    )


_SCALED: Final = {"w_bar": "W̄", "beta": "β"}


def work_window_map(maps: EnergyMaps, runs: Sequence[RunResult]) -> WindowMap | None:
    """The windows of runs without a tank on the plane of amplitude and frequency; None without signals."""
    everything = _windows_with_signals(runs)
    if not everything:
        return None
    shown, others = thinned(everything, _MOST_WINDOWS, "work_j")
    field = work_field(maps.dataset)
    factor, _ = prefixed_unit(maps.dataset["work_j"].values, "J")
    forces, lengths = ([getattr(each.signals, n) for each in shown] for n in ("force_n", "displacement_m"))
    force_factor, force_unit = prefixed_unit(np.concatenate(forces), "N")
    length_factor, length_unit = prefixed_unit(np.concatenate(lengths), "m")
    windows = [_window(each, force_factor, length_factor) for each in shown]
    of_others = _values(others, "frequency_hz"), _values(others, "acceleration_g")
    quantity = _quantity(field, factor * _values(shown, "work_j"), signed=False)
    return WindowMap(
        "Work per cycle",
        f"Dissipated work per cycle: the map within the measured region, and the windows as circles.{_HOW}",
        field.plane.abscissa_label,
        field.plane.ordinate_label,
        field.plane.abscissa(_values(shown, "frequency_hz"), _values(shown, "acceleration_g")),
        _values(shown, "frequency_hz"),
        field.plane.abscissa(*of_others),
        of_others[0],
        _extent(field),
        (quantity,),
        tuple(windows),
        f"force F [{force_unit}]",
        f"displacement u [{length_unit}]",
        "amplitude of F [N]",
        first=int(np.nanargmax(quantity.values)),
    )


@dataclass(frozen=True, eq=False)
class ShownWindow:
    """A window of a run by its number."""

    run: RunResult
    number: int

    @property
    def signals(self) -> WindowSignals:
        """What is seen of it."""
        return self.run.window_signals[self.number]

    def value(self, name: str) -> float:
        """One of its quantities."""
        return float(self.run.windows[name].values[self.number])


def _windows_with_signals(runs: Sequence[RunResult]) -> list[ShownWindow]:
    return [ShownWindow(run, number) for run in runs for number in range(len(run.window_signals))]


def thinned(
    windows: Sequence[ShownWindow], most: int, quantity: str
) -> tuple[list[ShownWindow], list[ShownWindow]]:
    """So many windows evenly, the one with the largest value of a quantity among them, and all the others."""
    n = len(windows)
    chosen = set(np.unique(np.linspace(0, n - 1, min(n, most)).astype(int)).tolist())
    values = np.array([window.value(quantity) for window in windows])
    if np.isfinite(values).any():
        chosen.add(int(np.nanargmax(values)))
    return [windows[at] for at in sorted(chosen)], [windows[at] for at in range(n) if at not in chosen]


def _values(windows: Sequence[ShownWindow], name: str) -> FloatArray:
    return np.array([window.value(name) for window in windows], np.float64)


def _window(window: ShownWindow, force_factor: float, length_factor: float) -> Window:
    signals, run = window.signals, window.run
    words = f"{window.value('frequency_hz'):.4g} Hz, {window.value('acceleration_g'):.3g} g"
    return Window(
        f"{run.attributes.run_id} ({level_text(run)})",
        f"{words} at {window.value('time_s'):.1f} s",
        signals.time_s - signals.time_s[0],
        force_factor * signals.force_n,
        length_factor * signals.displacement_m,
        signals.order,
        signals.amplitude_n,
    )


def _extent(field: MapField) -> tuple[float, float, float, float]:
    """From the edge of the first cell of a grid to that of the last."""
    low_x, high_x, low_y, high_y = (
        float(axis[end]) for axis in (field.abscissa, field.ordinate) for end in (0, -1)
    )
    half_x = 0.5 * (high_x - low_x) / max(field.abscissa.size - 1, 1)
    half_y = 0.5 * (high_y - low_y) / max(field.ordinate.size - 1, 1)
    return low_x - half_x, high_x + half_x, low_y - half_y, high_y + half_y


def _quantity(field: MapField, values: FloatArray, *, signed: bool) -> Quantity:
    """Colours that contain the map; windows beyond it have the colour of its end."""
    import matplotlib
    from matplotlib.colors import to_hex

    if not np.isfinite(values).any():
        raise NothingToDrawError(f"map of {field.label}: no finite value")
    colours = negative_colours() if signed else matplotlib.colormaps[WORK_COLOURS]
    low, high = float(np.nanmin(field.values)), float(np.nanmax(field.values))
    low = low if signed else min(low, 0.0)
    return Quantity(
        field.label,
        values,
        field.values,
        tuple(to_hex(colours(share)) for share in np.linspace(0, 1, _N_COLOURS)),
        low,
        high if high > low else low + 1.0,
    )
