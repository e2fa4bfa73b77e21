"""Computing the motion of a structure and its tank, with checkpoints, and sampling it.

Means over a few steps are kept and then decimated by the same filter of zero phase for every channel
(`acquisition.numerical_tank.sampling`). Before the start there is nothing to filter: motion and force are
mirrored there, as those of a structure released from rest are but for its damping, so that the release
stays as sharp as the filter allows.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank import coupled_checkpoint
from acquisition.numerical_tank.carried_tank import FrozenTank, SloshingTank, StructureHistory
from acquisition.numerical_tank.computed_force import SAVED_EVERY_S, ComputationInterruptedError
from acquisition.numerical_tank.coupled_checkpoint import CARRIED_PARTICLES, CarriedMethod
from acquisition.numerical_tank.forced_motion import averaged
from acquisition.numerical_tank.instability import InstabilityError
from acquisition.numerical_tank.long_computation import LongComputation
from acquisition.numerical_tank.sampling import HALF_LENGTH_SAMPLES, oversampling, sampled
from acquisition.numerical_tank.structures import Structure
from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]

_BLOCK_S: Final = 0.1


class CarriedSetup(Protocol):
    """A tank, of particles or of liquid and gas, whose time step is that of the structure, too."""

    @property
    def step_s(self) -> float:
        """Time step."""
        ...

    @property
    def steps_per_sample(self) -> int:
        """Steps in one sample."""
        ...

    @property
    def liquid_mass_kg(self) -> float:
        """Of the liquid."""
        ...


@dataclass(frozen=True)
class StructureTask:
    """What is to be computed.

    Attributes
    ----------
    setup : TankSetup or TwoPhaseSetup
        With a sampling rate.
    structure : Structure
        Without the liquid.
    base_acceleration_m_per_s2 : ndarray, shape (n_steps_of(setup, n_samples),)
        In the middle of every step.
    initial_displacement_m : float
        Of the tank, held and let go.
    configuration : {'sloshing', 'frozen', 'empty'}
    n_samples : int
        Wanted.
    method : CarriedMethod
        Of the setup.
    """

    setup: Any
    structure: Structure
    base_acceleration_m_per_s2: FloatArray
    initial_displacement_m: float
    configuration: str
    n_samples: int
    method: CarriedMethod = CARRIED_PARTICLES

    def identity(self) -> NDArray[np.uint8]:
        """Hash of all that determines the result."""
        described = (asdict(self.setup), asdict(self.structure), self.initial_displacement_m, self.configuration)
        digest = hashlib.sha256(json.dumps(described, sort_keys=True).encode())
        # two runs with the same settings may be shaken differently
        digest.update(np.ascontiguousarray(self.base_acceleration_m_per_s2).tobytes())
        return np.frombuffer(digest.digest(), np.uint8)


@dataclass(frozen=True)
class ComputedStructure:
    """What came out, at the times of the samples.

    Attributes
    ----------
    modal_displacement_m, modal_acceleration_m_per_s2 : ndarray, shape (n, n_modes)
        Relative to the base. Shorter than asked for where the computation became unstable.
    liquid_force_n : ndarray, shape (n,)
        Of the liquid on the tank, upward, without its weight.
    computing_s : float
        Time that it took, without interruptions.
    stopped : str
        Why, when and where it became unstable; empty if it did not.
    """

    modal_displacement_m: FloatArray
    modal_acceleration_m_per_s2: FloatArray
    liquid_force_n: FloatArray
    computing_s: float
    stopped: str = ""


def n_steps_of(setup: CarriedSetup, n_samples: int) -> int:
    """Return the steps that so many samples need, those for the filter at the end included.

    Parameters
    ----------
    setup : TankSetup or TwoPhaseSetup
    n_samples : int
    """
    # the filter of the last sample needs half its length beyond it
    return (n_samples + HALF_LENGTH_SAMPLES) * setup.steps_per_sample


def sampled_from_release(values: FloatArray, setup: CarriedSetup, n_samples: int) -> FloatArray:
    """Return samples of values given in the middle of every step since the release.

    Parameters
    ----------
    values : ndarray, shape (n_steps,)
    setup : TankSetup or TwoPhaseSetup
    n_samples : int
        Wanted; fewer come back if the values end too early.
    """
    n_means = oversampling(setup.steps_per_sample)
    return _sampled_means(averaged(values, setup.steps_per_sample // n_means), n_means, n_samples)


def _sampled_means(means: FloatArray, n_means: int, n_samples: int) -> FloatArray:
    # mirrored at the release, as a structure let go from rest would have moved but for its damping
    before = means[: HALF_LENGTH_SAMPLES * n_means][::-1]
    return sampled(np.concatenate([before, means]), n_means, n_samples + HALF_LENGTH_SAMPLES)[HALF_LENGTH_SAMPLES:]


def computed_structure(
    task: StructureTask,
    *,
    checkpoint: str | os.PathLike[str] | None = None,
    progress: Callable[[float], None] | None = None,
    saved_every_s: float = SAVED_EVERY_S,
    monotonic_s: Callable[[], float] = time.monotonic,
) -> ComputedStructure:
    """Compute a structure and its tank from the release on.

    Parameters
    ----------
    task : StructureTask
    checkpoint : path-like, optional
        Where the state of a sloshing run is saved from time to time. If the file is there, the computation
        goes on from it. Without a liquid to compute nothing is saved: it takes no time.
    progress : callable, optional
        Called with the share of the work done.
    saved_every_s : float
        Time of computing between two checkpoints.
    monotonic_s : callable
        The clock.

    Returns
    -------
    ComputedStructure
        For the same task the same bytes, however often it was stopped and continued.

    Raises
    ------
    InputError
        If the structure is too fast for the step, or the checkpoint is damaged or of another run.
    ComputationInterruptedError
        At Ctrl-C or SIGTERM, if there is a checkpoint.
    """
    run = _Computation(task)
    path = Path(checkpoint) if checkpoint is not None and task.configuration == "sloshing" else None
    if path is not None and path.exists():
        run.restore(path)
    try:
        stopped = run.run(path, progress, saved_every_s=saved_every_s, monotonic_s=monotonic_s)
    except KeyboardInterrupt as interrupt:
        if path is None:
            raise
        raise _interrupted(run, path) from interrupt
    return run.result(stopped)


class _Computation(LongComputation):
    """A tank on its structure, and the means so far."""

    def __init__(self, task: StructureTask) -> None:
        self._task = task
        steps_per_sample = task.setup.steps_per_sample
        self._n_means = oversampling(steps_per_sample)
        self._steps_per_mean = steps_per_sample // self._n_means
        n_columns = 2 * task.structure.n_modes + 1
        self._means = np.zeros(((task.n_samples + HALF_LENGTH_SAMPLES) * self._n_means, n_columns))
        self._at_once = max(round(_BLOCK_S / (self._steps_per_mean * task.setup.step_s)), 1)
        self._n_done = 0
        self._carried = _carried(task)
        self.computing_s = 0.0

    @property
    def n_left(self) -> int:
        return len(self._means) - self._n_done

    @property
    def share(self) -> float:
        return self._n_done / len(self._means)

    @property
    def time_s(self) -> float:
        return self._carried.time_s

    @property
    def is_consistent(self) -> bool:
        """False if an interrupt fell between a block of steps and the storing of its means."""
        return bool(self._carried.n_steps == self._n_done * self._steps_per_mean)

    def advance(self) -> str:
        """Compute a block; return why it became unstable, or nothing."""
        first = self._n_done * self._steps_per_mean
        last = first + min(self._at_once, self.n_left) * self._steps_per_mean
        try:
            history, trouble = self._carried.advance(self._task.base_acceleration_m_per_s2[first:last]), ""
        except InstabilityError as error:
            history, trouble = error.valid, str(error)
        means = _means_of(history, self._steps_per_mean)
        self._means[self._n_done : self._n_done + len(means)] = means
        self._n_done += len(means)
        return trouble

    def result(self, stopped: str) -> ComputedStructure:
        n = self._task.structure.n_modes
        columns = [
            _sampled_means(column, self._n_means, self._task.n_samples) for column in self._means[: self._n_done].T
        ]
        samples = np.stack(columns, axis=1)
        return ComputedStructure(
            samples[:, :n], samples[:, n : 2 * n], samples[:, 2 * n].copy(), self.computing_s, stopped
        )

    def save(self, path: Path) -> None:
        assert isinstance(self._carried, SloshingTank)
        beside: dict[str, NDArray[Any]] = {
            "run": self._task.identity(),
            "means": self._means[: self._n_done],
            "computing_s": np.array([self.computing_s]),
        }
        coupled_checkpoint.save(self._carried, path, beside, self._task.method)

    def restore(self, path: Path) -> None:
        carried, beside = coupled_checkpoint.load(path, self._task.method)
        if beside.get("run", np.zeros(0)).tobytes() != self._task.identity().tobytes():
            raise InputError(
                f"{path}", got="the checkpoint of another run", remedy="remove it, or give another name"
            )
        means, computing_s = beside.get("means", np.zeros((0, 0))), beside.get("computing_s", np.zeros(0))
        fits = means.ndim == 2 and means.shape[1] == self._means.shape[1] and len(means) <= len(self._means)
        if not fits or len(means) * self._steps_per_mean != carried.n_steps:
            raise InputError(f"{path}", got="a checkpoint without all it needs", remedy="remove it")
        self._carried, self._n_done, self.computing_s = carried, len(means), float(computing_s.sum())
        self._means[: len(means)] = means


def _carried(task: StructureTask) -> SloshingTank | FrozenTank:
    carried: SloshingTank | FrozenTank
    if task.configuration == "sloshing":
        carried = task.method.couple(task.setup, task.structure)
    else:
        mass_kg = task.setup.liquid_mass_kg if task.configuration == "frozen" else 0.0
        carried = FrozenTank(mass_kg, task.structure, task.setup.step_s)
    carried.deflect(task.initial_displacement_m)
    return carried


def _means_of(history: StructureHistory, n_steps: int) -> FloatArray:
    columns = (*history.modal_displacement_m.T, *history.modal_acceleration_m_per_s2.T, history.liquid_force_n)
    return np.stack([averaged(column, n_steps) for column in columns], axis=1)


def _interrupted(run: _Computation, path: Path) -> ComputationInterruptedError:
    # as with a shaken tank: steps without their means cannot be gone on from
    if run.is_consistent and run.share > 0:
        run.save(path)
    if not path.exists():
        return ComputationInterruptedError(f"interrupted at {run.time_s:.4g} s; nothing was saved yet")
    return ComputationInterruptedError(
        f"interrupted at {run.time_s:.4g} s; {path.name} keeps what was computed; "
        "give the same command again to go on"
    )
