"""How wrong a ball is at and away from the frequency that it was tuned at (Figs. 2.18, 2.19)."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.bouncing_ball.harmonic_response import HarmonicRun, w_bar_at
from sloshlab.errors import AnalysisError
from sloshlab.rig import Rig

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class FrequencyBand:
    """Errors of W̄ in one band of frequencies.

    Attributes
    ----------
    low, high : float
        ω̄ of the band.
    is_tuned : bool
        The ball was identified in it.
    n_windows : int
        That are compared.
    measured_rms, ball_rms : float
        RMS of W̄ in the windows.
    error_rms, error_mean : float
        Of ball minus measured.
    n_outside : int
        Windows that are not compared, because the ball leaves its tank there.
    """

    low: float
    high: float
    is_tuned: bool
    n_windows: int
    measured_rms: float
    ball_rms: float
    error_rms: float
    error_mean: float
    n_outside: int = 0

    @property
    def relative_error(self) -> float:
        """RMS error over RMS of the measured W̄."""
        return self.error_rms / self.measured_rms if self.measured_rms > 0 else float("nan")


def error_by_frequency(
    ball: BouncingBall,
    rig: Rig,
    *,
    omega_bar: FloatArray,
    u_bar: FloatArray,
    w_bar: FloatArray,
    tuned_omega_bar: float,
    n_bands: int = 7,
    tuned_half_width: float = 0.05,
    run: HarmonicRun | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[tuple[FrequencyBand, ...], FloatArray]:
    """Compare a ball with measured windows, band by band.

    Parameters
    ----------
    ball : BouncingBall
    rig : Rig
    omega_bar, u_bar, w_bar : ndarray, shape (n_windows,)
        Of the windows.
    tuned_omega_bar : float
        Where the ball was identified.
    n_bands : int
        Bands, about equal in ln ω̄, beside the one around the tuned frequency.
    tuned_half_width : float
        Of that band, relative to its centre.
    run : HarmonicRun, optional
    progress : callable, optional
        Called with (windows done, windows in all).

    Returns
    -------
    bands : tuple of FrequencyBand
        By frequency; the one around the tuned frequency holds its windows alone.
    simulated : ndarray, shape (n_windows,)
        W̄ of the ball in every window, NaN where it leaves its tank.

    Raises
    ------
    AnalysisError
        If no window lies at the tuned frequency.
    """
    # a band of its own, which no other one shares: its windows were used to tune
    low, high = tuned_omega_bar * (1 - tuned_half_width), tuned_omega_bar * (1 + tuned_half_width)
    tuned = (omega_bar >= low) & (omega_bar <= high)
    if not tuned.any():
        raise AnalysisError(
            "windows at the tuned frequency",
            got=f"none within ω̄ = {low:.3g} … {high:.3g}",
            allowed=f"ω̄ = {omega_bar.min():.3g} … {omega_bar.max():.3g}",
        )
    simulated = w_bar_at(ball, rig, omega_bar, u_bar, run, progress=progress)
    parts = [
        (a, b, ~tuned & (omega_bar >= a) & (omega_bar < b)) for a, b in _limits(omega_bar, low, high, n_bands)
    ]
    bands = [_band(a, b, False, w_bar[at], simulated[at]) for a, b, at in parts if at.any()]
    bands.append(_band(low, high, True, w_bar[tuned], simulated[tuned]))
    return tuple(sorted(bands, key=lambda band: band.low + band.high)), simulated


def _limits(omega_bar: FloatArray, low: float, high: float, n_bands: int) -> list[tuple[float, float]]:
    """Bands below and above the tuned one, of about equal width in ln ω̄."""
    first, last = min(float(omega_bar.min()), low), max(float(omega_bar.max()), high) * (1 + 1e-9)
    below = float(np.log(low / first) / np.log(low / first * last / high)) if first < low or last > high else 0.5
    n_below = min(max(1, round(below * n_bands)), max(1, n_bands - 1))
    edges = [np.geomspace(first, low, n_below + 1), np.geomspace(high, last, max(1, n_bands - n_below) + 1)]
    return [(float(a), float(b)) for part in edges for a, b in itertools.pairwise(part)]


def _band(low: float, high: float, is_tuned: bool, measured: FloatArray, ball: FloatArray) -> FrequencyBand:
    # a ball that is pressed through a wall dissipates nothing that could be compared; such windows are counted
    inside = np.isfinite(ball)
    counts = int(inside.sum()), int((~inside).sum())
    error = (ball - measured)[inside]
    means = [
        float(np.mean(values)) if counts[0] else float("nan")
        for values in (
            measured[inside] ** 2,
            ball[inside] ** 2,
            error**2,
            error,
        )
    ]
    rms = np.sqrt(means[:3])
    return FrequencyBand(
        low, high, is_tuned, counts[0], float(rms[0]), float(rms[1]), float(rms[2]), means[3], counts[1]
    )


def summary(bands: Sequence[FrequencyBand]) -> tuple[float, float]:
    """Relative error at the tuned frequency, and over all other windows together."""
    (tuned,) = (band for band in bands if band.is_tuned)
    others = [band for band in bands if not band.is_tuned and band.n_windows]
    n = np.array([band.n_windows for band in others], dtype=float)
    # bands are pooled by their windows: a mean over bands would count one of few windows as much as one of many
    squares = [np.array([getattr(band, name) for band in others]) ** 2 for name in ("error_rms", "measured_rms")]
    error, measured = (float((n * square).sum()) for square in squares)
    return tuned.relative_error, float(np.sqrt(error / measured)) if measured > 0 else float("nan")
