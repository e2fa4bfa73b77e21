"""The twin in Python: a recorded run in, the same channels simulated."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from pipelines.inputs.recordings import RunLike, run_source
from pipelines.inputs.rigs import RigLike, rig_source
from pipelines.interface import html
from pipelines.interface.drawing import axes_to_draw_on, in_words, legend_below
from pipelines.report.free_place import require_free_place
from pipelines.twin.simulate import SimulatedTwin, simulated_twin, write_simulation
from pipelines.twin.simulation_settings import SimulationSettings
from sloshlab.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_RECORDED, _SIMULATED = "#b8c4d0", "#d62728"


@dataclass(frozen=True)
class SimulationPlots:
    """Figures of a simulation, each on axes that are given or new.

    Attributes
    ----------
    found : SimulatedTwin
    """

    found: SimulatedTwin

    def channel(self, name: str = "", *, start_s: float | None = None, stop_s: float | None = None,
                ax: Axes | None = None) -> Axes:  # fmt: skip
        """Draw one channel over time, recorded and simulated.

        Parameters
        ----------
        name : str
            By default the first that was simulated and recorded.
        start_s, stop_s : float, optional
            The stretch that is drawn [s]; by default everything.
        ax : matplotlib.axes.Axes, optional

        Raises
        ------
        InputError
            If there is no such channel.
        """
        simulated, recorded = self.found.simulated.recording, self.found.recording
        common = sorted(str(each) for each in simulated.data_vars if each in recorded and each != "quality")
        chosen = name or next(iter(common), "")
        if chosen not in common:
            raise InputError("channel", got=repr(chosen), allowed=", ".join(common))
        with axes_to_draw_on(ax) as axes:
            for one, colour, width, label in (
                (recorded[chosen], _RECORDED, 2.4, "recorded"), (simulated[chosen], _SIMULATED, 0.9, "simulated")
            ):  # fmt: skip
                part = one.sel(time=slice(start_s, stop_s))
                axes.plot(part["time"].values, np.asarray(part.values), color=colour, lw=width, label=label)
            axes.set(xlabel="time [s]", ylabel=in_words(f"{chosen} [{recorded[chosen].attrs['units']}]"))
            legend_below(axes)
        return axes


@dataclass(frozen=True, eq=False)
class TwinSimulation:
    """A run of the twin: what `simulate` returns.

    Attributes
    ----------
    found : SimulatedTwin
        The twin, what drove it, and what it did.
    """

    found: SimulatedTwin

    @property
    def recording(self) -> xr.Dataset:
        """The simulated channels under the names of the recording, in SI units, upward positive."""
        return self.found.simulated.recording

    @property
    def flags(self) -> tuple[str, ...]:
        """What a reader must know before using it; empty is good, and else the command exits with 3."""
        return tuple(self.facts["flags"])

    @property
    def facts(self) -> dict[str, Any]:
        """What the command prints with ``--json``: energy balance, events, RMS of recorded and simulated."""
        summary = self.found.summary()
        return {name: value for name, value in summary.items() if name not in ("lines", "output")}

    @property
    def plot(self) -> SimulationPlots:
        """Figures on axes: ``plot.channel(name, ax=…)``."""
        return SimulationPlots(self.found)

    def save(
        self, path: str | os.PathLike[str], *, twin: str | os.PathLike[str] | None = None, overwrite: bool = False
    ) -> Path:
        """Write the simulated recording, and the twin that ran; return the path of the recording.

        Parameters
        ----------
        path : path-like
        twin : path-like, optional
            Where the twin is saved, as TOML.
        overwrite : bool
            Whether files that are there may be replaced.

        Raises
        ------
        InputError
            If a file is in the way.
        """
        place, of_twin = Path(path), None if twin is None else Path(twin)
        for file in filter(None, (place, of_twin)):
            require_free_place(file, overwrite=overwrite)
        settings = replace(self.found.settings, output=place, save_twin=of_twin, overwrite=overwrite)
        write_simulation(self.found, settings)
        return place

    def _repr_html_(self) -> str:
        lines = [line for line in self.found.summary()["lines"] if not line.startswith("simulation: ")]
        shown = html.data_sets({"recording": self.recording})
        return html.card("Simulation of the twin", lines, flags=self.flags, more=shown)


def simulate(
    rig: RigLike,
    run: RunLike,
    *,
    block: str = "all",
    configuration: str = "sloshing",
    twin: str | os.PathLike[str] | None = None,
    steps: int | None = None,
    seed: int = 0,
) -> TwinSimulation:
    """Simulate the twin of a rig, driven by the motion, the base motion or the release of a recorded run.

    Parameters
    ----------
    rig : path or Rig
        With tables ``[structure]`` and ``[twin]``. In a rig in memory, files that ``[twin]`` names need absolute
        paths; those of a rig file are looked for beside it.
    run : path or xarray.Dataset
        The recording that drives it.
    block : {"all", "tank", "structure"}
        All blocks together, or one alone on its measured input.
    configuration : {"sloshing", "frozen", "empty"}
        Of the liquid; ``sloshing`` is as the rig describes it.
    twin : path-like, optional
        A saved twin instead of that of the rig.
    steps : int, optional
        Integration steps per sample; by default 20 kHz, and 60 per period of the highest mode.
    seed : int
        Of the noise of the twin's sensors.

    Returns
    -------
    TwinSimulation
        Its `recording` has the channels of the run, simulated, in SI units, upward positive.

    Raises
    ------
    InputError
        If the run cannot drive the twin, or the twin leaves what can be simulated.

    Notes
    -----
    The command `sloshlab simulate` does the same; equations and integrator are in ``docs/twin.md``.
    """
    saved = None if twin is None else Path(twin)
    source, driving = rig_source(rig), run_source(run)
    settings = SimulationSettings(
        source, driving, Path(), block, configuration, twin=saved, steps=steps, seed=seed
    )
    return TwinSimulation(simulated_twin(settings))
