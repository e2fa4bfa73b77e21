"""A ball from the free decay of a structure with one degree of freedom: ζ(a) is matched (2.1.1)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.bouncing_ball.free_decay import DampingCurve, simulated_curve, simulated_decay
from sloshlab.bouncing_ball.identification import IdentifiedBall, SearchSettings, identified
from sloshlab.bouncing_ball.search_space import SearchSpace
from sloshlab.errors import AnalysisError
from sloshlab.rig import Rig

FloatArray = npt.NDArray[np.float64]

_SAMPLES_PER_CYCLE = 120
"""A recording that is quicker is simulated at a whole fraction of its rate."""


def identify_from_decay(
    measured: DampingCurve,
    rig: Rig,
    *,
    initial_displacement_m: float,
    duration_s: float,
    sampling_rate_hz: float,
    damping_in_flight: float = 0.0,
    settings: SearchSettings | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> IdentifiedBall:
    """The ball whose decay has the measured ζ(a).

    Parameters
    ----------
    measured : DampingCurve
        From `measured_curve`.
    rig : Rig
        Structure and tank; its guide's friction and damping enter with the values that the rig states.
    initial_displacement_m : float
        From which the structure was released.
    duration_s : float
        That the simulated decay lasts.
    sampling_rate_hz : float
        Of the recording; both decays must be read alike.
    damping_in_flight : float
        0 or 1.
    settings : SearchSettings, optional
    progress : callable, optional

    Returns
    -------
    IdentifiedBall
        Residuals are differences of ζ, in percent of critical damping, at the measured amplitudes.

    Raises
    ------
    AnalysisError
        If the release does not reach the measured amplitudes.
    """
    frequency = measured.frequency_hz
    reached = abs(initial_displacement_m) * (2 * np.pi * frequency) ** 2
    if not reached > 0.5 * float(measured.acceleration_m_per_s2.max()):
        raise AnalysisError(
            "initial displacement",
            got=f"{initial_displacement_m:g} m, which gives {reached:.3g} m/s²",
            allowed=f"enough for the {measured.acceleration_m_per_s2.max():.3g} m/s² of the decay",
        )

    # a whole fraction: the reading of the decrement depends on the rate, so that both decays must have one
    rate = sampling_rate_hz / max(1, int(sampling_rate_hz / (_SAMPLES_PER_CYCLE * frequency)))

    def residuals(ball: BouncingBall) -> FloatArray:
        decay = simulated_decay(ball, rig, initial_displacement_m, duration_s, sampling_rate_hz=rate)
        curve = simulated_curve(decay, frequency)
        # in per cent of critical damping, so that a residual of ten is that of no ball at all
        return 100 * (curve.at(measured.acceleration_m_per_s2) - measured.damping_ratio)

    space = SearchSpace(rig, 2 * np.pi * frequency, damping_in_flight)
    return identified(residuals, space, settings, progress=progress)
