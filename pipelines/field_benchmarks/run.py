"""The command `benchmark`: fit named models, simulate the tests once, set the errors beside published ones."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from pipelines.field_benchmarks.catalogue import BENCHMARKS
from pipelines.field_benchmarks.data_files import found_file
from pipelines.field_benchmarks.definition import Benchmark, BenchmarkData
from pipelines.field_benchmarks.fitting import FittedModel, fitted_model
from pipelines.field_benchmarks.results import BenchmarkResult, ModelResult
from pipelines.field_benchmarks.scoring import free_run, free_run_error
from pipelines.report.outputs import RESULT_ID, provenance_of, report_lines
from pipelines.report.progress import progress
from pipelines.report.result_folder import require_result_folder, result_folder
from sloshlab import atomic_file
from sloshlab.errors import InputError

DATA_VARIABLE: Final = "SLOSHLAB_EXTERNAL_DATA"
FILE_NAME: Final = "benchmarks.json"


def run_benchmarks(
    names: Sequence[str],
    data: Path | None,
    output: Path,
    *,
    command: str,
    diagnose: bool = False,
    report: bool = True,
) -> dict[str, Any]:
    """Run benchmarks, write their results, return the summary of the command.

    Parameters
    ----------
    names : sequence of str
        Of benchmarks; none for all whose files are there.
    data : Path, optional
        Folder with the published files; that of SLOSHLAB_EXTERNAL_DATA by default.
    output : Path
        Folder for results; all files appear together, or none does.
    command : str
        What the user typed.
    diagnose : bool
        Whether to search for what each baseline lacks, too.
    report : bool

    Raises
    ------
    InputError
        If a benchmark is unknown, or a file of one that was named is not there.
    """
    folder = data_folder(data)
    chosen, left_out = _chosen(names, folder)
    require_result_folder(output, (FILE_NAME, *(["report.html"] if report else [])))
    # Every file is read before anything is computed: what is wrong with one is then said at once.
    prepared = [(benchmark, benchmark.read(folder)) for benchmark in chosen]
    n_steps = sum(len(b.models(data)) + _is_searched(b, diagnose) for b, data in prepared)
    results = []
    with progress("benchmarks", n_steps) as advance:
        for benchmark, split in prepared:
            results.append(benchmark_result(benchmark, split, advance, diagnose=diagnose))
    provenance = provenance_of(command, _files(chosen, folder), settings={"diagnose": diagnose})
    _write(results, output, provenance, report=report)
    facts = {result.benchmark.name: result.facts() for result in results}
    lines = [line for result in results for line in _lines(result)]
    lines += [
        f"left out: {benchmark.name}, whose {', '.join(benchmark.files)} is not there" for benchmark in left_out
    ]
    lines += [f"written: {output / FILE_NAME}", *report_lines(output, written=report)]
    return {"lines": lines, RESULT_ID: provenance[RESULT_ID], "benchmarks": facts}


def benchmark_result(
    benchmark: Benchmark, data: BenchmarkData, advance: Callable[[str], None], *, diagnose: bool = False
) -> BenchmarkResult:
    """Fit and score all models of a benchmark.

    Parameters
    ----------
    benchmark : Benchmark
    data : BenchmarkData
    advance : callable
        Takes a word on every step.
    diagnose : bool
    """
    fitted, searched = [], dict[str, Any]()
    for model in benchmark.models(data):
        fitted.append(fitted_model(model, data.training))
        advance(f"{benchmark.name}: {model.name}")
    if _is_searched(benchmark, diagnose):
        # imported here: the diagnosis is a room of its own that most runs do without
        from pipelines.field_benchmarks.search import searched_model

        found, answer = searched_model(benchmark, data.training)
        fitted.append(found)
        searched = dict(answer)
        advance(f"{benchmark.name}: searched")
    results = tuple(scored(benchmark, data, model) for model in fitted)
    return BenchmarkResult(benchmark, data, results, searched)


def scored(benchmark: Benchmark, data: BenchmarkData, fitted: FittedModel) -> ModelResult:
    """Free runs of a fitted model over all records.

    Parameters
    ----------
    benchmark : Benchmark
    data : BenchmarkData
    fitted : FittedModel
    """

    def output(record: Any) -> Any:
        return free_run(fitted.model, record, fitted.values, fitted.extension)[benchmark.scored]

    simulated = {record.name: output(record) for record in data.tests}
    errors = {
        record.name: benchmark.per_si_unit
        * free_run_error(record.channels[benchmark.scored], simulated[record.name], record.n_initial)
        for record in data.tests
    }
    # Training outputs have been seen, so that they may tell where each record starts.
    seen = [replace(record, n_initial=record.n_samples) for record in data.training]
    squares = np.concatenate([(output(record) - record.channels[benchmark.scored]) ** 2 for record in seen])
    return ModelResult(fitted, benchmark.per_si_unit * float(np.sqrt(squares.mean())), errors, simulated)


def listed() -> list[str]:
    """One line for each benchmark: name, what it is, files, and where they are to be had."""
    return [
        f"{benchmark.name}: {benchmark.title}; "
        + (f"needs {', '.join(benchmark.files)}, {benchmark.source}" if benchmark.files else "needs no files")
        for benchmark in BENCHMARKS.values()
    ]


def data_folder(data: Path | None) -> Path | None:
    """The folder that was named, or that of the environment.

    Raises
    ------
    InputError
        If what was named is no folder.
    """
    named = data or (Path(os.environ[DATA_VARIABLE]) if os.environ.get(DATA_VARIABLE) else None)
    if named is not None and not named.is_dir():
        raise InputError(f"--data {named}", got="no such folder", allowed="a folder with the files of benchmarks")
    return named


def _chosen(names: Sequence[str], folder: Path | None) -> tuple[list[Benchmark], list[Benchmark]]:
    unknown = [name for name in names if name not in BENCHMARKS]
    if unknown:
        raise InputError(f"benchmark {unknown[0]!r}"[:80], got="an unknown name", allowed=", ".join(BENCHMARKS))
    if names:
        return [BENCHMARKS[name] for name in dict.fromkeys(names)], []
    there = [b for b in BENCHMARKS.values() if all(found_file(folder, file) for file in b.files)]
    return there, [benchmark for benchmark in BENCHMARKS.values() if benchmark not in there]


def _is_searched(benchmark: Benchmark, diagnose: bool) -> bool:
    return diagnose and benchmark.twin_file is not None


def _files(chosen: Sequence[Benchmark], folder: Path | None) -> list[Path]:
    found = [found_file(folder, name) for benchmark in chosen for name in benchmark.files]
    return [path for path in found if path is not None]


def _write(
    results: Sequence[BenchmarkResult], output: Path, provenance: Mapping[str, Any], *, report: bool
) -> None:
    facts = {RESULT_ID: provenance[RESULT_ID]} | {result.benchmark.name: result.facts() for result in results}
    with result_folder(output, provenance) as complete:
        atomic_file.write_bytes(complete / FILE_NAME, (json.dumps(facts, indent=1) + "\n").encode())
        if report:
            from pipelines.field_benchmarks.sections import page_of
            from pipelines.report.page import write_page

            write_page(page_of(results, provenance), complete, result_id=str(provenance[RESULT_ID]))


def _lines(result: BenchmarkResult) -> list[str]:
    lines = [f"{result.benchmark.name}: {result.data.note}"] if result.data.note else []
    for model in result.models:
        errors = ", ".join(f"{test} {error:.3g} {result.benchmark.unit}" for test, error in model.errors.items())
        lines.append(f"{result.benchmark.name}: {model.fitted.model.name}: {errors}")
    for record in result.data.tests:
        rival = result.rival(record.name)
        if rival is not None:
            text = f"{rival.model} ({rival.kind}) {rival.error:.3g} {result.benchmark.unit}"
            lines.append(f"{result.benchmark.name}: published, {record.name}: {text}")
    return lines
