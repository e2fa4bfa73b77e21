"""Frequencies and damping ratios from frequency responses: vector fit, then least squares with its covariance.

The vector fit finds the poles; a few Gauss–Newton steps on poles and residues together make the fit the weighted
least-squares one, whose covariance gives the intervals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.stats import norm
from scipy.stats import t as student_t

from sloshlab.errors import AnalysisError
from sloshlab.modal.instantaneous_damping import CONFIDENCE, damping_ratio_of
from sloshlab.modal.spectra import HANN_LINE_CORRELATIONS, Spectra, hann_line_shape
from sloshlab.modal.vector_fitting import RationalFit, vector_fit
from sloshlab.quantities import described

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

_N_STEPS = 8


@dataclass(frozen=True)
class ModalFit:
    """Modes of a rational fit, by frequency.

    Attributes
    ----------
    frequency_hz, frequency_hz_std : ndarray, shape (n_modes,)
        |p|/2π, the undamped frequency, and its standard error.
    damping_ratio, damping_ratio_std : ndarray, shape (n_modes,)
        −Re p/|p|, positive = stable, and its standard error.
    coverage_factor : float
        Half width of the 90 % interval in standard errors.
    residues : ndarray of complex, shape (n_outputs, n_modes)
        Of the poles with positive imaginary part.
    half_power_width_in_lines : ndarray, shape (n_modes,)
        2ζf over the distance of lines; below about 2 a random run is too short to tell ζ.
    line_hz : ndarray, shape (n_lines,)
        Lines that were fitted.
    modelled : ndarray of complex, shape (n_outputs, n_lines)
        The fitted responses there, seen through the line shape of the window where the data were.
    fit : RationalFit
        The vector fit that the least squares started from.
    """

    frequency_hz: FloatArray
    frequency_hz_std: FloatArray
    damping_ratio: FloatArray
    damping_ratio_std: FloatArray
    coverage_factor: float
    residues: ComplexArray
    half_power_width_in_lines: FloatArray
    line_hz: FloatArray
    modelled: ComplexArray
    fit: RationalFit

    @property
    def damping_ratio_interval(self) -> FloatArray:
        """Ends of the 90 % intervals of ζ, shape (2, n_modes)."""
        half = self.coverage_factor * self.damping_ratio_std
        return np.stack([self.damping_ratio - half, self.damping_ratio + half])

    @property
    def frequency_interval_hz(self) -> FloatArray:
        """Ends of the 90 % intervals of the frequency [Hz], shape (2, n_modes)."""
        half = self.coverage_factor * self.frequency_hz_std
        return np.stack([self.frequency_hz - half, self.frequency_hz + half])

    def to_dataset(self) -> xr.Dataset:
        """Frequencies, damping ratios and intervals over ``mode_number``."""
        along = "mode_number"
        variables = {
            "natural_frequency_hz": (along, self.frequency_hz),
            "natural_frequency_hz_std": (along, self.frequency_hz_std),
            "natural_frequency_low_hz": (along, self.frequency_interval_hz[0]),
            "natural_frequency_high_hz": (along, self.frequency_interval_hz[1]),
            "damping_ratio": (along, self.damping_ratio),
            "damping_ratio_std": (along, self.damping_ratio_std),
            "damping_ratio_low": (along, self.damping_ratio_interval[0]),
            "damping_ratio_high": (along, self.damping_ratio_interval[1]),
            "half_power_width_in_lines": (along, self.half_power_width_in_lines),
        }
        return described(xr.Dataset(variables, {along: np.arange(1, self.frequency_hz.size + 1)}))


def modal_fit(
    frequency_hz: FloatArray,
    response: ComplexArray,
    *,
    n_modes: int,
    response_std: FloatArray | None = None,
    hann_lines: bool = False,
    n_extra_pairs: int = 0,
) -> ModalFit:
    """Modes common to several frequency responses.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n_lines,)
        Equally spaced frequencies > 0 around the modes.
    response : ndarray of complex, shape (n_outputs, n_lines)
        Frequency responses.
    n_modes : int
        Modes asked for.
    response_std : ndarray, shape (n_outputs, n_lines), optional
        Standard error of the real and of the imaginary part; default: equal errors, estimated from the residual.
    hann_lines : bool
        The responses were averaged over the line shape of a Hann window (`random_spectra`): so is the model,
        and the errors of neighbouring lines are correlated.
    n_extra_pairs : int
        Pairs of poles beyond the modes, for what lies outside the band; the least damped are kept as modes.

    Returns
    -------
    ModalFit

    Raises
    ------
    AnalysisError
        If the lines are too few, or fewer complex poles than modes are found.

    Examples
    --------
    >>> f = np.linspace(5, 15, 300)
    >>> omega, s = 2 * np.pi * 10.0, 2j * np.pi * f
    >>> found = modal_fit(f, 1 / (s**2 + 2 * 0.02 * omega * s + omega**2), n_modes=1)
    >>> round(float(found.frequency_hz[0]), 6), round(float(found.damping_ratio[0]), 6)
    (10.0, 0.02)
    """
    h = np.atleast_2d(np.asarray(response, dtype=np.complex128))
    f = np.asarray(frequency_hz, dtype=np.float64)
    weights = np.ones(h.shape) if response_std is None else 1 / _floored(np.atleast_2d(response_std))
    # the vector fit needs no start near the poles, but minimises a linearised error; the least squares below
    # start from it
    fit = vector_fit(f, h, n_pole_pairs=n_modes + n_extra_pairs, weights=weights)
    pairs = fit.poles.imag > 0
    if pairs.sum() < n_modes:
        raise AnalysisError(
            "modal fit",
            got=f"{int(pairs.sum())} oscillating modes between {f.min():.4g} and {f.max():.4g} Hz",
            allowed=f"the {n_modes} asked for",
            remedy="ask for fewer modes, widen the frequency range, or give extra pairs",
        )
    kernel = hann_line_shape(float(np.median(np.diff(f)))) if hann_lines else (np.zeros(1), np.ones(1))
    refined = _least_squares(f, h, weights, fit, kernel)
    poles = refined.poles
    own = np.flatnonzero(poles.imag > 0)
    # the least damped are modes: pairs beyond them stand for what lies outside of the band
    own = own[np.argsort(-poles.real[own] / np.abs(poles[own]), kind="stable")[:n_modes]]
    own = own[np.argsort(np.abs(poles[own]))]
    return _modes(refined, own, fit, f, known_errors=response_std is not None)


def modal_fit_of_spectra(
    spectra: Spectra,
    *,
    n_modes: int,
    frequency_range_hz: tuple[float, float] | None = None,
    n_extra_pairs: int = 0,
) -> ModalFit:
    """Modes of a random run from H₁, weighted by its standard errors.

    Parameters
    ----------
    spectra : Spectra
        From `sloshlab.modal.spectra.random_spectra`.
    n_modes : int
        Modes in the range.
    frequency_range_hz : tuple of float, optional
        Lines that are used; default all.
    n_extra_pairs : int
        See `modal_fit`.

    Returns
    -------
    ModalFit
    """
    low, high = frequency_range_hz or (0.0, np.inf)
    lines = (spectra.frequency_hz >= low) & (spectra.frequency_hz <= high)
    return modal_fit(
        spectra.frequency_hz[lines],
        spectra.h1[:, lines],
        n_modes=n_modes,
        response_std=spectra.h1_std[:, lines],
        hann_lines=True,
        n_extra_pairs=n_extra_pairs,
    )


def _floored(std: FloatArray) -> FloatArray:
    """Standard errors, none smaller than a thousandth of the median: coherence 1 is no proof of no error."""
    positive = std[std > 0]
    floor = 1e-3 * float(np.median(positive)) if positive.size else 1.0
    return np.maximum(np.asarray(std, dtype=np.float64), floor)


@dataclass(frozen=True)
class _Refined:
    """Poles and residues [rad/s] after the least squares, and what they make of the lines.

    `covariance` is that of Re p and Im p of all poles, shape (2 n_poles, 2 n_poles); `n_free` counts the degrees
    of freedom of the residual.
    """

    poles: ComplexArray
    residues: ComplexArray
    modelled: ComplexArray
    covariance: FloatArray
    n_free: int


def _least_squares(
    f: FloatArray, h: ComplexArray, weights: FloatArray, fit: RationalFit, kernel: tuple[FloatArray, FloatArray]
) -> _Refined:
    """Gauss–Newton on poles, residues and constants together; a step that makes the fit worse is taken back."""
    # in units of the highest frequency, so that poles and residues are of size one
    scale = 2 * np.pi * float(f.max())
    offsets, shares = kernel
    # the model is averaged over the line shape: a mode as narrow as a line would come out too strongly damped
    s = np.asarray(2j * np.pi * (f[:, None] + offsets) / scale, dtype=np.complex128)
    found = (
        np.asarray(fit.poles / scale, dtype=np.complex128),
        np.asarray(fit.residues / scale, dtype=np.complex128),
        fit.constant.astype(np.complex128),
    )
    blocks, error = _linearised(s, shares, h, weights, found)
    for _ in range(_N_STEPS):
        change = np.asarray(np.linalg.lstsq(blocks, _stacked(weights * error), rcond=None)[0], dtype=np.float64)
        moved = _moved(found, change)
        moved_blocks, moved_error = _linearised(s, shares, h, weights, moved)
        before, after = (float((np.abs(weights * residual) ** 2).sum()) for residual in (error, moved_error))
        # the model it ends with is the last one that was better
        if after > before * (1 - 1e-12):
            break
        found, blocks, error = moved, moved_blocks, moved_error
    poles, residues, _ = found
    # the rank, not the number of columns: real poles have columns of zeros for their imaginary parts
    n_free = max(2 * h.size - int(np.linalg.matrix_rank(blocks)), 1)
    # sandwich: neighbouring lines of a Hann window are correlated, which the inverse of JᵀJ alone does not know
    bread = np.linalg.pinv(blocks.T @ blocks, rcond=1e-18)
    scatter = _scatter(blocks.reshape(-1, f.size, blocks.shape[1]), offsets.size > 1)
    cost = float((np.abs(weights * error) ** 2).sum())
    covariance = (bread @ scatter @ bread)[: 2 * poles.size, : 2 * poles.size] * cost / n_free
    return _Refined(poles * scale, residues * scale, h - error, covariance * scale**2, n_free)


def _moved(
    found: tuple[ComplexArray, ComplexArray, ComplexArray], change: FloatArray
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Poles, residues and constants after a step; real poles stay real."""
    poles, residues, constant = found
    n, paired = poles.size, poles.imag != 0
    own = change[2 * n :].reshape(residues.shape[0], 2 * n + 1)
    return (
        poles + change[:n] + 1j * np.where(paired, change[n : 2 * n], 0.0),
        residues + own[:, :n] + 1j * np.where(paired, own[:, n : 2 * n], 0.0),
        constant + own[:, -1],
    )


