"""One long run of a ball from which a network can learn it: amplitude and frequency vary slowly (C.1).

z_T = A(t) sin φ(t), φ' = Ω(t): Ω swings between its ends, A between its smallest and the largest that neither the
largest amplitude nor the largest acceleration forbids.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline, make_interp_spline

from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.errors import InputError
from sloshlab.reduced_order_model.regressors import Run
from sloshlab.rig import Rig
from sloshlab.twin.excitation import Excitation
from sloshlab.twin.model import INPUTS

FloatArray = npt.NDArray[np.float64]

_KNOTS_PER_SAMPLE = 2
_SHARPNESS = 8
"""Of the smooth minimum of two limits: a kink of the amplitude would be a jump of the velocity."""
_LONGEST_S = 2000.0


@dataclass(frozen=True)
class PseudoHarmonic:
    """A motion over a range of amplitudes and frequencies.

    Attributes
    ----------
    amplitude_m, frequency_rad_per_s : tuple of float
        Smallest and largest.
    largest_acceleration_m_per_s2 : float
        Where amplitude and frequency ask for more, the amplitude is smaller.
    duration_s, sampling_rate_hz : float
    frequency_period_s, amplitude_period_s : float
        Of the two swings.
    """

    amplitude_m: tuple[float, float]
    frequency_rad_per_s: tuple[float, float]
    largest_acceleration_m_per_s2: float
    duration_s: float = 200.0
    sampling_rate_hz: float = 1000.0
    frequency_period_s: float = 100.0
    amplitude_period_s: float = 7.3

    def __post_init__(self) -> None:
        for name in ("amplitude_m", "frequency_rad_per_s"):
            low, high = getattr(self, name)
            if not 0 < low < high < math.inf:
                raise InputError(
                    f"pseudo-harmonic motion: {name}", got=f"{low:g} … {high:g}", allowed="0 < low < high"
                )
        for name in ("largest_acceleration_m_per_s2", "frequency_period_s", "amplitude_period_s"):
            if not 0 < getattr(self, name) < math.inf:
                raise InputError(f"pseudo-harmonic motion: {name}", got=str(getattr(self, name)), allowed="> 0")
        if not 1 <= self.duration_s <= _LONGEST_S:
            raise InputError("duration_s", got=f"{self.duration_s:g}", allowed=f"1 … {_LONGEST_S:g}")
        # below it the motion is sampled too coarsely to be followed, above it memory is all that grows
        least = 10 * self.frequency_rad_per_s[1] / (2 * math.pi)
        if not least <= self.sampling_rate_hz <= 10_000:
            raise InputError("rate_hz", got=f"{self.sampling_rate_hz:g}", allowed=f"{least:.4g} … 10000")

    def path(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Amplitude [m] and frequency [rad/s] at times.

        Examples
        --------
        >>> motion = PseudoHarmonic((0.01, 0.1), (10.0, 50.0), 1e6, frequency_period_s=4.0, amplitude_period_s=6.0)
        >>> [values.round(3).tolist() for values in motion.path(np.array([0.0, 1.0]))]
        [[0.01, 0.018], [10.0, 30.0]]
        """
        lowest, highest = self.frequency_rad_per_s
        omega = lowest + (highest - lowest) * _swing(time_s / self.frequency_period_s)
        limits = self.amplitude_m[1], self.largest_acceleration_m_per_s2 / omega**2
        most = sum(limit**-_SHARPNESS for limit in np.broadcast_arrays(*limits)) ** (-1 / _SHARPNESS)
        # by factors: small amplitudes, at which the ball just begins to leave the floor, last as long as others
        share = _swing(time_s / self.amplitude_period_s)
        amplitude = self.amplitude_m[0] * (np.maximum(most, self.amplitude_m[0]) / self.amplitude_m[0]) ** share
        return amplitude, omega

    @cached_property
    def _displacement(self) -> BSpline:
        rate = _KNOTS_PER_SAMPLE * self.sampling_rate_hz
        time = np.arange(round((self.duration_s + 0.1) * rate)) / rate
        amplitude, omega = self.path(time)
        phase = np.concatenate([[0.0], np.cumsum((omega[1:] + omega[:-1]) / (2 * rate))])
        return make_interp_spline(time, amplitude * np.sin(phase), k=5)

    def excitation(self) -> Excitation:
        """Base motion whose velocity and acceleration are the derivatives of its displacement exactly."""
        orders = [self._displacement.derivative(order) if order else self._displacement for order in range(3)]

        def inputs(time: FloatArray) -> FloatArray:
            table = np.zeros((time.size, len(INPUTS)))
            for column, spline in enumerate(orders):
                table[:, column] = spline(time)
            return table

        n_samples = round(self.duration_s * self.sampling_rate_hz)
        return Excitation(self.sampling_rate_hz, n_samples, inputs, moves_base=True)


def run_of_ball(ball: BouncingBall, rig: Rig, motion: PseudoHarmonic, name: str) -> Run:
    """Velocity of the tank in, force Δf of the ball beyond a frozen liquid out.

    Parameters
    ----------
    ball : BouncingBall
    rig : Rig
        Its tank and liquid.
    motion : PseudoHarmonic
    name : str
        Of the run.

    Raises
    ------
    AnalysisError
        If the ball leaves the tank.

    Notes
    -----
    The source trains on F_S = Δf − m_l z̈_T. The difference is linear and conservative, and the structure of the
    twin carries it already (2.22).
    """
    simulation = ball.in_tank(rig).simulate(motion.excitation()).require_done()
    return Run.of(simulation.velocity_m_per_s, simulation.tank_force_n, name)


def _swing(turns: FloatArray) -> FloatArray:
    """0 at whole turns, 1 between them."""
    return np.asarray((1 - np.cos(2 * math.pi * turns)) / 2)
