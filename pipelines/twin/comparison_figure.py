"""Recorded and simulated over time, where a twin is compared with a run of another configuration."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.report.style import NEUTRAL_COLOUR, REFERENCE_COLOUR, drawing_style, new_figure, plain, png_bytes

FloatArray = npt.NDArray[np.float64]

_MOST_CHANNELS: Final = 3
_LEAST_SHARE: Final = 0.05
"""Of the share of the channel that differs most; others differ by noise."""
_SHOWN_S: Final = 0.5
"""Of each channel: some cycles of what shakers and guides do."""


def comparison_png(recording: xr.Dataset, simulated: xr.Dataset) -> bytes | None:
    """The channels that differ most, where they differ most; None where nothing can be compared.

    Parameters
    ----------
    recording, simulated : xarray.Dataset
        Of the same run, with channels of the same names.

    Returns
    -------
    bytes or None
        A PNG.
    """
    differences = _differences(recording, simulated)
    if not differences:
        return None
    shares = {name: _share(recording, name, difference) for name, difference in differences.items()}
    least = _LEAST_SHARE * max(shares.values())
    shown = sorted((name for name in shares if shares[name] >= least), key=lambda name: -shares[name])
    shown = shown[:_MOST_CHANNELS]
    time = np.asarray(recording["time"].values, np.float64)
    part = _worst_part(time, differences[shown[0]])
    with drawing_style():
        figure = new_figure(0.5 + 1.6 * len(shown))
        for axes, name in zip(figure.subplots(len(shown), 1, squeeze=False)[:, 0], shown, strict=True):
            recorded = np.asarray(recording[name].values, np.float64)[part]
            axes.plot(time[part], recorded, color=NEUTRAL_COLOUR, lw=2.0, alpha=0.6, label="recorded")
            twin = np.asarray(simulated[name].values, np.float64)[part]
            axes.plot(time[part], twin, color=REFERENCE_COLOUR, lw=0.9, label="simulated")
            axes.set_ylabel(f"{plain(name)}\n[{plain(recording[name].attrs.get('units', ''))}]", fontsize=7)
        axes.set_xlabel("time [s]")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside upper right", ncols=2)
        return png_bytes(figure)


def _differences(recording: xr.Dataset, simulated: xr.Dataset) -> dict[str, FloatArray]:
    """By channel, where both are known somewhere and not the same, as those that drive are."""
    found = {}
    for name in map(str, simulated.data_vars):
        if name == "quality" or name not in recording.data_vars or recording[name].shape != simulated[name].shape:
            continue
        both = np.asarray(recording[name].values, np.float64), np.asarray(simulated[name].values, np.float64)
        difference = both[0] - both[1]
        if np.isfinite(difference).any() and np.nanmax(np.abs(difference)) > 0:
            found[name] = difference
    return found


def _share(recording: xr.Dataset, name: str, difference: FloatArray) -> float:
    """Of a channel's motion, how much differs."""
    size = float(np.nanstd(np.asarray(recording[name].values, np.float64)))
    return float(np.sqrt(np.nanmean(difference**2))) / max(size, 1e-300)


def _worst_part(time: FloatArray, difference: FloatArray) -> slice:
    """The half second that differs most."""
    step = float(time[-1] - time[0]) / max(time.size - 1, 1)
    n = min(max(2, round(_SHOWN_S / max(step, 1e-300))), time.size)
    power = np.concatenate([[0.0], np.cumsum(np.nan_to_num(difference) ** 2)])
    first = int(np.argmax(power[n:] - power[: power.size - n]))
    return slice(first, first + n)
