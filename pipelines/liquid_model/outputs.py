"""Writing the report of a model: page, figures, training curve, maps and residual tests."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pipelines.inputs.recordings import RunSource
from pipelines.liquid_model.comparison import validated
from pipelines.liquid_model.results import Training, ValidatedModel
from pipelines.liquid_model.sections import page_of
from pipelines.liquid_model.training_runs import TrainingRuns
from pipelines.report.outputs import RESULT_ID, report_lines, stamp_of, write_dataset
from pipelines.report.page import write_page
from pipelines.report.progress import progress
from pipelines.report.result_folder import result_folder
from sloshlab.quantities import described
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.training import TrainingRecord

_N_FIGURES = 11
"""Of the page, for the progress."""


def write_validation(
    model: ReducedOrderModel,
    runs: TrainingRuns,
    test: Sequence[RunSource],
    folder: Path,
    *,
    provenance: Mapping[str, Any],
    training: Training | None = None,
) -> dict[str, Any]:
    """Compare a model with recordings and write the report; return the summary of the command.

    Parameters
    ----------
    model : ReducedOrderModel
    runs : TrainingRuns
    test : sequence of Path or RecordingInMemory
        Further runs.
    folder : Path
        All files appear in it together, complete, or none does.
    provenance : mapping
        What the model and the report rest on.
    training : Training, optional
    """
    files = runs.files
    n_steps = 3 + len(files.validation) + len(test) + _N_FIGURES
    with progress("validation", n_steps) as advance:
        found = validated(model, runs, test, training=training, advance=advance)
        found = dataclasses.replace(found, provenance=provenance)
        with result_folder(folder, provenance) as complete:
            for name, dataset in datasets(found).items():
                write_dataset(dataset, complete / name)
            write_page(
                page_of(found),
                complete,
                result_id=provenance[RESULT_ID],
                progress=lambda _done, _total, name: advance(name),
            )
    return _summary(found, folder)


def datasets(found: ValidatedModel) -> dict[str, xr.Dataset]:
    """What is written beside the page, by file name."""
    written = {}
    if found.training is not None:
        written["training_curve.nc"] = training_curve(found.training.record)
    if found.maps is not None:
        written["maps.nc"] = _maps(found)
    if found.tests:
        written["residual.nc"] = _residual(found)
    stamp = {"title": "Validation of a reduced-order model", **stamp_of(found.provenance)}
    return {name: described(dataset).assign_attrs(stamp) for name, dataset in written.items()}


def training_curve(record: TrainingRecord) -> xr.Dataset:
    """Errors on training and validation runs over the epochs, described."""
    epochs = record.epochs
    curve = xr.Dataset(
        {
            "start_number": ("epoch_index", np.array([epoch.start for epoch in epochs])),
            "epoch_number": ("epoch_index", np.array([epoch.number for epoch in epochs])),
            "training_rms_n": ("epoch_index", np.sqrt([epoch.training_mse for epoch in epochs])),
            "validation_rms_n": ("epoch_index", np.sqrt([epoch.validation_mse for epoch in epochs])),
            "is_kept": ("epoch_index", np.array([epoch is record.best for epoch in epochs], np.int8)),
        }
    )
    return described(curve)


def _maps(found: ValidatedModel) -> xr.Dataset:
    assert found.maps is not None
    variables: dict[str, Any] = {}
    for name in ("w_bar", "beta"):
        variables[name] = found.maps.measured.maps.dataset[name].variable
        variables[f"predicted_{name}"] = found.maps.predicted.maps.dataset[name].variable
        variables[f"{name}_difference"] = found.maps.difference(name).variable
    coordinates = {name: found.maps.measured.maps.dataset[name].values for name in ("omega_bar", "u_bar")}
    return xr.Dataset(variables, coords=coordinates)


def _residual(found: ValidatedModel) -> xr.Dataset:
    """Correlations of the first validation run."""
    tests = next(iter(found.tests.values()))
    rate = found.model.sampling_rate_hz
    n = max(test.lags.size for test in tests)
    values = np.full((2, len(tests), n), np.nan)
    for row, test in enumerate(tests):
        values[0, row, -test.lags.size :], values[1, row, -test.lags.size :] = test.correlation, test.band
    return xr.Dataset(
        {
            "residual_correlation": (("residual_test", "lag_s"), values[0]),
            "residual_band": (("residual_test", "lag_s"), values[1]),
            "residual_explained": ("residual_test", [test.explained for test in tests]),
        },
        coords={
            "residual_test": np.array([test.against for test in tests], dtype=object),
            "lag_s": np.arange(n) / rate,
        },
    )


def _summary(found: ValidatedModel, folder: Path) -> dict[str, Any]:
    summary: dict[str, Any] = {"report": str(folder / "report.html")}
    lines = []
    if found.ceiling:
        pairs = found.ceiling
        summary["ceiling_percent"] = float(
            np.mean([pair.repeats.fit_of_ideal_model().fit_percent for pair in pairs])
        )
        summary["repeat_percent"] = float(np.mean([pair.repeats.fit().fit_percent for pair in pairs]))
        summary["model_on_repeats_percent"] = float(np.mean([pair.model.fit_percent for pair in pairs]))
        lines.append(
            f"on repeats: fit {summary['model_on_repeats_percent']:.1f} %, one repeat for another "
            f"{summary['repeat_percent']:.1f} %, ideal model {summary['ceiling_percent']:.1f} %"
        )
    if found.maps is not None:
        for name, error in found.maps.errors.items():
            summary[f"{name}_map_error"] = error.relative_rms
        lines.append(
            f"maps: RMS error of W̄ {100 * summary['w_bar_map_error']:.1f} %, of β "
            f"{100 * summary['beta_map_error']:.1f} % of "
            "the largest value"
        )
    lines += [f"residual on {run}: {test.verdict}" for run, tests in found.tests.items() for test in tests[:2]]
    return {"lines": lines + report_lines(folder), "flags": list(found.flags), **summary}
