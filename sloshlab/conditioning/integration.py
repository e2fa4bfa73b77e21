"""Acceleration → velocity → displacement without drift.

Each stretch without lost samples is integrated by the symmetric six-point rule. What is left of
offsets and slow errors of the sensor is then removed as the trend that minimises
Σ (x − z)² + λ Σ (Δᵖ c)², z being a chain of straight lines with knot values c. Such a trend has no phase
error, needs no padding at the ends of a stretch, and for order p it takes off whole polynomials of
degree p − 1: with p = 2 a constant acceleration offset leaves nothing behind in the velocity.
Away from the ends the result is the integral passed through the zero-phase high-pass
1/(1 + (f_corner/f)^{2p}); `integration_error` states the transfer function exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr
from numba import njit
from scipy.linalg import solveh_banded

from sloshlab.conditioning.combined_channels import derived_channel
from sloshlab.conditioning.gaps import BoolArray, mark_nan, runs, sampling_step_s
from sloshlab.errors import AnalysisError
from sloshlab.quadrature import STEP_WEIGHTS
from sloshlab.units import SI_UNITS

# A tenth of the lowest frequency of the source's sweeps: the amplitude is 10⁻⁴ off at 5 Hz.
DRIFT_CORNER_HZ = 0.5
"""Default corner of the high-pass that removes drift."""

FEWEST_SAMPLES = 6
"""The six-point rule needs six samples in a row; shorter stretches between gaps stay NaN."""

_KNOTS_PER_CORNER_PERIOD = 200
_HIGHEST_ORDER = 3

# One-sided six-point weights of the first and the second step, from samples 0 … 5, in steps.
_FIRST_STEP = np.array([475.0, 1427.0, -798.0, 482.0, -173.0, 27.0]) / 1440.0
_SECOND_STEP = np.array([-27.0, 637.0, 1022.0, -258.0, 77.0, -11.0]) / 1440.0

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class IntegrationError:
    """Deviation of the numerical integration from 1/(jω).

    Attributes
    ----------
    gain_error : float
        |H|/|1/(jω)ⁿ| − 1; negative: amplitudes come out too small.
    phase_error_rad : float
        Phase of H minus that of 1/(jω)ⁿ; positive: the result comes too early. Zero by symmetry of rule
        and trend, away from the ends of a stretch (`is_away_from_ends`).
    """

    gain_error: float
    phase_error_rad: float


def velocity(acceleration: xr.DataArray, *, corner_hz: float = DRIFT_CORNER_HZ, order: int = 2) -> xr.DataArray:
    """Velocity from acceleration, drift removed.

    Parameters
    ----------
    acceleration : xarray.DataArray
        ``(time)`` [m/s²], NaN where lost.
    corner_hz : float
        Corner (half amplitude) of the zero-phase high-pass [Hz], below half the lowest frequency of interest.
    order : int
        Order p = 1, 2 or 3 of the high-pass 1/(1 + (f_corner/f)^{2p}).

    Returns
    -------
    xarray.DataArray
        ``velocity(time)`` [m/s], float64, same sign convention, NaN where the acceleration is NaN and on
        islands of fewer than six samples between lost ones. The constant of integration is free on
        each stretch between gaps.

    Raises
    ------
    AnalysisError
        If the quantity, corner or order is not usable.
    """
    return _integrated_channel(acceleration, "acceleration", "velocity", corner_hz, order)


def displacement(velocity: xr.DataArray, *, corner_hz: float = DRIFT_CORNER_HZ, order: int = 2) -> xr.DataArray:
    """Displacement [m] from velocity, drift removed; parameters as for `velocity`."""
    return _integrated_channel(velocity, "velocity", "displacement", corner_hz, order)


def integrated(
    values: FloatArray, step_s: float, *, corner_hz: float = DRIFT_CORNER_HZ, order: int = 2
) -> FloatArray:
    """Integral over time of uniformly sampled values, drift removed.

    Parameters
    ----------
    values : ndarray, shape (n,)
        NaN where lost.
    step_s : float
        Time step.
    corner_hz, order
        As for `velocity`.

    Returns
    -------
    ndarray, shape (n,)
        Float64, in units of `values` times seconds.
    """
    _check_settings(corner_hz, order, 1.0 / step_s)
    usable = np.ones(values.size, dtype=np.bool_)
    mark_nan(values, usable)
    result = np.full(values.size, np.nan) if not usable.all() else np.empty(values.size)
    # one knot per block of samples: the trend costs a small banded system, however long the recording
    block = _block_samples(1.0 / step_s, corner_hz)
    penalty = _penalty(1.0 / step_s, corner_hz, order)
    for start, stop in runs(usable, True):
        if stop - start < FEWEST_SAMPLES:
            result[start:stop] = np.nan
            continue
        stretch = result[start:stop]
        moments = np.zeros(_n_knots(stretch.size, block))
        _cumulative(values[start:stop], step_s, block, stretch, moments)
        # each stretch by itself: across a gap the constant of integration is not known
        knots = _trend_knots(moments, stretch.size, block, order, penalty)
        _subtract_chain(stretch, knots, block)
    return result


def displacement_of_part(
    acceleration: FloatArray, sampling_rate_hz: float, part: slice, *, corner_hz: float, padding_s: float
) -> FloatArray:
    """Displacement in a part of a long recording, without integrating all of it.

    Parameters
    ----------
    acceleration : ndarray, shape (n,)
        [m/s²], NaN where lost.
    sampling_rate_hz : float
        Samples per second.
    part : slice
        Samples that are wanted, with start and stop.
    corner_hz : float
        As for `velocity`.
    padding_s : float
        Stretch on both sides that is integrated, too: near the ends of a stretch the drift is known less well.

    Returns
    -------
    ndarray, shape (part.stop - part.start,)
        [m].
    """
    padding = int(padding_s * sampling_rate_hz)
    # near the ends of a stretch the trend has data on one side only
    used = slice(max(0, part.start - padding), min(acceleration.size, part.stop + padding))
    speed = integrated(np.asarray(acceleration[used], dtype=np.float64), 1 / sampling_rate_hz, corner_hz=corner_hz)
    moved = integrated(speed, 1 / sampling_rate_hz, corner_hz=corner_hz)
    return moved[part.start - used.start :][: part.stop - part.start]


def is_away_from_ends(usable: BoolArray, step_s: float, *, corner_hz: float = DRIFT_CORNER_HZ) -> BoolArray:
    """True where a sample lies at least one corner period from a gap and from the ends.

    There the transfer function of `integration_error` holds; nearer the drift is known less well.
    """
    margin = math.ceil(1.0 / (corner_hz * step_s))
    away = np.zeros(usable.size, dtype=np.bool_)
    for start, stop in runs(usable, True):
        away[start + margin : max(stop - margin, start + margin)] = True
    return away


def integration_error(
    frequency_hz: float,
    sampling_rate_hz: float,
    corner_hz: float = DRIFT_CORNER_HZ,
    order: int = 2,
    *,
    n_integrations: int = 1,
) -> IntegrationError:
    """Transfer-function error of `velocity` (and of `displacement` after it) against 1/(jω).

    Parameters
    ----------
    frequency_hz : float
        Frequency of the motion, 0 < f < half the sampling rate.
    sampling_rate_hz, corner_hz, order
        Sampling rate, corner and order of the high-pass.
    n_integrations : int
        1: acceleration → velocity; 2: acceleration → displacement.

    Returns
    -------
    IntegrationError

    Notes
    -----
    Rule: H = Δt Σ w_k cos((k − ½)ωΔt) / (2j sin(ωΔt/2)), k = 1, 2, 3 with both sides' weights.
    Trend with knots D samples apart: T = Ĥ²/D / (d₀ + 2d₁ cos ωDΔt + λD (2 sin ωDΔt/2)^{2p}), Ĥ the
    transform of one hat. The high-pass is 1 − T.

    Examples
    --------
    >>> error = integration_error(5.0, 10_000.0, corner_hz=0.5, order=2)
    >>> f"{error.gain_error:.2e}", error.phase_error_rad
    ('-1.00e-04', 0.0)
    """
    _check_settings(corner_hz, order, sampling_rate_hz)
    if not 0 < frequency_hz < sampling_rate_hz / 2:
        raise AnalysisError("frequency_hz", got=f"{frequency_hz:g}", allowed=f"0 < f < {sampling_rate_hz / 2:g}")
    omega = 2 * math.pi * frequency_hz / sampling_rate_hz
    # both errors are real factors: by symmetry neither rule nor trend shifts the phase
    rule = 2 * sum(w * math.cos((k + 0.5) * omega) for k, w in enumerate(STEP_WEIGHTS[3:]))
    gain = rule * omega / (2 * math.sin(omega / 2))
    gain *= 1.0 - _trend_response(omega, sampling_rate_hz, corner_hz, order)
    return IntegrationError(gain_error=gain**n_integrations - 1.0, phase_error_rad=0.0)


def _integrated_channel(
    data: xr.DataArray, quantity_in: str, quantity_out: str, corner_hz: float, order: int
) -> xr.DataArray:
    got = data.attrs.get("quantity")
    if data.dims != ("time",) or got != quantity_in:
        raise AnalysisError(
            f"channel {data.name} to integrate to {quantity_out}",
            got=f"quantity {got!r}, dimensions {data.dims}",
            allowed=f"{quantity_in}(time)",
        )
    values = integrated(data.values, sampling_step_s(data), corner_hz=corner_hz, order=order)
    attributes = {
        "units": SI_UNITS[quantity_out],
        "quantity": quantity_out,
        "integrated_from": str(data.name),
        "high_pass_corner_hz": corner_hz,
        "high_pass_order": order,
    }
    return derived_channel(data, values, quantity_out, attributes)


def _check_settings(corner_hz: float, order: int, sampling_rate_hz: float) -> None:
    if not 0 < corner_hz <= sampling_rate_hz / 10:
        raise AnalysisError("corner_hz", got=f"{corner_hz:g}", allowed=f"0 < corner ≤ {sampling_rate_hz / 10:g}")
    if order not in range(1, _HIGHEST_ORDER + 1):
        raise AnalysisError("order of the high-pass", got=str(order), allowed=f"1 … {_HIGHEST_ORDER}")


def _block_samples(sampling_rate_hz: float, corner_hz: float) -> int:
    return max(1, round(sampling_rate_hz / (_KNOTS_PER_CORNER_PERIOD * corner_hz)))


def _n_knots(n_samples: int, block: int) -> int:
    return (n_samples - 1) // block + 2


def _penalty(sampling_rate_hz: float, corner_hz: float, order: int) -> float:
    """λ that makes the trend's response one half at the corner (for D → fine knots)."""
    # λ (2 sin ωD/2)^{2p} = 1 at the corner
    angle = math.pi * corner_hz * _block_samples(sampling_rate_hz, corner_hz) / sampling_rate_hz
    return float((2 * math.sin(angle)) ** (-2 * order))


