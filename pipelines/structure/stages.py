"""The stages that one run of a beam or a guided tank goes through."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.inputs.recordings import RunSource
from pipelines.report.outputs import sha256_of
from pipelines.structure.random_runs import random_response, rms
from pipelines.structure.results import BeamRun, BeamSettings, ModeDecay, RandomResponse, group_of
from pipelines.sweep.stages import examined_recording, require_usable
from pipelines.twin.simulated_tank_model import departures_of
from sloshlab.channel_names import ACCELERATION_ROOT, FORCE_INTERFACE
from sloshlab.conditioning.cell_resonance import without_cell_resonance
from sloshlab.conditioning.combined_channels import (
    acceleration_channels,
    force_channels,
    mean_acceleration,
    total_force,
)
from sloshlab.conditioning.gaps import longest_whole_stretch
from sloshlab.conditioning.quality import RunQuality, quality_of
from sloshlab.conditioning.spring_inertia import at_the_tank
from sloshlab.consistency.examination import Reference
from sloshlab.consistency.finding import ConsistencyExamination
from sloshlab.errors import AnalysisError
from sloshlab.experiments import EXPERIMENTS, experiment_names
from sloshlab.modal.free_decay import analyse_free_decay
from sloshlab.modal.modal_filter import ModalFilter, ModalResponse, modal_filter
from sloshlab.modal.mode_band import decay_in_band
from sloshlab.modal.rig_modes import (
    ModeNames,
    rig_modal_filter,
    sensor_places_m,
    stated_modes,
    structure_of,
    uniform_beam,
)
from sloshlab.recording import RunAttributes, channels, run_attributes
from sloshlab.rig import Rig

FloatArray = npt.NDArray[np.float64]

_FIRST_MODE_RANGE: Final = (0.7, 1.4)
"""Where the first mode is looked for, over its believed frequency; the liquid takes mass away from it."""
_LARGEST_ROOT_SHARE: Final = 0.05
"""RMS of the root's acceleration over the tank's in a free run, beyond which the beam is not clamped."""
_LARGEST_RESIDUAL_SHARE: Final = 0.1
"""RMS that the modes may leave at a sensor, over that of the tank's acceleration."""


@dataclass(frozen=True)
class Loaded:
    """A recording with what is known about it before the analysis."""

    path: RunSource
    recording: xr.Dataset
    attributes: RunAttributes
    quality: RunQuality
    examination: ConsistencyExamination


@dataclass(frozen=True)
class _Motion:
    """Signals of the part that is analysed, means removed."""

    time_s: FloatArray
    tank: FloatArray
    root: FloatArray | None
    force: FloatArray | None
    sensors: dict[str, FloatArray]
    places_m: dict[str, float]
    flags: tuple[str, ...]


def has_spectra(attributes: RunAttributes) -> bool:
    """Whether the runs of this experiment are evaluated by spectra, not by decays."""
    return "spectra" in EXPERIMENTS[attributes.experiment].stages


def loaded(path: RunSource, recording: xr.Dataset, rig: Rig) -> Loaded:
    """A recording whose experiment suits the structure of a rig, with working sensors, examined.

    Raises
    ------
    AnalysisError
        If it is no run of this structure, or unusable.
    """
    attributes = run_attributes(recording, name=str(path))
    kind = structure_of(rig).kind
    allowed = experiment_names(lambda experiment: experiment.structure == kind)
    if attributes.experiment not in allowed:
        raise AnalysisError(
            f"{path}: experiment",
            got=repr(attributes.experiment),
            allowed=f"{' or '.join(allowed)} with this rig, whose structure is of kind {kind!r}",
            remedy="use `sloshlab shaker` for sweeps, or give the rig that the run belongs to",
        )
    if EXPERIMENTS[attributes.experiment].moves == "release":
        recording = _without_still_root(recording)
    # a frozen liquid has no force: constant channels are no dead sensors in a simulation
    if "simulated_from" in recording.attrs:
        return Loaded(
            path, recording, attributes, quality_of(recording), ConsistencyExamination(attributes.run_id)
        )
    quality = require_usable(recording, path)
    # of recordings only: a twin's force is that on the tank
    recording = at_the_tank(without_cell_resonance(recording, rig), rig)
    recording, examination = examined_recording(recording, path, Reference(rig))
    return Loaded(path, recording, attributes, quality, examination)


