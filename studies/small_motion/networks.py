"""Networks that learnt from the slow run alone, and those that were to do better where the motion is small."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.reduced_order_model.amplitude_weights import local_amplitude, weighted_runs
from sloshlab.reduced_order_model.break_up_fit import with_break_up
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.regressors import Delays, Run, blocks
from sloshlab.reduced_order_model.storage import load_model, save_model
from sloshlab.reduced_order_model.training import TrainingSettings, fit
from studies.small_motion.campaign import MODEL_RATE_HZ, ComputedRun
from studies.small_motion.motion import RANDOM, RANDOM_VALIDATION, SLOW, SLOW_VALIDATION, SMALL, Motion
from studies.small_motion.scaled import fit_scaled, load_scaled, save_scaled

FloatArray = NDArray[np.float64]

N_DELAYS: Final = 20
N_NEURONS: Final = 15
N_EPOCHS: Final = 20
SEEDS: Final = (0, 1, 2, 3)
OFFSETS_M_PER_S: Final = (-0.6, -0.2, 0.2, 0.6)
"""Constant velocities of the copies of the slow run; the force of a copy is that of the run (Galileo)."""


class Predictor(Protocol):
    """What says a force for a motion."""

    def simulate(self, x: FloatArray) -> FloatArray:
        """Return Δf [N] for velocities [m/s], both of shape (n,)."""
        ...


@dataclass(frozen=True)
class Candidate:
    """A way of training.

    Attributes
    ----------
    name : str
        As the table has it.
    galilean : bool
        Without the mean of the past velocities.
    added : tuple of Motion
        Beside the slow run.
    validated : tuple of Motion
        Beside the slow run for validation.
    has_offset_copies : bool
        Whether copies of the slow run with constant velocities train, too.
    is_weighted : bool
        By the inverse square of the local amplitude.
    is_linear_first : bool
        Whether a linear filter of small motion takes its part before the network learns the rest.
    remembers : bool
        Whether the force is multiplied by the share of the liquid that is broken up, fitted to the same runs.
    is_scaled : bool
        Whether inputs and output are scaled by their local amplitude; without the mean of the velocities, too.
    """

    name: str
    galilean: bool = False
    added: tuple[Motion, ...] = ()
    validated: tuple[Motion, ...] = ()
    has_offset_copies: bool = False
    is_weighted: bool = False
    is_linear_first: bool = False
    remembers: bool = False
    is_scaled: bool = False


SOURCE: Final = Candidate("slow run, as the source")
GALILEAN: Final = Candidate("slow run, Galilean", galilean=True)
CANDIDATES: Final = (
    SOURCE,
    Candidate("slow run and copies with an offset", has_offset_copies=True),
    Candidate("slow run, weighted", is_weighted=True),
    Candidate("slow and small runs", added=(SMALL,)),
    Candidate("slow and random runs", added=(RANDOM,), validated=(RANDOM_VALIDATION,)),
    GALILEAN,
    Candidate("Galilean, weighted", galilean=True, is_weighted=True),
    Candidate("Galilean, slow and small runs", galilean=True, added=(SMALL,)),
    Candidate("Galilean, slow and random runs", galilean=True, added=(RANDOM,), validated=(RANDOM_VALIDATION,)),
    Candidate(
        "Galilean, slow and random runs, weighted",
        galilean=True,
        added=(RANDOM,),
        validated=(RANDOM_VALIDATION,),
        is_weighted=True,
    ),
    Candidate(
        "Galilean, slow and random runs, linear first",
        galilean=True,
        added=(RANDOM,),
        validated=(RANDOM_VALIDATION,),
        is_linear_first=True,
    ),
    Candidate(
        "Galilean, slow and random runs, break-up",
        galilean=True,
        added=(RANDOM,),
        validated=(RANDOM_VALIDATION,),
        remembers=True,
    ),
    Candidate("slow run, scaled by its amplitude", is_scaled=True),
    Candidate(
        "slow and random runs, scaled by their amplitude",
        added=(RANDOM,),
        validated=(RANDOM_VALIDATION,),
        is_scaled=True,
    ),
)


@dataclass(frozen=True)
class LinearFirst:
    """A linear filter, and a network for the rest.

    Attributes
    ----------
    taps : ndarray, shape (N_DELAYS,)
        Force over past velocity without its mean [N s/m], the latest first.
    rest : Predictor
    """

    taps: FloatArray
    rest: Predictor

    def simulate(self, x: FloatArray) -> FloatArray:
        """Return the sum of both."""
        return filtered(self.taps, x) + self.rest.simulate(x)


@dataclass(frozen=True)
class Workshop:
    """Trains, or takes from the folder where it keeps what it trained.

    Attributes
    ----------
    folder : Path
    signals : mapping of str to LiquidSignals
        By the names of the runs.
    liquid : str
    """

    folder: Path
    signals: Mapping[str, LiquidSignals]
    liquid: str
    _found: dict[tuple[str, int], Predictor] = field(default_factory=dict)

    def of(self, motion: Motion, seed: int = 0) -> LiquidSignals:
        """Signals of a motion."""
        return self.signals[ComputedRun(self.liquid, motion, seed).name]

    def predictor(self, candidate: Candidate, seed: int) -> Predictor:
        """Return the network of a candidate, trained if it is not there.

        Parameters
        ----------
        candidate : Candidate
        seed : int
            Of the start.
        """
        training = [self.of(motion) for motion in (SLOW, *candidate.added)]
        validation = [self.of(motion) for motion in (SLOW_VALIDATION, *candidate.validated)]
        name = candidate.name.replace(",", "").replace(" ", "_")
        return trained(candidate, training, validation, self.folder / f"{self.liquid}_{name}_{seed}.nc", seed)


def trained(
    candidate: Candidate,
    training: Sequence[LiquidSignals],
    validation: Sequence[LiquidSignals],
    path: Path,
    seed: int,
) -> Predictor:
    """Train on runs, or load what is there.

    Parameters
    ----------
    candidate : Candidate
    training, validation : sequence of LiquidSignals
        The slow run first.
    path : Path
        Where the network is kept.
    seed : int
    """
    runs, others = (_runs(candidate, signals) for signals in (training, validation))
    if candidate.is_scaled:
        return _scaled_network(runs, others, path.with_suffix(".npz"), seed)
    if candidate.has_offset_copies:
        runs += [replace(runs[0], x=runs[0].x + offset) for offset in OFFSETS_M_PER_S]
    if not candidate.is_linear_first:
        return _network(candidate, runs, others, path, seed)
    taps = small_motion_filter(runs)
    return LinearFirst(taps, _network(candidate, _rests(taps, runs), _rests(taps, others), path, seed))


def _runs(candidate: Candidate, signals: Sequence[LiquidSignals]) -> list[Run]:
    if candidate.is_weighted:
        return [run for each in signals for run in weighted_runs(each)]
    return [each.run() for each in signals]


def _network(
    candidate: Candidate, training: Sequence[Run], validation: Sequence[Run], path: Path, seed: int
) -> ReducedOrderModel:
    if path.is_file():
        return load_model(path)
    model, _ = fit(
        "normalised_rbf",
        {"n_neurons": N_NEURONS},
        Delays.tapped(N_DELAYS),
        training,
        validation,
        sampling_rate_hz=MODEL_RATE_HZ,
        settings=TrainingSettings(n_epochs=N_EPOCHS, seed=seed, galilean=candidate.galilean),
    )
    if candidate.remembers:
        model = with_break_up(model, training)
    path.parent.mkdir(parents=True, exist_ok=True)
    save_model(model, path)
    return model


def _scaled_network(training: Sequence[Run], validation: Sequence[Run], path: Path, seed: int) -> Predictor:
    if path.is_file():
        return load_scaled(path)
    model = fit_scaled(training, validation, n_delays=N_DELAYS, n_neurons=N_NEURONS, n_epochs=N_EPOCHS, seed=seed)
    save_scaled(model, path)
    return model


def small_motion_filter(runs: Sequence[Run]) -> FloatArray:
    """Taps that describe the force best where the local amplitude is below g, by least squares.

    Parameters
    ----------
    runs : sequence of Run
    """
    normal, moments = np.zeros((N_DELAYS, N_DELAYS)), np.zeros(N_DELAYS)
    for run in runs:
        amplitude = local_amplitude(np.gradient(run.x) * MODEL_RATE_HZ / GRAVITY_M_PER_S2, N_DELAYS)
        small = replace(run, y=np.where(amplitude < 1.0, run.y, np.nan))
        for phi, target in blocks([small], Delays.tapped(N_DELAYS), 4096):
            centred = phi - phi.mean(axis=0)
            normal += centred @ centred.T
            moments += centred @ target
    # past velocities are alike from delay to delay: directions that hardly vary are left out
    return np.asarray(np.linalg.lstsq(normal, moments, rcond=1e-6)[0])


def filtered(taps: FloatArray, velocity: FloatArray) -> FloatArray:
    """Force of the filter, NaN where past velocities are not known.

    Parameters
    ----------
    taps : ndarray, shape (N_DELAYS,)
    velocity : ndarray, shape (n,)
    """
    centred = taps - taps.mean()
    force = np.full(velocity.size, np.nan)
    # delays start at 1: the force of a sample is that of the N_DELAYS velocities before it
    force[taps.size :] = np.convolve(velocity, centred, mode="valid")[:-1]
    return force


def _rests(taps: FloatArray, runs: Sequence[Run]) -> list[Run]:
    return [replace(run, y=run.y - filtered(taps, run.x)) for run in runs]