def _trend_response(omega: float, sampling_rate_hz: float, corner_hz: float, order: int) -> float:
    """Response of the trend at ω [rad/sample], images left out."""
    block = _block_samples(sampling_rate_hz, corner_hz)
    hat = (math.sin(omega * block / 2) / math.sin(omega / 2)) ** 2 / block
    # sums over the samples of a block in closed form, not the integrals of hats, which fine blocks would miss
    gram = (2 * block**2 + 1) / (3 * block) + (block**2 - 1) / (3 * block) * math.cos(omega * block)
    stiffness = _penalty(sampling_rate_hz, corner_hz, order) * block
    stiffness *= (2 * math.sin(omega * block / 2)) ** (2 * order)
    return hat**2 / block / (gram + stiffness)


def _trend_knots(moments: FloatArray, n_samples: int, block: int, order: int, penalty: float) -> FloatArray:
    """Knot values c of (BᵀB + λD ΔᵖᵀΔᵖ) c = Bᵀx, a banded system.

    The polynomial that the penalty does not see is fitted first: it can be a thousand times larger
    than the rest, and the banded system would lose those digits.
    """
    n_knots = moments.size
    # a short stretch has too few knots for the full difference
    degree = min(order, n_knots - 1)
    bands = np.zeros((max(degree, 1) + 1, n_knots))  # lower form: bands[k, i] = A[i + k, i]
    _add_gram(bands, n_samples, block)
    # Legendre polynomials, whose columns stay independent where powers of the knot numbers would not
    unseen = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, n_knots), degree - 1)
    weighted = bands[0, :, None] * unseen  # BᵀB times the polynomials
    weighted[1:] += bands[1, :-1, None] * unseen[:-1]
    weighted[:-1] += bands[1, :-1, None] * unseen[1:]
    coefficients = np.linalg.lstsq(unseen.T @ weighted, unseen.T @ moments, rcond=None)[0]
    difference = np.array([(-1.0) ** k * math.comb(degree, k) for k in range(degree + 1)])
    for k in range(degree + 1):
        for i in range(degree + 1 - k):
            product = penalty * block * difference[i] * difference[i + k]
            bands[k, i : n_knots - degree + i] += product
    rest = solveh_banded(bands, moments - weighted @ coefficients, lower=True)
    return np.asarray(unseen @ coefficients + rest, dtype=np.float64)