def _stacked(rows: ComplexArray) -> FloatArray:
    """Real and imaginary part of each output behind each other."""
    return np.concatenate([part for row in rows for part in (row.real, row.imag)])


def _scatter(blocks: FloatArray, hann_lines: bool) -> FloatArray:
    """Covariance of Jᵀe for errors e of variance 1, correlated between neighbouring lines of a Hann window.

    `blocks` has the shape (real and imaginary parts of all outputs, n_lines, n_parameters).
    """
    total = np.einsum("blp,blq->pq", blocks, blocks)
    for apart, correlation in enumerate(HANN_LINE_CORRELATIONS if hann_lines else (), start=1):
        shifted = correlation * np.einsum("blp,blq->pq", blocks[:, apart:], blocks[:, :-apart])
        total = total + shifted + shifted.T
    return np.asarray(total, dtype=np.float64)


def _linearised(
    s: ComplexArray,
    shares: FloatArray,
    h: ComplexArray,
    weights: FloatArray,
    found: tuple[ComplexArray, ComplexArray, ComplexArray],
) -> tuple[FloatArray, ComplexArray]:
    """Weighted Jacobian over Re p, Im p of all poles, then Re r, Im r, d of each output; error of each output."""
    poles, residues, constant = found
    n, n_outputs = poles.size, h.shape[0]
    pair = (poles.imag != 0).astype(float)
    # s holds the points of the line shape of each line, shape (n_lines, n_points)
    # a pole and its conjugate, which a real pole does not have
    single, partner = 1 / (s[:, :, None] - poles), pair / (s[:, :, None] - poles.conj())
    plus, minus = (np.einsum("lkp,k->lp", fraction, shares) for fraction in (single, partner))
    plus_squared, minus_squared = (np.einsum("lkp,k->lp", fraction**2, shares) for fraction in (single, partner))
    rows, errors = [], []
    for output in range(n_outputs):
        r = residues[output]
        first, second = r * plus_squared, r.conj() * minus_squared
        block = np.zeros((s.shape[0], 2 * n + n_outputs * (2 * n + 1)), dtype=np.complex128)
        block[:, :n], block[:, n : 2 * n] = first + second, pair * 1j * (first - second)
        start = 2 * n + output * (2 * n + 1)
        block[:, start : start + n] = plus + minus
        block[:, start + n : start + 2 * n] = pair * 1j * (plus - minus)
        block[:, start + 2 * n] = 1.0
        errors.append(h[output] - plus @ r - minus @ r.conj() - constant[output])
        weighted = weights[output][:, None] * block
        rows += [weighted.real, weighted.imag]
    return np.vstack(rows), np.array(errors)


