"""Noise of accelerometers that drive a simulation: how it is spread over frequencies, and draws of it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from sloshlab.identification.case import CaseRun
from sloshlab.identification.observations import noise_of_sensor

FloatArray = NDArray[np.float64]
_MOST_OF_STATED: Final = 2.0
"""Over a sensor's noise: drives of repeats that differ by more were not the same."""
_SECONDS_OF_A_SPECTRUM: Final = 4.0
_FEWEST_LINES: Final = 3


@dataclass(frozen=True, eq=False)
class NoiseSpectrum:
    """Spectrum of a sensor's noise over that of white noise of the same sensor, at least one.

    Attributes
    ----------
    frequencies_hz, ratios : array, shape (n,)
    """

    frequencies_hz: FloatArray
    ratios: FloatArray

    def drawn(self, run: CaseRun, name: str, generator: np.random.Generator) -> FloatArray:
        """Noise of a channel as it may have been, shape (n,).

        Parameters
        ----------
        run : CaseRun
        name : str
            Of the channel.
        generator : Generator
        """
        white = noise_of_sensor(run, name) * generator.standard_normal(run.recording[name].size)
        return self.coloured(white, run.attributes.sampling_rate_hz)

    def coloured(self, white: FloatArray, rate_hz: float) -> FloatArray:
        """White noise filtered to have this spectrum, shape (n,)."""
        at = np.interp(np.fft.rfftfreq(white.size, 1 / rate_hz), self.frequencies_hz, self.ratios)
        return np.asarray(np.fft.irfft(np.fft.rfft(white) * np.sqrt(at), white.size))


WHITE: Final = NoiseSpectrum(np.zeros(1), np.ones(1))
"""Of a sensor of which repeats tell nothing."""


def noise_spectrum(tests: Sequence[Sequence[CaseRun]], name: str) -> NoiseSpectrum:
    """Spectrum of a driving sensor's noise, from repeats whose drives differ by no more than noise.

    Noise of accelerometers and amplifiers grows towards low frequencies, where structures resonate (two to ten
    times the stated density there); the stated noise, or that of the quietest bands, is that of high frequencies.

    Parameters
    ----------
    tests : sequence of sequences of CaseRun
        Runs of each test.
    name : str
        Of the channel.
    """
    ratios: list[FloatArray] = []
    frequencies: FloatArray = np.zeros(1)
    for test in tests:
        # Only repeats tell noise from motion; runs of other tests move otherwise.
        for first, other in itertools.pairwise(run for run in test if name in run.recording and not run.is_free):
            rate = first.attributes.sampling_rate_hz
            a, b = (np.asarray(run.recording[name].values, np.float64) for run in (first, other))
            std = max(noise_of_sensor(first, name), noise_of_sensor(other, name))
            if a.size != b.size or rate != other.attributes.sampling_rate_hz or not std > 0:
                continue
            # The signal of repeats cancels; the noise of two independent readings adds.
            difference = (a - b) / np.sqrt(2)
            # Drives that were not repeated exactly would be taken for noise.
            if not np.isfinite(difference).all() or difference.std() > _MOST_OF_STATED * std:
                continue
            n = min(a.size, round(_SECONDS_OF_A_SPECTRUM * rate))
            frequency, density = welch(difference, rate, nperseg=n)
            if ratios and density.shape != ratios[0].shape:
                continue
            frequencies = frequency
            # 2σ²/f_s is the one-sided density of white noise of this standard deviation.
            ratios.append(density / (2 * std**2 / rate))
    if not ratios:
        return WHITE
    mean = np.mean(ratios, axis=0)
    # Averaged over an octave: a periodogram of few segments scatters by its own size.
    low = np.minimum(np.searchsorted(frequencies, frequencies / np.sqrt(2)), frequencies.size - _FEWEST_LINES)
    high = np.maximum(np.searchsorted(frequencies, frequencies * np.sqrt(2)), low + _FEWEST_LINES)
    sums = np.concatenate([[0.0], np.cumsum(mean)])
    high = np.minimum(high, mean.size)
    # Never below one: the stated noise, that of high frequencies, is the least.
    return NoiseSpectrum(frequencies, np.maximum((sums[high] - sums[low]) / (high - low), 1.0))