def _add_gram(bands: FloatArray, n_samples: int, block: int) -> None:
    """BᵀB of the hats at the samples; only the last block may be incomplete."""
    xi = np.arange(block) / block
    full = n_samples // block
    last = xi[: n_samples - full * block]
    # samples lie on the hats at whole fractions of a block, those of the last block only as far as it goes
    for count_from, count_to, places in ((0, full, xi), (full, full + (last.size > 0), last)):
        blocks = slice(count_from, count_to)
        bands[0, blocks] += ((1 - places) ** 2).sum()
        bands[0, count_from + 1 : count_to + 1] += (places**2).sum()
        bands[1, blocks] += (places * (1 - places)).sum()


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _step_integral(values: FloatArray, i: int) -> float:
    """Integral over the step from sample i to i + 1, in steps; one-sided near the ends."""
    n = values.size
    total = 0.0
    if 2 <= i < n - 3:
        for k in range(6):
            total += STEP_WEIGHTS[k] * values[i - 2 + k]
    elif i < 2:
        weights = _FIRST_STEP if i == 0 else _SECOND_STEP
        for k in range(6):
            total += weights[k] * values[k]
    else:
        # mirrored: the same one-sided rules, from the other end
        weights = _FIRST_STEP if i == n - 2 else _SECOND_STEP
        for k in range(6):
            total += weights[k] * values[n - 1 - k]
    return total


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _cumulative(values: FloatArray, step_s: float, block: int, result: FloatArray, moments: FloatArray) -> None:
    """Fill `result` with the integral from the first sample and `moments` with Σ hat × result."""
    n = values.size
    # symmetric weights in three pairs: three products per step instead of six
    w0, w1, w2 = STEP_WEIGHTS[0], STEP_WEIGHTS[1], STEP_WEIGHTS[2]
    total = 0.0
    place, knot = 0, 0
    plain, weighted = 0.0, 0.0
    for i in range(n):
        value = total * step_s
        result[i] = value
        plain += value
        weighted += place * value
        place += 1
        # moments are gathered in the pass that integrates: a second pass would read the result again
        if place == block or i == n - 1:
            moments[knot] += plain - weighted / block
            moments[knot + 1] += weighted / block
            place, plain, weighted = 0, 0.0, 0.0
            knot += 1
        if 2 <= i < n - 3:
            total += (
                w0 * (values[i - 2] + values[i + 3])
                + w1 * (values[i - 1] + values[i + 2])
                + w2 * (values[i] + values[i + 1])
            )
        elif i < n - 1:
            total += _step_integral(values, i)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _subtract_chain(values: FloatArray, knots: FloatArray, block: int) -> None:
    """Subtract the chain of straight lines through the knots, in place."""
    n = values.size
    for knot in range(knots.size - 1):
        start = knot * block
        left = knots[knot]
        slope = (knots[knot + 1] - left) / block
        for i in range(start, min(start + block, n)):
            values[i] -= left + slope * (i - start)
