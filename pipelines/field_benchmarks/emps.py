"""EMPS: a servo axis with dry friction, whose motor's voltage is the input.

The package of nonlinearbenchmark.org trains on one file and tests on another, ``DATA_EMPS_PULSES.mat``, whose
first 20 samples are not scored. Where that file is absent the last of four periods of the first one is the test.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pipelines.field_benchmarks.data_files import found_file, located, require_samples, series, table_of
from pipelines.field_benchmarks.definition import (
    BASELINE,
    PUBLISHED_NUMBERS,
    Benchmark,
    BenchmarkData,
    NamedModel,
    Record,
)
from pipelines.field_benchmarks.twins import servo_axis as twin

FloatArray = NDArray[np.float64]
FILE, TEST_FILE = "DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"
SOURCE: Final = "https://www.nonlinearbenchmark.org/benchmarks/emps (EMPS.zip)"
RATE_HZ: Final = 1000.0
PERIOD, N_PERIODS = 6240, 4
"""Samples of a period of the motion, and how many there are."""
N_INITIAL: Final = 20
_COULOMB, _CONSTANT = "structure.coulomb_friction.", "structure.constant_force."
PUBLISHED: Final = {
    "mass": 95.1089,
    "viscous_friction": 203.5034,
    f"{_COULOMB}force_n": 20.3935,
    f"{_CONSTANT}force_n": 3.1648,
}
"""Of its authors' reference model; their offset is the force against the motion's direction."""


def read(folder: Path | None) -> BenchmarkData:
    """Periods of the training file, and the test file where it is there.

    Position is the double integral of force: each period is simulated from its own start, so that what a model
    leaves out does not add up over all of them.
    """
    whole = _record("training", located(folder, FILE, SOURCE))
    periods = tuple(_period(whole, number) for number in range(N_PERIODS))
    test = found_file(folder, TEST_FILE)
    if test is not None:
        return BenchmarkData(periods, (_record("pulses", test, N_INITIAL),))
    *training, last = periods
    return BenchmarkData(
        tuple(training),
        (replace(last, n_initial=N_INITIAL),),
        is_published_test=False,
        note=f"{TEST_FILE} is not in the data folder: three periods of {FILE} are fitted, the fourth is the test",
    )


def _period(whole: Record, number: int) -> Record:
    # The last period is shorter, and all that is left belongs to it.
    part = slice(number * PERIOD, (number + 1) * PERIOD if number < N_PERIODS - 1 else None)
    return Record(f"period {number + 1}", {name: values[part] for name, values in whole.channels.items()}, RATE_HZ)


def _record(name: str, path: Path, n_initial: int = 0) -> Record:
    position, voltage = series(table_of(path), path, ("qm", "vir"))
    require_samples(position, (N_PERIODS - 1) * PERIOD + 2 * N_INITIAL, path, "qm")
    return Record(name, {"displacement_carriage": position, "voltage_motor": voltage}, RATE_HZ, n_initial)


def models(data: BenchmarkData) -> tuple[NamedModel, ...]:
    """Viscous friction alone, dry friction with an offset, and the numbers of its authors."""
    del data
    friction = ("coulomb_friction", "constant_force")
    return (
        NamedModel("viscous friction", twin.TWIN, role=BASELINE),
        NamedModel("viscous and dry friction, offset", twin.TWIN, friction),
        NamedModel("reference model of its authors", twin.TWIN, friction, PUBLISHED_NUMBERS, PUBLISHED),
    )


EMPS: Final = Benchmark(
    name="emps",
    title="EMPS: a servo axis with dry friction",
    files=(FILE,),
    source=SOURCE,
    read=read,
    models=models,
    scored="displacement_carriage",
    unit="mm",
    per_si_unit=1e3,
    published=(),
    reference=(
        "A. Janot, M. Gautier, M. Brunot: Data set and reference models of EMPS. Workshop on Nonlinear System "
        "Identification Benchmarks, Eindhoven (2019)."
    ),
    twin_file=Path(twin.__file__),
)
