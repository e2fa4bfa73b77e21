"""Noise and compression of force cells and accelerometers, with their effect on W̄ and β."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import xarray as xr

from sloshlab.conditioning.combined_channels import acceleration_channels, force_channels
from sloshlab.conditioning.gaps import sampling_step_s
from sloshlab.conditioning.quality import sample_statistics
from sloshlab.consistency.effect import Inertia
from sloshlab.consistency.finding import Finding, contradiction
from sloshlab.consistency.sensor_response import PairNoise, pair_noise
from sloshlab.consistency.series import SensorSeries

_LARGEST_NOISE_RATIO: Final = 1.5
"""Measured over stated noise: steps of a converter add a tenth, and a stated noise is known to a quarter or so."""
_COMPRESSION_SIGMA: Final = 5.0
_WINDOW_CYCLES: Final = 12
"""Of the usual windows, over which noise averages."""


def noise_findings(
    recording: xr.Dataset, acceleration: xr.DataArray, inertia: Inertia, series: SensorSeries
) -> list[Finding]:
    """More noise than stated, and characteristics that flatten, of like sensors in pairs.

    Parameters
    ----------
    recording : xarray.Dataset
    acceleration : xarray.DataArray
        `mean_acceleration` of it.
    inertia : Inertia
    series : SensorSeries
        Of the force against the acceleration, for the frequencies of the run.
    """
    found: list[Finding] = []
    n_per_block = round(1.0 / sampling_step_s(recording))
    w_bar_std = _w_bar_std_of_noise(acceleration, inertia, series)
    # noise of a force counts as it is, that of one accelerometer by its share in ü, times the mass
    groups = ((force_channels(recording), 1.0), (acceleration_channels(recording), inertia.total_kg))
    for names, force_per_unit in groups:
        share = 1.0 if names == groups[0][0] else 1.0 / len(names)
        for name, partner in zip(names, [*names[1:], names[0]], strict=True):
            if name == partner:
                continue
            pair = pair_noise(recording[name].values, recording[partner].values, n_per_block)
            found += _noise(recording[name], pair, w_bar_std * share * force_per_unit)
            found += _compression(name, pair, inertia, 1.0 / len(names))
    return found


def _noise(channel: xr.DataArray, pair: PairNoise, w_bar_std_per_unit: float) -> list[Finding]:
    stated = float(channel.attrs.get("noise_std", 0.0))
    if not stated > 0 or not pair.std > _LARGEST_NOISE_RATIO * stated:
        return []
    what = f"noise of {pair.std:.3g} {channel.attrs.get('units', '')}, {pair.std / stated:.3g} times its noise_std"
    error = 2 * w_bar_std_per_unit * pair.std
    return [contradiction("noise", what, (str(channel.name),), effect=(error, math.nan))]


def _compression(name: str, pair: PairNoise, inertia: Inertia, share: float) -> list[Finding]:
    if not pair.compression > _COMPRESSION_SIGMA * pair.compression_std:
        return []
    # y = x − x³/(3 L²): the slope at the peak is 1 − (x̂/L)², the fundamental is short by (x̂/L)²/4
    effect = inertia.of_gain(0.25 * share * pair.compression)
    what = (
        f"its gain is {100 * pair.compression:.2g} ± {100 * pair.compression_std:.1g} % smaller at both ends of "
        "its range than in the middle"
    )
    return [contradiction("linearity", what, (name,), effect=effect)]


def _w_bar_std_of_noise(acceleration: xr.DataArray, inertia: Inertia, series: SensorSeries) -> float:
    """Standard deviation of W̄ of a window for white noise of 1 N on the force.

    The work of a cycle is ∑ F u̇ Δt, so that noise σ gives σ (Ωu₀/√2) √(T Δt); W̄ divides by m_l (Ωu₀)².
    """
    omega = float(np.median(series.omega_rad_per_s))
    *_, acceleration_std = sample_statistics(acceleration.values)
    velocity = math.sqrt(2.0) * acceleration_std / omega
    period = 2 * math.pi / omega
    of_cycle = math.sqrt(0.5 * period * sampling_step_s(acceleration)) / (inertia.liquid_kg * velocity)
    return of_cycle / math.sqrt(_WINDOW_CYCLES)
