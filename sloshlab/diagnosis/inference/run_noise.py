r"""Noise of all channels of a run together, and the places at which something may show beside it.

The noise of an accelerometer that drives shows in all channels at once. In standard deviations of their noise, the
channels have the covariance

.. math:: \Sigma = I - \mathrm{diag}(D) + D, \qquad D_{cd} = \langle d_c d_d \rangle

with what draws d of that noise make of the channels, averaged over draws and neighbouring blocks of time. The
residuals are whitened by the inverse of its Cholesky root, and so is the transfer of every place.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from sloshlab.diagnosis.inference.places import ELSEWHERE, PLACES_IN_A_BAND, SENSOR, STRUCTURE, TANK, transfers_of
from sloshlab.identification.diagnosed_model import EXACT, DiagnosedModel, ModelOfBlocks
from sloshlab.identification.noise_floor import N_BLOCKS
from sloshlab.identification.observations import Observation
from sloshlab.identification.rig_model import RigModel

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
_REACH: Final = 2
"""Bands to either side of which a coefficient has power: the main lobe of its window, and its first side lobes."""
_N_DIRECTIONS: Final = 4
"""Of a transfer over a band: its value and its slope, real and imaginary."""
_CELL: Final = (4, 4)
"""Blocks and bands, two seconds and four hertz, within which powers and correlations are constant."""
_EXACT_BESIDE_CHAOS: Final = 0.05
"""As `EXACT`, where a liquid moves chaotically: to this its damping is believed to be that of the mean."""
_LARGEST_CORRELATION: Final = 0.95
"""Of the noise of two channels: sensors have noise of their own, which draws of the drive's do not contain."""


@dataclass(frozen=True, eq=False)
class RunNoise:
    """Noise and places of one run.

    Attributes
    ----------
    inverse_root : ndarray, shape (n_blocks, n_bands, n_channels, n_channels)
        Of the covariance of the channels; identity where their noise is independent.
    places : dict of str to (ndarray, ndarray)
        Projections of whitened channels on the directions in which a place shows, shape (n_blocks, n_bands, m,
        n_channels), and the share of its power in each, shape (n_blocks, n_bands, m).
    exactness : dict of str to float
        Of the simulated motion at each place, to which a simulation can describe the run.
    """

    inverse_root: FloatArray
    places: dict[str, tuple[FloatArray, FloatArray]]
    exactness: Mapping[str, float]

    def whitened(self, x: FloatArray) -> FloatArray:
        """Channels with independent noise.

        Parameters
        ----------
        x : ndarray, shape (n_channels, n_blocks, n_bands)
            In standard deviations.
        """
        return np.asarray(np.einsum("bkcd,dbk->cbk", self.inverse_root, x))


def run_noise(model: DiagnosedModel, observed: Sequence[Observation], values: Mapping[str, float]) -> RunNoise:
    """Noise and places of a run.

    Parameters
    ----------
    model : DiagnosedModel
    observed : sequence of Observation
    values : mapping
        Of the baseline, for the transfers of its structure.
    """
    covariance = _covariance(observed)
    inverse_root = np.linalg.inv(np.linalg.cholesky(covariance))
    n = len(observed)
    noise = np.sqrt(np.stack([each.variance for each in observed], axis=-1))
    places = {}
    transfers_at, spread = _transfers_over_bands(model, observed, values)
    scales = np.median(noise, axis=0)
    for place, transfers in transfers_at.items():
        parts = spread(transfers, scales)
        if parts.any():
            places[place] = _projections(inverse_root @ (parts[None] / noise[..., None]))
    if not isinstance(model, RigModel | ModelOfBlocks) and (n > 1 or STRUCTURE not in places):
        # A force on another coordinate of a user's own twin shows in any way in all channels.
        places[ELSEWHERE] = _projections(inverse_root)
    for i, each in enumerate(observed):
        places[f"{SENSOR} {each.channel}"] = _projections(inverse_root @ np.eye(n)[:, i : i + 1])
    is_chaotic = isinstance(model, RigModel) and model.liquid_fluctuates(observed[0].run)
    steady = set(places)
    if is_chaotic:
        # What the tank does not move, such as the acceleration of a driven table, knows no chaos of its liquid.
        is_moved = np.abs(transfers_at[TANK]).sum(axis=0) > 0
        steady = {f"{SENSOR} {each.channel}" for each, moved in zip(observed, is_moved, strict=True) if not moved}
    exactness = {place: EXACT if place in steady else _EXACT_BESIDE_CHAOS for place in places}
    return RunNoise(inverse_root, places, exactness)


