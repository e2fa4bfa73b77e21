"""Recorded channels as short-time spectra, each coefficient with its variance (whitening weights)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np
import xarray as xr
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter
from scipy.stats import chi2

from sloshlab.conditioning.clipping import clipped_samples
from sloshlab.conditioning.integration import DRIFT_CORNER_HZ
from sloshlab.identification.case import CaseRun
from sloshlab.identification.lapped_transform import band_frequencies_hz, block_times_s, lapped_spectra
from sloshlab.identification.release import samples_disturbed

FloatArray = NDArray[np.float64]
BLOCK_S: Final = 0.5
"""Length of a block of the lapped transform."""
ZERO_IS_KNOWN: Final = "zero_is_known"
"""Optional attribute of a channel: 1 where its static part is measured too, as that of displacements is."""
_INFORMATIVE: Final = 4.0
"""Power over variance, from which a coefficient stands out of the noise."""
_SLOWEST_INTEGRATED_HZ: Final = 5 * DRIFT_CORNER_HZ
"""Below it displacements from integrated accelerometers are not valid."""
_FILTER_SETTLING_S: Final = 1.0 / DRIFT_CORNER_HZ
"""Beginnings and ends that the filter which removes drift disturbs."""
IGNORED_VARIANCE: Final = 100.0
"""Factor of a variance with which a coefficient counts for next to nothing."""
_LEAST_SHARE_OF_BLOCKS: Final = 0.01
"""Of the blocks, in which a band must be informative to be kept."""
SCATTER_AVERAGED_OVER: Final = (3, 9)
"""Blocks and bands: two repeats leave one degree of freedom each, and 27 together tell a variance."""
_MEDIAN_OF_SQUARE: Final = 0.4549
"""Of a normal number, over its mean (χ² with one degree of freedom)."""
_LEAST_SHARE: Final = 1e-4
"""Of the RMS of a channel: least standard deviation of a coefficient, for quantisation and rounding."""


@dataclass(frozen=True, eq=False)
class OtherDrive:
    """Noise of a channel where one of several accelerometers is left out of the drive.

    Attributes
    ----------
    added : ndarray, shape (n_blocks, n_kept)
        Variance beyond that where all of them drive.
    of_drive : ndarray, shape (n_draws, n_blocks, n_kept)
        As in `Observation`.
    told : ndarray, shape (n_blocks, n_kept)
        What is expected of the residual per residual of the one that is left out, which has the same noise.
    """

    added: FloatArray
    of_drive: FloatArray
    told: FloatArray

    def within(self, n_kept: int) -> OtherDrive:
        """In the lowest bands alone."""
        return OtherDrive(
            np.ascontiguousarray(self.added[:, :n_kept]),
            np.ascontiguousarray(self.of_drive[:, :, :n_kept]),
            np.ascontiguousarray(self.told[:, :n_kept]),
        )


@dataclass(frozen=True, eq=False)
class Observation:
    """One channel of one run.

    Attributes
    ----------
    run : CaseRun
    channel : str
    keeps_mean : bool
        Whether the static part is compared too; not for channels whose zero means nothing.
    known : ndarray of bool, shape (n,)
        Samples that were neither lost nor clipped.
    spectra : ndarray, shape (n_blocks, n_kept)
        Of the recording, in the lowest bands.
    variance : ndarray, shape (n_blocks, n_kept)
        Of each coefficient, by noise and by what does not repeat.
    without_scatter : ndarray of shape of `variance`, or None
        The variance but for the scatter of repeats, where this was added: what differs from one to the other may
        be physics.
    n_transformed : int
        Bands of the transform, if not all of them are kept.
    is_rough : bool
        Whether a model need not describe the channel to its noise (`known_to`), although the rest repeats.
    simulated : ndarray of shape of `spectra`, or None
        Of the same, as a first fit of the baseline simulates it, where that is known.
    of_drive : ndarray, shape (n_draws, n_blocks, n_kept), or None
        What draws of the noise of a driving accelerometer make of the channel; all channels of a run share a draw.
    other_drives : mapping of str to OtherDrive
        By the accelerometer that does not drive, such as one that a model says is faulty.
    ignored : ndarray of bool, of the shape of `spectra`, or None
        Coefficients whose variance is inflated, so that they do not count.
    """

    run: CaseRun
    channel: str
    keeps_mean: bool
    known: NDArray[np.bool_]
    spectra: FloatArray
    variance: FloatArray
    n_transformed: int = 0
    is_rough: bool = False
    simulated: FloatArray | None = None
    of_drive: FloatArray | None = None
    other_drives: Mapping[str, OtherDrive] = field(default_factory=dict)
    ignored: NDArray[np.bool_] | None = None
    without_scatter: FloatArray | None = None

    @property
    def n_bands(self) -> int:
        """Coefficients per block of the transform."""
        return self.n_transformed or int(self.spectra.shape[1])

    @property
    def frequencies_hz(self) -> FloatArray:
        """Of the bands that are kept."""
        every = band_frequencies_hz(self.n_bands, self.run.attributes.sampling_rate_hz)
        return every[: self.spectra.shape[1]]

    @property
    def times_s(self) -> FloatArray:
        """Of the blocks."""
        return block_times_s(self.spectra.shape[0], self.n_bands, self.run.attributes.sampling_rate_hz)

    @property
    def informative(self) -> NDArray[np.bool_]:
        """Coefficients in whose neighbourhood the recording or its simulation stands out of the noise.

        The simulation counts, too: driven by a faulty sensor it moves where nothing is recorded.
        """
        shown = [spectra for spectra in (self.spectra, self.simulated) if spectra is not None]
        # The square of a single coefficient of noise scatters by its own size. The mean of nine independent ones
        # exceeds four variances in 4 of 100 000 cases (χ² with nine degrees of freedom).
        power = np.max([uniform_filter(spectra**2, (3, 3), mode="nearest") for spectra in shown], axis=0)
        return np.asarray(power > _INFORMATIVE * self.variance)

    def of(self, values: FloatArray) -> FloatArray:
        """Spectra of simulated values, treated as the recording was; samples beyond their end are zero."""
        return np.asarray(self._of([values])[0])

    def _of(self, several: Sequence[FloatArray]) -> FloatArray:
        found = _spectra(several, self.known, self._taper, self.keeps_mean, self.n_bands)
        return found[..., : self.spectra.shape[1]]

    def residual(self, values: FloatArray) -> FloatArray:
        """Whitened residual: recorded minus simulated spectra in standard deviations, shape (n_blocks,
        n_bands).
        """
        return np.asarray(self.residuals([values])[0])

    def residuals(self, several: Sequence[FloatArray]) -> FloatArray:
        """Whitened residuals of several simulations, shape (n_simulations, n_blocks, n_bands)."""
        # Division by the standard deviation of each coefficient makes the sum of squares a negative
        # log-likelihood of independent normal errors; the lapped transform is orthogonal and keeps white noise
        # white.
        found = self.spectra - self._of(several)
        found *= self._inverse_deviation
        return np.asarray(found)

    def beside_faults(self, faulty: Collection[str]) -> Observation:
        """Known as where faulty channels leave the drive to the others; itself if none of them drives.

        Parameters
        ----------
        faulty : collection of str
        """
        left_out = tuple(name for name in self.other_drives if name in faulty)
        if not left_out:
            return self
        if left_out not in self._beside_faults:
            # Of several that are left out the noisiest drive counts.
            others = [self.other_drives[name] for name in left_out]
            added = np.max([other.added for other in others], axis=0)
            if self.ignored is not None:
                added = np.where(self.ignored, 0.0, added)
            least = self.without_scatter
            self._beside_faults[left_out] = replace(
                self,
                variance=self.variance + added,
                without_scatter=None if least is None else least + added,
                of_drive=max(others, key=lambda other: float(other.added.sum())).of_drive,
                other_drives={},
            )
        return self._beside_faults[left_out]

    @cached_property
    def _beside_faults(self) -> dict[tuple[str, ...], Observation]:
        """Those that were asked for, as every problem with the same faults needs them."""
        return {}

    @cached_property
    def _inverse_deviation(self) -> FloatArray:
        return np.asarray(1.0 / np.sqrt(self.variance))

    @cached_property
    def _taper(self) -> FloatArray:
        return _taper(self.run, self.known.size, self.n_bands)


def observations(
    run: CaseRun, names: Sequence[str], driving: Sequence[str] = (), *, knows_noise_of_drive: bool = False
) -> list[Observation]:
    """Channels of a run, weighted by the noise of their sensors alone.

    Parameters
    ----------
    run : CaseRun
    names : sequence of str
    driving : sequence of str
        Channels that drive the simulation.
    knows_noise_of_drive : bool
        Whether what its noise makes of slow displacements is added elsewhere.

    Notes
    -----
    The noise of a sensor is `noise_std`, and in squares beside it what no model need describe (`known_to`), where
    the recording states them, or what the quietest of bands near the end of its spectrum shows; never less than
    10⁻⁴ of the channel. Where accelerometers drive the simulation, slow displacements and velocities are lost with
    the drift that integration removes, and count for nothing; where the noise of what drives is known, near
    beginnings and ends only.
    """
    n_bands = _n_bands(run)
    found = []
    for name in names:
        variable = run.recording[name]
        values = np.asarray(variable.values, np.float64)
        # Samples at the end of a stated range are known to be beyond it only, which no residual can say.
        known = np.isfinite(values) & ~clipped_samples(variable)
        if run.is_free:
            # Before its release, wherever it is among these, nothing moves.
            known[: samples_disturbed(run.attributes.sampling_rate_hz)] = False
        # Less than two blocks have no spectrum to compare.
        if known.sum() < 2 * n_bands:
            continue
        # The zero of accelerometers and force sensors means nothing; a displacement has a static part.
        keeps_mean = variable.attrs["quantity"] == "displacement" or bool(variable.attrs.get(ZERO_IS_KNOWN, 0))
        spectra = _spectra_of(variable, known, keeps_mean, run)
        # Without it a channel that states no noise and has quiet high bands would be known beyond its
        # quantisation.
        least = (_LEAST_SHARE * float(np.sqrt(np.mean(spectra**2)))) ** 2
        variance = np.full(spectra.shape, max(_stated_variance(variable), _white_level(spectra), least, 1e-300))
        is_rough = float(variable.attrs.get("known_to", 0.0)) > 0.0
        observation = Observation(run, name, keeps_mean, known, spectra, variance, is_rough=is_rough)
        # In a refit, drift that integration had removed from the base became physics: these bands must not be
        # fitted.
        lost = slow_displacements(observation, driving)
        if lost.any():
            times = observation.times_s
            # The filter that removes drift has no past at the beginning and no future at the end.
            at_ends = (times - times[0] < _FILTER_SETTLING_S) | (times[-1] - times < _FILTER_SETTLING_S)
            everywhere = IGNORED_VARIANCE * (spectra[lost] ** 2).mean()
            variance[lost & (at_ends[:, None] | (not knows_noise_of_drive))] += everywhere
        found.append(observation)
    return found


def slow_displacements(observation: Observation, driving: Sequence[str]) -> NDArray[np.bool_]:
    """Coefficients of displacements and velocities below the band in which integrated accelerometers are valid.

    Parameters
    ----------
    observation : Observation
    driving : sequence of str
        Channels that drive the simulation.
    """
    quantity = observation.run.recording[observation.channel].attrs["quantity"]
    is_lost = quantity in ("displacement", "velocity") and _is_integrated(observation.run, driving)
    return np.broadcast_to(
        (observation.frequencies_hz < _SLOWEST_INTEGRATED_HZ) & is_lost, observation.spectra.shape
    )


def noise_of_sensor(run: CaseRun, name: str) -> float:
    """Standard deviation of a channel's white noise in its unit: stated, or of its quietest high bands.

    Parameters
    ----------
    run : CaseRun
    name : str
    """
    variable = run.recording[name]
    values, n_bands = np.asarray(variable.values, np.float64), _n_bands(run)
    known = np.isfinite(values)
    white = _white_level(_spectra_of(variable, known, False, run)) if known.sum() >= 2 * n_bands else 0.0
    return float(np.sqrt(max(_stated_variance(variable), white)))


def _n_bands(run: CaseRun) -> int:
    return max(8, 2 * round(0.5 * BLOCK_S * run.attributes.sampling_rate_hz))


def _stated_variance(variable: xr.DataArray) -> float:
    """Variance of the noise and of what no model need describe, as the recording states them; zero where not."""
    # `known_to` counts as if it were white noise. That is right for the size of a residual, not for its repeats,
    # which is why the channel is marked as rough.
    return float(variable.attrs.get("noise_std", 0.0)) ** 2 + float(variable.attrs.get("known_to", 0.0)) ** 2


def _is_integrated(run: CaseRun, driving: Sequence[str]) -> bool:
    """Whether a simulation knows displacements of the base from accelerometers alone."""
    present = [run.recording[name] for name in driving if name in run.recording.data_vars]
    return any(variable.attrs["quantity"] == "acceleration" for variable in present)


def within_informative_bands(observed: Sequence[Observation]) -> list[Observation]:
    """The channels of a run without the high bands in which none of them stands out of the noise.

    Parameters
    ----------
    observed : sequence of Observation
        Of one run.
    """
    # Channels of different rates have no bands in common.
    if len({observation.n_bands for observation in observed}) != 1:
        return list(observed)
    n_bands, highest = observed[0].n_bands, 0
    for observation in observed:
        # Bands that hold only noise add a constant to the cost, and time to every residual.
        shown = np.flatnonzero(observation.informative.mean(axis=0) > _LEAST_SHARE_OF_BLOCKS)
        highest = max(highest, int(shown[-1]) + 1 if shown.size else 0)
    n_kept = min(n_bands, max(highest + n_bands // 16, n_bands // 8))
    return [
        replace(
            observation,
            spectra=np.ascontiguousarray(observation.spectra[:, :n_kept]),
            variance=np.ascontiguousarray(observation.variance[:, :n_kept]),
            simulated=None
            if observation.simulated is None
            else np.ascontiguousarray(observation.simulated[:, :n_kept]),
            of_drive=None
            if observation.of_drive is None
            else np.ascontiguousarray(observation.of_drive[:, :, :n_kept]),
            other_drives={name: other.within(n_kept) for name, other in observation.other_drives.items()},
            ignored=None if observation.ignored is None else observation.ignored[:, :n_kept],
            without_scatter=None
            if observation.without_scatter is None
            else np.ascontiguousarray(observation.without_scatter[:, :n_kept]),
            n_transformed=n_bands,
        )
        for observation in observed
    ]


def with_scatter(
    group: Sequence[Sequence[Observation]], residuals: Sequence[Mapping[str, FloatArray]]
) -> list[list[Observation]]:
    """Observations of the repeats of one test, weighted by how their residuals scatter.

    Parameters
    ----------
    group : sequence of sequences of Observation
        One sequence per repeat, at least two.
    residuals : sequence of mappings
        Unweighted residual spectra per channel, of the same repeats and one model.

    Notes
    -----
    The scatter about the mean of the repeats is averaged over three blocks and nine bands; it is never taken as
    less than what is steady in its band, or than the noise of the sensor. Repeats may have left out other bands
    (`within_informative_bands`): beyond those that all keep it is that of the last of these.
    """
    n = len(group)
    scatter: dict[str, FloatArray] = {}
    for observation in group[0]:
        name = observation.channel
        parts = [
            residual[name]
            for repeat, residual in zip(group, residuals, strict=True)
            for each in repeat
            if each.channel == name in residual and _is_comparable(each, observation)
        ]
        if len(parts) != n:
            continue
        n_kept = min(part.shape[1] for part in parts)
        stacked = np.stack([part[:, :n_kept] for part in parts])
        # About the mean of the repeats, not about zero: what the simulation misses in every repeat alike stays
        # visible, and the chaos of a liquid does not count.
        about = ((stacked - stacked.mean(axis=0)) ** 2).sum(axis=0) / (n - 1)
        # Two repeats leave one degree of freedom per coefficient; 27 neighbours together tell a variance.
        local = uniform_filter(about, SCATTER_AVERAGED_OVER, mode="nearest")
        scatter[name] = np.maximum(local, _steady_noise(about, n - 1))
    return [
        [
            _weighted(
                observation, np.maximum(_up_to(scatter[observation.channel], observation), observation.variance)
            )
            if observation.channel in scatter
            else observation
            for observation in repeat
        ]
        for repeat in group
    ]


def _is_comparable(one: Observation, other: Observation) -> bool:
    """Whether coefficients are of the same times and frequencies, as far as both keep them."""
    return one.n_bands == other.n_bands and one.spectra.shape[0] == other.spectra.shape[0]


def _up_to(scatter: FloatArray, observation: Observation) -> FloatArray:
    """For the bands of one repeat: less than all that are known, or more, which have the last one's."""
    n = observation.spectra.shape[1]
    return np.pad(scatter[:, :n], ((0, 0), (0, max(n - scatter.shape[1], 0))), mode="edge")


