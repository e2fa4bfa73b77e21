"""A public friction damper with backlash: a force with memory, and a play of about 0.16 in at 30 lb of tension."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from sloshlab.diagnosis.candidate import Candidate, Surroundings, known_effects, withdraw
from sloshlab.diagnosis.case import read_case
from sloshlab.diagnosis.free_run_fit import FreeRunFit, FreeRunProblem, fitted, fitted_from, huber_cost
from sloshlab.diagnosis.observations import observations
from sloshlab.diagnosis.user_effects import load_user_effects
from sloshlab.diagnosis.user_twin import UserTwinModel, load_user_twin

pytestmark = [pytest.mark.external, pytest.mark.slow]

INCH_M = 0.0254
FITTED, HELD_OUT = ("amplitude_0.5", "amplitude_1.5"), "amplitude_1"


class Damper:
    """The case, with fits on two amplitudes and their errors on the third."""

    def __init__(self, example: ModuleType, case: Path) -> None:
        runs = read_case(case, with_rig=False).runs
        self.model = UserTwinModel(load_user_twin(example.TWIN), runs)
        self.observed = {run.name: observations(run, self.model.compared(run)) for run in runs}
        motion = np.max([np.abs(self.model.motion(run, {})).max(axis=0) for run in runs], axis=0)
        self.surroundings = Surroundings(
            None,  # type: ignore[arg-type]
            self.model.twin,
            *motion.tolist(),
            frequency_hz=0.5,
            force_n=self.model.moving_mass_kg * float(motion[2]),
            channels={},
            driving=(),
            sampling_rate_hz=runs[0].attributes.sampling_rate_hz,
            longest_run_s=14.0,
            blocks=self.model.blocks,
        )

    def fit(self, name: str) -> FreeRunFit:
        chosen = [Candidate(one, self.surroundings) for one in known_effects() if one.name == name]
        chosen = [one for one in chosen if one.effect.block == "structure"]
        problem = FreeRunProblem(self.model, [self.observed[run] for run in FITTED], chosen)
        if not chosen:
            return fitted(problem, self.model.believed)[0]
        return fitted_from(problem, [{**self.model.believed, **one} for one in chosen[0].starts()])

    def error(self, fit: FreeRunFit) -> float:
        problem = FreeRunProblem(self.model, [self.observed[HELD_OUT]], fit.candidates)
        residual = problem.residual(problem.theta_of(fit.values))
        return float(np.sqrt(huber_cost(residual) / residual.size))


@pytest.fixture(scope="module")
def example(repository: Path) -> ModuleType:
    file = repository / "docs/examples/friction_damper.py"
    specification = importlib.util.spec_from_file_location("friction_damper", file)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def damper(external_data: Path, example: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Damper]:
    if not (external_data / "friction_backlash").is_dir():
        pytest.skip("no friction_backlash among the recordings of other laboratories")
    case = example.write_case(external_data, tmp_path_factory.mktemp("damper") / "case")
    loaded = load_user_effects(example.EFFECTS)
    yield Damper(example, case)
    for effect in loaded:
        withdraw(effect)


def test_the_force_has_memory(damper: Damper) -> None:
    """Friction with memory halves the error on an amplitude that chose nothing; without it nothing is gained."""
    retuned = damper.error(damper.fit(""))
    assert damper.error(damper.fit("hysteresis")) < 0.7 * retuned
    assert damper.error(damper.fit("coulomb_friction")) > 0.9 * retuned
    assert damper.error(damper.fit("clearance")) > 0.9 * retuned


def test_friction_behind_a_play_has_the_documented_play(damper: Damper) -> None:
    fit = damper.fit("friction_behind_play")
    play_in = fit.values["structure.friction_behind_play.play_m"] / INCH_M
    assert play_in == pytest.approx(0.16, abs=0.04)
    assert fit.cost < damper.fit("hysteresis").cost