def _without_still_root(recording: xr.Dataset) -> xr.Dataset:
    """A root that does not move at all is what a free run wants; whether its sensor is dead does not matter."""
    roots = [name for name in channels(recording, "acceleration") if name.startswith(ACCELERATION_ROOT)]
    return recording.drop_vars([name for name in roots if np.ptp(recording[name].values) == 0])


def analysed(run: Loaded, rig: Rig, settings: BeamSettings) -> BeamRun:
    """Take one run from its channels to modal accelerations, decays or spectra.

    Raises
    ------
    AnalysisError
        If sensors cannot see a mode, the first mode does not decay, or channels are missing.
    """
    stages, is_random = EXPERIMENTS[run.attributes.experiment].stages, has_spectra(run.attributes)
    rate_hz = run.attributes.sampling_rate_hz
    motion = _motion(run, rig, is_random)
    its_filter, response = _modal_response(motion, rig, settings, rate_hz, is_random)
    modes = stated_modes(rig, settings.n_modes)
    flags = [*motion.flags, *_residual_flags(run, its_filter, response, motion.tank), *_domain_flags(run)]
    return BeamRun(
        path=run.path,
        sha256=sha256_of(run.path),
        attributes=run.attributes,
        quality=run.quality,
        time_s=motion.time_s,
        tank_acceleration=motion.tank,
        root_acceleration=motion.root,
        interface_force=motion.force,
        sensors=motion.sensors,
        modal_filter=its_filter,
        response=response,
        decays=_decays(response, modes, settings, rate_hz) if "decays" in stages else (),
        random=_random(motion, response, modes, settings, rate_hz) if is_random else None,
        flags=(*flags, *run.examination.flags),
        examination=run.examination,
    )


def _motion(run: Loaded, rig: Rig, is_random: bool) -> _Motion:
    recording, flags = run.recording, list[str]()
    names = channels(recording, "acceleration")
    tank_names = acceleration_channels(recording)
    if not is_random:
        recording, flags = _longest_part_without_gaps(run, names)
    signals = {name: _centred(recording[name].values) for name in names}
    root = next((signals[name] for name in names if name.startswith(ACCELERATION_ROOT)), None)
    if is_random and root is None:
        raise AnalysisError(
            f"{run.path}: random run", got=f"channels {', '.join(names)}", allowed="acceleration_root among them"
        )
    tank = _centred(mean_acceleration(recording, tank_names).values)
    if not is_random and root is not None and rms(root) > _LARGEST_ROOT_SHARE * rms(tank):
        flags.append(
            f"{run.attributes.run_id}: the root moves by {100 * rms(root) / rms(tank):.0f} % of the tank's "
            "acceleration in a free run; it is no clamped beam"
        )
    force = None
    if FORCE_INTERFACE in channels(recording, "force"):
        force = _centred(total_force(recording, force_channels(recording)).values)
    places = {} if structure_of(rig).kind == "sdof" else _places_m(recording, names, rig)
    kept = list(places) or tank_names
    sensors = {name: signals[name] for name in kept}
    return _Motion(recording["time"].values, tank, root, force, sensors, places, tuple(flags))


def _places_m(recording: xr.Dataset, names: list[str], rig: Rig) -> dict[str, float]:
    """Accelerometers beyond the root and where they are [m]."""
    stated = {name: recording[name].attrs.get("x_m") for name in names}
    places = sensor_places_m(stated, uniform_beam(rig).length_m)
    return {name: place for name, place in places.items() if place > 0}


def _centred(values: npt.NDArray[np.floating]) -> FloatArray:
    numbers = np.asarray(values, dtype=np.float64)
    return np.asarray(numbers - np.nanmean(numbers))


