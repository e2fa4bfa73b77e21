"""Maps of what a simulation misses: over orders of the motion, level, phase of the cycle, cells of (ω̄, ū).

Every map holds the mean excess per coefficient: squares of weighted residuals less one, zero where the recording
is followed to its noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import butter, hilbert, sosfiltfilt

from sloshlab.channel_names import ACCELERATION_CONTROL, ACCELERATION_ROOF, ACCELERATION_TIP
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.identification.observations import Observation
from sloshlab.rig import Rig

FloatArray = NDArray[np.float64]
_N_ORDERS: Final = 36
_HIGHEST_ORDER: Final = 4.5
_N_LEVELS: Final = 10
_N_PHASES: Final = 24
_N_CELLS: Final = 8
_LARGEST: Final = 1e6
"""Squares of weighted residuals are cut off there."""
_NARROW: Final = 0.6
"""Share of the power about one frequency, from which a motion has a single one."""
NAMED_ORDERS: Final = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
_ABOUT: Final = 0.2
"""Half width of the neighbourhood of an order."""


@dataclass(frozen=True, eq=False)
class Profile:
    """A mean excess over one quantity.

    Attributes
    ----------
    edges : ndarray, shape (n + 1,)
    excess : ndarray, shape (n,)
        NaN where nothing was measured.
    """

    edges: FloatArray
    excess: FloatArray

    @property
    def middles(self) -> FloatArray:
        """Middle of each class."""
        return np.asarray(0.5 * (self.edges[1:] + self.edges[:-1]))


@dataclass(frozen=True, eq=False)
class ResidualMaps:
    """All maps of one channel, over all runs.

    Attributes
    ----------
    channel : str
    order : Profile or None
        Frequency over that of the motion in the same block of time; None where the motion has no single frequency.
    level : Profile or None
        Amplitude of the acceleration [g].
    phase : Profile or None
        Phase [rad] of the acceleration of the cycle, a = a₀ cos φ: zero at the lowest point.
    omega_bar, u_bar : ndarray or None
        Edges of the cells, shape (n + 1,).
    cells : ndarray or None, shape (n, n)
        Over (ω̄, ū); NaN where nothing was measured.
    """

    channel: str
    order: Profile | None
    level: Profile | None
    phase: Profile | None
    omega_bar: FloatArray | None = None
    u_bar: FloatArray | None = None
    cells: FloatArray | None = None

    def at_orders(self) -> dict[float, float]:
        """Mean excess about each of the orders ½, 1, 1½, 2, 3, 4."""
        if self.order is None:
            return {}
        found = {}
        for order in NAMED_ORDERS:
            near = np.abs(self.order.middles - order) < _ABOUT
            values = self.order.excess[near]
            if np.isfinite(values).any():
                found[order] = float(np.nanmean(values))
        return found


@dataclass(frozen=True, eq=False)
class _Block:
    """Coefficients of one channel with what they are sorted by."""

    excess: FloatArray
    order: FloatArray
    level_g: FloatArray
    omega: FloatArray


def residual_maps(
    runs: Sequence[Sequence[Observation]], readings: Mapping[str, Mapping[str, FloatArray]], rig: Rig | None
) -> list[ResidualMaps]:
    """Maps of every channel.

    Parameters
    ----------
    runs : sequence of sequences of Observation
        Per run.
    readings : mapping of run name to mapping of channel to values
        What the simulation shows.
    rig : Rig or None
        For the scales of ω̄ and ū.
    """
    blocks: dict[str, list[_Block]] = {}
    phases: dict[str, list[tuple[FloatArray, FloatArray]]] = {}
    for observed in runs:
        motion = _motion_per_block(observed)
        turning = _phase(observed)
        for observation in observed:
            values = readings[observation.run.name][observation.channel]
            blocks.setdefault(observation.channel, []).append(
                _sorted_by(observation, observation.residual(values), motion)
            )
            if turning is not None:
                phases.setdefault(observation.channel, []).append((turning, _in_time(observation, values)))
    return [_maps(channel, found, phases.get(channel, []), rig) for channel, found in blocks.items()]


def _motion_per_block(observed: Sequence[Observation]) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Amplitude [m/s²], frequency [Hz] and purity (0 … 1) of the tank's acceleration per block."""
    names = (ACCELERATION_ROOF, ACCELERATION_TIP, ACCELERATION_CONTROL, "acceleration")
    for name in names:
        chosen = [observation for observation in observed if observation.channel.startswith(name)]
        if chosen:
            break
    else:
        return None
    power = np.mean([observation.spectra**2 for observation in chosen], axis=0)
    frequency = chosen[0].frequencies_hz
    amplitude = np.sqrt(2 * power.mean(axis=1))
    power = uniform_filter1d(power, 3, axis=0, mode="nearest")  # one block's coefficients depend on the phase
    peak = power.argmax(axis=1)
    near = np.abs(np.arange(power.shape[1])[None, :] - peak[:, None]) <= 2
    inside = np.where(near, power, 0.0)
    total = np.maximum(power.sum(axis=1), 1e-300)
    centre = (inside * frequency).sum(axis=1) / np.maximum(inside.sum(axis=1), 1e-300)
    return amplitude, centre, inside.sum(axis=1) / total


