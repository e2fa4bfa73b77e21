r"""What a model leaves beside noise: *any force* of a block, *any error* of a sensor, as models of their own.

Residual spectra of all channels of a run, in standard deviations of their noise, are vectors x. Noise makes them
standard normal. A force f at a place of the structure adds g f to them, with the transfer g of the channels per
force; f is a Gaussian process whose power s is constant within a cell of time and frequency and otherwise free, so
that x has the covariance

.. math:: I + s\, \mathrm{Re}(g g^H) / |g|^2

(the transform is real and its phase runs, so that both quadratures of g count). An error of a sensor is the same
with g along its channel. The power is integrated over a log-uniform prior, together with the share π of cells that
have any. What is less of the simulated motion in a cell than a simulation is exact to (`RunNoise`), or than a law
is (`LAW`), belongs to the noise, and so does a burst, all bands of one sensor in a stretch of time.

So *something is left* is a model with a marginal likelihood like any other, per place. Latent forces as Gaussian
processes: Rogers and Friis (2022), doi:10.1016/j.ymssp.2022.109308; spike and slab: Mitchell and Beauchamp (1988),
doi:10.1080/01621459.1988.10478694.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.special import logsumexp, softmax

from sloshlab.diagnosis.inference.independent_residuals import IndependentResiduals, independent_residuals
from sloshlab.diagnosis.inference.places import SENSOR, block_of
from sloshlab.diagnosis.inference.run_noise import sums_of_cells
from sloshlab.diagnosis.inference.thresholds import LAW, PRIOR_OF_REMAINDER
from sloshlab.diagnosis.inference.whitened import WhitenedRun
from sloshlab.identification.free_run_problem import TEMPERING

FloatArray = NDArray[np.float64]
_POWERS: Final = np.geomspace(4.0, 4e6, 13)
"""In noise variances, two a decade: from twice the noise in amplitude, below which nothing is worth a word, to
what hides every noise (log-uniform prior)."""
SHARES: Final = np.array([0.01, 0.05, 0.2, 0.8])
"""Of cells that have a remainder: from bursts to everywhere."""
BURST: Final = 0.01
"""Share of the stretches of time in which a sensor has a burst of noise, of any power."""


@dataclass(frozen=True, eq=False)
class Remainder:
    """Log-likelihood of one model, cell by cell of time and frequency, and with a remainder at each place.

    Attributes
    ----------
    noise : ndarray, shape (n_cells,)
        With noise and bursts alone; the cells of all runs, one after the other.
    places : dict
        The same with any force, or any error of a sensor, at a place; shape (n_shares, n_cells).
    """

    noise: FloatArray
    places: dict[str, FloatArray]

    def gain(self, place: str) -> float:
        """Log evidence ratio of a remainder at a place over noise alone."""
        return float(logsumexp(self.places[place].sum(axis=1)) - np.log(SHARES.size) - self.noise.sum())

    @property
    def likeliest_place(self) -> str:
        """That of the largest gain; empty without any."""
        return max(self.places, key=self.gain, default="")

    @property
    def largest_gain(self) -> float:
        """Over all places."""
        return max((self.gain(place) for place in self.places), default=0.0)

    @property
    def is_probable(self) -> bool:
        """Whether a remainder at some place is more probable than noise and bursts alone."""
        return self.largest_gain / TEMPERING + float(np.log(PRIOR_OF_REMAINDER)) > 0


def remainder(
    runs: Sequence[WhitenedRun], missing: Sequence[WhitenedRun] = (), tests: Sequence[Sequence[str]] = ()
) -> Remainder:
    """What a model leaves.

    Parameters
    ----------
    runs : sequence of WhitenedRun
    missing : sequence of WhitenedRun, optional
        The same runs with nothing added, of which laws explain most; none for the baseline itself.
    tests : sequence of sequences of str, optional
        Names of the runs of every test: what its repeats share counts as one.
    """
    noise: list[FloatArray] = []
    per_run: list[dict[str, FloatArray]] = []
    for each in independent_residuals(runs, missing, tests):
        plain = sums_of_cells((-0.5 * each.residual**2).sum(axis=0) + each.log_density)
        gains = {place: _gains(each.residual, *directions) for place, directions in each.places.items()}
        small = {place: _POWERS[:, None, None] < power for place, power in _powers_of_inexactness(each).items()}
        # Noise, and what a simulation that is as exact as it can be leaves at any place.
        inexact = _log_mean(np.stack([_log_mean_of(gains[place], small[place]) for place in gains]))
        usual = np.logaddexp(np.log(0.5), np.log(0.5) + inexact)
        # A burst is noise of one sensor in all bands of a stretch of time.
        bursts = np.concatenate([gain for place, gain in gains.items() if block_of(place) == SENSOR])
        noise.append((plain + _or_burst(usual, bursts)).ravel())
        mixed = {place: _mixed(usual, _log_mean_of(gains[place], ~small[place])) for place in gains}
        per_run.append(
            {place: (plain + _or_burst(mixed[place], bursts)).reshape(SHARES.size, -1) for place in gains}
        )
    places = dict.fromkeys(place for found in per_run for place in found)
    return Remainder(
        np.concatenate(noise),
        {
            place: np.concatenate(
                [
                    found.get(place, np.broadcast_to(own, (SHARES.size, own.size)))
                    for found, own in zip(per_run, noise, strict=True)
                ],
                axis=1,
            )
            for place in places
        },
    )


def _or_burst(usual: FloatArray, bursts: FloatArray) -> FloatArray:
    """Log-likelihood ratios where each stretch of time may be a burst of a sensor, shape (…, n_times, n_bands).

    A burst has all bands of its stretch, so that only the sum over these has a likelihood; it is shared out among
    them as each expects of it (the lower bound of expectation maximisation, where it is exact).

    Parameters
    ----------
    usual : ndarray, shape (…, n_times, n_bands)
        Without a burst.
    bursts : ndarray, shape (n_bursts, n_times, n_bands)
        With each that is possible; all are as probable.
    """
    of_each = bursts.sum(axis=-1)
    burst = np.einsum("bt,btk->tk", softmax(of_each, axis=0), bursts)
    both = np.stack(np.broadcast_arrays(np.log1p(-BURST) + usual.sum(axis=-1), np.log(BURST) + _log_mean(of_each)))
    without, with_burst = softmax(both, axis=0)[..., None]
    expected = without * usual + with_burst * burst
    total = logsumexp(both, axis=0)
    return np.asarray(expected + ((total - expected.sum(axis=-1)) / expected.shape[-1])[..., None])


def _powers_of_inexactness(each: IndependentResiduals) -> dict[str, FloatArray]:
    """Power that a simulation may leave at each place, in noise variances, per cell of time and frequency."""
    found = {}
    for place, (projections, _) in each.places.items():
        simulated = [_power_of_cells(signal, projections) for signal in each.simulated]
        found[place] = each.exactness[place] ** 2 * np.sum(simulated, axis=0)
        for signal in each.lacking:
            # A law that is off by a little leaves it elsewhere, too, such as at multiples of a frequency.
            shown = _power(signal, projections)[each.is_informative]
            everywhere = float(shown.mean()) if shown.size else 0.0
            found[place] = found[place] + LAW**2 * np.maximum(_power_of_cells(signal, projections), everywhere)
        if each.diverging:
            # The motion of the rig is one more of those that are as likely, which part at other times; by contacts
            # in other bands, too.
            powers = [_power_of_cells(difference, projections) for difference in each.diverging]
            found[place] = found[place] + maximum_filter1d(np.max(powers, axis=(0, 1)), 3)
    return found


def _gains(x: FloatArray, projections: FloatArray, shares: FloatArray) -> FloatArray:
    """Log-likelihood ratios of every power over none, shape (n_powers, cells of time, cells of frequency)."""
    along = np.einsum("bkmc,cbk->bkm", projections, x) ** 2
    gains = []
    for power in _POWERS:
        size = power * shares
        gains.append(sums_of_cells((-0.5 * np.log1p(size) + 0.5 * along * (size / (1.0 + size))).sum(axis=-1)))
    return np.array(gains)


def _power(signal: FloatArray, projections: FloatArray) -> FloatArray:
    """Power of a signal at a place, shape (n_blocks, n_bands)."""
    return np.asarray((np.einsum("bkmc,cbk->bkm", projections, signal) ** 2).sum(axis=-1))


def _power_of_cells(signal: FloatArray, projections: FloatArray) -> FloatArray:
    """Mean power of a signal at a place, per cell of time and frequency.

    That of the neighbours in time counts, too: an error of a motion that decays is more of what is left of it.
    """
    power = _power(signal, projections)
    return np.asarray(maximum_filter1d(sums_of_cells(power) / sums_of_cells(np.ones(power.shape)), 3, axis=0))


def _log_mean(gains: FloatArray) -> FloatArray:
    return np.asarray(logsumexp(gains, axis=0) - np.log(gains.shape[0]))


def _log_mean_of(gains: FloatArray, chosen: NDArray[np.bool_]) -> FloatArray:
    """Over the chosen powers alone; that of no power at all where none is chosen."""
    n = chosen.sum(axis=0)
    total = logsumexp(np.where(chosen, gains, -np.inf), axis=0)
    return np.asarray(np.where(n > 0, total - np.log(np.maximum(n, 1)), 0.0))


def _mixed(usual: FloatArray, gain: FloatArray) -> FloatArray:
    """Log-likelihood ratios where a share of the cells has a remainder, shape (n_shares, …)."""
    shares = SHARES[:, None, None]
    return np.asarray(np.logaddexp(np.log1p(-shares) + usual, np.log(shares) + gain))
