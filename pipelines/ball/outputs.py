"""Writing a ball: the [twin] table of a rig file, netCDF, and the report."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pipelines.ball.results import BallExperiment, DecayResult
from pipelines.report.outputs import RESULT_ID, provenance_of, report_lines, stamp_of, write_dataset
from pipelines.report.result_folder import result_folder
from sloshlab import atomic_file
from sloshlab.bouncing_ball.frequency_error import summary
from sloshlab.quantities import described


def files_of(*, report: bool) -> tuple[str, ...]:
    """Names of the files that are written for certain."""
    return ("ball.toml", "ball.nc", *(["report.html"] if report else []))


def write_ball(experiment: BallExperiment, folder: Path, *, command: str, report: bool = True) -> dict[str, Any]:
    """Write `ball.toml`, `ball.nc` and the report; return the summary of the command.

    All files appear together, complete, or none does.
    """
    provenance = provenance_of(command, experiment.inputs, settings=experiment.settings)
    with result_folder(folder, provenance) as complete:
        atomic_file.write_bytes(complete / "ball.toml", _twin_table(experiment, provenance[RESULT_ID]).encode())
        write_dataset(_dataset(experiment, provenance), complete / "ball.nc")
        if report:
            from pipelines.ball.sections import page_of
            from pipelines.report.page import write_page

            page = page_of(dataclasses.replace(experiment, provenance=provenance))
            write_page(page, complete, result_id=provenance[RESULT_ID])
    return _summary(experiment, folder, report)


def _twin_table(experiment: BallExperiment, result_id: str) -> str:
    """The table to put into the rig file, with what is known of each number."""
    lines = [f"# bouncing ball identified at omega_bar = {experiment.omega_bar:.4g} for {experiment.rig_name}"]
    lines.append(f"# {RESULT_ID} {result_id}")
    for interval in experiment.identified.intervals:
        at = f", at the {interval.at_bound} bound of its search" if interval.at_bound else ""
        lines.append(f"# {interval.name}: 90 % interval {interval.low:.4g} ... {interval.high:.4g}{at}")
    return "\n".join(lines) + "\n" + experiment.identified.ball.twin_table()


def _dataset(experiment: BallExperiment, provenance: dict[str, object]) -> xr.Dataset:
    """Parameters, and measured and simulated curve."""
    intervals = experiment.identified.intervals
    along = "ball_parameter"
    variables: dict[str, Any] = {
        "ball_value": (along, [interval.value for interval in intervals]),
        "ball_value_low": (along, [interval.low for interval in intervals]),
        "ball_value_high": (along, [interval.high for interval in intervals]),
        "ball_profile_ratio": (along, [interval.profile_ratio for interval in intervals]),
    }
    result = experiment.result
    if isinstance(result, DecayResult):
        curve = result.measured
        variables["acceleration_amplitude_m_per_s2"] = ("measured_value", curve.acceleration_m_per_s2)
        variables["damping_ratio"] = ("measured_value", curve.damping_ratio)
        simulated = result.simulated.at(curve.acceleration_m_per_s2)
        variables["ball_damping_ratio"] = ("measured_value", simulated)
        for name in ("loss_factor", "work_j", "work_j_std"):
            variables[name] = result.response[name]
    else:
        for name in ("omega_bar", "u_bar", "w_bar"):
            variables[name] = ("window", result.windows[name].values)
        variables["ball_w_bar"] = ("window", result.w_bar_of_ball)
    names = np.array([interval.name for interval in intervals], dtype=object)
    dataset = described(xr.Dataset(variables, coords={along: names}))
    return dataset.assign_attrs(
        title="Bouncing ball",
        rig=experiment.rig_name,
        tuned_omega_bar=experiment.omega_bar,
        damping_in_flight=experiment.identified.ball.damping_in_flight,
        **stamp_of(provenance),
    )


def _summary(experiment: BallExperiment, folder: Path, report: bool) -> dict[str, Any]:
    ball, found = experiment.identified.ball, experiment.identified
    numbers: dict[str, Any] = {**dataclasses.asdict(ball), "rms": found.rms, "evaluations": found.n_evaluations}
    lines = [f"ball: {folder / 'ball.toml'}", f"curves: {folder / 'ball.nc'}"]
    if not isinstance(experiment.result, DecayResult):
        tuned, others = summary(experiment.result.bands)
        numbers |= {"relative_error_tuned": tuned, "relative_error_elsewhere": others}
        lines.append(f"relative error of W̄: {tuned:.2f} at ω̄ = {experiment.omega_bar:g}, {others:.2f} elsewhere")
    return {
        "lines": lines + report_lines(folder, written=report),
        "flags": list(experiment.flags),
        "output": str(folder),
        **numbers,
    }