def _modes(
    refined: _Refined, own: npt.NDArray[np.intp], fit: RationalFit, f: FloatArray, *, known_errors: bool
) -> ModalFit:
    poles, n = refined.poles, refined.poles.size
    decay, omega = -poles[own].real, poles[own].imag
    damping, _ = damping_ratio_of(decay, omega, np.zeros(own.size), np.zeros(own.size))
    size = np.abs(poles[own])
    damping_std, frequency_std = [], []
    for index, s, w, modulus in zip(own, decay, omega, size, strict=True):
        part = refined.covariance[np.ix_([index, n + index], [index, n + index])]
        # ζ = −Re p/|p| and f = |p|/2π, derived by Re p and Im p
        to_damping = np.array([-(w**2), -s * w]) / modulus**3
        to_frequency = np.array([-s, w]) / modulus / (2 * np.pi)
        damping_std.append(np.sqrt(max(to_damping @ part @ to_damping, 0.0)))
        frequency_std.append(np.sqrt(max(to_frequency @ part @ to_frequency, 0.0)))
    tail = 0.5 + CONFIDENCE / 2
    # errors that were estimated from the residual need Student's quantile
    quantile = norm.ppf(tail) if known_errors else student_t.ppf(tail, refined.n_free)
    frequency = size / (2 * np.pi)
    spacing = float(np.median(np.diff(f)))
    return ModalFit(
        frequency_hz=frequency,
        frequency_hz_std=np.array(frequency_std),
        damping_ratio=damping,
        damping_ratio_std=np.array(damping_std),
        coverage_factor=float(quantile),
        residues=refined.residues[:, own],
        half_power_width_in_lines=2 * damping * frequency / spacing,
        line_hz=f,
        modelled=refined.modelled,
        fit=fit,
    )
