"""Public benchmarks: what named models leave on the tests, beside published errors."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipelines.field_benchmarks.catalogue import BENCHMARKS
from pipelines.field_benchmarks.results import BenchmarkResult
from pipelines.field_benchmarks.run import benchmark_result

pytestmark = [pytest.mark.external, pytest.mark.slow]


def results(name: str, folder: Path) -> BenchmarkResult:
    benchmark = BENCHMARKS[name]
    for file in benchmark.files:
        if not list(folder.glob(f"**/{file}")):
            pytest.skip(f"no {file} among the recordings of other laboratories")
    return benchmark_result(benchmark, benchmark.read(folder), lambda step: None)


def errors(result: BenchmarkResult, model: str) -> dict[str, float]:
    [found] = [dict(known.errors) for known in result.models if known.fitted.model.name == model]
    return found


def test_the_silverbox_is_as_the_best_published_physical_model(external_data: Path) -> None:
    """0.38 mV on the arrow by a linear part with polynomial feedback (Paduart and others 2004)."""
    result = results("silverbox", external_data)
    linear = errors(result, "linear spring")
    # Champneys and others (2024), linear state space of any order
    assert linear["multisine"] == pytest.approx(6.96, rel=0.02)
    assert linear["arrow"] == pytest.approx(14.4, rel=0.02)
    named = errors(result, "cubic and quadratic spring")
    assert named["arrow"] <= 1.1 * 0.38
    assert named["multisine"] <= 0.64 / 2
    rival = result.rival("arrow")
    assert rival is not None
    assert (rival.kind, rival.error) == ("physical", 0.38)


def test_the_servo_axis_is_as_the_reference_model_of_its_authors(external_data: Path) -> None:
    """Their numbers, simulated by the same protocol."""
    result = results("emps", external_data)
    baseline, named, published = (
        next(iter(errors(result, name).values()))
        for name in ("viscous friction", "viscous and dry friction, offset", "reference model of its authors")
    )
    assert named <= 1.1 * published
    assert named < 0.5 * baseline


def test_passages_and_modes_of_the_wing(external_data: Path) -> None:
    """8.5 to 6 Hz at 0.05 Hz/s and 100 Hz are 5000 samples; the torsion mode is documented near 7.3 Hz."""
    wing = BENCHMARKS["f16"]
    for file in wing.files:
        if not list(external_data.glob(f"**/{file}")):
            pytest.skip(f"no {file} among the recordings of other laboratories")
    data = wing.read(external_data)
    assert {(record.n_samples, record.sampling_rate_hz) for record in data.training} == {(5000, 100.0)}
    assert not {record.name for record in data.tests} & {record.name for record in data.training}
    [frequency, _] = wing.models(data)[0].twin.parameters
    assert frequency.believed == pytest.approx(7.3, abs=0.1)


def test_a_softening_torsion_mode_of_the_wing_leaves_less_than_linear_modes(external_data: Path) -> None:
    """Its documented frequency falls with the level, from 7.2 to 7.0 Hz."""
    result = results("f16", external_data)
    linear, softening = (errors(result, name) for name in ("five linear modes", "softening torsion mode (cubic)"))
    assert all(softening[test] < 0.9 * linear[test] for test in linear)
    [cubic] = [n.value for n in result.models[1].fitted.numbers if n.name.startswith("cubic stiffness")]
    assert cubic < 0
