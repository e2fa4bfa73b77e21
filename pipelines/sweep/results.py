"""What the experiments hand to the writers and to the report."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.inputs.recordings import RunSource
from pipelines.inputs.rigs import RigSource
from pipelines.sweep.window_signals import Excerpt, WindowSignals
from sloshlab.conditioning.calibration import DryMass
from sloshlab.conditioning.quality import RunQuality
from sloshlab.consistency.finding import NOT_EXAMINED, ConsistencyExamination
from sloshlab.maps.energy_maps import EnergyMaps
from sloshlab.recording import RunAttributes
from sloshlab.rig import Rig
from sloshlab.sweep.law import SweepLaw
from sloshlab.sweep.windows import WindowSettings

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class SweepOptions:
    """Choices of the analysis: windows, boundaries, what to do with a sweep that stops early, what is kept."""

    windows: WindowSettings = field(default_factory=WindowSettings)
    boundaries: str = "measured"
    allow_incomplete: bool = False
    has_report: bool = field(default=True, kw_only=True)
    """Keeps the signals of every window, which only a report shows."""


@dataclass(frozen=True)
class SweepSignals:
    """Force and motion of one run, ready to be evaluated; all arrays of shape (n_samples,).

    Attributes
    ----------
    force_n : ndarray
        On the structure or tank, upward positive, NaN where lost.
    motion : ndarray
        Acceleration [m s-2] or velocity [m s-1], NaN where lost.
    motion_is_velocity : bool
        Which of the two.
    phase_motion : ndarray, optional
        What the phase is taken from, as an acceleration; None means `motion`.
    not_measured : ndarray of bool, optional
        True where a sample that enters `force_n` or `motion` is clipped, lost, repaired or stuck.
    inertia_kg : float
        Mass removed to get the dynamic force.
    noise_power : float
        Mean square of the dynamic force from sensor noise [N²].
    """

    force_n: FloatArray
    motion: FloatArray
    motion_is_velocity: bool = False
    phase_motion: FloatArray | None = None
    not_measured: BoolArray | None = None
    inertia_kg: float = 0.0
    noise_power: float = 0.0


@dataclass(frozen=True)
class RunResult:
    """One run, analysed.

    Attributes
    ----------
    path, sha256 : Path or RecordingInMemory, str
        The recording and the hash of its bytes.
    attributes : RunAttributes
        Its global attributes.
    rig_name : str
        File name of the rig it belongs to; empty without a rig.
    windows : xarray.Dataset
        See `sloshlab.sweep.windows.evaluate_windows`.
    law, stated : SweepLaw
        The law identified from the motion, and the one that the recording states (None if none).
    boundary_error_s : float
        Largest difference between measured cycle boundaries and those of the stated law, constant
        offset removed [s]; NaN without a stated law.
    quality : RunQuality
        Channels, gaps, clipping, agreement of redundant sensors.
    n_cycles, n_cycles_lost : int
        All cycles, and those that a lost or clipped sample cost.
    excerpts : tuple of Excerpt
        At the windows nearest 9, 13 and 17 Hz, or a quarter, half and three quarters of the sweep.
    flags : tuple of str
        What losses a reader must know before using the numbers; empty is good.
    examination : ConsistencyExamination
        Whether the run agrees with itself, with other runs and with physics.
    start_time_s : float
        Of the first sample.
    signals : SweepSignals, optional
        What the windows were evaluated from, if it was to be kept.
    window_signals : tuple of WindowSignals
        What is seen of every window, in their order; none where the motion is a velocity.
    """

    path: RunSource
    sha256: str
    attributes: RunAttributes
    rig_name: str
    windows: xr.Dataset
    law: SweepLaw
    stated: SweepLaw | None
    boundary_error_s: float
    quality: RunQuality
    n_cycles: int
    n_cycles_lost: int
    excerpts: tuple[Excerpt, ...] = ()
    flags: tuple[str, ...] = ()
    examination: ConsistencyExamination = NOT_EXAMINED
    start_time_s: float = 0.0
    signals: SweepSignals | None = None
    window_signals: tuple[WindowSignals, ...] = ()


@dataclass(frozen=True)
class RigResult:
    """All runs of one rig: its fill level, its dry mass and its maps."""

    name: str
    rig: Rig
    dry_mass: DryMass | None
    windows: xr.Dataset
    maps: EnergyMaps


@dataclass(frozen=True)
class SweepExperiment:
    """A whole experiment: what `windows.nc`, `maps.nc` and the report are made of.

    Attributes
    ----------
    title : str
        Headline of the report.
    kind : str
        ``"shaker"`` (with tank and liquid) or ``"work"`` (force and motion only).
    runs : tuple of RunResult
        In the order given, sloshing runs only for ``"shaker"``.
    rigs : tuple of RigResult
        One per rig file; empty for ``"work"``.
    windows : xarray.Dataset
        All windows of all runs.
    maps : xarray.Dataset
        The contents of `maps.nc`.
    settings : SweepOptions
        P and M among them.
    inputs : tuple of Path, RecordingInMemory or RigInMemory
        Everything that the results depend on: recordings, dry runs among them, and rigs.
    work_maps : EnergyMaps, optional
        For ``"work"``: the map without a tank.
    provenance : dict
        Input hashes, versions and the command.
    still_runs : tuple of ConsistencyExamination
        Of the empty and frozen runs, and of what they identify together.
    flags : tuple of str
        Losses of all runs and of the experiment.
    """

    title: str
    kind: str
    runs: tuple[RunResult, ...]
    rigs: tuple[RigResult, ...]
    windows: xr.Dataset
    maps: xr.Dataset
    settings: SweepOptions
    inputs: tuple[RunSource | RigSource, ...] = ()
    work_maps: EnergyMaps | None = None
    provenance: dict[str, Any] = field(default_factory=dict)
    still_runs: tuple[ConsistencyExamination, ...] = ()
    flags: tuple[str, ...] = ()

    @property
    def examinations(self) -> tuple[ConsistencyExamination, ...]:
        """Of all runs, still ones first."""
        return (*self.still_runs, *(run.examination for run in self.runs))

    @property
    def all_flags(self) -> tuple[str, ...]:
        """Losses and contradictions; if there is one the exit code is 3."""
        return (*self.flags, *(flag for examination in self.examinations for flag in examination.flags))
