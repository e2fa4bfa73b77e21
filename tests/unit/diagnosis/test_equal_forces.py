"""Effects that make the same force as one of a fit: by closed forms, on recordings that SciPy made."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from recorded_oscillators import LIQUID_KG, decays, driven, effect, rig, surroundings

from sloshlab.diagnosis.selection import model_selection
from sloshlab.diagnosis.selection.equal_forces import equal_forces
from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.diagnosis.selection.model_selection import ModelSelection
from sloshlab.identification.case import CaseRun
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, candidates

assert effects.__all__

MASS_KG, FRICTION_N = 0.04, 0.5


def fitted_runs(folder: Path, recorded: list[CaseRun]) -> tuple[FittedRuns, Any]:
    model = RigModel(rig(folder), folder, recorded)
    runs = FittedRuns(model, [observations(run, model.compared(run)) for run in model.runs], [])
    return runs, surroundings(model)


def beside(runs: FittedRuns, known: Candidate, **numbers: float) -> FreeRunFit:
    own = {f"{known.key}.{name}": value for name, value in numbers.items()}
    return FreeRunFit((known,), {**runs.model.believed, **own}, 0.0, 0.0)


def with_force(channels: dict[str, Any]) -> dict[str, Any]:
    moved = channels["acceleration_tip"]
    return {**channels, "force_interface": (2.241 + MASS_KG) * moved}


def test_a_mass_of_the_tank_is_a_share_of_its_liquid(tmp_path: Path) -> None:
    """A mass m is a share m/m_l of the liquid's."""
    runs, at = fitted_runs(tmp_path, driven(with_force))
    fit = beside(runs, Candidate(effect("tank.mass_error"), at), mass_kg=MASS_KG)
    (first, numbers), *others = equal_forces(runs, fit, fit.candidates[0], candidates(at), 3)
    assert first.key == "tank.effective_mass"
    assert numbers[f"{first.key}.beta"] == pytest.approx(MASS_KG / LIQUID_KG, rel=1e-3)
    assert len(others) == 2
    assert all(each.effect.block == "tank" for each, _ in others)


def test_of_the_forms_of_a_name_the_nearest_is_given_and_not_the_effect_itself(tmp_path: Path) -> None:
    runs, at = fitted_runs(tmp_path, decays())
    play = Candidate(effect("structure.friction_behind_play"), at)
    fit = beside(runs, play, force_n=FRICTION_N, play_m=0.0, stiffness_n_per_m=1e6)
    found = equal_forces(runs, fit, fit.candidates[0], candidates(at), 8)
    names = [each.effect.known_as for each, _ in found]
    assert len(set(names)) == len(names) == 8
    assert "friction_behind_play" not in names
    numbers = {each.key: numbers for each, numbers in found}["structure.coulomb_friction"]
    assert numbers["structure.coulomb_friction.force_n"] == pytest.approx(FRICTION_N, rel=0.02)


def test_what_is_no_force_has_no_equal(tmp_path: Path) -> None:
    runs, at = fitted_runs(tmp_path, decays())
    gain = next(each for each in candidates(at) if each.key.startswith("sensor.sensor_gain"))
    fit = FreeRunFit((gain,), {**runs.model.believed, f"{gain.key}.ratio": 0.1}, 0.0, 0.0)
    assert equal_forces(runs, fit, gain, candidates(at), 3) == []


@pytest.mark.parametrize(("remains", "expected"), [(False, {"tank.effective_mass"}), (True, set())])
def test_equal_forces_are_fitted_where_nothing_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, remains: bool, expected: set[str]
) -> None:
    runs, at = fitted_runs(tmp_path, driven(with_force))
    mass, share, drag = (
        Candidate(effect(f"tank.{name}"), at) for name in ("mass_error", "effective_mass", "quadratic_drag")
    )
    best = FreeRunFit((mass,), {"frequency of mode 1": 1.01, "tank.mass_error.mass_kg": 0.04}, 100.0, 100.0)
    equal = [(share, {"tank.effective_mass.beta": -0.3}), (drag, {"tank.quadratic_drag.drag_n_s2_per_m2": 9.0})]
    monkeypatch.setattr(model_selection, "equal_forces", lambda *arguments: equal)
    selection = cast(Any, ModelSelection(runs, at, lambda what, done, of: None))
    selection.known.keep([best])
    monkeypatch.setattr(selection.known, "remains", lambda fit: remains)
    monkeypatch.setattr(selection.known, "may_win", lambda fit: fit.cost < 200.0)

    def few_steps_on(begun: list[FreeRunFit]) -> list[FreeRunFit]:
        assert all(fit.values["frequency of mode 1"] == 1.01 for fit in begun)
        costs = {"effective_mass": 120.0, "quadratic_drag": 4e4}
        return [FreeRunFit(f.candidates, f.values, costs[f.candidates[0].effect.name], 0.0) for f in begun]

    fitted: list[str] = []

    def fitted_to_the_end(coarse: list[FreeRunFit], base: FreeRunFit) -> list[FreeRunFit]:
        fitted.extend(fit.candidates[0].key for fit in coarse)
        return coarse

    monkeypatch.setattr(selection, "_few_steps_on", few_steps_on)
    selection.growth = SimpleNamespace(pool=[], fitted_to_the_end=fitted_to_the_end)
    selection._with_equal_forces(1)
    assert set(fitted) == expected
