"""What the analysis of a beam or a guided tank hands to the writers and to the report."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pipelines.inputs.recordings import RunSource
from pipelines.inputs.rigs import RigSource
from pipelines.structure.uncertain_damping import NetworkUncertainty
from sloshlab.conditioning.calibration import ApparentMass
from sloshlab.conditioning.quality import RunQuality
from sloshlab.configurations import EMPTY, FROZEN, SLOSHING
from sloshlab.consistency.finding import NOT_EXAMINED, ConsistencyExamination
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.modal.free_decay import FreeDecay
from sloshlab.modal.modal_filter import ModalFilter, ModalResponse
from sloshlab.modal.modal_fit import ModalFit
from sloshlab.modal.output_only_fit import DensityFit
from sloshlab.modal.pooled_decays import PooledDamping
from sloshlab.modal.rig_modes import ModeNames
from sloshlab.modal.spectra import Spectra
from sloshlab.modal.structural_update import UpdatedBeam
from sloshlab.recording import RunAttributes
from sloshlab.rig import Rig

FloatArray = npt.NDArray[np.float64]

CONFIGURATIONS: Final = (FROZEN, EMPTY, SLOSHING)
"""In the order in which the report shows them: the structure alone first."""
_SHORT: Final = {"reduced order model": "ROM"}
METHODS: Final = ("log decrement", "envelope", "local sine fit")
"""Of reading a decay, in the order of `FreeDecay.readings`."""


@dataclass(frozen=True)
class BeamSettings:
    """Choices of the analysis.

    Attributes
    ----------
    n_modes : int, optional
        Modes of the rig that are kept; default all.
    n_cycles : int
        Cycles per stretch of envelope and sine fit.
    segment_s : float, optional
        Length of the segments of random runs; default a sixth of the shortest run, in whole seconds.
    """

    n_modes: int | None = None
    n_cycles: int = 4
    segment_s: float | None = None


@dataclass(frozen=True)
class ModeDecay:
    """The decay of one mode, or why there is none.

    Attributes
    ----------
    mode : int
        0, 1 …
    decay : FreeDecay or None
        Three readings.
    reason : str
        Why it could not be read; empty if it could.
    """

    mode: int
    decay: FreeDecay | None
    reason: str = ""


@dataclass(frozen=True)
class ModeFit:
    """The fit of one mode to a random run, or why there is none."""

    mode: int
    fit: ModalFit | None
    reason: str = ""


@dataclass(frozen=True)
class RandomResponse:
    """Spectra and fits of one random run.

    Attributes
    ----------
    spectra : Spectra
        Of every accelerometer, the interface force and the modal accelerations over the root's acceleration.
    root_rms_g, tank_rms_g, tank_peak_g : float
        Over g.
    fits : tuple of ModeFit
        H₁ of each modal acceleration.
    density_fit : DensityFit or None
        First mode from the density of the tank's acceleration alone.
    density_reason : str
        Why there is none.
    """

    spectra: Spectra
    root_rms_g: float
    tank_rms_g: float
    tank_peak_g: float
    fits: tuple[ModeFit, ...]
    density_fit: DensityFit | None
    density_reason: str = ""


@dataclass(frozen=True)
class BeamRun:
    """One run, analysed.

    Attributes
    ----------
    path, sha256 : Path or RecordingInMemory, str
        The recording and the hash of its bytes.
    attributes : RunAttributes
        Its global attributes.
    quality : RunQuality
        Channels, gaps, clipping.
    time_s : ndarray, shape (n,)
        Of the part that was analysed.
    tank_acceleration, root_acceleration, interface_force : ndarray, shape (n,)
        [m/s²] and [N], upward positive, mean removed; the last two None where not recorded.
    sensors : dict of str to ndarray
        Accelerations that the modal filter was applied to, mean removed.
    modal_filter : ModalFilter or None
        None on a guide, which has one mode.
    response : ModalResponse
        Modal accelerations; relative to the root in random runs.
    decays : tuple of ModeDecay
        Of a free run, else empty.
    random : RandomResponse or None
        Of a random run.
    flags : tuple of str
        What a reader must know before using the numbers.
    examination : ConsistencyExamination
        Whether the run agrees with itself, with the rig and with physics.
    """

    path: RunSource
    sha256: str
    attributes: RunAttributes
    quality: RunQuality
    time_s: FloatArray
    tank_acceleration: FloatArray
    root_acceleration: FloatArray | None
    interface_force: FloatArray | None
    sensors: dict[str, FloatArray]
    modal_filter: ModalFilter | None
    response: ModalResponse
    decays: tuple[ModeDecay, ...] = ()
    random: RandomResponse | None = None
    flags: tuple[str, ...] = ()
    examination: ConsistencyExamination = NOT_EXAMINED

    @property
    def is_simulated(self) -> bool:
        """Whether a twin made it (`sloshlab simulate`)."""
        return bool((self.attributes.model_extra or {}).get("simulated_from"))

    @property
    def simulated_from(self) -> str:
        """File name of the recording that drove the twin; empty for a measured run."""
        return str((self.attributes.model_extra or {}).get("simulated_from", ""))

    @property
    def group(self) -> str:
        """What the run is a repeat of: its configuration, or the twin that made it."""
        return group_of(self.attributes)

    @property
    def name(self) -> str:
        """`run_id`, with its twin where one made it."""
        return f"{self.attributes.run_id} ({self.group})" if self.is_simulated else self.attributes.run_id

    @property
    def first_decay(self) -> FreeDecay | None:
        """Decay of the first mode."""
        return self.decays[0].decay if self.decays else None

    @property
    def level_text(self) -> str:
        """What was done to the structure, for a person."""
        if self.random is not None:
            stated = (self.attributes.model_extra or {}).get("rms_g", self.attributes.acceleration_g)
            return f"{stated if isinstance(stated, float) else self.random.root_rms_g:.2g} g RMS"
        start = self.attributes.initial_displacement_m
        return "release" if start is None else f"release from {1e3 * start:.3g} mm".replace("-", "−")

    @property
    def label(self) -> str:
        """Group and what was done to the structure, for legends and tables."""
        return f"{self.group}, {self.level_text}"


@dataclass(frozen=True)
class FrozenMode:
    """One mode with the liquid frozen, from all frozen runs.

    Attributes
    ----------
    frequency_hz, frequency_hz_std, damping_ratio : float
        Undamped frequency with its standard error, and ζ.
    source : str
        ``decay`` or ``random run``.
    """

    frequency_hz: float
    frequency_hz_std: float
    damping_ratio: float
    source: str


@dataclass(frozen=True)
class BeamExperiment:
    """A whole experiment: what `modal.nc`, `spectra.nc` and the report are made of.

    Attributes
    ----------
    title, kind : str
        Headline; ``beam`` or ``sdof``.
    rig_name, rig : str, Rig
        The rig that all runs belong to.
    modes : ModeNames
        As the rig states them.
    runs : tuple of BeamRun
        In the order given.
    settings : BeamSettings
        As used.
    carried_mass : ApparentMass or None
        Force over acceleration with the liquid frozen: M_dry + m_l beyond the force sensor.
    frozen_modes : dict of int to FrozenMode
        By number of the mode, from 0.
    updated : UpdatedBeam or None
        The beam model fitted to the frozen frequencies.
    update_reason : str
        Why there is none.
    pooled : dict of (group, method) to PooledDamping
        First mode over repeats of the free runs.
    inputs : tuple of Path, RecordingInMemory or RigInMemory
        Recordings and rig.
    provenance : dict
        Input hashes, versions and the command.
    flags : tuple of str
        Of all runs and of the experiment; if not empty the exit code is 3.
    network_uncertainty : NetworkUncertainty or None
        ζ₁ by the members of an ensemble, if one was given.
    """

    title: str
    kind: str
    rig_name: str
    rig: Rig
    modes: ModeNames
    runs: tuple[BeamRun, ...]
    settings: BeamSettings
    carried_mass: ApparentMass | None
    frozen_modes: dict[int, FrozenMode]
    updated: UpdatedBeam | None
    update_reason: str
    pooled: dict[tuple[str, str], PooledDamping]
    inputs: tuple[RunSource | RigSource, ...]
    provenance: dict[str, Any] = field(default_factory=dict)
    flags: tuple[str, ...] = ()
    network_uncertainty: NetworkUncertainty | None = None

    @property
    def free_runs(self) -> tuple[BeamRun, ...]:
        """Runs with decays."""
        return tuple(run for run in self.runs if run.decays)

    @property
    def random_runs(self) -> tuple[BeamRun, ...]:
        """Runs with spectra, weakest first, recordings before the twins that they drove."""
        found = [(run.random.root_rms_g, run.is_simulated, run) for run in self.runs if run.random is not None]
        # a twin's root is that of its recording but for rounding
        return tuple(run for *_, run in sorted(found, key=lambda entry: (float(f"{entry[0]:.3g}"), entry[1])))

    @property
    def groups(self) -> tuple[str, ...]:
        """Groups of all runs: measured configurations first, frozen before sloshing, then twins in their order."""
        measured = {run.group for run in self.runs if not run.is_simulated}
        twins = dict.fromkeys(run.group for run in self.runs if run.is_simulated)
        return (*(configuration for configuration in CONFIGURATIONS if configuration in measured), *twins)

    def first_of(self, group: str) -> BeamRun | None:
        """The first free run of a group."""
        return next((run for run in self.free_runs if run.group == group), None)

    def measured_of(self, simulated: BeamRun) -> BeamRun | None:
        """The recording that drove a simulated run, if it is among the runs."""
        return next((run for run in self.runs if run.path.name == simulated.simulated_from), None)

    @property
    def total_mass_kg(self) -> float:
        """M_dry + m_l: identified from frozen runs, else as believed."""
        if self.carried_mass is not None:
            return self.carried_mass.mass_kg
        return self.rig.tank.dry_mass_kg + self.rig.liquid_mass_kg


def group_of(attributes: RunAttributes) -> str:
    """Configuration of a measured run; of a simulated one the forces on its tank and its rig.

    Forces of the structure are left out: they are there with every liquid.
    """
    more = attributes.model_extra or {}
    if not more.get("simulated_from"):
        return attributes.configuration
    forces = [force.strip() for force in str(more.get("simulated_forces", "")).split(",")]
    liquid = [
        force.removesuffix("(tank)").strip().replace("_", " ") for force in forces if force.endswith("(tank)")
    ]
    liquid = [_SHORT.get(name, name) for name in liquid]
    rig, what = PurePath(attributes.rig).stem, ", ".join(liquid) or "frozen"
    return f"twin {what}" if rig == what else f"twin {rig}: {what}"


def in_g(values: FloatArray) -> FloatArray:
    """Acceleration over g."""
    return np.asarray(values / GRAVITY_M_PER_S2)
