"""`modal.nc` and `spectra.nc`, and the summary of the command."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import xarray as xr

from pipelines.report.outputs import InMemory, provenance_of, report_lines, stamp_of, write_dataset
from pipelines.report.result_folder import require_result_folder, result_folder
from pipelines.structure.analysis import analyse_beam
from pipelines.structure.results import METHODS, BeamExperiment, BeamRun, BeamSettings, ModeDecay
from sloshlab import atomic_file
from sloshlab.errors import InputError
from sloshlab.modal.instantaneous_damping import InstantaneousDamping
from sloshlab.quantities import described

TWINS_FOLDER: Final = "twins"

_POINTS: Final = ("peak", "envelope", "sine_fit")
"""Dimensions of the three methods, in the order of `METHODS`."""
_VALUES: Final = {
    "amplitude": ("acceleration_amplitude_m_per_s2", "acceleration_amplitude_m_per_s2"),
    "damping_ratio": ("damping_ratio", "damping_ratio"),
    "damping_ratio_low": ("damping_ratio_low", "damping_ratio_low"),
    "damping_ratio_high": ("damping_ratio_high", "damping_ratio_high"),
    "frequency_hz": ("modal_frequency_hz", "modal_frequency_hz"),
    "frequency_low_hz": ("modal_frequency_low_hz", "modal_frequency_low_hz"),
    "frequency_high_hz": ("modal_frequency_high_hz", "modal_frequency_high_hz"),
}
"""Names in modal.nc, names in a reading's data set, and names in the table of quantities."""


def modal_dataset(experiment: BeamExperiment) -> xr.Dataset:
    """The contents of `modal.nc`.

    Runs lie behind each other along ``time`` and along the points of each method (contiguous ragged arrays):
    `sample_run` and `peak_run` say which run, by its place in ``run``, and `peak_mode` which mode. Values of the
    logarithmic decrement have the plain names; those of envelope and sine fit a prefix.
    """
    variables: dict[str, Any] = {
        "modal_acceleration": (("mode", "time"), np.concatenate(
            [run.response.acceleration_m_per_s2 for run in experiment.runs], axis=1)),
        "sample_run": ("time", np.concatenate(
            [np.full(run.time_s.size, index, dtype=np.int32) for index, run in enumerate(experiment.runs)])),
    }  # fmt: skip
    for index, point in enumerate(_POINTS):
        variables.update(_readings(experiment.runs, index, point))
    coordinates = {
        "run": ("run", np.array([run.name for run in experiment.runs], dtype=object)),
        "configuration": (
            "run",
            np.array([run.attributes.configuration for run in experiment.runs], dtype=object),
        ),
        "mode": ("mode", np.arange(1, len(experiment.modes.names) + 1)),
        "time": ("time", np.concatenate([run.time_s for run in experiment.runs])),
    }
    dataset = xr.Dataset(variables, coordinates)
    _describe(dataset)
    return _with_update(_with_filter(dataset, experiment), experiment)


def _readings(runs: Sequence[BeamRun], index: int, point: str) -> dict[str, Any]:
    """Variables of one method over its points, all runs and modes behind each other."""
    found: list[tuple[int, ModeDecay, InstantaneousDamping]] = [
        (number, read, read.decay.readings[index])
        for number, run in enumerate(runs)
        for read in run.decays
        if read.decay is not None
    ]
    sets = [reading.to_dataset() for _, _, reading in found]
    joined = {
        f"{_prefix(point)}{name}": (point, _joined([dataset[source].values for dataset in sets]))
        for name, (source, _) in _VALUES.items()
    }
    start_s = [float(runs[number].time_s[0]) for number, _, _ in found]
    times = [reading.time_s + start for (_, _, reading), start in zip(found, start_s, strict=True)]
    return {
        **joined,
        f"{point}_time_s": (point, _joined(times)),
        f"{point}_run": (point, _repeated([(number, reading) for number, _, reading in found])),
        f"{point}_mode": (point, _repeated([(read.mode + 1, reading) for _, read, reading in found])),
        f"{point}_trust": (point, _joined([reading.trust.astype(object) for _, _, reading in found], object)),
    }


def _joined(parts: list[Any], kind: type = float) -> Any:
    return np.concatenate(parts) if parts else np.array([], dtype=kind)


def _repeated(parts: list[tuple[int, InstantaneousDamping]]) -> Any:
    return np.concatenate(
        [
            np.array([], dtype=np.int32),
            *(np.full(reading.time_s.size, number, np.int32) for number, reading in parts),
        ]
    )


