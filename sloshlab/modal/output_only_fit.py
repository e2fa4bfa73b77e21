"""Frequency and damping of one mode from the power spectral density of a response alone (Table 2.5).

The input is not used, only taken as smooth over the mode: the density is a rational function of frequency with the
mode as its denominator and a parabola above it, seen through the line shape of the window. Maximum likelihood for
averaged periodograms (Whittle).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares
from scipy.stats import norm

from sloshlab.errors import AnalysisError
from sloshlab.modal.instantaneous_damping import CONFIDENCE
from sloshlab.modal.spectra import HANN_LINE_CORRELATIONS, hann_line_shape

FloatArray = npt.NDArray[np.float64]

_SMALLEST_N_LINES: Final = 12
_SMALLEST_SHARE: Final = 1e-6
"""The modelled density is kept above this share of the largest, so that its logarithm exists."""


@dataclass(frozen=True)
class DensityFit:
    """One mode found in a power spectral density.

    Attributes
    ----------
    frequency_hz, frequency_hz_std : float
        Undamped frequency and its standard error.
    damping_ratio, damping_ratio_std : float
        ζ and its standard error.
    coverage_factor : float
        Half width of the 90 % interval in standard errors.
    half_power_width_in_lines : float
        2ζf over the distance of lines; below about 2 the run is too short to tell ζ.
    misfit : float
        Mean square of the relative error over that of a right model; well above 1 the response is not that of a
        linear mode in smooth noise.
    line_hz, density : ndarray, shape (n_lines,)
        The fitted density, seen through the window, in the units of the data.
    """

    frequency_hz: float
    frequency_hz_std: float
    damping_ratio: float
    damping_ratio_std: float
    coverage_factor: float
    half_power_width_in_lines: float
    misfit: float
    line_hz: FloatArray
    density: FloatArray

    @property
    def damping_ratio_interval(self) -> tuple[float, float]:
        """Ends of the 90 % interval of ζ."""
        half = self.coverage_factor * self.damping_ratio_std
        return self.damping_ratio - half, self.damping_ratio + half


def fit_density(
    line_hz: FloatArray,
    density: FloatArray,
    *,
    frequency_range_hz: tuple[float, float],
    n_effective_averages: float,
) -> DensityFit:
    """Fit one mode to a power spectral density made with a Hann window.

    Parameters
    ----------
    line_hz : ndarray, shape (n_lines,)
        Equally spaced lines.
    density : ndarray, shape (n_lines,)
        One-sided density of the response, any units.
    frequency_range_hz : tuple of float
        Lines that are used; one mode within, its neighbours well outside.
    n_effective_averages : float
        Independent segments averaged, from `sloshlab.modal.spectra.Normalisation`.

    Returns
    -------
    DensityFit

    Raises
    ------
    AnalysisError
        If the range has too few lines, or nothing in it that looks like a mode.

    Examples
    --------
    >>> f = np.arange(1, 400) * 0.05
    >>> psd = 1 / ((1 - (f / 10) ** 2) ** 2 + (2 * 0.02 * f / 10) ** 2)
    >>> found = fit_density(f, psd, frequency_range_hz=(7, 14), n_effective_averages=20)
    >>> round(found.frequency_hz, 2), round(found.damping_ratio, 3)
    (10.0, 0.02)
    """
    inside = (line_hz >= frequency_range_hz[0]) & (line_hz <= frequency_range_hz[1])
    f, p = np.asarray(line_hz[inside], dtype=np.float64), np.asarray(density[inside], dtype=np.float64)
    if f.size < _SMALLEST_N_LINES or not (np.isfinite(p).all() and (p > 0).all()):
        raise AnalysisError(
            "fit to a power spectral density",
            got=f"{f.size} lines between {frequency_range_hz[0]:.4g} and {frequency_range_hz[1]:.4g} Hz",
            allowed=f"at least {_SMALLEST_N_LINES} lines with power",
            remedy="record longer, or widen the range",
        )
    spacing = float(np.median(np.diff(f)))
    model = _Model(f, spacing, p)
    # Whittle's likelihood as a sum of squares: densities scatter in proportion to themselves, so that plain
    # squares would fit the peak only
    found = least_squares(model.deviances, model.start, x_scale=model.scale, max_nfev=400, xtol=1e-12, ftol=1e-12)
    # ζ enters squared: its sign means nothing
    frequency, damping = float(found.x[0]), abs(float(found.x[1]))
    if not (f[0] < frequency < f[-1]) or 2 * damping * frequency > f[-1] - f[0]:
        raise AnalysisError(
            "fit to a power spectral density",
            got=f"no mode between {f[0]:.4g} and {f[-1]:.4g} Hz",
            allowed="one peak",
            remedy="state another frequency range, or excite the mode",
        )
    modelled = model.density(found.x)
    covariance, misfit = model.covariance(found.x, n_effective_averages)
    return DensityFit(
        frequency_hz=frequency,
        frequency_hz_std=float(np.sqrt(covariance[0, 0])),
        damping_ratio=damping,
        damping_ratio_std=float(np.sqrt(covariance[1, 1])),
        coverage_factor=float(norm.ppf(0.5 + CONFIDENCE / 2)),
        half_power_width_in_lines=2 * damping * frequency / spacing,
        misfit=misfit,
        line_hz=f,
        density=modelled * model.unit,
    )


class _Model:
    """Density over (fₙ, ζ, c₀, c₁, c₂): (c₀ + c₁x + c₂x²)/((1 − y)² + 4ζ²y), y = (f/fₙ)², x = f/f_peak − 1."""

    def __init__(self, f: FloatArray, spacing_hz: float, density: FloatArray) -> None:
        offsets, self._shares = hann_line_shape(spacing_hz)
        # the density is even: the line shape of the lowest lines reaches below zero
        self._points = np.abs(f[:, None] + offsets)
        self.unit = float(density.max())
        self._data = density / self.unit
        peak = int(np.argmax(density))
        # x about the peak, where the parabola's coefficients are nearly independent
        self._centre = float(f[peak])
        # half-power width 2ζf
        width = max(float((self._data > 0.5).sum()), 1.0) * spacing_hz
        damping = 0.5 * width / self._centre
        self.start = np.array([self._centre, damping, (2 * damping) ** 2, 0.0, 0.0])
        level = (2 * damping) ** 2
        self.scale = np.array([width, damping, level, level / 0.3, level / 0.1])

    def density(self, parameters: FloatArray) -> FloatArray:
        """The model through the line shape, shape (n_lines,), over `unit`."""
        frequency, damping, *numerator = parameters
        squared = (self._points / frequency) ** 2
        x = self._points / self._centre - 1
        above = numerator[0] + numerator[1] * x + numerator[2] * x**2
        seen = (above / ((1 - squared) ** 2 + 4 * damping**2 * squared)) @ self._shares
        return np.asarray(np.maximum(seen, _SMALLEST_SHARE))

    def deviances(self, parameters: FloatArray) -> FloatArray:
        """Signed roots of the deviance of a gamma distribution: their squares sum to −2 log likelihood."""
        ratio = self._data / self.density(parameters)
        return np.asarray(np.sign(ratio - 1) * np.sqrt(np.maximum(2 * (ratio - 1 - np.log(ratio)), 0.0)))

    def covariance(self, parameters: FloatArray, n_averages: float) -> tuple[FloatArray, float]:
        """Covariance of the parameters with neighbouring lines correlated, and the misfit."""
        steps = 1e-5 * self.scale
        # by the logarithm, because errors are relative
        jacobian = np.stack(
            [
                (np.log(self.density(parameters + step)) - np.log(self.density(parameters - step))) / (2 * size)
                for step, size in zip(np.diag(steps), steps, strict=True)
            ],
            axis=1,
        ) * self.scale  # fmt: skip
        scatter = jacobian.T @ jacobian
        total = scatter.copy()
        for apart, correlation in enumerate(HANN_LINE_CORRELATIONS, start=1):
            shifted = correlation * jacobian[apart:].T @ jacobian[:-apart]
            total = total + shifted + shifted.T
        # sandwich: neighbouring lines of a Hann window are correlated, which the inverse of JᵀJ does not know
        bread = np.linalg.pinv(scatter)
        error = self._data / self.density(parameters) - 1
        n_free = max(error.size - parameters.size, 1)
        misfit = float(n_averages * (error**2).sum() / n_free)
        # a misfit below one is chance and makes no interval shorter
        unscaled = bread @ total @ bread * max(misfit, 1.0) / n_averages
        return unscaled * np.outer(self.scale, self.scale), misfit
