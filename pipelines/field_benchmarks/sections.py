"""The report on benchmarks: which figures and tables, in which order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from pipelines.field_benchmarks.figures import free_runs, shown_models
from pipelines.field_benchmarks.results import BenchmarkResult
from pipelines.field_benchmarks.tables import model_table, number_table, published_table
from pipelines.report.citations import Citation
from pipelines.report.page import Page
from pipelines.report.sections import FigurePlan, SectionPlan
from pipelines.report.tables import provenance_table
from sloshlab import __version__


def page_of(results: Sequence[BenchmarkResult], provenance: Mapping[str, Any]) -> Page:
    """The page of the report."""
    return Page(
        title="Benchmarks of nonlinear system identification",
        subtitle=f"free-run errors of named models · sloshlab {__version__}",
        flags=tuple(f"{result.benchmark.name}: {result.data.note}" for result in results if result.data.note),
        summary=tuple(sentence(result) for result in results),
        plans=(
            *(_section(result) for result in results),
            SectionPlan("Provenance", (), (provenance_table(provenance),)),
        ),
        papers=tuple(
            Citation(result.benchmark.name, result.benchmark.reference, result.benchmark.doi) for result in results
        ),
    )


def _section(result: BenchmarkResult) -> SectionPlan:
    tables = [model_table(result), number_table(result)]
    if result.benchmark.published:
        tables.append(published_table(result))
    figure = FigurePlan(f"{result.benchmark.name}_free_runs", partial(free_runs, result=result))
    return SectionPlan(result.benchmark.title, (figure,), tuple(tables))


def sentence(result: BenchmarkResult) -> str:
    """What naming what was missing is worth, and what the search said."""
    baseline, *named = shown_models(result)
    test, unit = result.data.tests[0].name, result.benchmark.unit
    text = f"{result.benchmark.title}: {baseline.fitted.model.name} leaves {baseline.errors[test]:.3g} {unit}"
    for model in named:
        text += f", {model.fitted.model.name} {model.errors[test]:.3g} {unit} ({test})"
    if result.searched:
        text += f". The search: {result.searched['statement']}"
    return text.rstrip(".") + "."
