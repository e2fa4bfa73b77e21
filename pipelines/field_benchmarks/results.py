"""What a run of the benchmarks found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipelines.field_benchmarks.definition import PHYSICAL, Benchmark, BenchmarkData, Published
from pipelines.field_benchmarks.fitting import FittedModel

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ModelResult:
    """A model, and its free runs.

    Attributes
    ----------
    fitted : FittedModel
    training_error : float
        RMS error of the free runs over the training records, in the unit of the benchmark.
    errors : mapping of str to float
        Per test, in the unit of the benchmark.
    simulated : mapping of str to ndarray, shape (n,)
        The scored output per test, in SI units.
    """

    fitted: FittedModel
    training_error: float
    errors: Mapping[str, float]
    simulated: Mapping[str, FloatArray]


@dataclass(frozen=True, eq=False)
class BenchmarkResult:
    """All models of a benchmark.

    Attributes
    ----------
    benchmark : Benchmark
    data : BenchmarkData
    models : tuple of ModelResult
    searched : mapping
        Answer of the search for missing physics, if one was asked for.
    """

    benchmark: Benchmark
    data: BenchmarkData
    models: tuple[ModelResult, ...]
    searched: Mapping[str, Any]

    def rival(self, test: str) -> Published | None:
        """The best published model whose structure and numbers mean something.

        The best of all where there is none; None where no error on this test was published.
        """
        own = [known for known in self.benchmark.published if known.test == test]
        if not self.data.is_published_test or not own:
            return None
        physical = [known for known in own if known.kind == PHYSICAL]
        return min(physical or own, key=lambda known: known.error)

    def facts(self) -> dict[str, Any]:
        """Everything but the signals, for machines."""
        return {
            "title": self.benchmark.title,
            "unit": self.benchmark.unit,
            "is_published_test": self.data.is_published_test,
            "note": self.data.note,
            "reference": self.benchmark.reference,
            "doi": self.benchmark.doi,
            "n_samples": {record.name: record.n_samples for record in (*self.data.training, *self.data.tests)},
            "n_not_scored": {record.name: record.n_initial for record in self.data.tests},
            "models": [
                {
                    "name": result.fitted.model.name,
                    "role": result.fitted.model.role,
                    "effects": list(result.fitted.model.effects),
                    "numbers": [vars(number) for number in result.fitted.numbers],
                    "training_error": result.training_error,
                    "errors": dict(result.errors),
                }
                for result in self.models
            ],
            "published": [vars(known) for known in self.benchmark.published],
            "search": dict(self.searched),
        }
