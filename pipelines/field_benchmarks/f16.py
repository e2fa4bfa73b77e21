"""F-16: a wing with a payload, whose joint slides and rattles; the shaker's force drives the whole aircraft.

The package of nonlinearbenchmark.org tests on the validation files of levels 2, 4 and 6, whose first 50 samples
are not scored. Where these are absent the sweep of level 3 and the multisine of level 5 are held out.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import decimate

from pipelines.field_benchmarks.aircraft_modes import modal_twin, real_modes
from pipelines.field_benchmarks.data_files import found_file, located, require_samples, scalar, series, table_of
from pipelines.field_benchmarks.definition import BASELINE, Benchmark, BenchmarkData, NamedModel, Record

FloatArray = NDArray[np.float64]
SOURCE: Final = "https://www.nonlinearbenchmark.org/benchmarks/f-16-gvt (F16GVT_Files.zip)"
LINEAR_FILE, MULTISINE_FILE = "F16Data_FullMSine_Level1.mat", "F16Data_FullMSine_Level5.mat"
SWEEP_FILES: Final = {level: f"F16Data_SineSw_Level{level}.mat" for level in (1, 3, 5, 7)}
TEST_FILES: Final = {
    f"{name} {level}": f"F16Data_{kind}_Level{level}_Validation.mat"
    for name, kind in (("multisine", "FullMSine"), ("sweep", "SineSw"))
    for level in (2, 4, 6)
}
FORCE: Final = "force_shaker"
OUTPUTS = ("acceleration_drive", "acceleration_wing", "acceleration_payload")
N_INITIAL: Final = 50
N_PER_PERIOD: Final = 8192
BAND_HZ = (2.0, 15.0)
"""Of the multisines."""
EVERY: Final = 4
"""Samples of a passage that are kept, after a filter: nothing is driven above 15 Hz."""
START_HZ, HZ_PER_S, PASSAGE_HZ = 15.0, 0.05, (8.5, 6.0)
"""Of the sweeps, downwards, and what is fitted of them."""
MODES_HZ = (3.5, 5.2, 6.6, 7.3, 9.2)
TORSION: Final = 3
"""Of these modes the one that is nonlinear."""


def read(folder: Path | None) -> BenchmarkData:
    """A multisine of the lowest level, passages of sweeps through the torsion mode, and whole records as tests."""
    linear = _record("multisine 1", located(folder, LINEAR_FILE, SOURCE))
    sweeps = {level: located(folder, name, SOURCE) for level, name in SWEEP_FILES.items()}
    found = {name: found_file(folder, file) for name, file in TEST_FILES.items()}
    validation = {name: path for name, path in found.items() if path is not None}
    if len(validation) == len(TEST_FILES):
        training = tuple(_passage(level, path) for level, path in sweeps.items())
        tests = tuple(_record(name, path, N_INITIAL) for name, path in validation.items())
        return BenchmarkData(training, tests, linear=(linear,))
    return BenchmarkData(
        tuple(_passage(level, path) for level, path in sweeps.items() if level != 3),
        (
            _record("sweep 3", sweeps[3], N_INITIAL),
            _record("multisine 5", located(folder, MULTISINE_FILE, SOURCE), N_INITIAL),
        ),
        is_published_test=False,
        note="the validation files are not in the data folder: sweep level 3 and multisine level 5 are held out",
        linear=(linear,),
    )


def _record(name: str, path: Path, n_initial: int = 0) -> Record:
    table = table_of(path)
    names = ("Force", *(f"Acceleration[{number}]" for number in (1, 2, 3)))
    columns = series(table, path, names)
    require_samples(columns[0], 2 * N_PER_PERIOD, path, "Force")
    rate_hz = scalar(table, path, "Fs")
    return Record(name, dict(zip((FORCE, *OUTPUTS), columns, strict=True)), rate_hz, n_initial)


def _passage(level: int, path: Path) -> Record:
    """A sweep from 8.5 to 6 Hz at a quarter of its rate."""
    whole = _record(f"passage {level}", path)
    first, last = (round((START_HZ - f) / HZ_PER_S * whole.sampling_rate_hz) for f in PASSAGE_HZ)
    require_samples(whole.channels[FORCE], last, path, "Force")
    kept = {
        name: np.asarray(decimate(values[first:last], EVERY, zero_phase=True))
        for name, values in whole.channels.items()
    }
    return Record(whole.name, kept, whole.sampling_rate_hz / EVERY)


def models(data: BenchmarkData) -> tuple[NamedModel, ...]:
    """Five linear modes, of which the torsion mode is then nonlinear."""
    [linear] = data.linear
    periods = {
        name: values[: values.size // N_PER_PERIOD * N_PER_PERIOD].reshape(-1, N_PER_PERIOD)[1:].mean(axis=0)
        for name, values in linear.channels.items()
    }
    lines_hz = np.asarray(np.fft.rfftfreq(N_PER_PERIOD, 1 / linear.sampling_rate_hz), np.float64)
    band = (lines_hz >= BAND_HZ[0]) & (lines_hz <= BAND_HZ[1])
    driven = np.fft.rfft(periods[FORCE])[band]
    response = np.stack([np.fft.rfft(periods[name])[band] / driven for name in OUTPUTS])
    twin = modal_twin(real_modes(lines_hz[band], response, MODES_HZ), OUTPUTS, FORCE, TORSION)
    return (
        NamedModel("five linear modes", twin, role=BASELINE),
        NamedModel("softening torsion mode (cubic)", twin, ("cubic_stiffness",)),
    )


F16: Final = Benchmark(
    name="f16",
    title="F-16: a joint with clearance and friction under a wing",
    files=(LINEAR_FILE, *SWEEP_FILES.values(), MULTISINE_FILE),
    source=SOURCE,
    read=read,
    models=models,
    scored="acceleration_payload",
    unit="m/s²",
    per_si_unit=1.0,
    published=(),
    reference=(
        "J.-P. Noël, M. Schoukens: F-16 aircraft benchmark based on ground vibration test data. Workshop on "
        "Nonlinear System Identification Benchmarks, 19–23, Brussels (2017)."
    ),
)
