"""Delay and drift between two sensors that feel the same motion on two clocks.

The delay is read from the phase of the cross spectrum, window by window, and a line through the
windows gives offset and drift. A phase knows the delay only up to a period of the motion; in a sweep
the period changes, so that a delay wrong by a period fits some windows and misses others. Several
candidates are therefore followed through all windows, and the one with the smallest residual is taken.
"""

from __future__ import annotations

import enum
import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from sloshlab.conditioning.gaps import runs
from sloshlab.conditioning.redundancy import PHASE_ERROR_AT_HZ
from sloshlab.conditioning.resampling import resampled
from sloshlab.errors import AnalysisError

FloatArray = npt.NDArray[np.float64]

_HIGHEST_FREQUENCY_HZ = 150.0
_LOWEST_FREQUENCY_HZ = 1.0
_COARSE_RATE_HZ = 400.0
# A phase knows the delay up to a period: the right maximum need not be the highest.
_N_CANDIDATES = 5
_SMALLEST_CORRELATION = 0.3
_CLEARLY_WORSE = 2.0
_FEWEST_WINDOWS = 4
_OUTLIER = 6.0
"""Windows further from the line than this many standard deviations, from their median, are left out."""
_WINDOW_OVERLAP_VARIANCE = 4.0 / 3.0
"""Hann windows that overlap by half have noise correlated by 1/6, with a neighbour on either side."""


@dataclass(frozen=True)
class SampledSignal:
    """Samples on a uniform time base.

    Attributes
    ----------
    values : ndarray, shape (n_samples,)
        NaN where lost.
    start_s, step_s : float
        Time of the first sample and between samples, in the time base that the delay is stated in.
    """

    values: FloatArray
    start_s: float
    step_s: float


class AlignmentStatus(enum.Enum):
    """What a delay is worth; the text is the explanation."""

    ALIGNED = "the two signals were aligned"
    AMBIGUOUS = "the motion repeats itself: another delay explains the signals as well"
    NO_COMMON_MOTION = "the two signals have no motion in common"