def _steady_noise(about: FloatArray, n_degrees: int) -> FloatArray:
    """Variance of noise that is the same at all times, per band, shape (n_bands,).

    Noise of sensors is steady and grows towards low frequencies, where nine bands would smear it. Medians over all
    times and an octave: neither a loud stretch nor a line, such as a hum whose phase differs between repeats, is
    such noise.
    """
    by_band = np.median(about, axis=0) * n_degrees / float(chi2.median(n_degrees))
    k = np.arange(by_band.size) + 0.5
    low, high = np.floor(k / np.sqrt(2)).astype(int), np.ceil(k * np.sqrt(2)).astype(int)
    return np.array([np.median(by_band[first:end]) for first, end in zip(low, high, strict=True)])


def with_typical_scatter(target: Sequence[Observation], sources: Sequence[Observation]) -> list[Observation]:
    """Observations of a test that was not repeated, with the scatter of its channels in repeated tests.

    That scatter is modelled as a constant noise per band, and a share of the signal.

    Parameters
    ----------
    target : sequence of Observation
    sources : sequence of Observation
        Of repeated tests.
    """
    weighted = []
    for observation in target:
        alike = [
            source
            for source in sources
            if source.channel == observation.channel and source.n_bands == observation.n_bands
        ]
        if not alike:
            weighted.append(observation)
            continue
        # A repeated test has other levels at other times, so that its variance cannot be taken over place by
        # place.
        quiet = _of_quietest(alike, observation.spectra.shape[1])
        shares = [
            source.variance[source.informative].sum() / (source.spectra**2)[source.informative].sum()
            for source in alike
            if source.informative.any()
        ]
        # The median over the repeats, so that a burst in one of them does not set it.
        share = float(np.median(shares)) if shares else 0.0
        local = uniform_filter(observation.spectra**2, SCATTER_AVERAGED_OVER, mode="nearest")
        weighted.append(_weighted(observation, np.maximum(quiet[None, :], share * local)))
    return weighted


