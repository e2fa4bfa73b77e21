"""The shaker experiment: sweeps and VFA runs of a tank to work, effective mass and maps."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from pipelines.inputs.recordings import RunSource, attributes_of, recording_of, work_of
from pipelines.inputs.rigs import RigSource, rig_of
from pipelines.report.progress import progress
from pipelines.sweep.results import RigResult, RunResult, SweepExperiment, SweepOptions, SweepSignals
from pipelines.sweep.stages import (
    analyse_sweep,
    examined_recording,
    naming,
    not_measured,
    require_usable,
)
from pipelines.sweep.still_runs import HIGHEST_SWEEP_HZ, StillRuns, read_still_runs
from sloshlab.conditioning.calibration import DryMass, check_signs
from sloshlab.conditioning.combined_channels import (
    acceleration_channels,
    dynamic_force_noise_power,
    force_channels,
    mean_acceleration,
    total_force,
)
from sloshlab.conditioning.quality import RunQuality
from sloshlab.configurations import SLOSHING, STILL_CONFIGURATIONS
from sloshlab.consistency.between_runs import sibling_findings
from sloshlab.consistency.bounds import window_findings
from sloshlab.consistency.effect import Inertia
from sloshlab.consistency.examination import Reference
from sloshlab.errors import AnalysisError, InputError
from sloshlab.experiments import experiment_names
from sloshlab.maps.energy_maps import energy_maps
from sloshlab.out_of_core import blocks
from sloshlab.quantities import described
from sloshlab.recording import RunAttributes, channels
from sloshlab.rig import Rig
from sloshlab.sweep.windows import WindowSettings


@dataclass(frozen=True)
class ShakerSettings(SweepOptions):
    """Choices of the shaker analysis, checked."""

    @classmethod
    def checked(
        cls, *, p: int, m: int, boundaries: str, allow_incomplete: bool, has_report: bool = True
    ) -> ShakerSettings:
        """Settings from the command line.

        Raises
        ------
        InputError
            If `boundaries` is not ``measured`` or ``law``.
        """
        if boundaries not in ("measured", "law"):
            raise InputError("--boundaries", got=repr(boundaries), allowed="measured or law")
        windows = WindowSettings(half_width_cycles=p, spacing_cycles=m)
        return cls(windows, boundaries, allow_incomplete, has_report=has_report)


@dataclass(frozen=True)
class _Run:
    path: RunSource
    attributes: RunAttributes
    rig_name: str


def analyse_shaker(
    paths: Sequence[RunSource],
    rig_paths: Sequence[RigSource],
    settings: ShakerSettings,
    *,
    keep_signals: bool = False,
) -> SweepExperiment:
    """Analyse the runs of one or several rigs that differ in fill level.

    Parameters
    ----------
    paths : sequence of Path or RecordingInMemory
        Recordings; those of configuration ``empty`` and ``frozen`` identify the dry mass, the others
        are analysed.
    rig_paths : sequence of Path or RigInMemory
        Rig descriptions. With more than one, the attribute `rig` of every run must name one of them.
    settings : ShakerSettings
        Windows, boundaries, what to do with incomplete sweeps.
    keep_signals : bool
        Whether force and motion of every run stay in memory, so that the loop of any window can be drawn.

    Returns
    -------
    SweepExperiment

    Raises
    ------
    InputError
        If a run, a rig or their combination is bad; nothing has been written then.
    """
    rigs = rigs_by_name(rig_paths)
    runs = _assigned(paths, rigs)
    results: dict[str, list[RunResult]] = {name: [] for name in rigs}
    still: dict[str, StillRuns] = {}
    in_turn = [run.path for name in rigs for run in runs if run.rig_name == name]
    with progress("shaker", len(runs), work_of(in_turn)) as advance:
        for name, rig in rigs.items():
            own = [run for run in runs if run.rig_name == name]
            quiet = [run.path for run in own if run.attributes.configuration in STILL_CONFIGURATIONS]
            still[name] = read_still_runs(quiet, rig, name)
            for run in own:
                if run.attributes.configuration == SLOSHING:
                    with naming(run.path):
                        results[name].append(_analysed(run, rig, still[name].reference, settings, keep_signals))
                advance(run.path.name)
            results[name] = compared_with_siblings(results[name], rig)
        inputs = [*(run.path for run in runs), *rig_paths]
        return _experiment(results, rigs, still, settings, inputs)


def rigs_by_name(paths: Sequence[RigSource]) -> dict[str, Rig]:
    """Rigs of one tank by the names that their runs call them.

    Raises
    ------
    InputError
        If two have one name, or they describe different tanks.
    """
    rigs: dict[str, Rig] = {}
    for path in paths:
        if path.name in rigs:
            raise InputError("--rig", got=f"{path.name} twice", allowed="rig files with different names")
        rigs[path.name] = rig_of(path)
    first = next(iter(rigs.values()))
    for name, rig in rigs.items():
        box = ("height_m", "length_m", "width_m")
        if any(getattr(rig.tank, side) != getattr(first.tank, side) for side in box):
            raise InputError(
                "--rig",
                got=f"{name} with another tank than {next(iter(rigs))}",
                allowed="rigs that differ in fill level only",
                remedy="analyse them apart",
            )
    return rigs


def _assigned(paths: Sequence[RunSource], rigs: Mapping[str, Rig]) -> list[_Run]:
    """Runs with the rig each belongs to; runs of different rigs must not be mixed under one."""
    described = [(path, attributes_of(path)) for path in paths]
    swept = experiment_names(lambda experiment: experiment.moves == "shaker" and experiment.is_recorded)
    for path, attributes in described:
        if attributes.experiment not in swept:
            raise AnalysisError(
                f"{path}: experiment",
                got=repr(attributes.experiment),
                allowed=" or ".join(swept),
                remedy="use `sloshlab work` for other sweeps",
            )
    seen: dict[str, RunSource] = {}
    for path, attributes in described:
        if attributes.run_id in seen:
            raise AnalysisError(f"{path}: run_id", got=f"{attributes.run_id!r}, as in {seen[attributes.run_id]}",
                                allowed="one run_id per run", remedy="give every run once")  # fmt: skip
        seen[attributes.run_id] = path
    named = sorted({attributes.rig for _, attributes in described})
    unknown = [name for name in named if name not in rigs]
    if len(rigs) == 1 and len(named) == 1 and not _another_rig_lies_beside(described, next(iter(rigs.values()))):
        return [_Run(path, attributes, next(iter(rigs))) for path, attributes in described]
    if unknown:
        raise AnalysisError(
            "runs of different rigs",
            got=f"runs of {', '.join(named)} with --rig {', '.join(rigs)}",
            allowed="runs of the rigs given",
            remedy="analyse them apart, or give every rig with --rig",
        )
    return [_Run(path, attributes, attributes.rig) for path, attributes in described]


def _another_rig_lies_beside(described: Sequence[tuple[RunSource, RunAttributes]], rig: Rig) -> bool:
    """True if the rig that a run names lies beside it and describes another tank or filling.

    A rig file that was only renamed is no reason to refuse its runs.
    """
    own = {
        path.parent / attributes.rig
        for path, attributes in described
        if isinstance(path, Path) and attributes.rig == Path(attributes.rig).name
    }
    return any(file.is_file() and Rig.from_toml(file) != rig for file in own)


def _analysed(
    run: _Run, rig: Rig, reference: Reference, settings: ShakerSettings, keep_signals: bool
) -> RunResult:
    recording = recording_of(run.path)
    quality = require_usable(recording, run.path)
    recording, examination = examined_recording(recording, run.path, reference)
    signals = sweep_signals(recording, rig, reference.dry, quality)
    result = analyse_sweep(
        recording,
        run.path,
        signals,
        settings,
        quality=quality,
        rig=rig,
        rig_name=run.rig_name,
        keep_signals=keep_signals,
    )
    examination = examination.with_findings(window_findings(result.windows))
    return dataclasses.replace(result, examination=examination)


def compared_with_siblings(results: Sequence[RunResult], rig: Rig) -> list[RunResult]:
    """The runs of one rig with what their quiet starts say of each other."""
    starts = {run.attributes.run_id: run.examination.start for run in results}
    known = {run_id: start for run_id, start in starts.items() if start is not None}
    found = sibling_findings(known, rig, Inertia.of(rig, HIGHEST_SWEEP_HZ))
    return [
        dataclasses.replace(run, examination=run.examination.with_findings([found[run.attributes.run_id]]))
        if run.attributes.run_id in found
        else run
        for run in results
    ]


def sweep_signals(recording: xr.Dataset, rig: Rig, dry: DryMass | None, quality: RunQuality) -> SweepSignals:
    """Force and motion of a run of a tank on the shaker, ready to be evaluated.

    Raises
    ------
    AnalysisError
        If the recording has wrong signs.
    """
    check_signs(_enough_for_signs(recording), rig)
    forces, accelerations = force_channels(recording), acceleration_channels(recording)
    gain = 1.0 if dry is None else dry.gain_ratio
    mass = (dry.mass_kg if dry is not None else rig.tank.dry_mass_kg) + rig.liquid_mass_kg
    force = total_force(recording).values
    # by g before anything else, so that force and acceleration are on one scale; in place and in its own type,
    # because long recordings cost memory traffic
    if gain != 1.0:
        for part in blocks(force.size, force):
            force[part] /= gain
    return SweepSignals(
        force_n=force,
        motion=mean_acceleration(recording).values,
        not_measured=not_measured(recording, forces + accelerations, quality),
        inertia_kg=mass,
        noise_power=dynamic_force_noise_power(recording, forces, accelerations, mass),
    )


def _enough_for_signs(recording: xr.Dataset) -> xr.Dataset:
    """The middle minute, if it is complete: a sign does not need the whole run."""
    middle, half = recording.sizes["time"] // 2, round(30 * float(recording.attrs["sampling_rate_hz"]))
    part = recording.isel(time=slice(max(0, middle - half), middle + half))
    for name in channels(part):
        values = part[name].values
        if not all(np.isfinite(values[of].sum()) for of in blocks(values.size, values)):
            return recording
    return part


def _windows_of(name: str, results: Sequence[RunResult]) -> xr.Dataset:
    if not results:
        raise AnalysisError(f"rig {name}", got="no sloshing run", allowed="at least one", remedy="record one")
    windows = xr.concat([result.windows for result in results], dim="window", combine_attrs="drop")
    if windows.sizes["window"] == 0:
        raise AnalysisError(
            f"rig {name}", got="no window with enough usable cycles", allowed="a sweep of at least 2P cycles"
        )
    return windows


def _experiment(
    results: Mapping[str, Sequence[RunResult]],
    rigs: Mapping[str, Rig],
    still: Mapping[str, StillRuns],
    settings: ShakerSettings,
    inputs: Sequence[RunSource | RigSource],
) -> SweepExperiment:
    windows = {name: _windows_of(name, results[name]) for name in rigs}
    everything = xr.concat(list(windows.values()), dim="window", combine_attrs="drop")
    rig_results = [
        RigResult(name, rig, still[name].dry, windows[name], energy_maps(windows[name], rig, extent=everything))
        for name, rig in rigs.items()
    ]
    runs = [result for name in rigs for result in results[name]]
    return SweepExperiment(
        title="Tank on the shaker",
        inputs=tuple(inputs),
        kind="shaker",
        runs=tuple(runs),
        rigs=tuple(rig_results),
        windows=everything,
        maps=_joined(rig_results),
        settings=settings,
        still_runs=tuple(examination for name in rigs for examination in still[name].examinations),
        flags=tuple(flag for run in runs for flag in run.flags),
    )


def _joined(rigs: Sequence[RigResult]) -> xr.Dataset:
    """The maps of one rig as they are; of several along a dimension ``fill_level``."""
    if len(rigs) == 1:
        return rigs[0].maps.dataset
    rigs = sorted(rigs, key=lambda rig: rig.rig.liquid.fill_level)
    joined = xr.concat([rig.maps.dataset for rig in rigs], dim="fill_level", combine_attrs="drop", join="exact")
    return described(joined.assign_coords(fill_level=[rig.rig.liquid.fill_level for rig in rigs]))
