"""Splits, what is not scored, and errors, as the benchmarks ask for them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from synthetic_files import write_ramps

from pipelines.field_benchmarks.bouc_wen import N_PER_PERIOD
from pipelines.field_benchmarks.catalogue import BENCHMARKS
from pipelines.field_benchmarks.definition import NamedModel, Record
from pipelines.field_benchmarks.scoring import free_run, free_run_error
from pipelines.field_benchmarks.twins import cascaded_tanks, silverbox
from sloshlab.errors import InputError
from sloshlab.missing_physics.extension import NOTHING
from sloshlab.user_twin import Compared, MechanicalTwin, Mechanism, Reading, TwinRun


@pytest.fixture(scope="module")
def ramps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ramps")
    write_ramps(folder)
    return folder


def ends(record: Record, channel: str) -> tuple[float, float]:
    values = record.channels[channel]
    return float(values[0]), float(values[-1])


# numbers of nonlinearbenchmark.org and of its package, version 1.0.1, written out
SPLITS = {
    "silverbox": (
        "displacement_output",
        {
            "training": (-40_650, -105_711),
            "multisine": (-105_712, -127_399),
            "arrow": (-100, -40_574),
            "arrow without extrapolation": (-100, -32_099),
        },
        50,
    ),
    "emps": ("displacement_carriage", {"pulses": (0, -24_799)}, 20),
    "cascaded_tanks": ("voltage_level", {"estimation": (0, -1023), "validation": (-5000, -6023)}, 50),
    "wiener_hammerstein": ("voltage_output", {"training": (-5200, -105_199), "test": (-105_200, -183_999)}, 50),
}


@pytest.mark.parametrize("name", SPLITS)
def test_splits_are_the_published_ones(ramps: Path, name: str) -> None:
    output, parts, n_not_scored = SPLITS[name]
    data = BENCHMARKS[name].read(ramps)
    records = {record.name: record for record in (*data.training, *data.tests)}
    assert {part: ends(records[part], output) for part in parts} == parts
    assert {record.n_initial for record in data.tests} == {n_not_scored}
    assert data.is_published_test
    assert BENCHMARKS[name].scored == output


def test_driving_and_output_are_not_exchanged(ramps: Path) -> None:
    for name, channel in (("silverbox", "force_input"), ("wiener_hammerstein", "voltage_input")):
        [training] = BENCHMARKS[name].read(ramps).training
        assert min(ends(training, channel)) > 0


def test_rates_are_the_published_ones(ramps: Path) -> None:
    rates = {name: BENCHMARKS[name].read(ramps).tests[0].sampling_rate_hz for name in SPLITS}
    expected = {"silverbox": 610.3515625, "emps": 1000.0, "cascaded_tanks": 0.25, "wiener_hammerstein": 51_200.0}
    assert rates == expected


def test_periods_of_the_servo_axis_lose_no_sample(ramps: Path) -> None:
    periods = BENCHMARKS["emps"].read(ramps).training
    starts_and_ends = [ends(record, "voltage_motor") for record in periods]
    assert starts_and_ends == [(0, 6239), (6240, 12_479), (12_480, 18_719), (18_720, 24_840)]


def test_without_the_test_file_the_fourth_period_of_the_servo_axis_is_held_out(
    ramps: Path, tmp_path: Path
) -> None:
    (tmp_path / "DATA_EMPS.mat").write_bytes((ramps / "DATA_EMPS.mat").read_bytes())
    data = BENCHMARKS["emps"].read(tmp_path)
    assert len(data.training) == 3
    assert [ends(record, "voltage_motor") for record in data.tests] == [(18_720, 24_840)]
    assert data.tests[0].n_initial == 20
    assert not data.is_published_test
    assert "DATA_EMPS_PULSES.mat is not in the data folder" in data.note


def test_splits_agree_with_those_of_the_package(ramps: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = pytest.importorskip("nonlinear_benchmarks", reason="nonlinear_benchmarks is not installed")
    from nonlinear_benchmarks import benchmarks

    def where_the_files_are(*_: Any, **__: Any) -> str:
        return str(ramps)

    monkeypatch.setattr(benchmarks, "cashed_download", where_the_files_are)
    for folder in ("SilverboxFiles", "CascadedTanksFiles"):
        if not (ramps / folder).exists():
            (ramps / folder).symlink_to(ramps)
    own = {name: BENCHMARKS[name].read(ramps) for name in SPLITS}
    theirs = {
        "silverbox": package.Silverbox(always_return_tuples_of_datasets=True),
        "emps": package.EMPS(always_return_tuples_of_datasets=True),
        "cascaded_tanks": package.Cascaded_Tanks(always_return_tuples_of_datasets=True),
        "wiener_hammerstein": package.WienerHammerBenchMark(always_return_tuples_of_datasets=True),
    }
    for name, (training, tests) in theirs.items():
        scored = BENCHMARKS[name].scored
        np.testing.assert_array_equal(
            np.concatenate([record.channels[scored] for record in own[name].training]),
            np.concatenate([part.y for part in training]),
        )
        assert len(own[name].tests) == len(tests)
        for record, test in zip(own[name].tests, tests, strict=True):
            np.testing.assert_array_equal(record.channels[scored], test.y)
            assert record.n_initial == test.state_initialization_window_length


def test_the_error_of_a_free_run_by_hand() -> None:
    """√((3² + 4²)/2) after one sample that does not count."""
    measured, simulated = np.array([9.0, 1.0, 2.0]), np.array([0.0, 4.0, 6.0])
    assert free_run_error(measured, simulated, 1) == pytest.approx(12.5**0.5)
    assert free_run_error(measured, simulated, 0) == pytest.approx((106 / 3) ** 0.5)


@pytest.mark.parametrize(("n_simulated", "n_initial"), [(2, 0), (3, 3), (3, -1)])
def test_an_error_of_nothing_is_refused(n_simulated: int, n_initial: int) -> None:
    with pytest.raises(InputError, match="free run"):
        free_run_error(np.zeros(3), np.zeros(n_simulated), n_initial)


@pytest.mark.parametrize(
    ("name", "n_initial"), [("silverbox", 50), pytest.param("cascaded_tanks", 50, marks=pytest.mark.slow)]
)
def test_a_free_run_sees_nothing_of_the_outputs_but_the_first_samples(name: str, n_initial: int) -> None:
    rng = np.random.default_rng(5)
    if name == "silverbox":
        model, values = NamedModel("linear", silverbox.TWIN), {}
        channels = {"force_input": rng.standard_normal(600), "displacement_output": rng.standard_normal(600)}
        record = Record("test", channels, 610.0, n_initial)
    else:
        model = NamedModel("square roots", cascaded_tanks.WITH_SQUARE_ROOTS)
        values = {known.name: known.believed for known in cascaded_tanks.WITH_SQUARE_ROOTS.parameters}
        levels = 5 + np.cumsum(0.05 * rng.standard_normal(600))
        channels = {"voltage_pump": 3 + 0.5 * np.sin(np.arange(600) / 30), "voltage_level": levels}
        record = Record("test", channels, 0.25, n_initial)
    output = BENCHMARKS[name].scored
    hidden = record.channels[output].copy()
    hidden[n_initial:] += 100.0
    shown = record.channels[output].copy()
    shown[:n_initial] += 1.0
    runs = [
        free_run(model, replace(record, channels={**record.channels, output: values_}), values, NOTHING)[output]
        for values_ in (record.channels[output], hidden, shown)
    ]
    np.testing.assert_array_equal(runs[0], runs[1])
    assert np.abs(runs[2] - runs[0]).max() > 0.1


def test_a_twin_that_looks_at_the_outputs_sees_the_first_samples_only() -> None:
    def copied(run: TwinRun, values: object) -> Mechanism:
        del values
        return Mechanism(1.0, 1.0, 0.1, {"displacement_output": Reading(plus=run.channels["displacement_output"])})

    twin = MechanicalTwin((), ("force_input",), {"displacement_output": Compared("m", gain_tolerance=0.0)}, copied)
    record = Record("test", {"force_input": np.zeros(200), "displacement_output": np.arange(200.0)}, 100.0, 50)
    shown = free_run(NamedModel("copied", twin), record, {}, NOTHING)["displacement_output"]
    np.testing.assert_array_equal(shown, np.minimum(np.arange(200.0), 49.0))


def test_the_first_period_of_a_steady_multisine_is_not_scored() -> None:
    multisine, sweep = BENCHMARKS["bouc_wen"].read(None).tests
    assert (multisine.n_initial, multisine.n_samples) == (N_PER_PERIOD, 2 * N_PER_PERIOD)
    force = multisine.channels["force_drive"]
    np.testing.assert_allclose(force[:N_PER_PERIOD], force[N_PER_PERIOD:], atol=1e-9)
    assert force.std() == pytest.approx(50.0, rel=1e-3)
    # 20 to 50 Hz at 10 Hz per minute, 40 N
    assert sweep.n_samples == 180 * 750 + 1
    assert np.abs(sweep.channels["force_drive"]).max() == pytest.approx(40.0, rel=1e-3)