def _sorted_by(
    observation: Observation, residual: FloatArray, motion: tuple[FloatArray, FloatArray, FloatArray] | None
) -> _Block:
    excess = np.minimum(residual**2, _LARGEST) - 1.0
    missing = np.full(excess.shape[0], np.nan)
    if motion is None or motion[0].size != excess.shape[0]:
        return _Block(excess, np.full(excess.shape, np.nan), missing, missing)
    amplitude, frequency, purity = motion
    # An order means nothing where the motion has several frequencies.
    pure = np.where(purity > _NARROW, frequency, np.nan)
    order = observation.frequencies_hz[None, :] / pure[:, None]
    return _Block(excess, order, amplitude / GRAVITY_M_PER_S2, 2 * np.pi * pure)


def _phase(observed: Sequence[Observation]) -> FloatArray | None:
    """Phase of the tank's acceleration at every sample, NaN at the ends; None where it has no single frequency."""
    chosen = [
        observation
        for observation in observed
        if observation.channel.startswith((ACCELERATION_ROOF, ACCELERATION_TIP))
    ]
    if not chosen:
        return None
    run = chosen[0].run
    rate = run.attributes.sampling_rate_hz
    series = np.mean(
        [np.nan_to_num(np.asarray(run.recording[observation.channel].values)) for observation in chosen], axis=0
    )
    power = np.abs(np.fft.rfft(series - series.mean())) ** 2
    frequency = np.fft.rfftfreq(series.size, 1 / rate)
    main = float(frequency[power.argmax()])
    # Fewer than four cycles, or than four samples in each, have no phase.
    if not 4 * rate / series.size < main < 0.25 * rate:
        return None
    narrow = sosfiltfilt(butter(2, (main / 1.6, 1.6 * main), "bandpass", fs=rate, output="sos"), series)
    if np.mean(narrow**2) < _NARROW * np.mean((series - series.mean()) ** 2):
        return None
    phase = np.angle(hilbert(narrow))
    # Where the motion has died away the phase is that of a ringing filter.
    size = np.abs(hilbert(narrow))
    return np.asarray(np.where(size > 0.03 * size.max(), phase, np.nan))


def _in_time(observation: Observation, values: FloatArray) -> FloatArray:
    """Squares of the residual over its noise, less one, per sample."""
    recorded = np.asarray(observation.run.recording[observation.channel].values, np.float64)
    n = min(recorded.size, values.size)
    rest = np.full(recorded.size, np.nan)
    rest[:n] = np.where(observation.known[:n], recorded[:n] - values[:n], np.nan)
    # As in the comparison itself, a mean that means nothing is no residual.
    if not observation.keeps_mean:
        rest -= np.nanmean(rest)
    return np.asarray(np.minimum(rest**2 / float(np.median(observation.variance)), _LARGEST) - 1.0)


def _maps(
    channel: str, blocks: Sequence[_Block], phases: Sequence[tuple[FloatArray, FloatArray]], rig: Rig | None
) -> ResidualMaps:
    excess = np.concatenate([block.excess.ravel() for block in blocks])
    order = np.concatenate([block.order.ravel() for block in blocks])
    per_block = np.concatenate([block.excess.mean(axis=1) for block in blocks])
    level = np.concatenate([block.level_g for block in blocks])
    omega = np.concatenate([block.omega for block in blocks])
    over_phase = None
    if phases:
        turned, squares = (np.concatenate([pair[i] for pair in phases]) for i in range(2))
        over_phase = profile(turned, squares, np.linspace(-np.pi, np.pi, _N_PHASES + 1))
    over_order = None
    if np.isfinite(order).any():
        over_order = profile(order, excess, np.linspace(0.0, _HIGHEST_ORDER, _N_ORDERS + 1))
    over_level = None
    if np.isfinite(level).any():
        over_level = profile(level, per_block, np.linspace(0.0, 1.001 * float(np.nanmax(level)), _N_LEVELS + 1))
    known = np.isfinite(level) & np.isfinite(omega)
    if rig is None or known.sum() < _N_CELLS:
        return ResidualMaps(channel, over_order, over_level, over_phase)
    omega_bar = omega[known] / rig.frequency_scale_rad_per_s
    u_bar = level[known] * GRAVITY_M_PER_S2 / omega[known] ** 2 / rig.tank.height_m
    edges = [_edges(values) for values in (omega_bar, u_bar)]
    count, _, _ = np.histogram2d(omega_bar, u_bar, edges)
    total, _, _ = np.histogram2d(omega_bar, u_bar, edges, weights=per_block[known])
    cells = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return ResidualMaps(channel, over_order, over_level, over_phase, edges[0], edges[1], cells)


def _edges(values: FloatArray) -> FloatArray:
    low, high = float(values.min()), float(values.max())
    margin = 0.02 * max(high - low, 0.05 * abs(high), 1e-9)
    return np.linspace(low - margin, high + margin, _N_CELLS + 1)


def profile(places: FloatArray, values: FloatArray, edges: FloatArray) -> Profile:
    """Mean of values per class of their places.

    Parameters
    ----------
    places, values : ndarray, shape (n,)
        NaN in either leaves a value out.
    edges : ndarray, shape (m + 1,)

    Examples
    --------
    >>> profile(np.array([0.5, 1.5, 1.6]), np.array([1.0, 2.0, 4.0]), np.array([0.0, 1.0, 2.0])).excess
    array([1., 3.])
    """
    known = np.isfinite(places) & np.isfinite(values)
    count, _ = np.histogram(places[known], edges)
    total, _ = np.histogram(places[known], edges, weights=values[known])
    return Profile(edges, np.where(count > 0, total / np.maximum(count, 1), np.nan))