def _describe(dataset: xr.Dataset) -> None:
    """Attributes from the table of quantities, under the names of the file."""
    quantity_of = {
        "modal_acceleration": "modal_acceleration_m_per_s2",
        "time": "sample_time_s",
        "run": "run",
        "configuration": "configuration",
        "mode": "mode_number",
        "sample_run": "run_index",
    }
    for point in _POINTS:
        quantity_of |= {f"{_prefix(point)}{name}": quantity for name, (_, quantity) in _VALUES.items()}
        quantity_of |= {f"{point}_time_s": "decay_time_s", f"{point}_run": "run_index"}
        quantity_of |= {f"{point}_mode": "mode_number", f"{point}_trust": "trust"}
    for name in map(str, dataset.variables):
        stand_in = xr.Dataset({quantity_of[name]: dataset[name].drop_vars(dataset[name].coords)})
        dataset[name].attrs = described(stand_in)[quantity_of[name]].attrs
    for point, method in zip(_POINTS, METHODS, strict=True):
        dataset[f"{point}_trust"].attrs["decay_method"] = method


def _prefix(point: str) -> str:
    return "" if point == "peak" else f"{point}_"


def _with_filter(dataset: xr.Dataset, experiment: BeamExperiment) -> xr.Dataset:
    """Residuals of the modal filter per run and sensor, weights and visibility of the filter."""
    sensors = sorted({name for run in experiment.runs for name in run.response.sensor_names})
    residual = np.full((len(experiment.runs), len(sensors)), np.nan)
    visibility = np.full((len(experiment.runs), len(experiment.modes.names)), np.nan)
    condition = np.full(len(experiment.runs), np.nan)
    for number, run in enumerate(experiment.runs):
        places = [sensors.index(name) for name in run.response.sensor_names]
        residual[number, places] = run.response.residual_rms_m_per_s2
        if run.modal_filter is not None:
            visibility[number], condition[number] = run.modal_filter.visibility, run.modal_filter.condition_number
    added = described(
        xr.Dataset(
            {
                "modal_residual_m_per_s2": (("run", "sensor"), residual),
                "mode_visibility": (("run", "mode"), visibility),
                "modal_condition_number": ("run", condition),
            },
            {"sensor": ("sensor", np.array(sensors, dtype=object))},
        )
    )
    return dataset.merge(added)


def _with_update(dataset: xr.Dataset, experiment: BeamExperiment) -> xr.Dataset:
    """Frequencies with the liquid frozen, and the beam model fitted to them; NaN where there is none."""
    updated, frozen = experiment.updated, experiment.frozen_modes
    numbers = range(len(experiment.modes.names))
    modelled = np.full(len(numbers), np.nan)
    scalars = dict.fromkeys(
        ("tip_mass_kg", "tip_mass_kg_std", "youngs_modulus_pa", "youngs_modulus_pa_std"), np.nan
    )
    if updated is not None:
        modelled[: updated.modelled_hz.size] = updated.modelled_hz
        scalars |= {
            "tip_mass_kg": updated.beam.tip_mass_kg,
            "tip_mass_kg_std": updated.tip_mass_kg_std,
            "youngs_modulus_pa": updated.beam.youngs_modulus_pa,
            "youngs_modulus_pa_std": updated.youngs_modulus_pa_std,
        }
    over_mode = {
        "measured_frequency_hz": [frozen[n].frequency_hz if n in frozen else np.nan for n in numbers],
        "measured_frequency_hz_std": [frozen[n].frequency_hz_std if n in frozen else np.nan for n in numbers],
        "natural_frequency_hz": modelled,
    }
    added = {name: ("mode", values) for name, values in over_mode.items()}
    return dataset.merge(
        described(xr.Dataset({**added, **{name: ((), scalar) for name, scalar in scalars.items()}}))
    )


def spectra_dataset(experiment: BeamExperiment) -> xr.Dataset:
    """The contents of `spectra.nc`: densities, H₁, H₂ and coherence per random run, and the modal fits."""
    parts = []
    for run in experiment.random_runs:
        random = run.random
        assert random is not None
        fits = [mode_fit.fit for mode_fit in random.fits]
        density = random.density_fit
        modal = xr.Dataset(
            {
                "natural_frequency_hz": ("mode", [_first(fit and fit.frequency_hz) for fit in fits]),
                "natural_frequency_hz_std": ("mode", [_first(fit and fit.frequency_hz_std) for fit in fits]),
                "damping_ratio": ("mode", [_first(fit and fit.damping_ratio) for fit in fits]),
                "damping_ratio_low": ("mode", [_first(fit and fit.damping_ratio_interval[0]) for fit in fits]),
                "damping_ratio_high": ("mode", [_first(fit and fit.damping_ratio_interval[1]) for fit in fits]),
                "density_frequency_hz": ((), density.frequency_hz if density else np.nan),
                "density_damping_ratio": ((), density.damping_ratio if density else np.nan),
                "density_damping_ratio_std": ((), density.damping_ratio_std if density else np.nan),
                "root_rms_g": ((), random.root_rms_g),
                "tank_rms_g": ((), random.tank_rms_g),
                "configuration": ((), run.attributes.configuration),
            }
        )
        spectra = random.spectra.to_dataset()
        parts.append(spectra.merge(modal).assign_coords(run=run.name).assign_attrs(spectra.attrs))
    if not parts:
        return xr.Dataset()
    joined = xr.concat(parts, dim="run", combine_attrs="drop_conflicts", join="outer")
    return described(joined).assign_attrs(joined.attrs)


