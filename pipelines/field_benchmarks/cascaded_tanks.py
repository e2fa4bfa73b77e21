"""Cascaded tanks: two tanks, one above the other, with free outlets, which a pump fills and may overfill.

Split of nonlinearbenchmark.org and of its package: estimation data train, validation data test, whose first 50
samples are not scored and may tell the initial levels.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from pipelines.field_benchmarks.data_files import located, require_samples, scalar, series, table_of
from pipelines.field_benchmarks.definition import (
    BASELINE,
    BLACK_BOX,
    LINEAR,
    Benchmark,
    BenchmarkData,
    NamedModel,
    Published,
    Record,
)
from pipelines.field_benchmarks.twins import cascaded_tanks as twin

FILE: Final = "dataBenchmark.mat"
SOURCE: Final = "https://doi.org/10.4121/12960104 (CascadedTanksFiles.zip)"
N_INITIAL: Final = 50
_UNSTRUCTURED: Final = (
    "R. Relan, K. Tiels, A. Marconato, J. Schoukens: An unstructured flexible nonlinear model for the cascaded "
    "water-tanks benchmark. IFAC-PapersOnLine 50(1), 452–457 (2017)."
)
_UNSTRUCTURED_DOI: Final = "10.1016/j.ifacol.2017.08.074"


def read(folder: Path | None) -> BenchmarkData:
    """Pump voltage and level of the lower tank, twice."""
    path = located(folder, FILE, SOURCE)
    table = table_of(path)
    rate_hz = 1.0 / scalar(table, path, "Ts")

    def record(name: str, suffix: str, n_initial: int) -> Record:
        pump, level = series(table, path, (f"u{suffix}", f"y{suffix}"))
        require_samples(pump, 2 * N_INITIAL, path, f"u{suffix}")
        return Record(name, {"voltage_pump": pump, "voltage_level": level}, rate_hz, n_initial)

    return BenchmarkData((record("estimation", "Est", 0),), (record("validation", "Val", N_INITIAL),))


def models(data: BenchmarkData) -> tuple[NamedModel, ...]:
    """Linear outlets, outlets by Bernoulli's law, and brims besides."""
    del data
    return (
        NamedModel("linear outlets", twin.TWIN, role=BASELINE),
        NamedModel("square-root outlets", twin.WITH_SQUARE_ROOTS),
        NamedModel("square-root outlets and overflow", twin.WITH_OVERFLOW),
    )


CASCADED_TANKS: Final = Benchmark(
    name="cascaded_tanks",
    title="Cascaded tanks: square-root outlets and overflow",
    files=(FILE,),
    source=SOURCE,
    read=read,
    models=models,
    scored="voltage_level",
    unit="V",
    per_si_unit=1.0,
    published=(
        Published("best linear approximation", LINEAR, "validation", 0.757, _UNSTRUCTURED, _UNSTRUCTURED_DOI),
        Published("polynomial state space", BLACK_BOX, "validation", 0.450, _UNSTRUCTURED, _UNSTRUCTURED_DOI),
        Published("nonlinear state space", BLACK_BOX, "validation", 0.343, _UNSTRUCTURED, _UNSTRUCTURED_DOI),
    ),
    reference=(
        "M. Schoukens, J.-P. Noël: Three benchmarks addressing open challenges in nonlinear system "
        "identification. IFAC-PapersOnLine 50(1), 446–451 (2017)."
    ),
    doi="10.1016/j.ifacol.2017.08.071",
)
