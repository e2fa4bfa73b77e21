"""The force of the computed liquid along a whole motion: hours of computing that may be stopped at any time.

The force is kept as means over a few steps (`sampling`). Now and then they are saved together with the state
of the tank; started again with the same checkpoint the computation goes on and ends with the same bytes.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank import checkpoint as checkpoints
from acquisition.numerical_tank.forced_motion import MovedTank, averaged
from acquisition.numerical_tank.instability import InstabilityError
from acquisition.numerical_tank.long_computation import LongComputation
from acquisition.numerical_tank.sampling import HALF_LENGTH_SAMPLES, oversampling, sampled
from acquisition.numerical_tank.simulation import NumericalTank
from sloshlab.errors import InputError, RecordingInterruptedError

FloatArray = NDArray[np.float64]
VerticalMotion = Callable[[FloatArray], FloatArray]
"""Vertical acceleration of the tank [m/s²] at given times [s], 0 being the start of the run."""
Progress = Callable[[float], None]
"""Takes the share of the work that is done, 0 … 1."""

# of computing: what a kill or a power cut costs
SAVED_EVERY_S: Final = 20.0
_BLOCK_S: Final = 0.1


class SampledSetup(Protocol):
    """A tank whose force is wanted as samples."""

    @property
    def sampling_rate_hz(self) -> float | None:
        """Samples per second; None if it was not stated."""
        ...


@dataclass(frozen=True)
class TankMethod:
    """How a liquid is computed: a tank, its checkpoints, and what its force at rest weighs.

    Attributes
    ----------
    make : callable
        Takes a setup, returns the tank.
    save : callable
        Takes tank, path and further arrays.
    load : callable
        Takes a path, returns the tank and the further arrays.
    mass_kg : callable
        Takes a setup, returns the mass of all fluid.
    """

    make: Callable[[Any], MovedTank[Any]]
    save: Callable[[Any, Path, Mapping[str, NDArray[Any]]], None]
    load: Callable[[Path], tuple[Any, dict[str, NDArray[Any]]]]
    mass_kg: Callable[[Any], float]


PARTICLES: Final = TankMethod(
    NumericalTank, checkpoints.save, checkpoints.load_with_extra, lambda setup: float(setup.liquid_mass_kg)
)
"""Smoothed particles: the liquid alone."""


class ComputationInterruptedError(RecordingInterruptedError):
    """A person stopped a computation; its checkpoint is safe, and the message says how to go on."""


@dataclass(frozen=True)
class ComputedForce:
    """What the computation gave.

    Attributes
    ----------
    vertical_n : ndarray, shape (n,)
        Force of the liquid on the tank [N], upward positive, without the static weight −m g; sample k at
        k over the sampling rate. Shorter than asked for where the computation became unstable.
    computing_s : float
        Time that it took, without interruptions.
    stopped : str
        Why, when and where it became unstable; empty if it did not.
    """

    vertical_n: FloatArray
    computing_s: float
    stopped: str = ""


def computed_force(
    setup: Any,
    acceleration_m_per_s2: VerticalMotion,
    duration_s: float,
    *,
    method: TankMethod = PARTICLES,
    checkpoint: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
    saved_every_s: float = SAVED_EVERY_S,
    monotonic_s: Callable[[], float] = time.monotonic,
) -> ComputedForce:
    """Move the tank from rest and return the force of the liquid on it.

    Parameters
    ----------
    setup : TankSetup or TwoPhaseSetup
        With a sampling rate.
    acceleration_m_per_s2 : callable
        Vertical acceleration of the tank [m/s²] at times [s]; also asked for up to 12 samples beyond the end,
        which the filter of the last samples needs. Before the start the tank is at rest.
    duration_s : float
        Duration of the run.
    method : TankMethod
        Of the setup.
    checkpoint : path-like, optional
        Where the state is saved from time to time. If the file is there, the computation goes on from it.
    progress : callable, optional
        Called with the share of the work done, every few tenths of a second.
    saved_every_s : float
        Time of computing between two checkpoints.
    monotonic_s : callable
        The clock.

    Returns
    -------
    ComputedForce
        With the same setup and motion the same bytes, however often it was stopped and continued.

    Raises
    ------
    InputError
        If there is no sampling rate, a time is out of range, or the checkpoint is damaged or of another run.
    ComputationInterruptedError
        At Ctrl-C or SIGTERM, if there is a checkpoint.
    """
    n_samples = _n_samples(setup, duration_s)
    run = _Computation(setup, acceleration_m_per_s2, n_samples, method)
    path = None if checkpoint is None else Path(checkpoint)
    if path is not None and path.exists():
        run.restore(path)
    try:
        stopped = run.run(path, progress, saved_every_s=saved_every_s, monotonic_s=monotonic_s)
    except KeyboardInterrupt as interrupt:
        if path is None:
            raise
        # steps whose forces were not stored cannot be saved: the older checkpoint is better
        if run.is_consistent:
            run.save(path)
        raise _interrupted(run, path, duration_s) from interrupt
    return ComputedForce(run.samples(n_samples), run.computing_s, stopped)


class _Computation(LongComputation):
    """A tank, its motion and the mean forces so far."""

    def __init__(self, setup: Any, motion: VerticalMotion, n_samples: int, method: TankMethod) -> None:
        self._n_means = oversampling(setup.steps_per_sample)
        self._steps_per_mean = setup.steps_per_sample // self._n_means
        # the filter of the last sample needs half its length beyond it
        self._means = np.zeros((n_samples - 1 + HALF_LENGTH_SAMPLES) * self._n_means)
        # whole means in a block, so that a checkpoint never falls within one
        self._at_once = max(round(_BLOCK_S / (self._steps_per_mean * setup.step_s)), 1)
        self._n_done = 0
        self._motion = motion
        self._weight_n = setup.gravity_m_per_s2 * method.mass_kg(setup)
        self._run = _identity(setup, motion, n_samples)
        self._method = method
        self.tank: Any = method.make(setup)
        self.computing_s = 0.0

    @property
    def n_left(self) -> int:
        return self._means.size - self._n_done

    @property
    def share(self) -> float:
        return self._n_done / self._means.size

    @property
    def is_consistent(self) -> bool:
        """False if an interrupt fell between a block of steps and the storing of its forces."""
        return bool(self.tank.n_steps == self._n_done * self._steps_per_mean)

    def advance(self) -> str:
        """Compute a block; return why it became unstable, or nothing."""
        n_steps = min(self._at_once, self.n_left) * self._steps_per_mean
        motion = self._motion(self.tank.times_s(n_steps))
        try:
            forces, trouble = self.tank.advance(motion), ""
        except InstabilityError as error:
            if error.valid is None:
                raise
            forces, trouble = error.valid, str(error)
        # the static weight is taken away: the liquid at rest has no force
        means = averaged(forces.vertical_n, self._steps_per_mean) + self._weight_n
        self._means[self._n_done : self._n_done + means.size] = means
        self._n_done += means.size
        return trouble

    def samples(self, n_samples: int) -> FloatArray:
        return sampled(self._means[: self._n_done], self._n_means, n_samples)

    def save(self, path: Path) -> None:
        extra: dict[str, NDArray[Any]] = {
            "run": self._run,
            "means": self._means[: self._n_done],
            "computing_s": np.array([self.computing_s]),
        }
        self._method.save(self.tank, path, extra)

    def restore(self, path: Path) -> None:
        tank, extra = self._method.load(path)
        if extra.get("run", np.zeros(0)).tobytes() != self._run.tobytes():
            remedy = "remove it, or give another name"
            raise InputError(f"{path}", got="the checkpoint of another run", remedy=remedy)
        means, computing_s = extra.get("means", np.zeros(0)), extra.get("computing_s", np.zeros(0))
        # forces and state were saved together and must end at the same step
        if means.size * self._steps_per_mean != tank.n_steps or means.size > self._means.size:
            raise InputError(f"{path}", got="a checkpoint without all forces", remedy="remove it")
        self.tank, self._n_done, self.computing_s = tank, means.size, float(computing_s.sum())
        self._means[: means.size] = means


def _n_samples(setup: SampledSetup, duration_s: float) -> int:
    if setup.sampling_rate_hz is None:
        raise InputError("sampling_rate_hz of the tank", got="none", allowed="1 … 1e6")
    if not (math.isfinite(duration_s) and duration_s * setup.sampling_rate_hz >= 1):
        raise InputError("duration_s", got=f"{duration_s}", allowed="at least one sample, finite")
    return round(duration_s * float(setup.sampling_rate_hz))


def _identity(setup: Any, motion: VerticalMotion, n_samples: int) -> NDArray[np.uint8]:
    """Hash of all that determines the run: setup, and motion at the times of the samples."""
    digest = hashlib.sha256(json.dumps(asdict(setup), sort_keys=True).encode())
    # a function has no bytes of its own; its values at the samples stand for it
    digest.update(np.ascontiguousarray(motion(np.arange(n_samples) / (setup.sampling_rate_hz or 1.0))).tobytes())
    return np.frombuffer(digest.digest(), np.uint8)


def _interrupted(run: _Computation, path: Path, duration_s: float) -> ComputationInterruptedError:
    done_s = min(run.tank.time_s, duration_s)
    if not path.exists():
        return ComputationInterruptedError(
            f"interrupted at {done_s:.4g} of {duration_s:g} s; nothing was saved yet"
        )
    return ComputationInterruptedError(
        f"interrupted at {done_s:.4g} of {duration_s:g} s; {path.name} keeps what was computed; "
        "give the same command again to go on"
    )