def _transfers_over_bands(
    model: DiagnosedModel, observed: Sequence[Observation], values: Mapping[str, float]
) -> tuple[dict[str, ComplexArray], Callable[[ComplexArray, FloatArray], FloatArray]]:
    """Transfers of the places, and what makes directions of them, shape (n_bands, n_channels, m).

    A force has power at all frequencies of a band, and where a resonance is beside it shows as the resonance does:
    a coefficient has the covariance ∫ |W(f − f_k)|² Re(g gᴴ) df with the spectrum W of its window, a half sine
    of two bands, W(δ) ∝ cos(πδ)/(1 − 4δ²) with δ in bands.
    """
    if not isinstance(model, RigModel | ModelOfBlocks):
        # Real and imaginary part as two directions: the transform is real, and its phase runs.
        return transfers_of(model, observed, values), lambda g, _: np.stack([g.real, g.imag], axis=-1)
    bands_hz = observed[0].frequencies_hz
    width_hz = bands_hz[1] - bands_hz[0]
    n = PLACES_IN_A_BAND
    fine_hz = bands_hz[0] + width_hz * (np.arange(-_REACH * n, (bands_hz.size - 1 + _REACH) * n + 1) / n)
    offsets = np.arange(-_REACH * n, _REACH * n + 1) / n
    window = (np.sinc(offsets - 0.5) + np.sinc(offsets + 0.5)) ** 2

    def spread(transfers: ComplexArray, scales: FloatArray) -> FloatArray:
        powers = np.einsum("fc,fd->fcd", transfers, transfers.conj()).real
        within = np.lib.stride_tricks.sliding_window_view(powers, window.size, axis=0)[::n]
        covariance = within @ (window / window.sum()) / (scales[:, :, None] * scales[:, None, :])
        found, vectors = np.linalg.eigh(covariance)
        largest = slice(-min(_N_DIRECTIONS, found.shape[1]), None)
        sizes = np.sqrt(np.maximum(found[:, largest], 0.0))
        return np.asarray(vectors[:, :, largest] * sizes[:, None, :] * scales[:, :, None])

    # none at and below zero frequency
    return transfers_of(model, observed, values, np.maximum(fine_hz, 1e-3 * width_hz)), spread


def _covariance(observed: Sequence[Observation]) -> FloatArray:
    """Correlation of the noise of the channels, shape (n_blocks, n_bands, n_channels, n_channels)."""
    n, shape = len(observed), observed[0].spectra.shape
    covariance = np.broadcast_to(np.eye(n), (*shape, n, n)).copy()
    if any(each.of_drive is None for each in observed):
        return covariance
    drawn = np.stack([np.asarray(each.of_drive) / np.sqrt(each.variance) for each in observed])
    powers = [_steady(each**2) for each in drawn]
    for i in range(n):
        for j in range(i):
            # Draws larger than the noise of a channel say how it is shared, not how large it is.
            size = np.sqrt(np.maximum(powers[i], 1.0) * np.maximum(powers[j], 1.0))
            shared = np.clip(_steady(drawn[i] * drawn[j]) / size, -1.0, 1.0)
            covariance[..., i, j] = covariance[..., j, i] = _LARGEST_CORRELATION * shared
    return covariance


def _steady(drawn: FloatArray) -> FloatArray:
    """Mean over draws and neighbouring blocks, band by band: noise through a resonance is steady and narrow."""
    return np.asarray(uniform_filter1d(drawn.mean(axis=0), N_BLOCKS, axis=0, mode="nearest"))


def _projections(directions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Orthonormal directions of the columns of (…, n_channels, m) with the share of their power in each."""
    gram = np.swapaxes(directions, -1, -2) @ directions
    powers, vectors = np.linalg.eigh(gram)
    powers = np.maximum(powers, 0.0)
    largest = powers.max(axis=-1, keepdims=True)
    safe = np.where(powers > 1e-9 * largest, powers, np.inf)
    rows = np.swapaxes(directions @ vectors, -1, -2) / np.sqrt(safe)[..., None]
    total = powers.sum(axis=-1, keepdims=True)
    return rows, np.where(np.isfinite(safe), powers, 0.0) / np.where(total > 0, total, 1.0)


def sums_of_cells(values: FloatArray) -> FloatArray:
    """Sums over the cells of time and frequency; the last two axes are blocks and bands."""
    n_blocks, n_bands = values.shape[-2:]
    by_time = np.add.reduceat(values, np.arange(0, n_blocks, _CELL[0]), axis=-2)
    return np.asarray(np.add.reduceat(by_time, np.arange(0, n_bands, _CELL[1]), axis=-1))
