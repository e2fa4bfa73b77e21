"""Do the accelerometers of a rigid tank agree, so soon after the recording that one can still look?"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from acquisition.recorder.recording_plan import Part
from sloshlab.conditioning.quality import LARGEST_GAIN_DISAGREEMENT
from sloshlab.conditioning.redundancy import PairAgreement, agreement, redundant_accelerometers
from sloshlab.conditioning.resampling import resampled
from sloshlab.errors import AnalysisError
from sloshlab.units import factor_to_si

# sensors at rest have no gain to compare: noise alone feigned a wrong one
_MOTION_OVER_NOISE = 3.0

LARGEST_DELAY_S: Final = 2e-3
"""Accelerometers of one tank further apart in time than this are remarked on: 0.25 rad at 20 Hz."""


def doubtful_sensors(parts: Sequence[Part], experiment: str) -> list[str]:
    """One remark per accelerometer of the tank that disagrees with the first one; shaker experiments only."""
    # on the shaker the tank is rigid, so that its accelerometers read the same; elsewhere nothing need agree
    if not experiment.startswith("shaker_"):
        return []
    recording = _thinned_recording(parts)
    names = redundant_accelerometers(recording)
    if len(names) < 2 or not any(_moves(recording[name]) for name in names):
        return []
    try:
        agreed = agreement(recording, names)
    except AnalysisError as error:
        return [f"redundant accelerometers were not compared: {error}"]
    remarks = [_remark(pair) for pair in agreed.pairs if _disagrees(pair)]
    return [f"{remark}; sensor swapped or gain wrong?" for remark in remarks]


def _thinned_recording(parts: Sequence[Part]) -> xr.Dataset:
    """Accelerations of all devices on the thinned time base of the first, in m/s²."""
    base = parts[0]
    step_s = base.survey.thinned_by / base.placement.info.sampling_rate_hz
    n = base.placement.n_samples // base.survey.thinned_by
    variables = {}
    for part in parts:
        for name, channel in zip(part.names, part.channels, strict=True):
            if channel.quantity == "acceleration" and channel.name in part.survey.thinned:
                values = _on_base(part, part.survey.thinned[channel.name], n, step_s)
                factor = factor_to_si(channel.units, "acceleration")
                # at least one count, where the device states no noise
                noise = factor * max(channel.noise_std or 0.0, abs(channel.scale_factor))
                attributes = {"quantity": "acceleration", "noise_std": noise}
                variables[name] = ("time", factor * values, attributes)
    return xr.Dataset(variables, coords={"time": step_s * np.arange(n)})


def _moves(channel: xr.DataArray) -> bool:
    """Whether there is more than noise to compare."""
    values = channel.values[np.isfinite(channel.values)]
    return bool(values.size) and float(values.std()) > _MOTION_OVER_NOISE * channel.attrs["noise_std"]


def _on_base(part: Part, values: NDArray[np.float64], n: int, step_s: float) -> NDArray[np.float64]:
    # means of samples belong to the middle of them, on the time base as well
    own_step_s = part.survey.thinned_by * part.alignment.step_s
    own_start_s = part.alignment.start_s + 0.5 * (own_step_s - part.alignment.step_s)
    rate_hz = part.placement.info.sampling_rate_hz
    base_start_s = 0.5 * (step_s - 1.0 / rate_hz) if part.survey.thinned_by > 1 else 0.0
    if part.alignment.start_s == 0 and own_step_s == step_s:
        return values[:n] if values.size >= n else np.append(values, np.full(n - values.size, np.nan))
    places = (base_start_s + step_s * np.arange(n) - own_start_s) / own_step_s
    return resampled(values, places, rate_ratio=own_step_s / step_s)


def _disagrees(pair: PairAgreement) -> bool:
    gain_is_good = abs(pair.gain_ratio - 1) <= LARGEST_GAIN_DISAGREEMENT
    return not gain_is_good or pair.sign < 0 or not abs(pair.delay_s) <= LARGEST_DELAY_S


def _remark(pair: PairAgreement) -> str:
    return (
        f"{pair.name} disagrees with {pair.reference}: gain {pair.sign * pair.gain_ratio:.4g}, "
        f"delay {1e3 * pair.delay_s:.3g} ms"
    )
