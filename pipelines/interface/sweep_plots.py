"""Maps and loops of sweeps on axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import xarray as xr

from pipelines.interface.drawing import axes_to_draw_on, figure_of
from pipelines.sweep.results import RigResult, RunResult, SweepExperiment
from sloshlab.errors import AnalysisError, InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SYMBOLS: Final = {"w_bar": "W̄", "beta": "β", "w_bar_over_v_bar": "W̄", "beta_over_v_bar": "β"}
_WORK: Final = "work_j"


@dataclass(frozen=True)
class SweepPlots:
    """Figures of sweeps, each on axes that are given or new.

    Attributes
    ----------
    experiment : SweepExperiment
    """

    experiment: SweepExperiment

    def map(self, quantity: str = "", *, rig: str | float | None = None, ax: Axes | None = None) -> Axes:
        """Draw a map with the windows, lines of constant acceleration, and its cross-validated error.

        Parameters
        ----------
        quantity : str
            ``w_bar`` (W̄ over ū and ω̄, the default with a tank), ``beta``, both also ``…_over_v_bar``, or
            ``work_j`` (W [J] over amplitude and frequency, the default without one).
        rig : str or float, optional
            Name or fill level of the rig, where there are several; by default the first.
        ax : matplotlib.axes.Axes, optional

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        InputError
            If there is no such map or rig, or nothing to draw.
        """
        from pipelines.sweep import figures_maps
        from pipelines.sweep.selection import by_level, runs_of

        chosen = quantity or ("w_bar" if self.experiment.rigs else _WORK)
        allowed = [*(_SYMBOLS if self.experiment.rigs else ()), _WORK]
        if chosen not in allowed:
            raise InputError("map", got=repr(chosen), allowed=", ".join(allowed))
        found = self._rig(rig)
        runs = by_level(self.experiment.runs) if found is None else runs_of(self.experiment, found)
        with axes_to_draw_on(ax) as axes:
            if found is not None and chosen in _SYMBOLS:
                label = _SYMBOLS[chosen]
                figures_maps.draw_scaled(figure_of(axes), axes, found, runs, chosen, label=label, twins=False)
            else:
                maps = found.maps if found is not None else self.experiment.work_maps
                assert maps is not None
                figures_maps.draw_work(figure_of(axes), axes, maps, runs)
        return axes

    def loop(self, window: int | xr.Dataset, *, ax: Axes | None = None) -> Axes:
        """Draw force over displacement about one window, the periods over each other from dark to light.

        With a tank it is the sloshing force on the tank over m_l a₀ against u/u₀: counter-clockwise dissipates.
        Without one it is the measured force in its unit: clockwise dissipates.

        Parameters
        ----------
        window : int or xarray.Dataset
            Place along ``window`` of the windows, or one window of them (``windows.isel(window=3)``).
        ax : matplotlib.axes.Axes, optional

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        InputError
            If there is no such window, or its signals were not kept.
        """
        from pipelines.sweep.figures_signals import draw_loops, panel_of
        from pipelines.sweep.stages import excerpt_of

        run, at = self._window(window)
        if run.signals is None or run.signals.motion_is_velocity:
            got = "a motion that was not recorded as acceleration" if run.signals is not None else "no signals"
            raise AnalysisError(
                f"{run.attributes.run_id}: loop", got=got, allowed="the acceleration, kept with keep_signals=True"
            )
        rig = next((found for found in self.experiment.rigs if found.name == run.rig_name), None)
        rate_hz, start_s = run.attributes.sampling_rate_hz, run.start_time_s
        window = run.windows.isel(window=at)
        excerpt = excerpt_of(window, run.signals, None if rig is None else rig.rig, rate_hz, start_s)
        panels = panel_of(excerpt, None if rig is None else rig.rig.liquid_mass_kg)
        with axes_to_draw_on(ax) as axes:
            draw_loops(axes, panels.panels[0])
            axes.set(xlabel=panels.displacement_label, ylabel=panels.force_label)
        return axes

    def _rig(self, wanted: str | float | None) -> RigResult | None:
        rigs = self.experiment.rigs
        if wanted is None:
            return rigs[0] if rigs else None
        for rig in rigs:
            if wanted == rig.name or wanted == rig.rig.liquid.fill_level:
                return rig
        names = ", ".join(f"{rig.name} ({rig.rig.liquid.fill_level:g})" for rig in rigs)
        raise InputError("rig of the map", got=repr(wanted), allowed=names or "none, as there is no tank")

    def _window(self, window: int | xr.Dataset) -> tuple[RunResult, int]:
        """The run of a window, and its place among the windows of that run."""
        runs, sizes = self.experiment.runs, [run.windows.sizes["window"] for run in self.experiment.runs]
        if isinstance(window, xr.Dataset):
            window = self._place(window)
        n_windows = sum(sizes)
        if not -n_windows <= window < n_windows:
            raise InputError("window", got=str(window), allowed=f"0 … {n_windows - 1}")
        ends = np.cumsum(sizes)
        number = int(np.searchsorted(ends, window % n_windows, side="right"))
        return runs[number], int(window % n_windows - (ends[number] - sizes[number]))

    def _place(self, window: xr.Dataset) -> int:
        windows = self.experiment.windows
        if "run" in window and "time_s" in window and window["time_s"].ndim == 0:
            same = (windows["run"] == window["run"]) & (windows["time_s"] == window["time_s"])
            if same.any():
                return int(same.values.argmax())
        raise InputError(
            "window", got="a data set that is none of these windows", allowed="windows.isel(window=…)"
        )