def _of_quietest(sources: Sequence[Observation], n_kept: int) -> FloatArray:
    """Least median variance of each band; none of bands that all of them have left out, as nothing stood out."""
    quiet = np.full(n_kept, np.inf)
    for source in sources:
        medians = np.median(source.variance[:, :n_kept], axis=0)
        quiet[: medians.size] = np.minimum(quiet[: medians.size], medians)
    return np.where(np.isinf(quiet), 0.0, quiet)


def with_scatter_of_residuals(
    runs: Sequence[Sequence[Observation]], residual: FloatArray
) -> list[list[Observation]]:
    """Observations weighted by how large the residuals of one simulation are, run by run.

    Averaged as the scatter of repeats is, and never less than the noise of sensors and drives.

    Parameters
    ----------
    runs : sequence of sequences of Observation
    residual : ndarray
        Whitened, of all coefficients of these runs in their order.
    """
    ends = np.cumsum([observation.spectra.size for run in runs for observation in run])
    parts = iter(np.split(residual, ends[:-1]))

    def weighted(observation: Observation) -> Observation:
        squares = next(parts).reshape(observation.spectra.shape) ** 2 * observation.variance
        least = observation.variance if observation.without_scatter is None else observation.without_scatter
        variance = np.maximum(uniform_filter(squares, SCATTER_AVERAGED_OVER, mode="nearest"), least)
        if observation.ignored is not None:
            variance = np.where(observation.ignored, observation.variance, variance)
        return replace(observation, variance=variance)

    return [[weighted(observation) for observation in run] for run in runs]


