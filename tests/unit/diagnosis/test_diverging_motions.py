"""Motions that are as likely as a simulated one, against closed forms of each draw."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import effect, motion, rig, run_of, surroundings
from test_remainder import run

from sloshlab.diagnosis.inference.diverging_motions import DivergingMotions
from sloshlab.diagnosis.inference.remainder import remainder
from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics.candidate import Candidate
from sloshlab.rig import Rig

FRICTION_N, START_M, DURATION_S = 0.4, 0.02, 6.0
TIP = "acceleration_tip"
NOISE = {TIP: 1e-4, "displacement_tank": 1e-8}


def rubbing(folder: Path) -> RigModel:
    """A decay with friction, and a rig that knows of none."""
    _, x, _, a = motion(START_M, DURATION_S, friction_n=(FRICTION_N, FRICTION_N))
    channels = {TIP: a, "displacement_tank": x}
    decay = run_of("decay", channels, NOISE, 5, configuration="frozen", initial_displacement_m=START_M)
    rig(folder)
    return RigModel(Rig.from_toml(folder / "rig.toml"), folder, [decay])


@pytest.mark.slow
def test_numbers_of_a_friction_are_drawn_to_a_hundredth(tmp_path: Path) -> None:
    model = rubbing(tmp_path)
    [decay] = model.runs
    friction = Candidate(effect("structure.coulomb_friction"), surroundings(model))
    observed = observations(decay, [TIP])
    values = {**model.believed, f"{friction.key}.force_n": FRICTION_N}
    found = DivergingMotions(model).differences(observed, [friction], values)
    assert len(found) == 8
    _, _, _, plain = motion(START_M, DURATION_S, friction_n=(FRICTION_N, FRICTION_N))
    for seed, difference in enumerate(found):
        force_n = FRICTION_N * (1.0 + 0.01 * np.random.default_rng(seed).standard_normal())
        _, _, _, drawn = motion(START_M, DURATION_S, friction_n=(force_n, force_n))
        expected = observed[0].of(drawn - plain) / np.sqrt(observed[0].variance)
        # sampled jumps are as they fall in the simulation and in the closed form
        assert np.linalg.norm(difference[0]) == pytest.approx(np.linalg.norm(expected), rel=0.03)


def test_what_neither_meets_nor_sticks_is_exact(tmp_path: Path) -> None:
    model = rubbing(tmp_path)
    drag = Candidate(effect("structure.quadratic_drag"), surroundings(model))
    values = {**model.believed, **drag.starts()[0]}
    assert DivergingMotions(model).differences(observations(model.runs[0], [TIP]), [drag], values) == []


def test_what_two_likely_motions_differ_by_is_not_missing() -> None:
    """Residuals as large as by what draws differ at another time are none of a force; larger ones are."""
    generator = np.random.default_rng(11)
    shape, along = (2, 16, 8), np.array([0.6, 0.8])
    residual, drawn = (generator.normal(size=shape) for _ in range(2))
    residual[:, 8:12] += 8.0 * along[:, None, None] * generator.normal(size=(1, 4, 8))
    drawn[:, :4] += 8.0 * along[:, None, None] * generator.normal(size=(1, 4, 8))
    of_places = {"structure": along}
    plain = run(residual, of_places)
    assert remainder([plain]).gain("structure") > 30.0
    as_likely = run(residual, of_places)
    as_likely.diverging.append(drawn)
    assert remainder([as_likely]).gain("structure") < 3.0
    as_likely.diverging[:] = [0.1 * drawn]
    assert remainder([as_likely]).gain("structure") > 30.0
