"""A ball from W̄ over amplitude at one frequency, excited by a decaying harmonic motion (2.1.3)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.bouncing_ball.decaying_motion import DecayingRun, w_bar_line
from sloshlab.bouncing_ball.identification import IdentifiedBall, SearchSettings, identified
from sloshlab.bouncing_ball.search_space import SearchSpace
from sloshlab.errors import AnalysisError
from sloshlab.rig import Rig

FloatArray = npt.NDArray[np.float64]

_N_VALUES = 25
# The decay passes beyond both ends of the line, so that nothing is extrapolated.
_MARGIN = 1.05


@dataclass(frozen=True, eq=False)
class WorkLine:
    """W̄ over ū at one ω̄, amplitudes rising.

    Attributes
    ----------
    omega_bar : float
    u_bar, w_bar : ndarray, shape (n,)
    """

    omega_bar: float
    u_bar: FloatArray
    w_bar: FloatArray


def work_line(maps: xr.Dataset, omega_bar: float, n_values: int = _N_VALUES) -> WorkLine:
    """The line of a measured map W̄(ω̄, ū) at one frequency, within the measured region.

    Parameters
    ----------
    maps : xarray.Dataset
        With ``w_bar`` over (omega_bar, u_bar), NaN where nothing was measured.
    omega_bar : float
    n_values : int
        Values, equally spaced.

    Raises
    ------
    AnalysisError
        If the map does not reach this frequency.
    """
    axis = maps["omega_bar"].values
    line = maps["w_bar"].interp(omega_bar=omega_bar) if axis.min() <= omega_bar <= axis.max() else None
    measured = line is not None and np.isfinite(line.values) & (line["u_bar"].values > 0)
    if line is None or np.sum(measured) < 6:
        raise AnalysisError(
            "W̄ line",
            got=f"ω̄ = {omega_bar:g} with {int(np.sum(measured))} measured amplitudes",
            allowed=f"ω̄ within {axis.min():.3g} … {axis.max():.3g}, at least 6 amplitudes measured",
            remedy="choose another frequency, or give runs that cover it",
        )
    known_u, known_w = line["u_bar"].values[measured], line.values[measured]
    # equally spaced: the grid of the map is not, and dense parts would count more
    u_bar = np.linspace(known_u[0], known_u[-1], n_values)
    return WorkLine(omega_bar, u_bar, np.interp(u_bar, known_u, known_w))


def line_of(ball: BouncingBall, rig: Rig, line: WorkLine, run: DecayingRun | None = None) -> FloatArray:
    """W̄ of a ball at the amplitudes of a line, from one decaying motion."""
    u_bar, w_bar = w_bar_line(
        ball,
        rig,
        line.omega_bar,
        largest_u_bar=_MARGIN * float(line.u_bar[-1]),
        smallest_u_bar=float(line.u_bar[0]) / _MARGIN,
        run=run,
    )
    # amplitudes fall along the motion
    return np.interp(line.u_bar, u_bar[::-1], w_bar[::-1])


def identify_from_line(
    line: WorkLine,
    rig: Rig,
    *,
    damping_in_flight: float = 0.0,
    settings: SearchSettings | None = None,
    run: DecayingRun | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> IdentifiedBall:
    """The ball that dissipates the measured W̄ over amplitude at one frequency.

    Parameters
    ----------
    line : WorkLine
    rig : Rig
        Its tank.
    damping_in_flight : float
        0 or 1.
    settings : SearchSettings, optional
    run : DecayingRun, optional
    progress : callable, optional

    Returns
    -------
    IdentifiedBall
        Residuals are differences of W̄.
    """

    def residuals(ball: BouncingBall) -> FloatArray:
        return line_of(ball, rig, line, run) - line.w_bar

    omega = line.omega_bar * rig.frequency_scale_rad_per_s
    return identified(residuals, SearchSpace(rig, omega, damping_in_flight), settings, progress=progress)
