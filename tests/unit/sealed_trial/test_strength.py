"""An effect shows as far as nothing that a laboratory regards as possible explains it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sealed_trial.case_signals import Laboratory
from sealed_trial.hidden_physics.effect import Change, Signals
from sealed_trial.laboratory import kernel_layout as at
from sealed_trial.laboratory.hidden_rig import HiddenRig, drawn_rig
from sealed_trial.laboratory.sensors import Sensor
from sealed_trial.laboratory.test_plan import TestPlan, drawn_plan
from sealed_trial.strength import QUICK, NoiseFloor


def laboratory_of(plan_name: str, **factors: float) -> Laboratory:
    """Everything as believed but the factors given."""
    generator = np.random.default_rng(1)
    rig = replace(drawn_rig(plan_name.partition("_")[0], generator), coulomb_n=0.0, factors=factors)
    return Laboratory(rig, drawn_plan(plan_name, rig, generator), 5)


def floor_of(laboratory: Laboratory, gain: float = 1.0) -> tuple[NoiseFloor, list[Signals]]:
    """Sensors with a noise of half a per cent of the channel's kind."""
    plain = laboratory.signals(relative_tolerance=QUICK)
    sensors = {}
    for name in plain[0]:
        kind = [other for other in plain[0] if other.partition("_")[0] == name.partition("_")[0]]
        rms = max(float(np.sqrt(np.mean(run[other] ** 2))) for run in plain for other in kind)
        sensors[name] = Sensor(gain, 0.005 * rms, 0.0, 1.0, 10.0 * rms, 0.005 * rms)
    return NoiseFloor(laboratory, plain, sensors), plain


def of_stiffness(plan_name: str, factor: float, share: float) -> float:
    """Strength of a spring that is stiffer by a share, on a rig whose frequency is off by a factor."""
    laboratory = laboratory_of(plan_name, frequency_1=factor)
    floor, _ = floor_of(laboratory)
    stiffness = float(laboratory.rig.system().stiffness[0, 0])
    changed = laboratory.signals([Change({}, {at.STIFFNESS_CHANGE: share * stiffness})], relative_tolerance=QUICK)
    return floor.strength(changed, damping_is_known=False)


@pytest.mark.slow
@pytest.mark.parametrize("plan_name", ["sdof_decays", "sdof_base"])
def test_a_stiffness_within_the_tolerance_of_the_frequency_does_not_show(plan_name: str) -> None:
    # 0.988 √1.07 = 1.022 and 1.02 √0.94 = 0.989 are frequencies that the laboratory regards as possible
    assert of_stiffness(plan_name, 0.988, 0.07) < 0.5
    assert of_stiffness(plan_name, 1.02, -0.06) < 0.5
    # 1.02 √1.07 = 1.055 is not
    assert of_stiffness(plan_name, 1.02, 0.07) > 3.0


@pytest.mark.parametrize(("gain", "shows"), [(0.99, (0.02, -0.01)), (1.01, (-0.02, 0.01))])
def test_a_gain_is_judged_about_its_calibration(gain: float, shows: tuple[float, float]) -> None:
    floor, plain = floor_of(laboratory_of("sdof_base"), gain)

    def strength(ratio: float) -> float:
        changed = [{**run, "acceleration_tip": (1 + ratio) * run["acceleration_tip"]} for run in plain]
        return floor.strength(changed, damping_is_known=True)

    within, beyond = shows
    assert strength(within) < 0.1
    assert strength(beyond) > strength(within) + 0.5


def test_a_release_of_another_size_does_not_show() -> None:
    floor, plain = floor_of(laboratory_of("sdof_decays"))

    def strength(ratio: float) -> float:
        changed = [{name: (1 + ratio) * values for name, values in plain[0].items()}, *plain[1:]]
        return floor.strength(changed, damping_is_known=True)

    assert strength(0.03) < 0.1
    assert strength(-0.03) < 0.1
    assert strength(0.15) > 3.0


def test_the_zero_of_a_displacement_does_not_show() -> None:
    floor, plain = floor_of(laboratory_of("sdof_decays"))

    def strength(share: float) -> float:
        moved = plain[0]["displacement_tank"] + share * np.abs(plain[0]["displacement_tank"]).max()
        return floor.strength([{**plain[0], "displacement_tank": moved}, *plain[1:]], damping_is_known=True)

    assert strength(0.01) < 0.05
    assert strength(0.1) > 3.0


