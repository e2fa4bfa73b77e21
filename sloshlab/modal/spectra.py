"""Power spectral densities and frequency response functions of random runs, after Welch.

What a number means depends on window, overlap and scaling; all of it is stored with the result. One-sided
densities: their sum times the line spacing is the mean square.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.stats import chi2
from scipy.stats import f as fisher_f

from sloshlab.errors import AnalysisError
from sloshlab.modal.instantaneous_damping import CONFIDENCE
from sloshlab.quantities import described

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

HANN_LINE_CORRELATIONS: Final = ((2 / 3) ** 2, (1 / 6) ** 2)
"""Correlation of the errors of densities and of H₁ one and two lines apart: lines of a Hann window share noise."""
_LINE_SHAPE_POINTS: Final = np.arange(-16, 17) / 4
"""Quadrature points over the window's line shape, in lines: ± 4, where |W|² has fallen to 1e-8."""


@dataclass(frozen=True)
class Normalisation:
    """How spectra were made.

    Attributes
    ----------
    window : str
        ``hann``, periodic.
    segment_length : int
        Samples per segment.
    overlap : float
        Share of a segment that is shared with the next.
    n_segments : int
        Segments averaged; segments with gaps are left out.
    n_effective_averages : float
        Independent segments with the same scatter (Welch 1967).
    line_spacing_hz, effective_bandwidth_hz : float
        Distance of lines, and equivalent noise bandwidth of the window.
    scaling : str
        ``one-sided density``: power per hertz; its sum times the line spacing is the mean square.
    """

    window: str
    segment_length: int
    overlap: float
    n_segments: int
    n_effective_averages: float
    line_spacing_hz: float
    effective_bandwidth_hz: float
    scaling: str = "one-sided density"

    @property
    def attributes(self) -> dict[str, Any]:
        """For a data set."""
        return {
            "spectrum_window": self.window,
            "spectrum_segment_length": self.segment_length,
            "spectrum_overlap": self.overlap,
            "spectrum_n_segments": self.n_segments,
            "spectrum_n_effective_averages": self.n_effective_averages,
            "spectrum_effective_bandwidth_hz": self.effective_bandwidth_hz,
            "spectrum_scaling": self.scaling,
        }


