"""What the identification of a ball hands to the writers and to the report."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.ball.settings import BallSettings
from pipelines.inputs.recordings import RunSource
from pipelines.inputs.rigs import RigSource
from sloshlab.bouncing_ball.free_decay import DampingCurve
from sloshlab.bouncing_ball.frequency_error import FrequencyBand
from sloshlab.bouncing_ball.from_work_line import WorkLine
from sloshlab.bouncing_ball.guide import FrozenDecay
from sloshlab.bouncing_ball.identification import IdentifiedBall
from sloshlab.rig import Rig

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ForceTrace:
    """Motion and sloshing force of one decay; F_S without its mean, upward positive."""

    time_s: FloatArray
    acceleration_m_per_s2: FloatArray
    sloshing_force_n: FloatArray


@dataclass(frozen=True, eq=False)
class DecayResult:
    """A ball from free decays.

    Attributes
    ----------
    measured, simulated : DampingCurve
        ζ(a) of all decays together, and of the ball.
    initial_displacement_m : float
    trace, simulated_trace : ForceTrace
        Of the first decay and of the ball.
    traces : tuple of (str, ForceTrace)
        Every sloshing decay with the name of its run.
    shares : dict of str to DampingCurve
        ζ(a) of all dampings and of each alone.
    steady_acceleration_m_per_s2, steady_loss_factor : ndarray, shape (n,)
        η_sh (2.17).
    response : xarray.Dataset
        Work and loss factor of the ball over frequency and amplitude.
    loop : tuple
        Amplitude [m], frequency [Hz], displacement and force of one hysteresis cycle.
    frozen : FrozenDecay or None
        The guide without sloshing, if a frozen decay was given.
    """

    measured: DampingCurve
    simulated: DampingCurve
    initial_displacement_m: float
    trace: ForceTrace
    simulated_trace: ForceTrace
    traces: tuple[tuple[str, ForceTrace], ...]
    shares: dict[str, DampingCurve]
    steady_acceleration_m_per_s2: FloatArray
    steady_loss_factor: FloatArray
    response: xr.Dataset
    loop: tuple[float, float, FloatArray, FloatArray]
    frozen: FrozenDecay | None = None


@dataclass(frozen=True, eq=False)
class LineResult:
    """A ball from W̄ at one frequency.

    Attributes
    ----------
    line : WorkLine
        Measured.
    line_of_ball : ndarray, shape (n,)
        W̄ of the ball along the decaying motion, at the amplitudes of `line`.
    steady_w_bar : ndarray, shape (n,)
        The same in steady motion.
    maps : xarray.Dataset
        Measured.
    map_of_ball : xarray.DataArray
        W̄ of the ball in steady motion over (omega_bar, u_bar), NaN outside the measured region.
    windows : xarray.Dataset
        Windows that are compared.
    w_bar_of_ball : ndarray, shape (n_windows,)
    bands : tuple of FrequencyBand
    other_lines : tuple of (WorkLine, ndarray)
        Measured lines at other frequencies and W̄ of the ball there.
    """

    line: WorkLine
    line_of_ball: FloatArray
    steady_w_bar: FloatArray
    maps: xr.Dataset
    map_of_ball: xr.DataArray
    windows: xr.Dataset
    w_bar_of_ball: FloatArray
    bands: tuple[FrequencyBand, ...]
    other_lines: tuple[tuple[WorkLine, FloatArray], ...]


@dataclass(frozen=True, eq=False)
class BallExperiment:
    """One identified ball with all that the report shows; of decays, `rig` is on the guide that was measured."""

    rig: Rig
    rig_name: str
    inputs: tuple[RunSource | RigSource, ...]
    identified: IdentifiedBall
    omega_bar: float
    result: DecayResult | LineResult
    settings: BallSettings
    flags: tuple[str, ...] = ()
    provenance: dict[str, object] = field(default_factory=dict)