def test_the_shape_of_a_beam_between_root_and_tip_does_not_show() -> None:
    laboratory = laboratory_of("beam_decays")
    laboratory = replace(laboratory, plan=_first_run(laboratory.plan))
    floor, plain = floor_of(laboratory)

    def strength(channel: str, share: float) -> float:
        # the first mode alone moves the tip after a release by a static force there, but for a few per cent
        moved = plain[0][channel] + share * _first_mode(laboratory.rig, plain[0])
        return floor.strength([{**plain[0], channel: moved}], damping_is_known=True)

    assert strength("acceleration_beam_2", 0.02) < 0.05
    assert strength("acceleration_beam_2", 0.2) > 3.0
    assert strength("acceleration_tip", 0.05) > 1.0


def _first_run(plan: TestPlan) -> TestPlan:
    return replace(plan, runs=plan.runs[:1])


def _first_mode(rig: HiddenRig, run: Signals) -> np.ndarray:
    shapes = rig.shapes_at_places(rig.n_modes)
    names = ["acceleration_beam_1", "acceleration_beam_2", "acceleration_beam_3", "acceleration_tip"]
    return np.linalg.lstsq(shapes, np.stack([run[name] for name in names]), rcond=None)[0][0]


@pytest.mark.slow
def test_a_mass_on_a_beam_that_retuning_hides_does_not_show() -> None:
    """Eight per mille of what is carried turns the phase of a long run by more than a radian."""
    laboratory = laboratory_of("beam_base")
    floor, _ = floor_of(laboratory)

    def strength(share: float) -> float:
        floor.start_anew()
        mass = share * laboratory.rig.carried_mass_kg
        return floor.strength(
            laboratory.signals([Change({}, {at.TANK_MASS: mass})], relative_tolerance=QUICK),
            damping_is_known=False,
        )

    assert strength(0.008) < 0.5
    assert strength(0.08) > 3.0


@pytest.mark.parametrize("plan_name", ["sdof_decays", "sdof_base", "sdof_mixed", "sdof_one_frequency"])
def test_a_mass_on_one_mode_is_a_softer_spring_and_less_damping(plan_name: str) -> None:
    """(m + δm)(z̈ + ẅ) + c(1 + δ) ż + k(1 + δ) z = 0 divided by 1 + δ: no recording tells mass and spring apart."""
    laboratory = laboratory_of(plan_name)
    system = laboratory.rig.system()
    mass, stiffness = (float(matrix[0, 0]) for matrix in (system.mass, system.stiffness))
    damped = replace(laboratory, rig=laboratory.rig.with_factor("damping_1", 1.05))
    both = Change({}, {at.STRUCTURE_MASS: 0.05 * mass, at.STIFFNESS_CHANGE: 0.05 * stiffness})
    for plain, changed in zip(laboratory.signals(), damped.signals([both]), strict=True):
        for name, values in plain.items():
            assert changed[name] == pytest.approx(values, abs=1e-9 * (1.0 + np.abs(values).max()))


@pytest.mark.slow
def test_a_base_that_rocks_within_the_tolerances_of_all_modes_does_not_show() -> None:
    """It softens every mode, ten times this by less than frequencies may be off by, twenty times by more."""
    laboratory = laboratory_of("beam_decays")
    laboratory = replace(laboratory, plan=_first_run(laboratory.plan))
    stiffness = float(laboratory.rig.system().stiffness[0, 0])
    assert laboratory.rig.beam is not None
    compliance = 0.004 / (stiffness * laboratory.rig.beam.length_m**2)
    floor, _ = floor_of(laboratory)

    def strength(size: float) -> float:
        floor.start_anew()
        rocks = Change({}, compliance_rad_per_n_m=size * compliance)
        return floor.strength(laboratory.signals([rocks], relative_tolerance=QUICK), damping_is_known=False)

    assert strength(0.5) < 1.0
    assert strength(10.0) < 1.0
    assert strength(20.0) > 3.0
