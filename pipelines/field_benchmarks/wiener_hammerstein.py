"""The Wiener–Hammerstein benchmark: a diode between two filters.

Split of nonlinearbenchmark.org and of its package: samples 5200 to 184 000, of which the first 100 000 train;
of the others the first 50 are not scored.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from pipelines.field_benchmarks.data_files import located, require_samples, scalar, series, table_of
from pipelines.field_benchmarks.definition import (
    BASELINE,
    BLACK_BOX,
    Benchmark,
    BenchmarkData,
    NamedModel,
    Published,
    Record,
)
from pipelines.field_benchmarks.twins import wiener_hammerstein as twin

FILE: Final = "WienerHammerBenchMark.mat"
SOURCE: Final = "https://www.nonlinearbenchmark.org/benchmarks/wiener-hammerstein"
USED: Final = slice(5_200, 184_000)
N_TRAINING: Final = 100_000
N_INITIAL: Final = 50


def read(folder: Path | None) -> BenchmarkData:
    """Input and output of the circuit."""
    path = located(folder, FILE, SOURCE)
    table = table_of(path)
    voltage_in, voltage_out = series(table, path, ("uBenchMark", "yBenchMark"))
    require_samples(voltage_in, USED.stop, path, "uBenchMark")
    rate_hz = scalar(table, path, "fs")

    def record(name: str, part: slice, n_initial: int) -> Record:
        channels = {"voltage_input": voltage_in[USED][part], "voltage_output": voltage_out[USED][part]}
        return Record(name, channels, rate_hz, n_initial)

    return BenchmarkData(
        (record("training", slice(0, N_TRAINING), 0),), (record("test", slice(N_TRAINING, None), N_INITIAL),)
    )


def models(data: BenchmarkData) -> tuple[NamedModel, ...]:
    """Both filters, and the diode between them."""
    del data
    return (
        NamedModel("two filters", twin.TWIN, role=BASELINE),
        NamedModel("two filters and a diode between", twin.WITH_DIODE),
    )


WIENER_HAMMERSTEIN: Final = Benchmark(
    name="wiener_hammerstein",
    title="Wiener–Hammerstein: a diode between two filters",
    files=(FILE,),
    source=SOURCE,
    read=read,
    models=models,
    scored="voltage_output",
    unit="mV",
    per_si_unit=1e3,
    published=(
        Published(
            "deep subspace encoder",
            BLACK_BOX,
            "test",
            0.241,
            "G. I. Beintema, M. Schoukens, R. Tóth: Deep subspace encoders for nonlinear system identification. "
            "Automatica 156, 111210 (2023).",
            "10.1016/j.automatica.2023.111210",
        ),
    ),
    reference=(
        "J. Schoukens, J. Suykens, L. Ljung: Wiener–Hammerstein benchmark. 15th IFAC Symposium on System "
        "Identification, Saint-Malo (2009)."
    ),
)
