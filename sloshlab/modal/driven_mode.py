"""What a driven run shows without a model of the rig: its transfer function, and its largest mode."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import butter, cont2discrete, lfilter, sosfilt, ss2tf

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
_N_SEGMENTS: Final = 5
"""Of a driven run, overlapping by half: few for resolution, enough to see what does not follow the drive."""
_LEAST_DRIVE: Final = 1e-3
"""Power of the drive in a line over that in its largest one, from which the line counts as driven."""
_LEAST_RESONANCE: Final = 2.0
"""Largest transfer over the median of driven lines, from which a mode is sought: on a shaker there is none."""
N_BLOCKS: Final = 12
"""Of a driven run, whose scatter tells the error of its mode: each of two cycles at least."""
_SAMPLES_PER_CYCLE: Final = 6.0
"""Of the highest frequency in the band of a driven mode; the drive is a straight line between them."""
_STARTS_OF_DAMPING: Final = (0.005, 0.03)
"""Damping ratios from which a driven mode is sought: of a bare structure, and of one with a sloshing tank."""
_LARGEST_SHARE_LEFT: Final = 0.5
"""Of the power in the band of a mode: with more left than half, what is there is no single mode."""
LARGEST_STRETCH: Final = 0.25
"""Relative difference of frequencies up to which two runs show the same mode."""


@dataclass(frozen=True, eq=False)
class Transfer:
    """Response over drive per line, its variance, and where the drive has power."""

    frequency_hz: FloatArray
    value: ComplexArray
    variance: FloatArray
    is_driven: NDArray[np.bool_]


def transfer_of(pair: FloatArray, rate_hz: float) -> Transfer:
    """H = Σ Y X* / Σ |X|² over segments, its variance by what they do not share: Σ |X E/(1 − h)|² / (Σ |X|²)².

    E = Y − H X, with the leverage h = |X|² / Σ |X|² of a segment: in a sweep one segment alone drives a line, and
    leaves nothing there.
    """
    length = int(2 * pair.shape[1] / (_N_SEGMENTS + 1))
    window, starts = np.hanning(length), [i * (length // 2) for i in range(_N_SEGMENTS)]
    spectra = np.stack([np.fft.rfft(pair[:, i : i + length] * window) for i in starts])
    drive, response = spectra[:, 0], spectra[:, 1]
    power = (np.abs(drive) ** 2).sum(axis=0)
    is_driven = power > _LEAST_DRIVE * power.max()
    power = np.maximum(power, 1e-12 * power.max())
    value = (response * drive.conj()).sum(axis=0) / power
    leverage = np.minimum(np.abs(drive) ** 2 / power, 1.0 - 1e-6)
    left = (response - value * drive) / (1.0 - leverage)
    variance = (np.abs(drive * left) ** 2).sum(axis=0) / power**2
    lines = np.asarray(np.fft.rfftfreq(length, 1.0 / rate_hz), np.float64)
    return Transfer(lines, value, variance + 1e-300, is_driven)


def resonance_hz(first: Transfer, other: Transfer) -> float | None:
    """Where the two transfer functions together are largest among driven lines, if that stands out of them."""
    driven = np.flatnonzero(first.is_driven & other.is_driven & (first.frequency_hz > 0))
    if driven.size < 3:
        return None
    size = np.sqrt(np.abs(first.value * other.value)[driven])
    at = int(np.argmax(size))
    stands_out = 0 < at < driven.size - 1 and size[at] > _LEAST_RESONANCE * np.median(size)
    return float(first.frequency_hz[driven[at]]) if stands_out else None


@dataclass(frozen=True, eq=False)
class DrivenMode:
    """A mode as a driven run shows it.

    Attributes
    ----------
    frequency_hz, damping_ratio : float
    influence : ndarray, shape (n_blocks, 2)
        By how much what each block leaves moves both, relative to their values; sums to zero.
    """

    frequency_hz: float
    damping_ratio: float
    influence: FloatArray


def driven_mode(drive: FloatArray, response: FloatArray, rate_hz: float, *, near_hz: float) -> DrivenMode | None:
    """The mode near a frequency, by least squares of the response to the drive over the whole run.

    Parameters
    ----------
    drive, response : ndarray, shape (n,)
    rate_hz : float
    near_hz : float
        Within `LARGEST_STRETCH` of it.

    Returns
    -------
    DrivenMode or None
        None where a mode explains little that the drive itself does not.

    Notes
    -----
    Of q̈ + 2ζω q̇ + ω² q = u the response is a sum of q, q̇ and u, which other modes leave in its band, and of the
    free motion from the start of the run. All pass the same band-pass filter, so that the equation holds for what
    is left. Only ω and ζ are searched for, the sum is solved for (variable projection).
    """
    band = near_hz / (1 + LARGEST_STRETCH) / 1.3, near_hz * (1 + LARGEST_STRETCH) * 1.3
    if band[1] > 0.45 * rate_hz or near_hz * drive.size / rate_hz < 2 * N_BLOCKS:
        return None
    every = max(1, int(rate_hz / (_SAMPLES_PER_CYCLE * band[1])))
    impulse = np.zeros(drive.size)
    impulse[0] = 1.0
    sections = butter(2, band, "bandpass", fs=rate_hz, output="sos")
    u, y, start = (sosfilt(sections, values)[::every] for values in (drive, response, impulse))
    step_s, both = every / rate_hz, np.stack([u, start])

    def residual(numbers: FloatArray) -> FloatArray:
        basis = np.stack([*_of_mode(both, numbers, step_s), u], axis=1)
        basis /= np.maximum(np.abs(basis).max(axis=0), 1e-300)
        return np.asarray(y - basis @ np.linalg.lstsq(basis, y, rcond=1e-10)[0])

    # One start per line of the whole run: none is further than half a line from the minimum.
    n_starts = int(np.ceil(2 * LARGEST_STRETCH * near_hz * drive.size / rate_hz)) + 8
    frequencies = near_hz * np.linspace(1 - LARGEST_STRETCH, 1 + LARGEST_STRETCH, n_starts)
    starts = [np.log([2 * np.pi * f, ratio]) for f in frequencies for ratio in _STARTS_OF_DAMPING]
    best = min(starts, key=lambda numbers: float((residual(numbers) ** 2).sum()))
    lowest, highest = frequencies[[0, -1]]
    bounds = np.log([[2 * np.pi * lowest, 1e-5], [2 * np.pi * highest, 0.7]])
    found = least_squares(residual, best, bounds=bounds, x_scale=np.array([1e-3, 1e-1]))
    without = y - u * float(u @ y) / max(float(u @ u), 1e-300)
    if (found.fun**2).sum() > _LARGEST_SHARE_LEFT * (without**2).sum() or found.active_mask.any():
        return None
    frequency, ratio = float(np.exp(found.x[0]) / (2 * np.pi)), float(np.exp(found.x[1]))
    return DrivenMode(frequency, ratio, _influence(found.jac, found.fun))


def _of_mode(drives: FloatArray, numbers: FloatArray, step_s: float) -> FloatArray:
    """q and q̇ of a mode from rest under each drive, which is a straight line between samples; (2 n_drives, n)."""
    omega, ratio = np.exp(numbers)
    matrix = np.array([[0.0, 1.0], [-(omega**2), -2 * ratio * omega]])
    state = matrix, np.array([[0.0], [1.0]]), np.eye(2), np.zeros((2, 1))
    a, b, c, d, _ = cont2discrete(state, step_s, method="foh")
    numerators, denominator = ss2tf(a, b, c, d)
    return np.concatenate([lfilter(numerator, denominator, drives) for numerator in numerators])


def _influence(jacobian: FloatArray, residual: FloatArray) -> FloatArray:
    edges = np.linspace(0, residual.size, N_BLOCKS + 1).astype(int)
    scores = [jacobian[i:j].T @ residual[i:j] for i, j in itertools.pairwise(edges)]
    return np.asarray(np.stack(scores) @ np.linalg.pinv(jacobian.T @ jacobian))
