"""The force along a whole motion: what it is for a liquid that cannot slosh, and that stopping changes nothing."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.numerical_tank import checkpoint as checkpoints
from acquisition.numerical_tank import computed_force as computed_force_module
from acquisition.numerical_tank.computed_force import ComputationInterruptedError, ComputedForce, computed_force
from acquisition.numerical_tank.forced_motion import HarmonicMotion
from acquisition.numerical_tank.tank import Box, TankSetup, filled_tank
from sloshlab.errors import InputError

DURATION_S = 0.6
MOTION = HarmonicMotion(30.0, 12.0, rise_s=0.1)
SAVED_AND_KILLED = """
import os, signal, sys
import test_tank_computed_force as here
from acquisition.numerical_tank.computed_force import computed_force

def progress(share):
    if share > 0.5 and os.path.exists(sys.argv[1]):
        os.kill(os.getpid(), signal.SIGKILL)

saved = {"checkpoint": sys.argv[1], "saved_every_s": 0}
computed_force(here.tank(), here.MOTION, here.DURATION_S, progress=progress, **saved)
"""


def tank(seed: int = 3) -> TankSetup:
    return filled_tank(Box(0.06, 0.03, 0.05), 0.5, 10, seed=seed, sampling_rate_hz=256.0)


@pytest.fixture(scope="module")
def through() -> ComputedForce:
    return computed_force(tank(), MOTION, DURATION_S)


def test_a_gently_moved_liquid_moves_with_the_tank() -> None:
    """Below its own weight a flat liquid is rigid: F = −m ü; sound of 200 Hz adds (f/f₀)² to it."""
    motion, setup = HarmonicMotion(3.0, 9.0, rise_s=0.2), tank()
    force = computed_force(setup, motion, 0.7)
    time_s = np.arange(force.vertical_n.size) / 256.0
    expected = -setup.liquid_mass_kg * motion(time_s)
    settled = time_s > 0.25
    error = (force.vertical_n - expected)[settled]
    assert (
        np.sqrt(np.mean(error**2)) < 0.05 * np.abs(expected).max()
    )  # what is left rings in the sound of the liquid
    turned = np.exp(-2j * np.pi * 9.0 * time_s[settled])
    ratio = (force.vertical_n[settled] @ turned) / (expected[settled] @ turned)
    assert abs(ratio) == pytest.approx(1.0, abs=0.01)
    assert np.angle(ratio) == pytest.approx(0.0, abs=0.01)  # a sample late would be 0.22 rad


def test_at_rest_the_weight_is_taken_away() -> None:
    setup = tank()
    force = computed_force(setup, np.zeros_like, 0.5)
    assert force.vertical_n.size == 128
    assert abs(force.vertical_n[64:].mean()) < 1e-3 * 9.81 * setup.liquid_mass_kg
    assert force.stopped == ""


@pytest.mark.skipif(os.name != "posix", reason="SIGKILL")
def test_killed_and_started_again_it_ends_with_the_same_bytes(tmp_path: Path, through: ComputedForce) -> None:
    saved = tmp_path / "run.checkpoint"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    command = [sys.executable, "-c", SAVED_AND_KILLED, str(saved)]
    killed = subprocess.run(command, env=environment, capture_output=True, timeout=300, check=False)
    assert killed.returncode == -signal.SIGKILL, killed.stderr.decode()
    done = checkpoints.load(saved).time_s
    assert 0.3 * DURATION_S < done < DURATION_S
    again = computed_force(tank(), MOTION, DURATION_S, checkpoint=saved)
    assert again.vertical_n.tobytes() == through.vertical_n.tobytes()


def test_interrupted_it_says_how_to_go_on(tmp_path: Path, through: ComputedForce) -> None:
    saved, shares = tmp_path / "run.checkpoint", []

    def impatient(share: float) -> None:
        shares.append(share)
        if len(shares) == 3:
            raise KeyboardInterrupt

    with pytest.raises(ComputationInterruptedError, match=r"of 0\.6 s; run\.checkpoint keeps .* same command"):
        computed_force(tank(), MOTION, DURATION_S, checkpoint=saved, progress=impatient)
    assert shares == sorted(shares)
    resumed: list[float] = []
    again = computed_force(tank(), MOTION, DURATION_S, checkpoint=saved, progress=resumed.append)
    assert resumed[0] > shares[-1]
    assert resumed[-1] == 1.0
    assert again.vertical_n.tobytes() == through.vertical_n.tobytes()


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_within_a_block_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, through: ComputedForce, number: signal.Signals
) -> None:
    """It arrives while the steps of the second block are computed; both blocks are in the checkpoint."""
    saved, calls, before = tmp_path / "run.checkpoint", [], signal.getsignal(number)
    unharmed = computed_force_module.averaged

    def averaged(*arguments: Any) -> Any:
        calls.append(arguments)
        if len(calls) == 2:
            signal.raise_signal(number)
        return unharmed(*arguments)

    with monkeypatch.context() as patched:
        patched.setattr(computed_force_module, "averaged", averaged)
        with pytest.raises(ComputationInterruptedError, match=r"run\.checkpoint keeps"):
            computed_force(tank(), MOTION, DURATION_S, checkpoint=saved)
    assert len(calls) == 2
    assert checkpoints.load(saved).time_s == pytest.approx(0.2, rel=0.05)
    assert signal.getsignal(number) is before
    again = computed_force(tank(), MOTION, DURATION_S, checkpoint=saved)
    assert again.vertical_n.tobytes() == through.vertical_n.tobytes()


def test_an_interrupt_between_step_and_storing_saves_nothing_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, through: ComputedForce
) -> None:
    saved, calls = tmp_path / "run.checkpoint", []

    def averaged(*arguments: object) -> None:
        calls.append(arguments)
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("acquisition.numerical_tank.computed_force.averaged", averaged)
        with pytest.raises(ComputationInterruptedError, match="nothing was saved yet"):
            computed_force(tank(), MOTION, DURATION_S, checkpoint=saved)
    assert len(calls) == 1
    assert not saved.exists()


def test_without_a_checkpoint_an_interrupt_is_an_interrupt() -> None:
    def impatient(share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        computed_force(tank(), MOTION, DURATION_S, progress=impatient)


def test_a_checkpoint_of_another_run_is_refused(tmp_path: Path) -> None:
    saved = tmp_path / "run.checkpoint"
    computed_force(tank(), MOTION, 0.2, checkpoint=saved, saved_every_s=0)
    before = saved.read_bytes()
    for setup, motion, duration_s in (
        (tank(seed=4), MOTION, 0.2),
        (tank(), HarmonicMotion(30.0, 12.1, rise_s=0.1), 0.2),
        (tank(), MOTION, 0.3),
    ):
        with pytest.raises(InputError, match=r"the checkpoint of another run; remedy: remove it"):
            computed_force(setup, motion, duration_s, checkpoint=saved)
    checkpoints.save(checkpoints.load(saved), saved)
    with pytest.raises(InputError, match="another run"):
        computed_force(tank(), MOTION, 0.2, checkpoint=saved)
    saved.write_bytes(before[:-1])
    with pytest.raises(InputError, match="damaged"):
        computed_force(tank(), MOTION, 0.2, checkpoint=saved)


def test_it_is_saved_as_often_as_asked(tmp_path: Path) -> None:
    saved, there, clock = tmp_path / "run.checkpoint", [], iter(range(10**6))

    def monotonic_s() -> float:
        return 2.0 * next(clock)

    def progress(share: float) -> None:
        there.append(saved.exists())

    force = computed_force(
        tank(),
        MOTION,
        DURATION_S,
        checkpoint=saved,
        progress=progress,
        saved_every_s=20.0,
        monotonic_s=monotonic_s,
    )
    assert there == [False] * 4 + [True] * (len(there) - 4)  # saved after four blocks of three readings, 2 s each
    assert force.computing_s == 2.0 * len(there)


def test_an_unstable_run_keeps_what_is_valid(through: ComputedForce) -> None:
    def violent(time_s: np.ndarray) -> np.ndarray:
        return np.where(time_s < 0.3, MOTION(time_s), 1e5)

    force = computed_force(tank(), violent, DURATION_S)
    assert "numerical tank: " in force.stopped
    assert " at 0.3 s, x = " in force.stopped
    n_valid = force.vertical_n.size
    assert 0.3 * 256 - 14 <= n_valid <= 0.3 * 256 - 10  # the filter reaches 12 samples ahead
    assert force.vertical_n[:-2].tobytes() == through.vertical_n[: n_valid - 2].tobytes()


@pytest.mark.parametrize("duration_s", [0.0, -1.0, float("nan"), float("inf")])
def test_an_impossible_duration_is_refused(duration_s: float) -> None:
    with pytest.raises(InputError, match="duration_s"):
        computed_force(tank(), MOTION, duration_s)


def test_a_tank_without_sampling_rate_is_refused() -> None:
    with pytest.raises(InputError, match="sampling_rate_hz of the tank: got none"):
        computed_force(filled_tank(Box(0.06, 0.03), 0.5, 10), MOTION, 1.0)
