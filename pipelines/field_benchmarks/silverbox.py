"""The Silverbox: an electronic oscillator with a hardening spring.

Split of nonlinearbenchmark.org and of its package: of the multisine everything but the last quarter is for
training; the last quarter and the arrow are the tests, whose first 50 samples are not scored.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from pipelines.field_benchmarks.data_files import located, require_samples, series, table_of
from pipelines.field_benchmarks.definition import (
    BASELINE,
    BLACK_BOX,
    LINEAR,
    PHYSICAL,
    Benchmark,
    BenchmarkData,
    NamedModel,
    Published,
    Record,
)
from pipelines.field_benchmarks.twins import silverbox as twin

FILE: Final = "SNLS80mV.mat"
SOURCE: Final = "https://www.nonlinearbenchmark.org/benchmarks/silverbox (SilverboxFiles.zip)"
RATE_HZ: Final = 1e7 / 2**14
MULTISINE, ARROW, WITHOUT_EXTRAPOLATION = slice(40_650, 127_400), slice(100, 40_575), slice(100, 32_100)
SHARE_FOR_TRAINING: Final = 0.75
N_INITIAL: Final = 50
_BASELINES: Final = (
    "M. D. Champneys, G. I. Beintema, R. Tóth, M. Schoukens, T. J. Rogers: Baseline results for selected "
    "nonlinear system identification benchmarks. IFAC-PapersOnLine 58(15), 474–479 (2024)."
)
_BASELINES_DOI: Final = "10.1016/j.ifacol.2024.08.574"


def read(folder: Path | None) -> BenchmarkData:
    """Records of the multisine and of the arrow."""
    path = located(folder, FILE, SOURCE)
    force, displacement = series(table_of(path), path, ("V1", "V2"))
    require_samples(force, MULTISINE.stop, path, "V1")

    def record(name: str, part: slice, n_initial: int) -> Record:
        channels = {"force_input": force[part], "displacement_output": displacement[part]}
        return Record(name, channels, RATE_HZ, n_initial)

    middle = MULTISINE.start + int(SHARE_FOR_TRAINING * (MULTISINE.stop - MULTISINE.start))
    tests = {
        "multisine": slice(middle, MULTISINE.stop),
        "arrow": ARROW,
        "arrow without extrapolation": WITHOUT_EXTRAPOLATION,
    }
    return BenchmarkData(
        (record("training", slice(MULTISINE.start, middle), 0),),
        tuple(record(name, part, N_INITIAL) for name, part in tests.items()),
    )


def models(data: BenchmarkData) -> tuple[NamedModel, ...]:
    """The linear oscillator, with a cubic spring, and with a quadratic one besides."""
    del data
    return (
        NamedModel("linear spring", twin.TWIN, role=BASELINE),
        NamedModel("cubic spring", twin.TWIN, ("cubic_stiffness",)),
        NamedModel("cubic and quadratic spring", twin.TWIN, ("cubic_stiffness", "quadratic_stiffness")),
    )


SILVERBOX: Final = Benchmark(
    name="silverbox",
    title="Silverbox: an electronic oscillator with a hardening spring",
    files=(FILE,),
    source=SOURCE,
    read=read,
    models=models,
    scored="displacement_output",
    unit="mV",
    per_si_unit=1e3,
    published=(
        Published("linear state space", LINEAR, "multisine", 6.96, _BASELINES, _BASELINES_DOI),
        Published("linear state space", LINEAR, "arrow", 14.4, _BASELINES, _BASELINES_DOI),
        Published("polynomial NARX", BLACK_BOX, "multisine", 0.64, _BASELINES, _BASELINES_DOI),
        Published("Gaussian-process NARX", BLACK_BOX, "multisine", 0.301, _BASELINES, _BASELINES_DOI),
        Published("polynomial NARX", BLACK_BOX, "arrow", 2.25, _BASELINES, _BASELINES_DOI),
        Published(
            "linear part and static nonlinear feedback, five numbers",
            PHYSICAL,
            "arrow",
            0.96,
            "H. Hjalmarsson, J. Schoukens: On direct identification of physical parameters in non-linear models. "
            "IFAC Proceedings Volumes 37(13), NOLCOS (2004).",
        ),
        Published(
            "linear part and polynomial feedback, ten numbers",
            PHYSICAL,
            "arrow",
            0.38,
            "J. Paduart, G. Horváth, J. Schoukens: Fast identification of systems with nonlinear feedback. "
            "IFAC Proceedings Volumes 37(13), NOLCOS (2004).",
        ),
        Published(
            "polynomial state space (PNLSS)",
            BLACK_BOX,
            "arrow",
            0.26,
            "J. Paduart, L. Lauwers, J. Swevers, K. Smolders, J. Schoukens, R. Pintelon: Identification of "
            "nonlinear systems using polynomial nonlinear state space models. Automatica 46(4), 647–656 (2010).",
            "10.1016/j.automatica.2010.01.001",
        ),
    ),
    reference=(
        "T. Wigren, J. Schoukens: Three free data sets for development and benchmarking in nonlinear system "
        "identification. European Control Conference, 2933–2938 (2013)."
    ),
    doi="10.23919/ECC.2013.6669201",
    twin_file=Path(twin.__file__),
)
