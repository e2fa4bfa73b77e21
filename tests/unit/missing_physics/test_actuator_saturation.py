"""A command that is not obeyed: describing functions, and a base that moves less than it is told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import base_motion, decays, effect, motion, rig, run_of, surroundings

from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate
from sloshlab.missing_physics.effects.excitation import saturated
from sloshlab.missing_physics.extension import NOTHING, Extension

assert effects.__all__
LIMIT, DEAD_ZONE = 0.9, 0.12
ROOT, TIP = "acceleration_root", "acceleration_tip"


def share_within(zone: float, amplitude: float) -> float:
    """Describing function of a saturation at `zone`: 2/π (asin r + r √(1 − r²)), r = zone/amplitude, at most 1."""
    r = min(zone / amplitude, 1.0)
    return 2 / np.pi * (np.arcsin(r) + r * np.sqrt(1 - r**2))


@pytest.mark.parametrize("amplitude", [0.3, 1.0, 2.5])
@pytest.mark.parametrize(("limit", "dead_zone"), [(0.7, 0.0), (10.0, 0.2), (0.7, 0.2)])
def test_the_fundamental_of_what_acts_is_the_describing_function(
    amplitude: float, limit: float, dead_zone: float
) -> None:
    """A dead zone d before a saturation L passes N(L + d) − N(d) of a sine, N that of a saturation."""
    phase = 2 * np.pi * np.arange(200_000) / 200_000
    acting = saturated(limit, dead_zone)(amplitude * np.sin(phase))
    expected = share_within(limit + dead_zone, amplitude) - share_within(dead_zone, amplitude)
    assert 2 * np.mean(acting * np.sin(phase)) / amplitude == pytest.approx(expected, abs=1e-8)


def obeyed(t: float) -> float:
    """What the base does of `base_motion`."""
    command = base_motion(t)
    beyond = np.sign(command) * max(abs(command) - DEAD_ZONE, 0.0)
    return float(min(max(beyond, -LIMIT), LIMIT))


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> RigModel:
    """A run whose recording has the command, and a decay."""
    folder = tmp_path_factory.mktemp("saturated")
    time, _, _, a = motion(0.0, 6.0, base=obeyed)
    command, acting = (np.array([of(t) for t in time]) for of in (base_motion, obeyed))
    run = run_of("driven", {TIP: a + acting, ROOT: command}, {}, 1, experiment="other")
    return RigModel(rig(folder), folder, [run, *decays((0.01,), 1.0)])


def test_the_tip_follows_what_acts_and_not_the_command(model: RigModel) -> None:
    run, decay = model.runs
    candidate = Candidate(effect("excitation.actuator_saturation"), surroundings(model), ROOT)
    recorded = run.recording[TIP].values
    size = np.abs(recorded).max()
    true = candidate.extension({"limit": LIMIT, "dead_zone": DEAD_ZONE})
    off = [
        np.abs(model.simulate(run, model.believed, extension)[TIP] - recorded)[100:-100]
        for extension in (NOTHING, true)
    ]
    assert off[0].max() > 0.2 * size
    # corners of what acts, between samples of the command
    assert off[1].max() < 0.02 * size
    assert np.sqrt(np.mean(off[1] ** 2)) < 0.004 * size
    free = [model.simulate(decay, model.believed, extension)[TIP] for extension in (NOTHING, true)]
    np.testing.assert_array_equal(free[0], free[1])


def test_a_command_drives_alone(model: RigModel) -> None:
    saturation, at = effect("excitation.actuator_saturation"), surroundings(model)
    assert list(saturation.places(at)) == [ROOT]
    several = replace(at, driving=("acceleration_roof_1", "acceleration_roof_2"))
    assert list(saturation.places(several)) == []
    assert list(saturation.places(replace(at, driving=()))) == []
    machine = replace(at, rig=None, driving=("voltage_shaker", "force_left"))  # type: ignore[arg-type]
    assert list(saturation.places(machine)) == ["voltage_shaker", "force_left"]


def test_a_start_leads_to_a_limit_that_is_hardly_met(tmp_path: Path) -> None:
    """Without a dead zone, which every reading of a slow command would show."""
    time, _, _, _ = motion(0.0, 6.0)
    command = np.array([base_motion(t) for t in time])
    limit = 0.92 * np.abs(command).max()
    _, _, _, a = motion(0.0, 6.0, base=lambda t: float(np.clip(base_motion(t), -limit, limit)))
    run = run_of("driven", {TIP: a + np.clip(command, -limit, limit), ROOT: command}, {}, 1, experiment="other")
    model = RigModel(rig(tmp_path), tmp_path, [run])
    candidate = Candidate(effect("excitation.actuator_saturation"), surroundings(model), ROOT)

    def left(extension: Extension) -> float:
        return float(np.std(model.simulate(run, model.believed, extension)[TIP] - run.recording[TIP].values))

    starts = [{name.rpartition(".")[2]: value for name, value in start.items()} for start in candidate.starts()]
    assert min(left(candidate.extension(start)) for start in starts) < 0.9 * left(NOTHING)
