"""Which block owns a mismatch that was put into one of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import LIQUID_KG, MASS_KG, NOISE, RATE_HZ, motion, rig, run_of

from sloshlab.identification.case import CaseRun
from sloshlab.identification.observations import Observation, observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_force.interface_cut import SENSOR, BlockCut, InterfaceCut, interface_cut, own_tolerances
from sloshlab.missing_force.latent_force import EITHER, STRUCTURE, TANK
from sloshlab.missing_force.sensor_character import decided_terms, sensor_character
from sloshlab.missing_physics.evidence import PROPORTIONAL_TO_RATE, PROPORTIONAL_TO_READING, SATURATING, TREND
from sloshlab.twin.recorded_run import drive_of

CHANNELS = ("displacement_tank", "acceleration_tip", "force_interface")
FRICTION_N = 0.5


def runs(place: str, *, measured: bool = True, gain: float = 1.0, starts: tuple[float, ...] = (0.01, 0.016)):  # type: ignore[no-untyped-def]
    """Decays with dry friction at a place, the displacement read wrong by a gain."""
    found = []
    for i, start in enumerate(starts):
        friction = (FRICTION_N, FRICTION_N) if place else (0.0, 0.0)
        _, x, v, a = motion(start, 5.0, friction_n=friction)
        liquid = -FRICTION_N * np.sign(v) if place == TANK else np.zeros(x.size)
        channels = {"displacement_tank": gain * x, "acceleration_tip": a}
        if measured:
            channels["force_interface"] = MASS_KG * a - liquid
        found.append(run_of(f"decay_{i}", channels, NOISE, i, initial_displacement_m=start))
    return found


def cut_of(folder: Path, recorded: list[CaseRun]) -> tuple[InterfaceCut, RigModel, list[list[Observation]]]:
    model = RigModel(rig(folder), folder, recorded)
    observed = [observations(run, [name for name in CHANNELS if name in run.recording]) for run in recorded]
    return interface_cut(model, observed, model.believed), model, observed


def block(cut: InterfaceCut, name: str) -> BlockCut:
    return next(block for block in cut.blocks if block.block == name)


@pytest.mark.parametrize(("place", "other"), [(STRUCTURE, TANK), (TANK, STRUCTURE)])
def test_friction_is_owned_by_the_block_that_has_it(tmp_path: Path, place: str, other: str) -> None:
    cut, _, _ = cut_of(tmp_path, runs(place))
    assert block(cut, place).share > 0.9
    assert block(cut, place).low > 0.8
    assert block(cut, other).share < 0.1
    assert not cut.suspect
    least = FRICTION_N * np.sqrt(1 - 8 / np.pi**2)  # what the best damper leaves of dry friction in a sine
    assert least < block(cut, place).size < FRICTION_N


def test_without_the_force_between_them_nobody_is_named(tmp_path: Path) -> None:
    cut, _, _ = cut_of(tmp_path, runs(STRUCTURE, measured=False))
    assert cut.places == (EITHER,)
    assert "no force was measured" in block(cut, EITHER).remark
    assert not any(block.block in (STRUCTURE, TANK) for block in cut.blocks)


def test_nothing_missing_is_shared_by_nobody(tmp_path: Path) -> None:
    cut, _, _ = cut_of(tmp_path, runs(""))
    assert all(np.isnan(block.share) for block in cut.blocks)


def test_a_wrong_gain_is_found_by_the_forces_that_it_would_need(tmp_path: Path) -> None:
    cut, _, observed = cut_of(tmp_path, runs("", gain=0.75))
    assert cut.suspect == "displacement_tank"
    assert block(cut, SENSOR).share > 0.9
    answers = sensor_character(observed, cut.runs, cut.suspect)
    assert decided_terms(answers)[PROPORTIONAL_TO_READING]
    assert not decided_terms(answers)[TREND]
    assert not decided_terms(answers)[PROPORTIONAL_TO_RATE]
    assert not decided_terms(answers)[SATURATING]
    assert next(answer.share for answer in answers if answer.term == PROPORTIONAL_TO_READING) > 0.99


def test_two_motions_that_differ_a_little_name_nobody_for_sure(tmp_path: Path) -> None:
    """Without a force and with one decay that the release could explain, a doubt says why."""
    cut, _, _ = cut_of(tmp_path, runs("", measured=False, gain=0.97, starts=(0.01,)))
    assert cut.suspect in ("", "displacement_tank")
    assert cut.remark


def test_the_force_in_the_tank_is_what_the_tank_alone_misses(tmp_path: Path) -> None:
    """Another route: the engine drives the tank by its measured motion; recorded minus simulated is −Δf."""
    recorded = runs(TANK, starts=(0.016,))
    cut, model, _ = cut_of(tmp_path, recorded)
    [at] = cut.forces(TANK)
    drive = drive_of(recorded[0].recording, model.twin, block="tank")
    alone = drive.twin.simulate(drive.excitation).interface_force_n
    missed = recorded[0].recording["force_interface"].values[: alone.size] - alone
    start = round(at.time_s[0] * RATE_HZ)
    part = slice(int(RATE_HZ), int(3 * RATE_HZ))
    expected = -missed[start : start + at.force_n.size][part]
    assert np.corrcoef(at.force_n[part], expected)[0, 1] > 0.95
    assert at.force_n[part].std() == pytest.approx(expected.std(), rel=0.1)


def test_what_own_parameters_explain_counts_for_nobody(tmp_path: Path) -> None:
    """A tank four per mille heavier than believed is within the tolerance of the mass that the force carries."""
    _, x, _, a = motion(0.016, 5.0)
    heavier = 1.004 * MASS_KG * a
    run = run_of("decay", {"displacement_tank": x, "acceleration_tip": a, "force_interface": heavier}, NOISE, 1,
                 initial_displacement_m=0.016)  # fmt: skip
    cut, model, _ = cut_of(tmp_path, [run])
    assert all(np.isnan(block.share) for block in cut.blocks)
    assert own_tolerances(model, cut.runs[0], TANK)[2] == pytest.approx(0.01 * MASS_KG, rel=1e-6)
    assert LIQUID_KG < MASS_KG
