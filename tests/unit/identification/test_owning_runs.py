"""Numbers that belong to one run: told by what they are, not by how their names end."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from recorded_oscillators import decays, rig, surroundings

from sloshlab.identification.owning_runs import owning_runs
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import candidates
from sloshlab.user_twin import EquationTwin, Parameter, UserTwinModel


def test_runs_whose_names_end_alike_have_numbers_of_their_own(tmp_path: Path) -> None:
    """'offset of … in test in 1' ends as one of run '1' does."""
    runs = [replace(run, name=name) for run, name in zip(decays(), ("1", "test in 1"), strict=True)]
    model = RigModel(rig(tmp_path), tmp_path, runs)
    owners = owning_runs(model.parameters, [])
    for run in runs:
        assert {name for name, owner in owners.items() if owner == run.name} == {
            f"release of {run.name}",
            f"instant of release in {run.name}",
            f"offset of displacement_tank in {run.name}",
        }
    assert "frequency of mode 1" not in owners


def test_numbers_of_an_effect_belong_to_their_runs(tmp_path: Path) -> None:
    assert effects.external  # importing them makes them known
    model = RigModel(rig(tmp_path), tmp_path, decays())
    at = replace(surroundings(model), runs=("1", "test in 1"))
    [pulses] = [each for each in candidates(at) if each.key == "structure.external_force"]
    owners = owning_runs([], [pulses])
    assert owners == {f"{pulses.key}.start_s in {run}": run for run in ("1", "test in 1")}


def test_losses_of_a_rig_are_those_of_its_modes(tmp_path: Path) -> None:
    model = RigModel(rig(tmp_path), tmp_path, decays())
    assert {known.name for known in model.parameters if known.is_damping} == {"damping of mode 1"}


def test_losses_of_an_own_twin_are_told_by_their_units() -> None:
    """Whatever they are called, and a ratio that is called damping is none."""
    given = [
        Parameter("dashpot", 2.0, 0.4, "N s m-1"),
        Parameter("bearing", 0.1, 0.02, "N m s rad-1", each_run=True),
        Parameter("damping_of_what_one_likes", 3.0, 0.3),
    ]
    twin = EquationTwin(
        lambda state, inputs, parameters, force: ((force - parameters.dashpot * state[0],), (state[0],)),
        states={"v": 0.0},
        moves=("v",),
        parameters=given,
        driving=[],
        compared={"displacement_tank": "m"},
    )
    model = UserTwinModel(twin, decays()[:1])
    assert {known.name for known in model.parameters if known.is_damping} == {"dashpot", "bearing in decay_0"}