def without_scatter(run: Sequence[Observation]) -> list[Observation]:
    """Observations of a run known to the noise of their sensors and drives: what differs from repeat to repeat may
    be physics.

    Parameters
    ----------
    run : sequence of Observation
    """
    return [each if each.without_scatter is None else replace(each, variance=each.without_scatter) for each in run]


def _weighted(observation: Observation, variance: FloatArray) -> Observation:
    # Repeats that agree by chance must not make a coefficient better known than its sensor.
    least = observation.variance
    return replace(observation, variance=np.maximum(variance, least), without_scatter=least)


def _spectra_of(variable: xr.DataArray, known: NDArray[np.bool_], keeps_mean: bool, run: CaseRun) -> FloatArray:
    """Spectra of the known samples of a recorded channel."""
    n_bands = _n_bands(run)
    taper = _taper(run, known.size, n_bands)
    found = _spectra([np.asarray(variable.values, np.float64)], known, taper, keeps_mean, n_bands)
    return np.asarray(found[0])


def _spectra(
    several: Sequence[FloatArray], known: NDArray[np.bool_], taper: FloatArray, keeps_mean: bool, n_bands: int
) -> FloatArray:
    """Spectra of the known samples of several series, tapered at both ends."""
    masked = np.zeros((len(several), known.size))
    for row, values in zip(masked, several, strict=True):
        _mask(values, known, taper, keeps_mean, row)
    return lapped_spectra(masked, n_bands)