@dataclass(frozen=True)
class ClockDelay:
    """How much later than the reference the other signal comes, as a line in time.

    Attributes
    ----------
    status : AlignmentStatus
    n_windows, n_windows_left_out : int
        Windows used, and those whose delay is far from the line.
    centre_s : float
        Time at which `delay_s` holds and is best known.
    delay_s : float
        Positive: the other signal comes later, its stated times are too late by that much.
    drift_ppm : float
        Growth of the delay.
    delay_std_s, drift_std_ppm : float
        Standard deviations, from the scatter of the windows about the line.
    residual_rms_s : float
        That scatter.
    error_s : float
        Half width of the 95 % interval of the delay where it is largest within the common time.
    phase_error_at_20_hz_rad : float
        2π·20 Hz·`error_s`. The relative error of a loop area, that is of the work per cycle, is this
        phase times reactive over dissipative power: W = π F₀u₀ sin φ, so that δW/W = δφ/tan φ.
    gain_ratio : float
        Amplitude of the other signal over that of the reference.
    correlation : float
        Of the two signals, aligned.
    """

    status: AlignmentStatus
    n_windows: int
    n_windows_left_out: int
    centre_s: float
    delay_s: float
    drift_ppm: float
    delay_std_s: float
    drift_std_ppm: float
    residual_rms_s: float
    error_s: float
    phase_error_at_20_hz_rad: float
    gain_ratio: float
    correlation: float

    def reference_line(self, start_s: float, step_s: float) -> tuple[float, float]:
        """First instant and step of the other signal on the reference's time base, from its stated ones [s]."""
        growth = 1e-6 * self.drift_ppm
        start = (start_s - self.delay_s + growth * self.centre_s) / (1 + growth)
        return start, step_s / (1 + growth)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and texts; None for what is not finite, as JSON wants it."""
        plain = {**asdict(self), "status": self.status.name.lower()}
        return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in plain.items()}


@dataclass(frozen=True)
class _Line:
    """Delay = `middle_s` + `slope`·(t − `centre_s`)."""

    centre_s: float
    middle_s: float
    slope: float

    def at(self, time_s: Any) -> Any:
        return self.middle_s + self.slope * (time_s - self.centre_s)

    def plus(self, middle_s: float, slope: float) -> _Line:
        return _Line(self.centre_s, self.middle_s + middle_s, self.slope + slope)


@dataclass(frozen=True)
class _Fit:
    """A line through the delays of the windows that remained after `line` had been taken off."""

    line: _Line
    n_windows: int
    n_left_out: int
    middle_std_s: float
    slope_std: float
    residual_rms_s: float
    half_span_s: float
    centroid_s: float
    gain_ratio: float
    correlation: float


def clock_delay(
    reference: SampledSignal,
    other: SampledSignal,
    *,
    largest_delay_s: float = 0.5,
    largest_drift_ppm: float = 300.0,
) -> ClockDelay:
    """Delay of one sensor behind another that measures the same motion on another clock.

    Parameters
    ----------
    reference, other : SampledSignal
        The same motion with the same sign; gains and rates may differ. Rates above 300 Hz or so are enough.
    largest_delay_s, largest_drift_ppm : float
        How far the stated times may be wrong: what is known from host times beforehand.

    Returns
    -------
    ClockDelay
        The line is exact for clocks of constant rate; a wandering clock shows in `residual_rms_s`.

    Raises
    ------
    AnalysisError
        If the signals have less than two seconds in common.

    Notes
    -----
    Candidates are maxima of the correlation of the whole signals, over delay and drift. For each, `other` is
    resampled on the reference's instants; per Hann window of up to two seconds the cross spectrum C(f) = Y X*
    gives the remaining delay −Σ|C|ω arg C/Σ|C|ω² over the lines that carry the motion, weighted in the line
    fit by Σ|C|ω², its information in white noise.
    """
    _require_common_time(reference, other)
    candidates = _candidates(reference, other, largest_delay_s, largest_drift_ppm)
    fits = [fit for line in candidates if (fit := _line_through_windows(reference, other, line)) is not None]
    if not fits:
        return _nothing_in_common(reference)
    fits.sort(key=lambda fit: fit.residual_rms_s)
    # once more from the improved line: what is left then is far below a period, where the phase is exact
    best = _line_through_windows(reference, other, fits[0].line) or fits[0]
    quarter_period_s = 0.25 / _highest_frequency_hz(reference)
    # candidates that ended in the same line are no rivals
    rivals = [fit for fit in fits[1:] if abs(fit.line.middle_s - best.line.middle_s) > quarter_period_s]
    status = AlignmentStatus.ALIGNED
    if best.correlation < _SMALLEST_CORRELATION:
        status = AlignmentStatus.NO_COMMON_MOTION
    # a delay wrong by a period fits a steady motion as well as the right one; only a changing frequency tells
    # them apart
    elif any(fit.residual_rms_s < _CLEARLY_WORSE * best.residual_rms_s for fit in rivals):
        status = AlignmentStatus.AMBIGUOUS
    return _stated(best, status)


def _stated(fit: _Fit, status: AlignmentStatus) -> ClockDelay:
    # the worse end of the run: an error of the drift is largest there
    farthest_s = fit.half_span_s + abs(fit.centroid_s - fit.line.centre_s)
    error_s = 2 * math.hypot(fit.middle_std_s, fit.slope_std * farthest_s)
    return ClockDelay(
        status=status,
        n_windows=fit.n_windows,
        n_windows_left_out=fit.n_left_out,
        centre_s=fit.centroid_s,
        delay_s=float(fit.line.at(fit.centroid_s)),
        drift_ppm=1e6 * fit.line.slope,
        delay_std_s=fit.middle_std_s,
        drift_std_ppm=1e6 * fit.slope_std,
        residual_rms_s=fit.residual_rms_s,
        error_s=error_s,
        phase_error_at_20_hz_rad=2 * math.pi * PHASE_ERROR_AT_HZ * error_s,
        gain_ratio=fit.gain_ratio,
        correlation=fit.correlation,
    )


def _nothing_in_common(reference: SampledSignal) -> ClockDelay:
    unknown = math.inf
    return ClockDelay(
        AlignmentStatus.NO_COMMON_MOTION, 0, 0, reference.start_s, delay_s=0.0, drift_ppm=0.0,
        delay_std_s=unknown, drift_std_ppm=unknown, residual_rms_s=unknown, error_s=unknown,
        phase_error_at_20_hz_rad=unknown, gain_ratio=math.nan, correlation=0.0,
    )  # fmt: skip


def _require_common_time(reference: SampledSignal, other: SampledSignal) -> None:
    # stated times may be off by as much as is sought, so that little overlap is not yet a reason to refuse
    ends = [signal.start_s + signal.step_s * signal.values.size for signal in (reference, other)]
    common_s = min(ends) - max(reference.start_s, other.start_s)
    shortest_s = min(signal.step_s * signal.values.size for signal in (reference, other))
    if min(shortest_s, max(common_s, 0.5 * shortest_s)) < 2.0:
        raise AnalysisError(
            "signals to align", got=f"{common_s:.3g} s in common", allowed="≥ 2 s", remedy="record longer"
        )


def _highest_frequency_hz(signal: SampledSignal) -> float:
    """Below this lie 99 % of the power."""
    values = _centred(signal)
    # the frequency decides how far apart maxima of the correlation can be, and how fine drifts must be tried
    power = np.cumsum(np.abs(np.fft.rfft(values)) ** 2)
    line = int(np.searchsorted(power, 0.99 * power[-1]))
    return min(_HIGHEST_FREQUENCY_HZ, max(_LOWEST_FREQUENCY_HZ, line / (values.size * signal.step_s)))


def _candidates(
    reference: SampledSignal, other: SampledSignal, largest_delay_s: float, largest_drift_ppm: float
) -> list[_Line]:
    """Lines at the highest maxima of the correlation, over the drifts that change it noticeably."""
    # coarse, because every drift needs a correlation of its own; the maxima are refined afterwards
    step_s = max(reference.step_s, 1.0 / _COARSE_RATE_HZ)
    n = int(reference.values.size * reference.step_s / step_s)
    time = np.asarray(reference.start_s + step_s * np.arange(n), dtype=np.float64)
    centre_s = float(time.mean())
    x = _interpolated(reference, time)
    n_lags = max(1, round(largest_delay_s / step_s))
    # padded by more than the largest lag, so that the ends do not meet in the circular correlation
    n_padded = 1 << (n + n_lags).bit_length()
    x_spectrum = np.conj(np.fft.rfft(x, n_padded))
    found: list[tuple[float, _Line]] = []
    for slope in _drifts(largest_drift_ppm, n * step_s, _highest_frequency_hz(reference)):
        # about the middle, so that a drift does not change the delay it goes with
        y = _interpolated(other, time + slope * (time - centre_s))
        correlation = np.fft.irfft(x_spectrum * np.fft.rfft(y, n_padded), n_padded)
        near = np.concatenate([correlation[n_padded - n_lags :], correlation[: n_lags + 1]])
        found += [(height, _Line(centre_s, (lag - n_lags) * step_s, slope)) for height, lag in _maxima(near)]
    return _best_apart(
        [(height, line) for height, line in found if height > 0], 0.25 / _highest_frequency_hz(reference)
    )


def _drifts(largest_ppm: float, duration_s: float, frequency_hz: float) -> FloatArray:
    """Drifts so close that none turns the phase by more than half a radian at an end of the signal."""
    step = 1.0 / (math.pi * frequency_hz * duration_s)
    n = math.ceil(1e-6 * largest_ppm / step)
    return np.linspace(-1e-6 * largest_ppm, 1e-6 * largest_ppm, 2 * n + 1)


def _interpolated(signal: SampledSignal, time: FloatArray) -> FloatArray:
    """Good enough for a coarse search: linear, lost samples and what is outside at the mean."""
    values = _centred(signal)
    places = signal.start_s + signal.step_s * np.arange(values.size)
    return np.asarray(np.interp(time, places, values, left=0.0, right=0.0))


def _centred(signal: SampledSignal) -> FloatArray:
    """Values about their mean; lost samples at the mean."""
    there = np.isfinite(signal.values)
    mean = float(signal.values[there].mean()) if there.any() else 0.0
    return np.where(there, signal.values - mean, 0.0)


def _maxima(values: FloatArray) -> list[tuple[float, float]]:
    """Height and place (by a parabola) of the highest local maxima."""
    inner = np.flatnonzero((values[1:-1] >= values[:-2]) & (values[1:-1] > values[2:])) + 1
    highest = inner[np.argsort(values[inner])[::-1][:_N_CANDIDATES]]
    before, here, after = values[highest - 1], values[highest], values[highest + 1]
    shift = 0.5 * (before - after) / (before - 2 * here + after)
    return [(float(height), float(place)) for height, place in zip(here, highest + shift, strict=True)]


def _best_apart(found: list[tuple[float, _Line]], distance_s: float) -> list[_Line]:
    """The highest ones that are not the same maximum seen with another drift."""
    chosen: list[_Line] = []
    for _, line in sorted(found, key=lambda candidate: -candidate[0]):
        if all(abs(line.middle_s - other.middle_s) > distance_s for other in chosen):
            chosen.append(line)
        if len(chosen) == _N_CANDIDATES:
            break
    return chosen


def _line_through_windows(reference: SampledSignal, other: SampledSignal, line: _Line) -> _Fit | None:
    """Delays of the windows after `line` has been taken off, and the better line; None without signal."""
    time = reference.start_s + reference.step_s * np.arange(reference.values.size)
    # on the reference's instants, once per candidate; the fit of the windows is linear in what remains
    positions = (time + line.at(time) - other.start_s) / other.step_s
    y = resampled(other.values, positions, rate_ratio=other.step_s / reference.step_s)
    windows = _windows(reference.values, y, reference.step_s)
    if len(windows) < _FEWEST_WINDOWS:
        return None
    delay, weight, centre, gain_parts = (np.array(column) for column in zip(*windows, strict=True))
    middle_of_windows = reference.start_s + reference.step_s * centre
    fitted = _line_through(middle_of_windows, delay, weight)
    if fitted is None:
        return None
    centroid, middle, slope, middle_std, slope_std, rms, used = fitted
    cross, x_power, y_power = gain_parts[used].sum(axis=0)
    at_centre = middle + slope * (line.centre_s - centroid)
    return _Fit(
        line=line.plus(at_centre, slope),
        n_windows=int(used.sum()),
        n_left_out=int((~used).sum()),
        middle_std_s=middle_std,
        slope_std=slope_std,
        residual_rms_s=rms,
        half_span_s=0.5 * float(np.ptp(middle_of_windows)),
        centroid_s=centroid,
        gain_ratio=math.sqrt(y_power / x_power) if x_power > 0 else math.nan,
        correlation=cross / math.sqrt(x_power * y_power) if x_power * y_power > 0 else 0.0,
    )


def _windows(
    x: FloatArray, y: FloatArray, step_s: float
) -> list[tuple[float, float, float, tuple[float, float, float]]]:
    """Per window without lost samples: delay [s], weight, centre [samples], (Re ΣYX*, Σ|X|², Σ|Y|²)."""
    # at least some sixteen windows, or a line through them has no residual to speak of
    n_window = max(32, round(min(2.0, x.size * step_s / 16) / step_s))
    hann = np.hanning(n_window + 1)[:-1]
    omega = np.asarray(2 * np.pi * np.fft.rfftfreq(n_window, step_s), dtype=np.float64)
    in_band = (omega >= 2 * np.pi * _LOWEST_FREQUENCY_HZ) & (omega <= 2 * np.pi * _HIGHEST_FREQUENCY_HZ)
    found = []
    for first, last in runs(np.isfinite(x) & np.isfinite(y), True):
        for start in range(first, last - n_window + 1, n_window // 2):
            pair = [signal[start : start + n_window] for signal in (x, y)]
            spectra = [np.fft.rfft((part - part.mean()) * hann)[in_band] for part in pair]
            found.append((*_delay_of(spectra[0], spectra[1], omega[in_band]), start + 0.5 * n_window))
    return [(delay, weight, centre, powers) for delay, weight, powers, centre in found if weight > 0]


def _delay_of(
    x: npt.NDArray[np.complex128], y: npt.NDArray[np.complex128], omega: FloatArray
) -> tuple[float, float, tuple[float, float, float]]:
    power = np.abs(x) ** 2
    carries = power >= 0.01 * power.max()  # the phases of other lines are noise
    cross = (y * x.conj())[carries]
    # a phase −ωτ tells the delay the better the higher its frequency: weighted least squares of the phases
    information = float((np.abs(cross) * omega[carries] ** 2).sum())
    lag = -float((np.abs(cross) * omega[carries] * np.angle(cross)).sum())
    powers = float(cross.real.sum()), float(power[carries].sum()), float((np.abs(y[carries]) ** 2).sum())
    return (lag / information if information > 0 else 0.0), information, powers


def _line_through(
    time: FloatArray, delay: FloatArray, weight: FloatArray
) -> tuple[float, float, float, float, float, float, npt.NDArray[np.bool_]] | None:
    """Centroid, middle, slope, their standard deviations, residual RMS and the windows used."""
    used = np.ones(time.size, dtype=np.bool_)
    for _ in range(3):
        w = weight * used
        if np.count_nonzero(w) < _FEWEST_WINDOWS:
            return None
        # about the weighted centre the errors of height and slope are independent
        centroid = float((w * time).sum() / w.sum())
        middle = float((w * delay).sum() / w.sum())
        moment = float((w * (time - centroid) ** 2).sum())
        slope = float((w * (time - centroid) * delay).sum() / moment)
        residual = delay - middle - slope * (time - centroid)
        scaled = np.abs(residual) * np.sqrt(weight)
        # from the median, which windows that are far off do not move; the tiny term keeps exact data
        keep = scaled <= _OUTLIER * 1.4826 * np.median(scaled) + 1e-300
        if np.array_equal(keep, used):
            break
        used = keep
    n_free = max(1, int(np.count_nonzero(w)) - 2)
    # from the scatter, not from the stated noise: it contains what the two sensors do not share
    unit_variance = _WINDOW_OVERLAP_VARIANCE * float((w * residual**2).sum()) / n_free
    rms = math.sqrt(float((w * residual**2).sum() / w.sum()))
    stds = math.sqrt(unit_variance / float(w.sum())), math.sqrt(unit_variance / moment)
    return centroid, middle, slope, *stds, rms, w > 0
