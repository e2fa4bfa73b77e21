"""Numbers of effects from the force that is missing, of motions whose extra force is known in closed form."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import MASS_KG, NOISE, STIFFNESS, motion, rig, run_of

from sloshlab.diagnosis import effects
from sloshlab.diagnosis.candidate import Candidate, candidates
from sloshlab.diagnosis.force_starts import ForceStarts
from sloshlab.diagnosis.free_run_problem import FreeRunFit, FreeRunProblem
from sloshlab.diagnosis.observations import observations
from sloshlab.diagnosis.rig_model import RigModel
from sloshlab.diagnosis.surroundings import surroundings_of

assert effects.__all__
GAP_M, CONTACT_N_PER_M = 0.004, 0.15 * STIFFNESS
CHANNELS = ["displacement_tank", "acceleration_tip", "force_interface"]


def contact(t: float, x: float, v: float) -> float:
    """A spring beyond a gap on either side."""
    return -CONTACT_N_PER_M * float(np.sign(x)) * max(abs(x) - GAP_M, 0.0)


def softer(t: float, x: float, v: float) -> float:
    """What the baseline's own spring and damper can follow."""
    return 0.02 * STIFFNESS * x - 0.3 * v


def stribeck(t: float, x: float, v: float) -> float:
    return -(0.15 + 0.25 * float(np.exp(-((v / 0.05) ** 2)))) * float(np.tanh(v / 1e-3))


def starts_of(
    tmp_path: Path, force: Callable[[float, float, float], float]
) -> tuple[ForceStarts, dict[str, Candidate]]:
    runs = []
    for name, start_m in (("large", 0.012), ("small", 0.008)):
        _, x, _, a = motion(start_m, 6.0, force)
        channels = {"displacement_tank": x, "acceleration_tip": a, "force_interface": MASS_KG * a}
        runs.append(run_of(name, channels, NOISE, 5, initial_displacement_m=start_m))
    model = RigModel(rig(tmp_path), tmp_path, runs)
    fitting = [observations(run, CHANNELS) for run in runs]
    surroundings = surroundings_of(
        FreeRunProblem(model, fitting), FreeRunFit((), model.believed, 0.0, 0.0), model.rig
    )
    starts = ForceStarts(model, fitting, model.believed)
    return starts, {one.key: one for one in candidates(surroundings)}


def test_gap_and_stiffness_of_a_contact_come_from_its_force(tmp_path: Path) -> None:
    starts, known = starts_of(tmp_path, contact)
    found = starts.of(known["structure.clearance"])
    assert found is not None
    assert found.share_left < 0.02
    assert found.numbers["structure.clearance.gap_m"] == pytest.approx(GAP_M, rel=0.02)
    assert found.numbers["structure.clearance.stiffness_n_per_m"] == pytest.approx(CONTACT_N_PER_M, rel=0.02)


def test_another_effect_explains_less_of_the_same_force(tmp_path: Path) -> None:
    starts, known = starts_of(tmp_path, contact)
    right, wrong = (starts.of(known[f"structure.{name}"]) for name in ("clearance", "stribeck_friction"))
    assert right is not None
    assert wrong is None or wrong.share_left > 3 * right.share_left


def test_friction_that_falls_with_the_velocity(tmp_path: Path) -> None:
    starts, known = starts_of(tmp_path, stribeck)
    found = starts.of(known["structure.stribeck_friction"])
    assert found is not None
    assert found.share_left < 0.6
    assert (
        found.numbers["structure.stribeck_friction.static_n"]
        > found.numbers["structure.stribeck_friction.coulomb_n"]
    )
    gap = starts.of(known["structure.clearance"])
    assert gap is None or gap.share_left > 1.5 * found.share_left


def test_what_the_baseline_can_follow_needs_no_effect(tmp_path: Path) -> None:
    starts, known = starts_of(tmp_path, softer)
    for name in ("clearance", "stribeck_friction", "missing_mode"):
        assert starts.of(known[f"structure.{name}"]) is None


def test_nothing_missing_has_no_starts_and_a_single_number_asks_for_none(tmp_path: Path) -> None:
    starts, known = starts_of(tmp_path, lambda t, x, v: 0.0)
    assert starts.of(known["structure.clearance"]) is None
    starts, known = starts_of(tmp_path, contact)
    assert starts.of(known["structure.cubic_stiffness"]) is None


def test_the_same_force_gives_the_same_numbers(tmp_path: Path) -> None:
    first, second = (
        starts.of(known["structure.clearance"])
        for starts, known in (starts_of(tmp_path, contact) for _ in range(2))
    )
    assert first == second
