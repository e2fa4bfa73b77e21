"""What perfect sensors of a rig would show in a run, by the names of the channels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from sealed_trial.laboratory import kernel_layout as at
from sealed_trial.laboratory.hidden_rig import HiddenRig
from sealed_trial.laboratory.prescribed_motion import (
    Motion,
    at_rest,
    random_motion,
    stepped_motion,
    swept_motion,
    wandering_motion,
    with_modulation,
)
from sealed_trial.laboratory.recorder import Recorder
from sealed_trial.laboratory.system import System, simulate
from sealed_trial.laboratory.test_plan import RunPlan, TestPlan

FloatArray = npt.NDArray[np.float64]
Signals = dict[str, FloatArray]

SPARE_S = 0.1
"""Simulated beyond the end of a recording, for a sensor whose clock runs fast."""


def channel_names(kind: str) -> tuple[str, ...]:
    """Channels of a kind of rig."""
    if kind == "shaker":
        return (
            "force_cell_1",
            "force_cell_2",
            "acceleration_roof_1",
            "acceleration_roof_2",
            "acceleration_control",
        )
    structure = ("force_interface", "acceleration_tip", "displacement_tank", "acceleration_root")
    return structure if kind == "sdof" else (*structure, *(f"acceleration_beam_{k}" for k in (1, 2, 3)))


@lru_cache(maxsize=16)
def motion_of(run: RunPlan, chaos: float, seed: int) -> Motion:
    """The motion of the base in a run: that of its test, a little different at each repeat; with the chaos."""
    length = run.duration_s + 2 * SPARE_S
    test = np.random.default_rng([seed, run.test])
    once = np.random.default_rng([seed, run.test, run.repeat])
    drive = 1 + 0.002 * once.standard_normal()
    if run.motion == "free":
        motion = at_rest(length)
    elif run.motion == "random":
        motion = random_motion(length, run.level * drive, run.frequencies_hz[0], run.frequencies_hz[1], test)
    elif run.motion == "stepped":
        motion = stepped_motion(length, run.level * drive * np.array(run.levels), np.array(run.frequencies_hz))
    elif run.motion == "swept":
        motion = swept_motion(length, run.level * drive, run.frequencies_hz[0], run.frequencies_hz[1])
    else:
        motion = wandering_motion(length, run.level * drive, run.frequencies_hz[0], run.frequencies_hz[1])
    return with_modulation(motion, chaos, once) if chaos else motion


@dataclass(frozen=True)
class Setting:
    """What is done in a laboratory, whatever its rig is.

    Attributes
    ----------
    plan : TestPlan
    seed : int
        Of its motions.
    recorder : Recorder
    obeyed : callable or None
        From the commanded motion of the base to what it does; the recording has the command.
    """

    plan: TestPlan
    seed: int
    recorder: Recorder = field(default_factory=Recorder)
    obeyed: Callable[[Motion], Motion] | None = None


def true_signals(
    rig: HiddenRig, system: System, run: RunPlan, setting: Setting, *, relative_tolerance: float = 1e-9
) -> Signals:
    """Perfect signals of a run and `SPARE_S` more as the recorder passes them, SI units, upward positive."""
    seed, rate, recorder = setting.seed, setting.plan.sampling_rate_hz, setting.recorder
    commanded = motion_of(run, rig.chaos, seed)
    is_free = run.motion == "free"
    motion = commanded if setting.obeyed is None or is_free else setting.obeyed(commanded)
    scatter = np.random.default_rng([seed, run.test, run.repeat, 1]).standard_normal()
    n_held = recorder.n_held if is_free else 0
    simulated = simulate(
        system,
        motion,
        run.duration_s + SPARE_S - n_held / rate,
        rate,
        deflection_m=run.level * (1 + 0.002 * scatter) if is_free else 0.0,
        first_s=recorder.first_s_in_samples / rate if is_free else 0.0,
        relative_tolerance=relative_tolerance,
    )
    signals, start = (
        _readings(rig, system, seen, commanded, motion, rate) for seen in (simulated.seen, simulated.start[None])
    )
    recorded = {}
    for name, values in signals.items():
        # a tank that is held does not accelerate; what holds it pulls at it as its spring does
        before = 0.0 if is_free and name.startswith("acceleration") else float(start[name][0])
        recorded[name] = recorder.passed(np.concatenate([np.full(n_held, before), values]), before)
    return recorded


def _readings(
    rig: HiddenRig, system: System, seen: FloatArray, commanded: Motion, motion: Motion, rate_hz: float
) -> Signals:
    tank, force = seen[:, at.O_ACCELERATION], seen[:, at.O_INTERFACE_FORCE]
    if rig.kind == "shaker":
        return {
            "force_cell_1": 0.5 * force,
            "force_cell_2": 0.5 * force,
            "acceleration_roof_1": tank.copy(),
            "acceleration_roof_2": tank.copy(),
            "acceleration_control": tank.copy(),
        }
    every = round(1 / (rate_hz * motion.step_s))
    root, told = (table[: every * tank.size : every, 2].copy() for table in (motion.table, commanded.table))
    signals = {
        "force_interface": force.copy(),
        "acceleration_tip": tank.copy(),
        "displacement_tank": seen[:, at.O_DISPLACEMENT].copy(),
        "acceleration_root": told,
    }
    if rig.kind == "beam":
        n = system.shape.size
        shapes = rig.shapes_at_places(n)
        coordinates = seen[:, at.O_COORDINATES : at.O_COORDINATES + n]
        for k in range(3):
            signals[f"acceleration_beam_{k + 1}"] = root + coordinates @ shapes[k]
    return signals