def _longest_part_without_gaps(run: Loaded, names: list[str]) -> tuple[xr.Dataset, list[str]]:
    """A decay is read up to a gap or after it, never across."""
    whole = np.all([np.isfinite(run.recording[name].values) for name in names], axis=0)
    if whole.all():
        return run.recording, []
    part = run.recording.isel(time=longest_whole_stretch(whole))
    time = part["time"].values
    return part, [
        f"{run.attributes.run_id}: {int((~whole).sum())} samples are lost; the decay is read from {time[0]:.3f} s "
        f"to {time[-1]:.3f} s, the longest part without gaps"
    ]


def _modal_response(
    motion: _Motion, rig: Rig, settings: BeamSettings, rate_hz: float, is_random: bool
) -> tuple[ModalFilter | None, ModalResponse]:
    values = np.stack(list(motion.sensors.values()))
    if is_random and motion.root is not None:
        # q̈ is to be relative to the root
        values = values - motion.root
    if structure_of(rig).kind == "sdof":
        alike = modal_filter(np.ones((len(values), 1)), sensor_names=list(motion.sensors), mode_names=("guide",))
        return None, alike.apply(values, rate_hz)
    its_filter = rig_modal_filter(rig, motion.places_m, n_modes=settings.n_modes)
    return its_filter, its_filter.apply(values, rate_hz)


def _residual_flags(
    run: Loaded, its_filter: ModalFilter | None, response: ModalResponse, tank: FloatArray
) -> list[str]:
    if its_filter is None or its_filter.weights.shape[0] == its_filter.weights.shape[1]:
        return []
    unexplained = [
        f"{name} {residual:.3g} m/s²"
        for name, residual in zip(response.sensor_names, response.residual_rms_m_per_s2, strict=True)
        if residual > _LARGEST_RESIDUAL_SHARE * rms(tank)
    ]
    if not unexplained:
        return []
    return [
        f"{run.attributes.run_id}: the modes leave {', '.join(unexplained)} RMS unexplained, more than "
        f"{100 * _LARGEST_RESIDUAL_SHARE:.0f} % of the tank's acceleration; check gains, places and mode shapes"
    ]


def _domain_flags(run: Loaded) -> list[str]:
    """Where the tank model of a simulated run was beyond what it was trained on."""
    name = f"{run.attributes.run_id} ({group_of(run.attributes)})"
    return [f"{name}: {departure}" for departure in departures_of(run.attributes.model_extra or {})]


def _decays(
    response: ModalResponse, modes: ModeNames, settings: BeamSettings, rate_hz: float
) -> tuple[ModeDecay, ...]:
    """The first mode must decay; higher ones may be too weak to be read."""
    found = []
    for mode, believed in enumerate(modes.frequency_hz):
        signal = response.acceleration_m_per_s2[mode]
        if mode == 0:
            decay = analyse_free_decay(
                signal,
                rate_hz,
                frequency_range_hz=(_FIRST_MODE_RANGE[0] * believed, _FIRST_MODE_RANGE[1] * believed),
                n_cycles=settings.n_cycles,
            )
            found.append(ModeDecay(0, decay))
            continue
        try:
            found.append(
                ModeDecay(mode, decay_in_band(signal, modes.frequency_hz, mode, rate_hz, name=modes.names[mode]))
            )
        except AnalysisError as error:
            found.append(ModeDecay(mode, None, str(error)))
    return tuple(found)


def _random(
    motion: _Motion, response: ModalResponse, modes: ModeNames, settings: BeamSettings, rate_hz: float
) -> RandomResponse:
    if motion.root is None or settings.segment_s is None:
        raise AnalysisError(
            "random run", got="no acceleration_root", allowed="acceleration_root among the channels"
        )
    outputs = {**motion.sensors, **dict(zip(modes.names, response.acceleration_m_per_s2, strict=True))}
    if motion.force is not None:
        outputs[FORCE_INTERFACE] = motion.force
    return random_response(
        motion.root, motion.tank, outputs, modes, segment_s=settings.segment_s, sampling_rate_hz=rate_hz
    )
