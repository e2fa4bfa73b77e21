"""The beam and the guided tank: decays and random runs to modal accelerations, damping, spectra and modes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from pipelines.inputs.recordings import RunSource, recording_of, work_of
from pipelines.inputs.rigs import RigSource, rig_of
from pipelines.report.progress import progress
from pipelines.structure.results import METHODS, BeamExperiment, BeamRun, BeamSettings, FrozenMode, group_of
from pipelines.structure.stages import Loaded, analysed, has_spectra, loaded
from pipelines.sweep.stages import naming
from sloshlab.conditioning.calibration import ApparentMass, apparent_mass
from sloshlab.errors import AnalysisError, InputError
from sloshlab.modal.instantaneous_damping import mean_over_decay
from sloshlab.modal.pooled_decays import PooledDamping, pooled_damping
from sloshlab.modal.rig_modes import stated_modes, structure_of, uniform_beam
from sloshlab.modal.structural_update import UpdatedBeam, update_beam
from sloshlab.recording import channels
from sloshlab.rig import Rig

_TITLES: Final = {"beam": "Sloshing beam", "sdof": "Tank on a guide"}
_SEGMENTS_PER_RUN: Final = 6
"""Segments that would lie in the shortest random run without overlap, so that spectra have eleven averages."""
_SMALLEST_SEGMENT_S: Final = 1.0
_LARGEST_MASS_DEVIATION: Final = 0.05
"""Of the mass beyond the force sensor from the rig, before signs, gains and dry mass are doubted."""
_SMALLEST_WIDTH_IN_LINES: Final = 0.5
"""Half-power width of the first mode, in lines of the spectrum, below which its damping is flagged."""


def checked_settings(*, modes: int | None, n_cycles: int, segment_s: float | None) -> BeamSettings:
    """Settings from the command line.

    Raises
    ------
    InputError
        If one is out of range.
    """
    if n_cycles < 2:
        raise InputError("--cycles", got=str(n_cycles), allowed="≥ 2", remedy="a sine fit needs two cycles")
    if segment_s is not None and not (math.isfinite(segment_s) and segment_s > 0):
        raise InputError("--segment-s", got=str(segment_s), allowed="> 0")
    return BeamSettings(modes, n_cycles, segment_s)


def analyse_beam(paths: Sequence[RunSource], rig_path: RigSource, settings: BeamSettings) -> BeamExperiment:
    """Analyse the runs of one beam or one guided tank.

    Parameters
    ----------
    paths : sequence of Path or RecordingInMemory
        Recordings of experiment ``beam_free`` and ``beam_random``, or ``sdof_free``, frozen, sloshing or empty.
    rig_path : Path or RigInMemory
        The rig that all of them belong to.
    settings : BeamSettings
        Modes, stretches, segments.

    Returns
    -------
    BeamExperiment

    Raises
    ------
    InputError
        If a run, the rig or their combination is bad; nothing has been written then.
    """
    rig = rig_of(rig_path)
    structure, modes = structure_of(rig), stated_modes(rig, settings.n_modes)
    runs = _loaded(paths, rig)
    settings = dataclasses.replace(settings, segment_s=settings.segment_s or _segment_s(runs))
    results = []
    with progress("beam", len(runs), work_of(run.path for run in runs)) as advance:
        for run in runs:
            with naming(run.path):
                results.append(analysed(run, rig, settings))
            advance(run.path.name)
    carried, frozen = _carried_mass(runs), _frozen_modes(results)
    updated, reason = _updated(rig, frozen)
    return BeamExperiment(
        title=_TITLES[structure.kind],
        kind=structure.kind,
        rig_name=rig_path.name,
        rig=rig,
        modes=modes,
        runs=tuple(results),
        settings=settings,
        carried_mass=carried,
        frozen_modes=frozen,
        updated=updated,
        update_reason=reason,
        pooled=_pooled(results),
        inputs=(*paths, rig_path),
        flags=tuple([flag for run in results for flag in run.flags] + _flags(results, carried, rig)),
    )


def _loaded(paths: Sequence[RunSource], rig: Rig) -> list[Loaded]:
    runs: list[Loaded] = []
    for path in paths:
        run = loaded(path, recording_of(path), rig)
        own = run.attributes.run_id, group_of(run.attributes)
        same = next((run for run in runs if (run.attributes.run_id, group_of(run.attributes)) == own), None)
        if same is not None:
            raise AnalysisError(f"{path}: run_id", got=f"{own[0]!r}, as in {same.path}",
                                allowed="one run_id per run", remedy="give every run once")  # fmt: skip
        runs.append(run)
    rates = {run.attributes.sampling_rate_hz for run in runs if has_spectra(run.attributes)}
    if len(rates) > 1:
        raise AnalysisError(
            "random runs",
            got=f"sampling rates of {', '.join(f'{rate:g}' for rate in sorted(rates))} Hz",
            allowed="one rate, so that the spectra have the same lines",
            remedy="analyse them apart",
        )
    return runs


def _segment_s(runs: Sequence[Loaded]) -> float:
    """A sixth of the shortest random run, in whole seconds: eleven segments that overlap by half."""
    durations = [
        run.recording.sizes["time"] / run.attributes.sampling_rate_hz
        for run in runs
        if has_spectra(run.attributes)
    ]
    return max(math.floor(min(durations, default=0.0) / _SEGMENTS_PER_RUN), _SMALLEST_SEGMENT_S)


def _carried_mass(runs: Sequence[Loaded]) -> ApparentMass | None:
    """Force over acceleration of the frozen run that tells it best."""
    frozen = [
        apparent_mass(run.recording)
        for run in runs
        if group_of(run.attributes) == "frozen" and channels(run.recording, "force")
    ]
    return min(
        frozen, key=lambda mass: mass.mass_std_kg if math.isfinite(mass.mass_std_kg) else math.inf, default=None
    )


def _frozen_modes(runs: Sequence[BeamRun]) -> dict[int, FrozenMode]:
    """Frequencies with the liquid frozen: from decays where there are any, else from random runs."""
    found: dict[int, FrozenMode] = {}
    for run in runs:
        if run.group != "frozen":
            continue
        for read in run.decays:
            if read.decay is not None and read.decay.local_sine_fit.used.any() and read.mode not in found:
                mean = mean_over_decay(read.decay.local_sine_fit)
                found[read.mode] = FrozenMode(
                    mean.natural_frequency_hz, mean.frequency_hz_std, mean.damping_ratio, "decay"
                )
    for run in runs:
        if run.group != "frozen" or run.random is None:
            continue
        for fit in run.random.fits:
            if fit.fit is not None:
                found.setdefault(
                    fit.mode,
                    FrozenMode(
                        float(fit.fit.frequency_hz[0]),
                        float(fit.fit.frequency_hz_std[0]),
                        float(fit.fit.damping_ratio[0]),
                        "random run",
                    ),
                )
    return found


def _updated(rig: Rig, frozen: dict[int, FrozenMode]) -> tuple[UpdatedBeam | None, str]:
    """The beam model fitted to the modes that were measured without a gap from the first on."""
    if structure_of(rig).kind != "beam":
        return None, "a guided tank has one mode"
    n_modes = next((mode for mode in range(len(frozen) + 1) if mode not in frozen), 0)
    if n_modes < 2:
        return None, f"{n_modes} frequencies of the frozen liquid were measured; tip mass and stiffness need two"
    measured = np.array([frozen[mode].frequency_hz for mode in range(n_modes)])
    if not (np.diff(measured) > 0).all():
        return (
            None,
            f"the measured frequencies {', '.join(f'{value:.4g}' for value in measured)} Hz do not rise",
        )
    return update_beam(uniform_beam(rig), measured), ""


def _pooled(runs: Sequence[BeamRun]) -> dict[tuple[str, str], PooledDamping]:
    pooled = {}
    for group in sorted({run.group for run in runs if run.decays}):
        decays = [run.first_decay for run in runs if run.first_decay is not None and run.group == group]
        for index, method in enumerate(METHODS):
            readings = [decay.readings[index] for decay in decays]
            if any(reading.used.any() for reading in readings):
                pooled[group, method] = pooled_damping(readings)
    return pooled


def _flags(runs: Sequence[BeamRun], carried: ApparentMass | None, rig: Rig) -> list[str]:
    flags = []
    believed = rig.tank.dry_mass_kg + rig.liquid_mass_kg
    if carried is not None and abs(carried.mass_kg / believed - 1) > _LARGEST_MASS_DEVIATION:
        flags.append(
            f"{carried.run_id}: force over acceleration with the liquid frozen is {carried.mass_kg:.4g} kg, the "
            f"rig says {believed:.4g} kg; check signs, gains and tank.dry_mass_kg"
        )
    for run in runs:
        fit = run.random.density_fit if run.random is not None else None
        if fit is not None and fit.half_power_width_in_lines < _SMALLEST_WIDTH_IN_LINES:
            flags.append(
                f"{run.attributes.run_id}: the first mode is only {fit.half_power_width_in_lines:.2g} lines wide; "
                "the run is too short to tell its damping well"
            )
    return flags
