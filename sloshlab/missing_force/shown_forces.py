"""Missing forces of some runs as others are compared with them: over their noise, without what is linear there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import orth

from sloshlab.missing_force.latent_force import LatentForce

FloatArray = NDArray[np.float64]
MOST_OF_NOISE: Final = 2.0
"""Squares over those expected of noise, up to which there may be nothing but noise: as much again."""
_STRETCH_S: Final = 0.5
_LINES_OF_A_CELL: Final = 4
"""Two hertz apart: cells in which amplitudes are compared, as long as the blocks of a short-time spectrum."""


class ShownForces:
    """Missing forces of some runs as others are compared with them.

    Parameters
    ----------
    forces : sequence of LatentForce
        One per run.
    moved : sequence of sequences of LatentForce
        Of every place at which the baseline may be off, one per run; none where it is as it should be.

    Attributes
    ----------
    whiteners : list of Whitener
        One per run.
    missing : ndarray
        Whitened, all runs one after the other, without what a spring, a damper, a mass and a constant force of
        these places could do that are the same in all runs.
    noise : float
        Squares that are expected of noise alone.
    """

    def __init__(self, forces: Sequence[LatentForce], moved: Sequence[Sequence[LatentForce]]) -> None:
        self.whiteners = [Whitener(force) for force in forces]
        self._linear = _linear(self.whiteners, moved)
        known = zip(forces, self.whiteners, strict=True)
        self.missing = self._without_linear(
            np.concatenate([whitener.of_regularised(force.force_n) for force, whitener in known])
        )
        self.noise = sum(whitener.noise for whitener in self.whiteners)

    @property
    def is_more_than_noise(self) -> bool:
        """Whether the squares of what is missing are more than those of noise besides those of noise."""
        return float(self.missing @ self.missing) > MOST_OF_NOISE * self.noise

    def compared(self, series: Sequence[FloatArray]) -> FloatArray:
        """Forces of all runs as the missing ones are.

        Parameters
        ----------
        series : sequence of ndarray
            From the start of each run.
        """
        of_runs = zip(series, self.whiteners, strict=True)
        return self._without_linear(np.concatenate([whitener.whitened(each) for each, whitener in of_runs]))

    def _without_linear(self, series: FloatArray) -> FloatArray:
        return np.asarray(series - self._linear @ (self._linear.T @ series))


def _linear(whiteners: Sequence[Whitener], moved: Sequence[Sequence[LatentForce]]) -> FloatArray:
    """Orthonormal columns of what is linear in the motion of some places, the same in all runs, and of a constant
    force.
    """
    if not moved:
        return np.empty((sum(whitener.n_values for whitener in whiteners), 0))
    of_runs = []
    for whitener, *places in zip(whiteners, *moved, strict=True):
        motions = [np.concatenate([place.motion_before, place.motion]) for place in places]
        columns = [*(column for motion in motions for column in motion.T), np.ones(len(motions[0]))]
        of_runs.append(np.stack([whitener.whitened(column) for column in columns], axis=1))
    linear = np.concatenate(of_runs)
    # Both places move alike where the base does not.
    return np.asarray(orth(linear / np.maximum(np.abs(linear).max(axis=0), 1e-300)))


class Whitener:
    """Spectra of forces of one run over the noise of the missing one, real parts before imaginary ones.

    Squares add up to as many as there are samples for noise that the regularisation leaves whole.

    Parameters
    ----------
    force : LatentForce
    """

    def __init__(self, force: LatentForce) -> None:
        self._kept = slice(len(force.motion_before), len(force.motion_before) + len(force.motion))
        # Lengths of many small factors are transformed many times as fast.
        self._length, self._whole = (next_fast_len(2 * n, real=True) for n in (len(force.motion), self._kept.stop))
        known = (force.kept_share > 0) & (force.noise_power > 0)
        # The noise is that of a whole run, at half as many lines as that has padded samples.
        power = np.where(known, force.noise_power, 1.0) * self._length / (2 * (force.kept_share.size - 1))
        self._weights = _at_lines(np.where(known, 1.0 / np.sqrt(power), 0.0), self._length)
        self._share = _at_lines(np.where(known, force.kept_share, 0.0), self._whole)
        self._stretch = max(round(_STRETCH_S * force.run.attributes.sampling_rate_hz), 2 * _LINES_OF_A_CELL)

    @property
    def noise(self) -> float:
        """Squares that are expected of noise alone."""
        return float(self._kept.stop - self._kept.start) * float(np.mean(self._share**2))

    @property
    def n_values(self) -> int:
        """Of a whitened force."""
        return int(2 * (self._length // 2 + 1))

    def amplitudes(self, whitened: FloatArray) -> FloatArray:
        """Root of the power of a whitened force in cells of time and frequency."""
        real, imaginary = np.split(whitened, 2)
        series = irfft(real + 1j * imaginary, self._length)[: self._kept.stop - self._kept.start]
        n = min(self._stretch, series.size)
        stretches = series[: series.size // n * n].reshape(-1, n) * np.hanning(n)
        power = np.abs(rfft(stretches)) ** 2
        return np.sqrt(np.add.reduceat(power, np.arange(0, power.shape[1], _LINES_OF_A_CELL), axis=1)).ravel()

    def whitened(self, series: FloatArray) -> FloatArray:
        """Of a force as it acts, from the start of the run: what the regularisation took is no misfit."""
        regularised = irfft(self._share * rfft(series[: self._kept.stop], self._whole), self._whole)
        return self.of_regularised(regularised[self._kept])

    def of_regularised(self, series: FloatArray) -> FloatArray:
        """Of one that was regularised as the missing force was, as long as that."""
        spectrum = self._weights * rfft(series, self._length)
        return np.concatenate([spectrum.real, spectrum.imag])


def _at_lines(values: FloatArray, n_samples: int) -> FloatArray:
    """What is given at evenly spaced frequencies at those of a series of so many samples."""
    return np.interp(np.linspace(0.0, 1.0, n_samples // 2 + 1), np.linspace(0.0, 1.0, values.size), values)