def _first(values: Any) -> float:
    return float("nan") if values is None else float(np.ravel(values)[0])


def files_of(*, report: bool) -> tuple[str, ...]:
    """Names of the files that are written for certain."""
    return ("modal.nc", "spectra.nc", *(["report.html"] if report else []))


def write_beam(
    experiment: BeamExperiment,
    folder: Path,
    *,
    command: str,
    report: bool = True,
    twins: Mapping[str, bytes] | None = None,
    known_sha256: Mapping[Path | InMemory, str] | None = None,
) -> dict[str, Any]:
    """Write `modal.nc`, `spectra.nc` and the report; return the summary of the command.

    Parameters
    ----------
    experiment : BeamExperiment
        What was analysed.
    folder : Path
        Made if it is not there. All files appear together, complete, or none does.
    command : str
        What the user typed, for the report.
    report : bool
        False leaves the report and its figures out.
    twins : mapping of str to bytes, optional
        Files of what the twins are and simulated, which are kept with the results.
    known_sha256 : mapping, optional
        Hashes of inputs that need not be computed again, beside those of the runs.

    Returns
    -------
    dict
        ``lines`` for people, ``flags``, and numbers for machines.
    """
    provenance = provenance_of_beam(experiment, command, known_sha256)
    with result_folder(folder, provenance) as complete:
        for name, content in (twins or {}).items():
            atomic_file.write_bytes(complete / TWINS_FOLDER / name, content)
        for name, dataset in stamped_results(experiment, provenance).items():
            write_dataset(dataset, complete / name)
        if report:
            from pipelines.structure.sections import write_beam_report

            write_beam_report(dataclasses.replace(experiment, provenance=provenance), complete)
    return _summary(experiment, folder, report)


def provenance_of_beam(
    experiment: BeamExperiment, command: str, known_sha256: Mapping[Path | InMemory, str] | None = None
) -> dict[str, Any]:
    """What the results of an experiment rest on."""
    known: dict[Path | InMemory, str] = dict(known_sha256 or {})
    known.update({run.path: run.sha256 for run in experiment.runs})
    return provenance_of(command, experiment.inputs, known, settings=experiment.settings)


def stamped_results(experiment: BeamExperiment, provenance: Mapping[str, Any]) -> dict[str, xr.Dataset]:
    """The contents of `modal.nc` and `spectra.nc` by these names, with what they rest on as attributes."""
    stamp = {"title": experiment.title, **stamp_of(provenance)}
    contents = {"modal.nc": modal_dataset(experiment), "spectra.nc": spectra_dataset(experiment)}
    return {name: dataset.assign_attrs(stamp) for name, dataset in contents.items()}


def _summary(experiment: BeamExperiment, folder: Path, report: bool) -> dict[str, Any]:
    n_free, n_random = len(experiment.free_runs), len(experiment.random_runs)
    lines = [
        f"modal accelerations and decays: {folder / 'modal.nc'} ({len(experiment.runs)} runs, {n_free} decays)",
        f"spectra: {folder / 'spectra.nc'} ({n_random} random runs)",
    ]
    first = {
        run.name: float(run.first_decay.local_sine_fit.damping_ratio[run.first_decay.local_sine_fit.used].mean())
        for run in experiment.free_runs
        if run.first_decay is not None and run.first_decay.local_sine_fit.used.any()
    }
    return {
        "lines": lines + report_lines(folder, written=report),
        "flags": list(experiment.flags),
        "runs": len(experiment.runs),
        "decays": n_free,
        "random_runs": n_random,
        "mean_damping_ratio": first,
        "random_damping_ratio": {
            run.name: run.random.density_fit.damping_ratio
            for run in experiment.random_runs
            if run.random is not None and run.random.density_fit is not None
        },
        "frozen_frequency_hz": {
            str(mode + 1): found.frequency_hz for mode, found in sorted(experiment.frozen_modes.items())
        },
        "updated_beam": {}
        if experiment.updated is None
        else {
            "tip_mass_kg": experiment.updated.beam.tip_mass_kg,
            "youngs_modulus_pa": experiment.updated.beam.youngs_modulus_pa,
        },
        **(
            {"network_uncertainty": experiment.network_uncertainty.summary()}
            if experiment.network_uncertainty
            else {}
        ),
        "output": str(folder),
    }


def analyse_and_write(
    recordings: Sequence[Path], rigs: Sequence[Path], output: Path, command: str
) -> dict[str, Any]:
    """The pipeline of a tank on a structure with its usual settings."""
    if len(rigs) != 1:
        raise InputError("--rig", got=f"{len(rigs)} rigs", allowed="the one rig that the runs belong to")
    require_result_folder(output, files_of(report=True))
    experiment = analyse_beam(recordings, rigs[0], BeamSettings())
    return write_beam(experiment, output, command=command)
