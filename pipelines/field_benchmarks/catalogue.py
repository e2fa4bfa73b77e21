"""Which benchmarks there are."""

from __future__ import annotations

from typing import Final

from pipelines.field_benchmarks.bouc_wen import BOUC_WEN
from pipelines.field_benchmarks.cascaded_tanks import CASCADED_TANKS
from pipelines.field_benchmarks.definition import Benchmark
from pipelines.field_benchmarks.emps import EMPS
from pipelines.field_benchmarks.f16 import F16
from pipelines.field_benchmarks.silverbox import SILVERBOX
from pipelines.field_benchmarks.wiener_hammerstein import WIENER_HAMMERSTEIN

BENCHMARKS: Final[dict[str, Benchmark]] = {
    benchmark.name: benchmark for benchmark in (SILVERBOX, EMPS, F16, BOUC_WEN, CASCADED_TANKS, WIENER_HAMMERSTEIN)
}
