"""Sensors that measure one motion, or share one force, against each other: gains, delays, and their steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import xarray as xr

from sloshlab.conditioning.combined_channels import acceleration_channels, force_channels, mean_acceleration
from sloshlab.conditioning.redundancy import redundant_accelerometers
from sloshlab.consistency.effect import Inertia
from sloshlab.consistency.finding import Finding, OpenPoint, contradiction
from sloshlab.consistency.series import SensorSeries, sensor_series
from sloshlab.consistency.step_test import largest_step
from sloshlab.errors import AnalysisError

SIGMA: Final = 8.0
"""A series of a hundred values that are normal passes five standard deviations once in 10⁴ runs; real scatter has
heavier tails."""
N_EACH_SIDE: Final = 10
"""Blocks before and after a step."""
NORMAL_GAIN_ERROR: Final = 0.01
"""Of one sensor, as a laboratory states it (recording format: gains within ±1 % are normal)."""
_MEAN_SIGMA: Final = 5.0
"""For means of a whole run, whose scatter is known from batches."""
_SMALLEST_DELAY_SAMPLES: Final = 0.01
"""Sensors of one recorder are sampled together to so much."""
_SMALLEST_STEP_SAMPLES: Final = 0.1
"""A smaller step of a delay cannot be samples that were lost."""


def compared_series(
    recording: xr.Dataset, acceleration: xr.DataArray | None = None
) -> tuple[list[tuple[SensorSeries, float]], list[OpenPoint]]:
    """Every series of like sensors with the share that the second has in what is analysed.

    Parameters
    ----------
    recording : xarray.Dataset
    acceleration : xarray.DataArray, optional
        `mean_acceleration` of it, if it is known.

    Returns
    -------
    series : list of (SensorSeries, float)
        An error ε of the second sensor alone changes force or acceleration by share·ε; the control accelerometer
        has the share of what it is compared with.
    not_checked : list of OpenPoint
    """
    series: list[tuple[SensorSeries, float]] = []
    missing: list[OpenPoint] = []
    groups: list[tuple[str, Sequence[str]]] = []
    for what, chosen in (("force cells", force_channels), ("accelerometers of the tank", acceleration_channels)):
        try:
            together = chosen(recording)
        except AnalysisError:
            continue
        groups.append((what, together))
        if len(together) < 2:
            missing.append(OpenPoint(f"{what} against each other", "there is one only"))
    try:
        for _, names in groups:
            share = 1.0 / len(names)
            series += [(sensor_series(recording, name, recording[names[0]]), share) for name in names[1:]]
        series += _spare_accelerometers(recording, acceleration)
    except AnalysisError as error:
        missing.append(OpenPoint("like sensors against each other", str(error)))
    return series, missing


def _spare_accelerometers(
    recording: xr.Dataset, acceleration: xr.DataArray | None
) -> list[tuple[SensorSeries, float]]:
    """Accelerometers of the same rigid tank that are not analysed themselves."""
    redundant = redundant_accelerometers(recording)
    if len(redundant) < 2:
        return []
    used = acceleration_channels(recording)
    mean = mean_acceleration(recording) if acceleration is None else acceleration
    return [(sensor_series(recording, name, mean), 1.0) for name in redundant if name not in used]


def examined_pair(series: SensorSeries, share: float, inertia: Inertia, sample_s: float) -> list[Finding]:
    """What is wrong between two like sensors within one run.

    A constant difference of gain is normal for cells, which carry different loads; of accelerometers it is not.
    """
    found = (
        _delay_step(series, share, inertia, sample_s),
        _gain_step(series, share, inertia),
        _gain_drift(series, share, inertia),
        _constant_delay(series, share, inertia, sample_s),
        _constant_gain(series, share, inertia),
    )
    return [finding for finding in found if finding is not None]


def _constant_delay(series: SensorSeries, share: float, inertia: Inertia, sample_s: float) -> Finding | None:
    delay = series.mean_delay_s
    if abs(delay.value) <= _MEAN_SIGMA * delay.std + _SMALLEST_DELAY_SAMPLES * sample_s:
        return None
    what = f"the first comes {delay_text(delay.value, sample_s)} against the other"
    return contradiction(
        "delay between like sensors", what, _both(series), effect=inertia.of_delay(share * delay.value)
    )


def _constant_gain(series: SensorSeries, share: float, inertia: Inertia) -> Finding | None:
    gain = series.mean_gain
    if not series.name.startswith("acceleration"):
        return None
    if abs(gain.value - 1) <= 2 * NORMAL_GAIN_ERROR + _MEAN_SIGMA * gain.std:
        return None
    effect = inertia.of_gain(share * (gain.value - 1))
    return contradiction("gain between like sensors", f"gains are in the ratio {gain.value:.4f}", _both(series),
                         effect=effect)  # fmt: skip


def _delay_step(series: SensorSeries, share: float, inertia: Inertia, sample_s: float) -> Finding | None:
    step = largest_step(series.delay_s, N_EACH_SIDE)
    if step is None or step.sigma < SIGMA or abs(step.size) < _SMALLEST_STEP_SAMPLES * sample_s:
        return None
    what = f"the first comes {delay_text(step.size, sample_s)} from here on: samples lost or doubled"
    effect = inertia.of_delay(share * step.size)
    return contradiction("lost samples", what, _both(series), effect=effect, time_s=series.from_index(step.index))


def _gain_step(series: SensorSeries, share: float, inertia: Inertia) -> Finding | None:
    step = largest_step(series.gain, N_EACH_SIDE)
    if step is None or step.sigma < SIGMA:
        return None
    relative = step.size / series.mean_gain.value
    what = f"their ratio steps by {100 * relative:+.3g} %"
    effect = inertia.of_gain(share * relative)
    return contradiction(
        "gain over time", what, _both(series), effect=effect, time_s=series.from_index(step.index)
    )


def _gain_drift(series: SensorSeries, share: float, inertia: Inertia) -> Finding | None:
    trend = series.gain_trend
    if trend is None or abs(trend.value) < SIGMA * trend.std:
        return None
    relative = trend.value / series.mean_gain.value
    what = f"their ratio drifts by {100 * relative:+.3g} % over the run"
    return contradiction("gain over time", what, _both(series), effect=inertia.of_gain(share * relative))


def _both(series: SensorSeries) -> tuple[str, str]:
    return (series.name, series.reference)


def delay_text(delay_s: float, sample_s: float) -> str:
    """A delay in words.

    Examples
    --------
    >>> delay_text(-0.001, 0.002)
    '1 ms (0.5 samples) early'
    """
    size = f"{1e6 * abs(delay_s):.3g} µs" if abs(delay_s) < 999.5e-6 else f"{1e3 * abs(delay_s):.3g} ms"
    return f"{size} ({abs(delay_s) / sample_s:.2g} samples) {'late' if delay_s > 0 else 'early'}"
