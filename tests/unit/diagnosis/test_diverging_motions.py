"""Motions that are as likely as a simulated one, against closed forms of each draw."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import RATE_HZ, effect, motion, rig, run_of, surroundings
from scipy.signal import lfilter, welch
from test_remainder import run

from sloshlab.diagnosis.inference.diverging_motions import DivergingMotions
from sloshlab.diagnosis.inference.remainder import remainder
from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate
from sloshlab.rig import Rig

assert effects.__all__

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


def test_drives_are_drawn_with_the_colour_that_repeats_show(tmp_path: Path) -> None:
    """Slow noise of an accelerometer moves a velocity, and every reversal of a friction with it."""
    generator, motion_of_base = np.random.default_rng(3), 20.0 * np.sin(np.arange(round(40 * RATE_HZ)) / 8.0)
    kept, slow, fast = 0.97, 0.6, 0.8
    runs = []
    for repeat in (1, 2):
        steps = np.sqrt(1 - kept**2) * slow * generator.standard_normal(motion_of_base.size)
        noise = lfilter([1.0], [1.0, -kept], steps) + fast * generator.standard_normal(motion_of_base.size)
        read = {"acceleration_root": motion_of_base + noise, TIP: motion_of_base}
        recorded = run_of(f"run_{repeat}", read, {}, repeat, experiment="other", repeat=repeat)
        recorded.recording["acceleration_root"].attrs["noise_std"] = 1.0
        runs.append(recorded)
    rig(tmp_path)
    model = RigModel(Rig.from_toml(tmp_path / "rig.toml"), tmp_path, runs)

    def slow_power(motions: DivergingMotions) -> float:
        """Below two hertz, of what is added to the drive."""
        densities = []
        for _, drawn in motions._noisy:
            for each in runs:
                added = (drawn[each.name].recording - each.recording)["acceleration_root"].values
                frequencies, density = welch(added, RATE_HZ, nperseg=1000)
                densities.append(density[(frequencies > 0.2) & (frequencies < 2.0)].mean())
        return float(np.mean(densities))

    frequencies = np.linspace(0.2, 2.0, 50)
    turned = 1 + kept**2 - 2 * kept * np.cos(2 * np.pi * frequencies / RATE_HZ)
    expected = float(np.mean(fast**2 + slow**2 * (1 - kept**2) / turned)) * 2 / RATE_HZ
    assert slow_power(DivergingMotions(model, [["run_1", "run_2"]])) == pytest.approx(expected, rel=0.3)
    assert slow_power(DivergingMotions(model)) == pytest.approx(2 / RATE_HZ, rel=0.15)
