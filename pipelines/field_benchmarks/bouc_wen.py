"""The Bouc–Wen benchmark: an oscillator with hysteresis, whose signals are computed from its published equations.

Trained is on random-phase multisines with noise; tests are another one in steady motion and a swept sine, both
without noise. The published test signals are taken where their files are there.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pipelines.field_benchmarks.bouc_wen_equations import DrivingForce, displacement_m, multisine, swept_sine
from pipelines.field_benchmarks.data_files import found_file, series, table_of
from pipelines.field_benchmarks.definition import (
    BASELINE,
    BLACK_BOX,
    PUBLISHED_NUMBERS,
    Benchmark,
    BenchmarkData,
    NamedModel,
    Published,
    Record,
)
from pipelines.field_benchmarks.twins import hysteretic_oscillator as twin

FloatArray = NDArray[np.float64]
RATE_HZ: Final = 750.0
N_PER_PERIOD: Final = 8192
BAND_HZ, RMS_N = (5.0, 150.0), 50.0
N_TRAINING: Final = 2
"""Realisations that are fitted."""
NOISE_M: Final = 8e-6
"""Documented RMS of the noise on training outputs."""
SOURCE: Final = "https://doi.org/10.4121/12967592 (BoucWenFiles.zip)"
MULTISINE_FILES = ("uval_multisine.mat", "yval_multisine.mat")
SWEEP_FILES = ("uval_sinesweep.mat", "yval_sinesweep.mat")
_HYSTERESIS: Final = "structure.hysteresis."
PUBLISHED: Final = {
    "stiffness": 5e4,
    "damping": 10.0,
    f"{_HYSTERESIS}stiffness_n_per_m": 5e4,
    f"{_HYSTERESIS}beta_gamma": 1e3 * 0.8,
    f"{_HYSTERESIS}beta_delta": 1e3 * -1.1,
    f"{_HYSTERESIS}exponent": 1.0,
}


def read(folder: Path | None) -> BenchmarkData:
    """Computed training signals; tests of the files, or computed as well."""
    training = tuple(_noisy(f"realisation {seed}", seed) for seed in range(1, 1 + N_TRAINING))
    files = [found_file(folder, name) for name in (*MULTISINE_FILES, *SWEEP_FILES)]
    there = [path for path in files if path is not None]
    if len(there) == len(files):
        force, moved = _recorded(there[0], there[1])
        steady = _steady(np.tile(force, 2), np.tile(moved, 2), force.size)
        return BenchmarkData(training, (steady, _record("swept sine", *_recorded(there[2], there[3]))))
    sweep = swept_sine(RATE_HZ, (20.0, 50.0), 40.0, hz_per_minute=10.0)
    repeated = multisine(RATE_HZ, N_PER_PERIOD, 2, band_hz=BAND_HZ, rms_n=RMS_N, seed=99)
    return BenchmarkData(
        training,
        (
            _steady(repeated.samples_n, displacement_m(repeated), N_PER_PERIOD),
            _record("swept sine", sweep.samples_n, displacement_m(sweep)),
        ),
        note="tests are computed from the published equations: another realisation of the published multisine",
    )


def _noisy(name: str, seed: int) -> Record:
    force: DrivingForce = multisine(RATE_HZ, N_PER_PERIOD, 1, band_hz=BAND_HZ, rms_n=RMS_N, seed=seed)
    moved = displacement_m(force)
    moved += NOISE_M * np.random.default_rng(seed).standard_normal(moved.size)
    channels = {"force_drive": force.samples_n, "displacement_mass": moved}
    return Record(name, channels, RATE_HZ, noise_std={"displacement_mass": NOISE_M})


def _steady(force: FloatArray, moved: FloatArray, n_per_period: int) -> Record:
    """Two periods from rest, of which the first one lets the transient go and is not scored."""
    return _record("multisine", force, moved, n_per_period)


def _record(name: str, force: FloatArray, moved: FloatArray, n_initial: int = 0) -> Record:
    return Record(name, {"force_drive": force, "displacement_mass": moved}, RATE_HZ, n_initial)


def _recorded(force_file: Path, displacement_file: Path) -> tuple[FloatArray, FloatArray]:
    [force] = series(table_of(force_file), force_file, (force_file.stem,))
    [moved] = series(table_of(displacement_file), displacement_file, (displacement_file.stem,))
    return force, moved


def models(data: BenchmarkData) -> tuple[NamedModel, ...]:
    """A linear spring, with Bouc–Wen hysteresis, and the published numbers."""
    del data
    return (
        NamedModel("linear spring", twin.TWIN, role=BASELINE),
        NamedModel("Bouc–Wen hysteresis", twin.TWIN, ("hysteresis",)),
        NamedModel("published numbers", twin.TWIN, ("hysteresis",), PUBLISHED_NUMBERS, PUBLISHED),
    )


BOUC_WEN: Final = Benchmark(
    name="bouc_wen",
    title="Bouc–Wen: an oscillator with hysteresis",
    files=(),
    source=SOURCE,
    read=read,
    models=models,
    scored="displacement_mass",
    unit="µm",
    per_si_unit=1e6,
    published=(
        Published(
            "polynomial state space (PNLSS), degrees 3, 5, 7; −98.32 dB",
            BLACK_BOX,
            "multisine",
            1e6 * 10 ** (-98.32 / 20),
            "J.-P. Noël, A. F. Esfahani, G. Kerschen, J. Schoukens: A nonlinear state-space approach to "
            "hysteresis identification. Mechanical Systems and Signal Processing 84, 171–184 (2017).",
            "10.1016/j.ymssp.2016.08.025",
        ),
    ),
    reference=(
        "J.-P. Noël, M. Schoukens: Hysteretic benchmark with a dynamic nonlinearity. Workshop on Nonlinear System "
        "Identification Benchmarks, Brussels (2016)."
    ),
    doi="10.4121/12967592",
    twin_file=Path(twin.__file__),
)
