"""A twin of two blocks, a mass on a spring and a sensor of its drive, with effects as numbers of its own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import cast

import numpy as np
import pytest
import xarray as xr

from sloshlab.diagnosis.block_cut import block_cut
from sloshlab.diagnosis.inference.places import transfers_of
from sloshlab.errors import AnalysisError
from sloshlab.identification.case import CaseRun
from sloshlab.identification.diagnosed_model import ModelOfBlocks
from sloshlab.identification.free_run_problem import FreeRunProblem
from sloshlab.identification.observations import observations
from sloshlab.missing_force.latent_force import run_forces
from sloshlab.missing_physics.candidate import Candidate, Effect, EffectParameter, Surroundings
from sloshlab.missing_physics.extension import Extension
from sloshlab.missing_physics.prior import Range
from sloshlab.recording import run_attributes
from sloshlab.rig import Rig
from sloshlab.twin.structure_forces import COULOMB_FRICTION
from sloshlab.user_twin import (
    BlockTwin,
    BlockTwinModel,
    Parameter,
    Response,
    TwinRun,
    UserTwinModel,
    load_extended,
)

RATE, N = 200.0, 800


def _simulate(run: TwinRun, values: Mapping[str, float]) -> Response:
    """A lift gain that is first order in the drive: y = (1 + ε) k u, and its channel later by none."""
    read = values["slope"] * (1 + values.get("gain_error", 0.0)) * run.channels["force_push"]
    second = 0.5 * read + values.get("leak", 0.0) * run.channels["force_push"] ** 2
    motion = np.stack([read, np.gradient(read) * RATE, np.zeros(read.size)], axis=-1)
    return Response({"displacement_a": read, "displacement_b": second}, motion)


def _transfers(run: TwinRun, values: Mapping[str, float], frequencies: np.ndarray) -> dict[str, np.ndarray]:
    one = np.ones(frequencies.size, complex)
    return {"aerodynamics": np.stack([one, 0.5 * one], axis=1), "control flap": np.stack([0 * one, one], axis=1)}


def _effect(name: str, block: str, number: str) -> Effect:
    return Effect(
        name,
        block,
        "y → (1 + ε) y",
        (EffectParameter("ratio", -1.0, 1.0, range=Range(0.01, 0.5, may_be_negative=True)),),
        lambda at: [{"ratio": 0.1}],
        lambda numbers, at, channel: Extension(numbers={number: numbers["ratio"]}),
    )


EFFECTS = (_effect("lift_gain", "aerodynamics", "gain_error"), _effect("leak", "control", "leak"))
TWIN = BlockTwin(
    [Parameter("slope", 2.0, 0.02, "m N-1")],
    ["force_push"],
    {"displacement_a": "m", "displacement_b": "m"},
    _simulate,
    _transfers,
    EFFECTS,
)


def case_run(gain: float = 0.0) -> CaseRun:
    generator = np.random.default_rng(0)
    time = np.arange(N) / RATE
    push = np.sin(2 * np.pi * 3 * time) + 0.5 * np.sin(2 * np.pi * 11 * time)
    read = 2.0 * (1 + gain) * push
    channels = {"force_push": (push, "N"), "displacement_a": (read, "m"), "displacement_b": (0.5 * read, "m")}
    variables = {
        name: (
            "time",
            values + (0.0 if name == "force_push" else 1e-3) * generator.standard_normal(N),
            {"units": units, "quantity": name.partition("_")[0], "noise_std": 1e-3},
        )
        for name, (values, units) in channels.items()
    }
    attributes = {
        "sloshlab_format": "1",
        "run_id": "run",
        "experiment": "other",
        "configuration": "frozen",
        "rig": "wing",
        "sampling_rate_hz": RATE,
        "start_time_utc": "2026-01-01T00:00:00Z",
    }
    recording = xr.Dataset(variables, coords={"time": time}, attrs=attributes)
    return CaseRun("run", recording, run_attributes(recording))


@pytest.fixture
def model() -> BlockTwinModel:
    return BlockTwinModel(TWIN, [case_run(0.2)])


def test_it_is_a_model_of_blocks_and_others_are_not(model: BlockTwinModel) -> None:
    assert isinstance(model, ModelOfBlocks)
    assert not hasattr(UserTwinModel, "block_transfers")
    assert model.blocks == ("aerodynamics", "control", "sensor")
    # faults of what drives are effects of the twin itself
    assert model.driving(model.runs[0]) == ()


def test_numbers_of_an_effect_reach_the_simulation(model: BlockTwinModel) -> None:
    [run] = model.runs
    push = run.recording["force_push"].values
    plain = model.simulate(run, {}, Extension())
    larger = model.simulate(run, {"slope": 2.1}, Extension(numbers={"gain_error": 0.2}))
    np.testing.assert_allclose(plain["displacement_a"], 2.0 * push)
    np.testing.assert_allclose(larger["displacement_a"], 2.1 * 1.2 * push)
    # another number is another simulation, kept ones included
    both = Extension(numbers={"gain_error": 0.2}) + Extension(numbers={"leak": 0.3})
    np.testing.assert_allclose(model.simulate(run, {}, both)["displacement_b"], 1.2 * push + 0.3 * push**2)


def test_gains_of_sensors_are_those_of_every_twin(model: BlockTwinModel) -> None:
    [run] = model.runs
    read = model.simulate(run, {"gain of displacement_b": 1.01}, Extension())
    np.testing.assert_allclose(read["displacement_b"], 1.01 * run.recording["force_push"].values)
    transfers = model.block_transfers(run, {"gain of displacement_b": 1.01}, np.array([1.0]))
    np.testing.assert_allclose(transfers["aerodynamics"], [[1.0, 0.505]])


def test_a_force_is_no_effect_of_it(model: BlockTwinModel) -> None:
    with pytest.raises(AnalysisError, match="coulomb_friction"):
        model.simulate(model.runs[0], {}, Extension((COULOMB_FRICTION(force_n=1.0),)))


def test_places_are_those_that_it_names(model: BlockTwinModel) -> None:
    observed = observations(model.runs[0], model.compared(model.runs[0]), ())
    found = transfers_of(model, observed[::-1], {})
    assert set(found) == {"aerodynamics", "control flap"}
    # in the order of what is observed
    np.testing.assert_allclose(found["aerodynamics"][0], [0.5, 1.0])
    assert run_forces(model, observed, {}).forces == ()


def test_the_block_that_lacks_it_owns_the_mismatch(model: BlockTwinModel) -> None:
    observed = observations(model.runs[0], model.compared(model.runs[0]), ())
    shares = {cut.block: cut.share for cut in block_cut(model, [observed], {}).blocks}
    # the recording has 1.2 in both channels: along (1, ½), whose part along one sensor alone is 4/5 and 1/5
    assert shares["aerodynamics"] == pytest.approx(1.0, abs=0.02)
    assert shares["control"] == pytest.approx(0.2, abs=0.02)
    assert shares["sensor"] == pytest.approx(0.8, abs=0.02)


def test_an_error_of_a_sensor_that_drives_changes_every_channel(model: BlockTwinModel) -> None:
    """Its place is no channel: all are simulated anew where its size changes."""
    observed = observations(model.runs[0], model.compared(model.runs[0]), ())
    at = Surroundings(cast(Rig, None), model.twin, 1.0, 1.0, 1.0, 1.0, 1.0, {}, (), RATE, N / RATE)
    candidate = Candidate(_effect("airspeed_error", "sensor", "gain_error"), at)
    problem = FreeRunProblem(model, [observed], [candidate])
    base = problem.theta_of({f"{candidate.key}.ratio": 0.0})
    other = problem.theta_of({f"{candidate.key}.ratio": 0.2})
    own = [i for i, name in enumerate(problem.names) if name.startswith(candidate.key)]
    [moved] = problem.residuals_moved([other], own, problem.residual(base))
    np.testing.assert_allclose(moved, problem.residual(other))
    assert np.abs(moved).max() < 0.1 * np.abs(problem.residual(base)).max()


def test_an_extended_twin_keeps_its_numbers(model: BlockTwinModel, tmp_path: Path) -> None:
    candidate = Candidate(EFFECTS[0], None)  # type: ignore[arg-type]  # what it adds asks for nothing of a case
    values = {"slope": 2.01, f"{candidate.key}.ratio": 0.2}
    model.save_extended(values, [candidate], tmp_path / "extended.toml")
    read, extension = load_extended(tmp_path / "extended.toml")
    assert read["slope"] == 2.01
    assert dict(extension.numbers) == {"gain_error": 0.2}
    [run] = model.runs
    expected = 2.01 * 1.2 * run.recording["force_push"].values
    np.testing.assert_allclose(model.simulate(run, read, extension)["displacement_a"], expected)
