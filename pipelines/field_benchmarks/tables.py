"""Tables of the report on benchmarks."""

from __future__ import annotations

from pipelines.field_benchmarks.definition import PUBLISHED_NUMBERS
from pipelines.field_benchmarks.results import BenchmarkResult, ModelResult
from pipelines.report.tables import Table

_SHOWN_UNITS = {"1": "", "N m-1": "N/m", "N s m-1": "N s/m", "s-1": "1/s", "V0.5 s-1": "√V/s"}


def numbers_text(result: ModelResult) -> str:
    """Names and numbers of a model with their units, in one line."""
    parts = []
    for number in result.fitted.numbers:
        units = _SHOWN_UNITS.get(number.units, number.units)
        parts.append(f"{number.name.replace('_', ' ')} {number.value:.4g} {units}".strip())
    return ", ".join(parts)


def model_table(result: BenchmarkResult) -> Table:
    """Models with their numbers and free-run errors, and the best published error of its kind."""
    unit, rows = result.benchmark.unit, []
    for model in result.models:
        for record in result.data.tests:
            error = model.errors[record.name]
            rival = result.rival(record.name)
            rows.append(
                (
                    model.fitted.model.name,
                    model.fitted.model.role,
                    record.name,
                    f"{error:.3g}",
                    "–" if rival is None else f"{rival.error:.3g} ({rival.kind})",
                    "–" if rival is None else f"{error / rival.error:.2f}",
                    ratio_to_published_numbers(result, model, record.name),
                )
            )
    header = (
        "model",
        "role",
        "test",
        f"free-run error here [{unit}]",
        f"best published [{unit}]",
        "ratio",
        "ratio to published numbers run here",
    )
    caption = (
        "RMS errors of free runs; no model saw the tests. The best published error is that of the best model "
        "whose structure and numbers mean something, or of the best of all where there is none."
    )
    return Table("Models", header, tuple(rows), caption)


def ratio_to_published_numbers(result: BenchmarkResult, model: ModelResult, test: str) -> str:
    """Error over that of the model with its authors' numbers, in the same free run."""
    for other in result.models:
        if other.fitted.model.role == PUBLISHED_NUMBERS and other is not model:
            return f"{model.errors[test] / other.errors[test]:.3g}"
    return "–"


def number_table(result: BenchmarkResult) -> Table:
    """Names and numbers of every model."""
    rows = [
        (model.fitted.model.name, numbers_text(model), f"{model.training_error:.3g}") for model in result.models
    ]
    header = ("model", "numbers", f"free-run error on training records [{result.benchmark.unit}]")
    return Table("Numbers", header, tuple(rows))


def published_table(result: BenchmarkResult) -> Table:
    """Errors that others published."""
    rows = [
        (known.model, known.kind, known.test, f"{known.error:.3g}", known.reference, known.doi)
        for known in result.benchmark.published
    ]
    header = ("model", "kind", "test", f"error [{result.benchmark.unit}]", "reference", "DOI")
    return Table("Published errors", header, tuple(rows))
