"""Bad input, one line each: lost beginnings, twins that fail, believed numbers that the recordings refute."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from sloshlab.errors import SloshlabError
from sloshlab.identification.baseline_parameter import BaselineParameter
from sloshlab.identification.case import Case, CaseRun, level
from sloshlab.identification.observations import observations
from sloshlab.identification.readiness import RefutedBelief, refuted_beliefs, require_comparable
from sloshlab.missing_physics.extension import NOTHING
from sloshlab.recording import run_attributes
from sloshlab.user_twin import MechanicalTwin, Mechanism, Parameter, Reading, UserTwinModel
from sloshlab.user_twin.description import TwinRun

RATE_HZ, N = 250.0, 1000
TIME = np.arange(N) / RATE_HZ
START_M, MASS, STIFFNESS = 0.02, 2.0, 2.0 * (2 * np.pi * 6.0) ** 2


def _run(name: str = "run_1", *, lost: int = 0, n_samples: int = N) -> CaseRun:
    """An undamped mass after its release, the first samples of its displacement lost."""
    motion = START_M * np.cos(2 * np.pi * 6.0 * TIME)
    motion[:lost] = np.nan
    channel = ("time", motion[:n_samples], {"units": "m", "quantity": "displacement", "noise_std": 1e-5})
    attributes = {
        "sloshlab_format": "1",
        "run_id": name,
        "experiment": "other",
        "configuration": "frozen",
        "rig": "rig",
        "sampling_rate_hz": RATE_HZ,
        "start_time_utc": "2026-01-01T00:00:00Z",
    }
    recording = xr.Dataset({"displacement_mass": channel}, coords={"time": TIME[:n_samples]}, attrs=attributes)
    return CaseRun(name, recording, run_attributes(recording))


def _twin(*, reads_start: bool = False, **changed: Any) -> MechanicalTwin:
    def released(run: TwinRun, values: Any) -> Mechanism:
        start, speed = run.start("displacement_mass") if reads_start else (START_M, 0.0)
        numbers = {name: value(run) if callable(value) else value for name, value in changed.items()}
        described: dict[str, Any] = {
            "mass_kg": MASS,
            "stiffness_n_per_m": values["stiffness"],
            "damping_n_s_per_m": 0.0,
            "initial_displacement_m": start,
            "initial_velocity_m_per_s": speed,
            "readings": {"displacement_mass": Reading(1.0)},
        }
        return Mechanism(**{**described, **numbers})

    parameters = [Parameter("stiffness", STIFFNESS, 0.01 * STIFFNESS, "N m-1")]
    return MechanicalTwin(parameters, [], {"displacement_mass": "m"}, released)


def _case(*runs: CaseRun) -> Case:
    return Case("case", Path(), None, runs)


def test_a_lost_beginning_is_left_out_and_nothing_else() -> None:
    """Known from the fortieth sample on; what is left of it fits to half a deviation, the engine's error."""
    run = _run(lost=40)
    model = UserTwinModel(_twin(), [run])
    require_comparable(_case(run), model)
    (observed,) = observations(run, ["displacement_mass"])
    assert observed.known.sum() == N - 40
    assert not observed.known[:40].any()
    residual = observed.residual(model.simulate(run, {}, NOTHING)["displacement_mass"])
    assert np.abs(residual).max() < 1.0  # a lost sample that counted would leave two thousand


def test_a_start_is_read_from_what_is_known() -> None:
    """Three lost samples are a twelfth of a cycle: a cubic through six gives the release to 2 %."""
    run = _run(lost=3)
    model = UserTwinModel(_twin(reads_start=True), [run])
    assert model.simulate(run, {}, NOTHING)["displacement_mass"][0] == pytest.approx(START_M, rel=0.02)


def test_a_start_that_is_lost_is_one_line() -> None:
    """With what to do instead."""
    with pytest.raises(
        SloshlabError, match=r"run_1: displacement_mass: beginning: got 40 lost samples.*each_run=True"
    ):
        UserTwinModel(_twin(reads_start=True), [_run(lost=40)])


@pytest.mark.parametrize(("lost", "n_samples", "known"), [(N, N, 0), (0, 100, 100)])
def test_a_run_without_samples_to_compare_is_one_line(lost: int, n_samples: int, known: int) -> None:
    """All of them lost, or less than two blocks."""
    runs = [_run(), _run("run_2", lost=lost, n_samples=n_samples)]
    with pytest.raises(SloshlabError, match=rf"recording run_2: got at most {known} known samples"):
        require_comparable(_case(*runs), UserTwinModel(_twin(), runs))


def test_a_channel_without_samples_has_no_level() -> None:
    """And gives no warning."""
    assert level(_run(lost=N)) == 0.0


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"mass_kg": np.nan}, r"run_2: mechanism: mass_kg: got NaN or infinity; allowed"),
        (
            {"driving_force_n": lambda run: np.where(run.time_s < 1.5, 0.0, np.nan)},
            r"run_2: mechanism: driving_force_n: got NaN or infinity, first at sample 375",
        ),
        (
            {"readings": lambda run: {"displacement_mass": Reading(plus=np.where(run.time_s < 2, 0.0, np.inf))}},
            r"run_2: reading displacement_mass: plus: got NaN or infinity, first at sample 500",
        ),
        ({"readings": lambda run: 1 / 0}, r"run_2: got ZeroDivisionError"),
    ],
)
def test_a_twin_that_fails_says_in_which_run_and_sample(changed: dict[str, Any], says: str) -> None:
    """As believed, before anything is fitted; the first run is described, the second is not."""
    good, runs = _twin().mechanism, [_run(), _run("run_2")]
    bad = _twin(**changed).mechanism
    twin = MechanicalTwin(
        _twin().parameters,
        [],
        {"displacement_mass": "m"},
        lambda run, values: (good if run.name == "run_1" else bad)(run, values),
    )
    with pytest.raises(SloshlabError, match=says) as refused:
        UserTwinModel(twin, runs, name="twin my_twin.py")
    assert "\n" not in str(refused.value)


def test_believed_numbers_beyond_three_tolerances_are_refuted() -> None:
    parameters = [
        BaselineParameter("stiffness", 1e5, 1e4, "N m-1"),
        BaselineParameter("damping", 10.0, 4.0, "N s m-1"),
        BaselineParameter("mass", 2.0, 0.04, "kg", most_above=1.25),
    ]
    found = refuted_beliefs({"stiffness": 6.001e4, "damping": -2.1, "mass": 2.05}, parameters)
    assert [belief.name for belief in found] == ["stiffness", "damping"]
    assert found[0] == RefutedBelief("stiffness", 1e5, 1e4, 6.001e4, "N m-1")
    assert [belief.deviation_tolerances for belief in found] == pytest.approx([-3.999, -3.025])
    assert refuted_beliefs({}, parameters) == ()


def test_a_loss_may_be_less_than_believed_but_not_more() -> None:
    assert BaselineParameter("damping", 10.0, 2.0, most_above=1.25).bounds == (2.0, 12.5)
    assert BaselineParameter("gain", 1.0, 0.01, most_below=1.25, most_above=1.25).bounds == pytest.approx(
        (0.9875, 1.0125)
    )