def _taper(run: CaseRun, n: int, n_bands: int) -> FloatArray:
    """Weights of the samples.

    An abrupt end leaks the scatter of strong bands into weak ones, where it would count far too much. A release
    has a short taper at its start, after the samples in which it may be: its first cycles hold most of the
    information.
    """
    weights = np.ones(n)
    first = samples_disturbed(run.attributes.sampling_rate_hz) if run.is_free else 0
    n_in, n_out = max(1, n_bands // (32 if run.is_free else 2)), max(1, n_bands // 2)
    if first + n_in + n_out <= n:
        weights[:first] = 0.0
        weights[first : first + n_in] = np.sin(0.5 * np.pi * np.arange(n_in) / n_in) ** 2
        weights[-n_out:] = np.cos(0.5 * np.pi * (np.arange(n_out) + 1) / n_out) ** 2
    return weights


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _mask(
    values: FloatArray, known: NDArray[np.bool_], taper: FloatArray, keeps_mean: bool, masked: FloatArray
) -> None:
    """Tapered values without their mean.

    Lost samples are zero in the recording and in the simulation alike, so that they leave no residual.
    """
    n, total, n_known = min(known.size, values.size), 0.0, 0
    if not keeps_mean:
        # The mean of the known samples alone, on both sides: zeros of the lost ones would shift it.
        for i in range(n):
            if known[i]:
                total += values[i]
                n_known += 1
    mean = total / n_known if n_known else 0.0
    for i in range(n):
        if known[i]:
            masked[i] = (values[i] - mean) * taper[i]


def _white_level(spectra: FloatArray) -> float:
    """Variance per coefficient in the quietest stretch of bands above 0.3 of the sampling rate."""
    upper = spectra[:, int(0.6 * spectra.shape[1]) :]
    width = max(4, upper.shape[1] // 8)
    levels = [float(np.median(upper[:, i : i + width] ** 2)) for i in range(0, upper.shape[1] - width + 1, width)]
    # medians, as a line of the mains or a harmonic in some of the bands must not count
    return min(levels) / _MEDIAN_OF_SQUARE