@dataclass(frozen=True)
class Spectra:
    """Auto- and cross-spectra of one input and several outputs.

    Attributes
    ----------
    output_names : tuple of str
        Rows of the arrays below.
    frequency_hz : ndarray, shape (n_lines,)
        Lines without the mean.
    input_psd : ndarray, shape (n_lines,)
        S_xx [unit²/Hz].
    output_psd : ndarray, shape (n_outputs, n_lines)
        S_yy [unit²/Hz].
    cross_psd : ndarray of complex, shape (n_outputs, n_lines)
        S_xy = E[X* Y], so that H₁ = S_xy/S_xx.
    normalisation : Normalisation
        Window, overlap, scaling and number of averages.
    """

    output_names: tuple[str, ...]
    frequency_hz: FloatArray
    input_psd: FloatArray
    output_psd: FloatArray
    cross_psd: ComplexArray
    normalisation: Normalisation

    @property
    def h1(self) -> ComplexArray:
        """S_xy/S_xx: unbiased by noise of the outputs."""
        return np.asarray(self.cross_psd / _positive(self.input_psd))

    @property
    def h2(self) -> ComplexArray:
        """S_yy/S_yx: unbiased by noise of the input."""
        size = np.abs(self.cross_psd)
        safe = np.where(size > 0, size, 1.0)
        # S_yy S_xy/|S_xy|² in two steps: the square of a small density would underflow
        ratio = self.cross_psd / safe * (self.output_psd / safe)
        return np.asarray(np.where(size > 0, ratio, np.nan))

    @property
    def coherence(self) -> FloatArray:
        """γ² = |S_xy|²/(S_xx S_yy), between 0 and 1."""
        return np.asarray(np.abs(self.cross_psd) ** 2 / _positive(self.input_psd * self.output_psd))

    @property
    def output_psd_interval(self) -> FloatArray:
        """Ends of the 90 % intervals of S_yy, shape (2, n_outputs, n_lines)."""
        # real and imaginary part of every averaged line count
        n_free = 2 * self.normalisation.n_effective_averages
        tails = chi2.ppf([0.5 + CONFIDENCE / 2, 0.5 - CONFIDENCE / 2], n_free)
        return np.asarray(n_free / tails[:, None, None] * self.output_psd[None])

    @property
    def h1_radius(self) -> FloatArray:
        """Radius of the circle around H₁ that holds the true value in 90 % of repeats (Bendat and Piersol).

        Infinite with fewer than two effective averages.
        """
        # two of the degrees of freedom go into the real and the imaginary part of H₁
        n_free = 2 * self.normalisation.n_effective_averages - 2
        if n_free <= 0:
            return np.full(self.output_psd.shape, np.inf)
        ratio = 2 / n_free * fisher_f.ppf(CONFIDENCE, 2, n_free)
        noise = np.maximum(1 - self.coherence, 0.0) * self.output_psd / _positive(self.input_psd)
        return np.asarray(np.sqrt(ratio * noise))

    @property
    def h1_std(self) -> FloatArray:
        """Standard error of the real and of the imaginary part of H₁, shape (n_outputs, n_lines)."""
        n_free = max(2 * self.normalisation.n_effective_averages - 2, 1e-3)
        noise = np.maximum(1 - self.coherence, 0.0) * self.output_psd / _positive(self.input_psd)
        return np.asarray(np.sqrt(noise / n_free))

    def of_outputs(self, rows: Sequence[int]) -> Spectra:
        """A copy with some of the outputs."""
        chosen = list(rows)
        return dataclasses.replace(
            self,
            output_names=tuple(self.output_names[row] for row in chosen),
            output_psd=self.output_psd[chosen],
            cross_psd=self.cross_psd[chosen],
        )

    def to_dataset(self) -> xr.Dataset:
        """Densities, H₁ and H₂ in real and imaginary part, coherence and intervals over ``line_hz``."""
        both = ("output", "line_hz")
        low, high = self.output_psd_interval
        variables = {
            "input_psd": ("line_hz", self.input_psd),
            "output_psd": (both, self.output_psd),
            "output_psd_low": (both, low),
            "output_psd_high": (both, high),
            "frf_h1_real": (both, self.h1.real),
            "frf_h1_imag": (both, self.h1.imag),
            "frf_h1_radius": (both, self.h1_radius),
            "frf_h2_real": (both, self.h2.real),
            "frf_h2_imag": (both, self.h2.imag),
            "coherence": (both, self.coherence),
        }
        coordinates = {
            "line_hz": ("line_hz", self.frequency_hz),
            "output": ("output", np.array(self.output_names, dtype=object)),
        }
        return described(xr.Dataset(variables, coordinates)).assign_attrs(self.normalisation.attributes)


