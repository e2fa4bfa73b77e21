"""What a network trained on a ball hands to the writers and to the report."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from pipelines.ball.decays import Decays
from pipelines.ball.results import ForceTrace
from pipelines.inputs.recordings import RunSource
from pipelines.inputs.rigs import RigSource
from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.bouncing_ball.free_decay import DampingCurve
from sloshlab.bouncing_ball.pseudo_harmonic import PseudoHarmonic
from sloshlab.errors import InputError
from sloshlab.reduced_order_model.gradient_training import GradientSettings
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.training import TrainingRecord

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class BallNetworkSettings:
    """Choices of a network that learns from a ball; the defaults are those of Appendix C where it states them.

    Attributes
    ----------
    duration_s, rate_hz : float
        Of the run of the ball.
    n_delays, n_layers, n_neurons : int
        Past velocities, hidden layers and neurons of each.
    training : GradientSettings
    lowest_acceleration_g : float
        Below it ζ(a) is not read.
    n_map : int
        Grid lines of the map, each way.
    """

    duration_s: float = 200.0
    rate_hz: float = 1000.0
    n_delays: int = 50
    n_layers: int = 7
    n_neurons: int = 35
    training: GradientSettings = field(default_factory=lambda: GradientSettings(n_steps=1500, every=20))
    lowest_acceleration_g: float = 0.3
    n_map: int = 20

    def __post_init__(self) -> None:
        for option, value, most in (("--delays", self.n_delays, 500), ("--layers", self.n_layers, 20)):
            if not 1 <= value <= most:
                raise InputError(option, got=str(value), allowed=f"1 … {most}")


@dataclass(frozen=True, eq=False)
class Released:
    """A decay with something in the tank.

    Attributes
    ----------
    curve : DampingCurve
        ζ(a).
    trace : ForceTrace
    """

    curve: DampingCurve
    trace: ForceTrace


@dataclass(frozen=True, eq=False)
class OpenLoop:
    """A stretch of the validation run: velocity [m/s], force of the ball and of the network [N]."""

    time_s: FloatArray
    velocity_m_per_s: FloatArray
    of_ball_n: FloatArray
    of_network_n: FloatArray


@dataclass(frozen=True, eq=False)
class LossMap:
    """η of ball and network in steady harmonic motion, shape (n_frequencies, n_amplitudes); NaN where unknown."""

    amplitude_m: FloatArray
    frequency_hz: FloatArray
    of_ball: FloatArray
    of_network: FloatArray

    @property
    def error(self) -> FloatArray:
        """Network less ball."""
        return self.of_network - self.of_ball


@dataclass(frozen=True, eq=False)
class BallNetwork:
    """A network that learnt from a ball, beside the ball and the recorded decays.

    Attributes
    ----------
    decays : Decays
        Recorded.
    ball : BouncingBall
    model : ReducedOrderModel
    record : TrainingRecord
    motions : tuple of PseudoHarmonic
        Of the training and the validation run.
    fit_percent : float
        e_f of the validation run.
    stretch : OpenLoop
    with_ball, with_network : Released
    loss : LossMap
    settings : BallNetworkSettings
    rig_name : str
    inputs : tuple
        Files, for the provenance.
    flags : tuple of str
    provenance : dict
    """

    decays: Decays
    ball: BouncingBall
    model: ReducedOrderModel
    record: TrainingRecord
    motions: tuple[PseudoHarmonic, PseudoHarmonic]
    fit_percent: float
    stretch: OpenLoop
    with_ball: Released
    with_network: Released
    loss: LossMap
    settings: BallNetworkSettings
    rig_name: str
    inputs: tuple[RunSource | RigSource, ...]
    flags: tuple[str, ...] = ()
    provenance: dict[str, object] = field(default_factory=dict)

    def damping_errors(self, low_g: float, high_g: float) -> tuple[int, float, float]:
        """Values of the recorded ζ(a) within amplitudes, and the RMS of network − ball and network − recorded.

        Differences in per cent of critical damping; NaN where there is no value.
        """
        part = self.decays.measured
        inside = (part.acceleration_g >= low_g) & (part.acceleration_g < high_g)
        if not inside.any():
            return 0, float("nan"), float("nan")
        at = part.acceleration_m_per_s2[inside]
        network = self.with_network.curve.at(at)
        others = self.with_ball.curve.at(at), part.damping_ratio[inside]
        to_ball, to_recorded = (100 * float(np.sqrt(np.mean((network - other) ** 2))) for other in others)
        return int(inside.sum()), to_ball, to_recorded
