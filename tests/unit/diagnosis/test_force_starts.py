"""Numbers of effects from the force that is missing, of motions whose extra force is known in closed form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import DAMPING, LIQUID_KG, MASS_KG, NOISE, RATE_HZ, STIFFNESS, motion, rig, run_of

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.diagnosis import effects
from sloshlab.diagnosis.candidate import Candidate, candidates
from sloshlab.diagnosis.case import CaseRun
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
    return of_runs(tmp_path, runs)


def of_runs(tmp_path: Path, runs: list[CaseRun]) -> tuple[ForceStarts, dict[str, Candidate]]:
    model = RigModel(rig(tmp_path), tmp_path, runs)
    fitting = [observations(run, CHANNELS) for run in runs]
    surroundings = surroundings_of(
        FreeRunProblem(model, fitting), FreeRunFit((), model.believed, 0.0, 0.0), model.rig
    )
    starts = ForceStarts(model, fitting, model.believed)
    return starts, {candidate.key: candidate for candidate in candidates(surroundings)}


def test_gap_and_stiffness_of_a_contact_come_from_its_force(tmp_path: Path) -> None:
    starts, known = starts_of(tmp_path, contact)
    found = starts.of(known["structure.clearance"])
    assert found is not None
    assert found.unexplained_share < 0.02
    assert found.numbers["structure.clearance.gap_m"] == pytest.approx(GAP_M, rel=0.02)
    assert found.numbers["structure.clearance.stiffness_n_per_m"] == pytest.approx(CONTACT_N_PER_M, rel=0.02)


FLYING_KG, CONTACT_HZ, CONTACT_DAMPING = 0.4 * LIQUID_KG, 25.0, 0.25


def bouncing(start_m: float, duration_s: float, flight_m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Displacement and acceleration of a tank and the force on it, a part of its liquid flying inside.

    Two bodies with semi-implicit steps of 10 µs; a contact pushes, and never pulls.
    """
    step, every, rate = 1e-5, round(1e5 / RATE_HZ), 2 * np.pi * CONTACT_HZ
    spring, damper = FLYING_KG * rate**2, 2 * CONTACT_DAMPING * FLYING_KG * rate
    x, v, z, w = start_m, 0.0, start_m - GRAVITY_M_PER_S2 / rate**2, 0.0
    kept = []
    for i in range(round(duration_s / step)):
        below, closing = z - x, w - v
        push = 0.0
        if below < 0:
            push = max(-spring * below - damper * closing, 0.0)
        elif below > flight_m:
            push = min(-spring * (below - flight_m) - damper * closing, 0.0)
        force = FLYING_KG * GRAVITY_M_PER_S2 - push
        a = (-STIFFNESS * x - DAMPING * v + force) / (MASS_KG - FLYING_KG)
        if i % every == 0:
            kept.append((x, a, (MASS_KG - FLYING_KG) * a - force))
        v, w = v + a * step, w + (push / FLYING_KG - GRAVITY_M_PER_S2) * step
        x, z = x + v * step, z + w * step
    displacement, acceleration, read = np.array(kept).T
    return displacement, acceleration, read


@pytest.mark.parametrize(("flight_m", "within", "is_missed"), [(0.006, 0.05, False), (0.0105, 0.1, True)])
def test_a_share_of_the_liquid_that_flies_is_sought_at_many_places(
    tmp_path: Path, *, flight_m: float, within: float, is_missed: bool
) -> None:
    """Its starts alone miss a long flight: a later bounce is another one where the gap is 2 % larger."""
    runs = []
    for name, start_m in (("large", 0.014), ("small", 0.011)):
        x, a, read = bouncing(start_m, 4.0, flight_m)
        channels = {"displacement_tank": x, "acceleration_tip": a, "force_interface": read}
        runs.append(run_of(name, channels, NOISE, 5, initial_displacement_m=start_m))
    starts, known = of_runs(tmp_path, runs)
    impact = known["tank.ceiling_impact"]
    found = starts.of(impact)
    assert found is not None
    assert found.unexplained_share < 0.2
    assert found.others
    numbers = {name.rpartition(".")[2]: value for name, value in found.numbers.items()}
    assert numbers["gap_m"] == pytest.approx(flight_m, rel=within)
    assert numbers["share"] * LIQUID_KG == pytest.approx(FLYING_KG, rel=0.15)
    rate = np.sqrt(numbers["stiffness_n_per_m"] / (numbers["share"] * LIQUID_KG))
    assert rate / (2 * np.pi) == pytest.approx(CONTACT_HZ, rel=0.15)
    alone = starts.of(replace(impact, effect=replace(impact.effect, sought_at=lambda at: [])))
    assert (alone is None or alone.unexplained_share > 2 * found.unexplained_share) == is_missed


def test_another_effect_explains_less_of_the_same_force(tmp_path: Path) -> None:
    starts, known = starts_of(tmp_path, contact)
    right, wrong = (starts.of(known[f"structure.{name}"]) for name in ("clearance", "stribeck_friction"))
    assert right is not None
    assert wrong is None or wrong.unexplained_share > 3 * right.unexplained_share


def test_friction_that_falls_with_the_velocity(tmp_path: Path) -> None:
    starts, known = starts_of(tmp_path, stribeck)
    found = starts.of(known["structure.stribeck_friction"])
    assert found is not None
    assert found.unexplained_share < 0.6
    assert (
        found.numbers["structure.stribeck_friction.static_n"]
        > found.numbers["structure.stribeck_friction.coulomb_n"]
    )
    gap = starts.of(known["structure.clearance"])
    assert gap is None or gap.unexplained_share > 1.5 * found.unexplained_share


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