def random_spectra(
    excitation: FloatArray,
    responses: FloatArray,
    sampling_rate_hz: float,
    *,
    segment_length: int,
    overlap: float = 0.5,
    output_names: tuple[str, ...] | None = None,
) -> Spectra:
    """Welch spectra of a random run.

    Parameters
    ----------
    excitation : ndarray, shape (n,)
        Input, for example the acceleration of the root.
    responses : ndarray, shape (n_outputs, n)
        Outputs on the same samples.
    sampling_rate_hz : float
        Samples per second.
    segment_length : int
        Samples per segment; lines are ``sampling_rate_hz / segment_length`` apart, which must be well below the
        half-power bandwidth 2ζf of the modes, or peaks come out too broad.
    overlap : float
        0 … 0.9.
    output_names : tuple of str, optional
        Default: ``output 1`` …

    Returns
    -------
    Spectra

    Raises
    ------
    AnalysisError
        If lengths differ, or fewer than two segments without gaps fit.
    """
    x = np.asarray(excitation, dtype=np.float64)
    y = np.atleast_2d(np.asarray(responses, dtype=np.float64))
    if x.ndim != 1 or y.shape[1] != x.size or not 0 <= overlap <= 0.9 or not 8 <= segment_length <= x.size:
        raise AnalysisError(
            "random run",
            got=f"{x.shape} and {y.shape} samples, overlap {overlap}, segments of {segment_length} samples",
            allowed="equal lengths, overlap 0 … 0.9, segments of at least 8 samples of which at least 2 fit",
            remedy="take other segments or record longer",
        )
    window = np.hanning(segment_length + 1)[:-1]
    hop = max(1, round(segment_length * (1 - overlap)))
    n_used, sums = 0, np.zeros((2 * y.shape[0] + 1, segment_length // 2 + 1), dtype=np.complex128)
    for start in range(0, x.size - segment_length + 1, hop):
        part = slice(start, start + segment_length)
        # a segment with a gap in any channel is left out for all: H₁ needs both from the same instants
        block = np.vstack([x[None, part], y[:, part]])
        if np.isfinite(block).all():
            sums += _segment_products(block, window)
            n_used += 1
    if n_used < 2:
        raise AnalysisError(
            "random run",
            got=f"{n_used} segments of {segment_length} samples without gaps in {x.size} samples",
            allowed="at least 2",
            remedy="take shorter segments or record longer",
        )
    # one-sided: the negative frequencies are added to the positive ones
    density = 2 * sums / (n_used * sampling_rate_hz * (window**2).sum())
    # the line at half the sampling rate has no negative partner
    if segment_length % 2 == 0:
        density[:, -1] /= 2
    n_outputs = y.shape[0]
    names = output_names or tuple(f"output {n}" for n in range(1, n_outputs + 1))
    return Spectra(
        output_names=names,
        # without the mean, which was taken out of every segment
        frequency_hz=np.arange(1, density.shape[1]) * sampling_rate_hz / segment_length,
        input_psd=density[0, 1:].real,
        output_psd=density[1 : n_outputs + 1, 1:].real,
        cross_psd=density[n_outputs + 1 :, 1:],
        normalisation=_normalisation(window, hop, n_used, overlap, sampling_rate_hz),
    )


def hann_line_shape(line_spacing_hz: float) -> tuple[FloatArray, FloatArray]:
    """Offsets [Hz] and shares of the line shape of a Hann window.

    The expectation of a density is the true one smoothed by |W|²; for a Hann window |W(u)|² ∝ (sinc u/(1 − u²))²,
    u in lines.

    Parameters
    ----------
    line_spacing_hz : float
        Distance of lines.

    Returns
    -------
    tuple of ndarray

    Examples
    --------
    >>> offsets, shares = hann_line_shape(0.1)
    >>> round(float(shares.sum()), 12), round(float(offsets.max()), 12)
    (1.0, 0.4)
    """
    points = _LINE_SHAPE_POINTS
    # 0/0 one line off the middle, where the limit is 1/4
    u = np.where(np.abs(np.abs(points) - 1) < 1e-9, points + 1e-6, points)
    shape = (np.sinc(u) / (1 - u**2)) ** 2
    return points * line_spacing_hz, shape / shape.sum()


def _segment_products(block: FloatArray, window: FloatArray) -> ComplexArray:
    """|X|², |Y|² of each output and X*Y of each output, shape (1 + 2 n_outputs, n_lines)."""
    spectra = np.fft.rfft((block - block.mean(axis=1, keepdims=True)) * window, axis=1)
    power = (np.abs(spectra) ** 2).astype(np.complex128)
    return np.vstack([power, spectra[0].conj() * spectra[1:]])


def _normalisation(
    window: FloatArray, hop: int, n_segments: int, overlap: float, sampling_rate_hz: float
) -> Normalisation:
    length, energy = window.size, float((window**2).sum())
    shifts = range(1, min(n_segments, -(-length // hop)))
    correlations = [(j, float((window[: -j * hop] * window[j * hop :]).sum()) / energy) for j in shifts]
    # Welch (1967): overlapping segments share samples, so that they count for less than their number
    inflation = 1 + 2 * sum((1 - j / n_segments) * rho**2 for j, rho in correlations)
    return Normalisation(
        window="hann",
        segment_length=length,
        overlap=overlap,
        n_segments=n_segments,
        n_effective_averages=n_segments / inflation,
        line_spacing_hz=sampling_rate_hz / length,
        effective_bandwidth_hz=sampling_rate_hz * energy / float(window.sum()) ** 2,
    )


def _positive(values: FloatArray) -> FloatArray:
    return np.maximum(values, np.finfo(float).tiny)
