"""The search for what a baseline lacks, instead of being told its name."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pipelines.diagnosis.diagnose import diagnose_case
from pipelines.field_benchmarks.case_runs import write_case
from pipelines.field_benchmarks.definition import NAMED, Benchmark, NamedModel, Record
from pipelines.field_benchmarks.fitting import FittedModel, Number
from sloshlab.errors import InputError
from sloshlab.missing_physics.units import named_and_units
from sloshlab.user_twin import load_extended, load_user_twin

_N_RUNS, _LONGEST = 3, 6_500
"""Stretches of the training records that are diagnosed, and samples of each: as many as a search bears."""


def searched_model(benchmark: Benchmark, training: tuple[Record, ...]) -> tuple[FittedModel, Mapping[str, Any]]:
    """Diagnose stretches of the training records; the extended twin is the model.

    Parameters
    ----------
    benchmark : Benchmark
    training : tuple of Record

    Returns
    -------
    fitted : FittedModel
    answer : mapping
        Verdict, its sentence and effects.

    Raises
    ------
    InputError
        If the benchmark has no twin that can be searched.
    """
    if benchmark.twin_file is None:
        raise InputError(f"--diagnose {benchmark.name}", got="no twin of forces", remedy="leave --diagnose out")
    with tempfile.TemporaryDirectory(prefix="sloshlab-benchmark-") as name:
        case = write_case(stretches(training), Path(name) / "case")
        found = diagnose_case(
            case, None, command=f"sloshlab benchmark {benchmark.name}", report=False, twin=benchmark.twin_file
        )
        values, extension = load_extended(case / "diagnosis" / "extended_twin.toml")
    twin = load_user_twin(benchmark.twin_file)
    numbers = [Number(known.name, values[known.name], known.units) for known in twin.parameters]
    for effect in found["effects"]:
        for parameter, told in effect["parameters"].items():
            words, units = named_and_units(parameter)
            numbers.append(Number(f"{effect['name'].replace('_', ' ')}: {words}", told["estimate"], units))
    effects = tuple(effect["name"] for effect in found["effects"])
    model = NamedModel("found by the search", twin, effects, NAMED)
    answer = {key: found[key] for key in ("verdict", "statement")} | {"effects": list(effects)}
    return FittedModel(model, values, extension, tuple(numbers)), answer


def stretches(training: tuple[Record, ...]) -> tuple[Record, ...]:
    """Some stretches of the training records, each a run of its own.

    Parameters
    ----------
    training : tuple of Record
    """
    per_record = -(-_N_RUNS // len(training))
    found = []
    for record in training:
        length = min(record.n_samples // per_record, _LONGEST)
        for number in range(per_record):
            first = number * (record.n_samples // per_record)
            part = {name: values[first : first + length] for name, values in record.channels.items()}
            name = f"{record.name}_{number + 1}".replace(" ", "_")
            found.append(Record(name, part, record.sampling_rate_hz, 0, record.noise_std))
    return tuple(found[: max(_N_RUNS, len(training))])
