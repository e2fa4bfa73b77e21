"""W̄ and β of both liquids over level and frequency, side by side.

Run as ``python -m studies.two_phase_verification.maps WINDOWS.nc FILE.png``; the windows are those
that ``make shaker`` writes of the particles' campaign, the liquid with gas is the campaign in ``shaken.json``.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pipelines.report.style import drawing_style, new_figure, png_bytes
from sloshlab.atomic_file import write_bytes
from studies.two_phase_verification.shaken import CAMPAIGN, TANK

FloatArray = NDArray[np.float64]

KEPT: Final = Path(__file__).with_name("shaken.json")
LEVELS_G: Final = tuple(sorted({case.acceleration_g for case in CAMPAIGN}))
FREQUENCIES_HZ: Final = tuple(sorted({case.frequency_hz for case in CAMPAIGN}))
FILLING_LEVEL: Final = 0.5
HALF_BAND: Final = 0.05
"""Windows whose level and frequency are as near as this, relatively, count at a point."""
MEASURED_LARGEST: Final = (11.4, 4.0)
"""Frequency [Hz] and level [g] where the source's laboratory has its largest W̄, 1.65 (1.4.2, Appendix E)."""
_RANGES: Final = {"w_bar": ("W̄", 0.0, 2.4, "viridis"), "beta": ("β", -0.6, 0.6, "RdBu_r")}


def second_map(results: Mapping[str, Mapping[str, Any]], name: str) -> FloatArray:
    """Values of the liquid with gas.

    Parameters
    ----------
    results : mapping
        As in ``shaken.json``.
    name : str
        ``w_bar`` or ``beta``.

    Returns
    -------
    ndarray, shape (n_levels, n_frequencies)
        NaN where there is no result.
    """
    values = np.full((len(LEVELS_G), len(FREQUENCIES_HZ)), np.nan)
    for case in CAMPAIGN:
        if case.name in results:
            place = LEVELS_G.index(case.acceleration_g), FREQUENCIES_HZ.index(case.frequency_hz)
            values[place] = results[case.name][name]
    return values


def first_map(windows: xr.Dataset, name: str) -> FloatArray:
    """Means of the particles' windows near the same points.

    Parameters
    ----------
    windows : Dataset
        As ``make shaker`` writes them.
    name : str
        ``w_bar`` or ``beta``.

    Returns
    -------
    ndarray, shape (n_levels, n_frequencies)
        NaN where no window is near.
    """
    level, frequency = windows["acceleration_g"].values, windows["frequency_hz"].values
    half_filled = np.isclose(windows["fill_level"].values, FILLING_LEVEL)
    values = np.full((len(LEVELS_G), len(FREQUENCIES_HZ)), np.nan)
    for i, level_g in enumerate(LEVELS_G):
        for k, frequency_hz in enumerate(FREQUENCIES_HZ):
            near = half_filled & (abs(level / level_g - 1) < HALF_BAND)
            near &= abs(frequency / frequency_hz - 1) < HALF_BAND
            if near.any():
                values[i, k] = np.nanmean(windows[name].values[near])
    return values


def maps_figure(first: Mapping[str, FloatArray], second: Mapping[str, FloatArray]) -> bytes:
    """Draw both quantities of both liquids, as PNG.

    Parameters
    ----------
    first, second : mapping
        Arrays of the particles and of the liquid with gas by ``w_bar`` and ``beta``.
    """
    from matplotlib.patches import Rectangle

    with drawing_style():
        figure = new_figure(6.4)
        grid = figure.subplots(2, 2, sharex=True, sharey=True)
        for row, (name, (symbol, low, high, colours)) in zip(grid, _RANGES.items(), strict=True):
            for axes, of_liquid, liquid in zip(row, (first, second), ("particles", "liquid and gas"), strict=True):
                image = axes.imshow(
                    of_liquid[name], origin="lower", aspect="auto", vmin=low, vmax=high, cmap=colours
                )
                for (i, k), value in np.ndenumerate(of_liquid[name]):
                    dark = name == "w_bar" and value < 0.5 * high
                    text = "–" if np.isnan(value) else f"{value:.2f}".replace("-", "−")
                    axes.text(k, i, text, ha="center", va="center", fontsize=7, color="white" if dark else "black")
                axes.set_title(f"{symbol}, {liquid}")
                column = int(np.argmin(abs(np.array(FREQUENCIES_HZ) - MEASURED_LARGEST[0])))
                corner = column - 0.5, LEVELS_G.index(MEASURED_LARGEST[1]) - 0.5
                axes.add_patch(Rectangle(corner, 1, 1, fill=False, edgecolor="red", linewidth=2))
                axes.grid(False)
                axes.set_xticks(range(len(FREQUENCIES_HZ)), [f"{value:g}" for value in FREQUENCIES_HZ])
                axes.set_yticks(range(len(LEVELS_G)), [f"{value:g}" for value in LEVELS_G])
            figure.colorbar(image, ax=list(row), label=symbol)
            row[0].set_ylabel("level [g]")
        for axes in grid[-1]:
            axes.set_xlabel("frequency [Hz]")
        return png_bytes(figure)


def facts(maps: Mapping[str, FloatArray]) -> dict[str, float]:
    """What of the source's facts a map of a half-filled tank can tell.

    Parameters
    ----------
    maps : mapping
        Arrays by ``w_bar`` and ``beta``; NaN where nothing was measured.

    Returns
    -------
    dict
        Mean W̄ over ω̄ = 3 … 5 at each level, the largest W̄ and its level [g], ω̄ and ū,
        and the share of points where β < 0.
    """
    omega_bar = 2 * np.pi * np.array(FREQUENCIES_HZ) * np.sqrt(TANK.height_m / 9.80665)
    w_bar, beta = maps["w_bar"], maps["beta"]
    band = (omega_bar >= 3) & (omega_bar <= 5)
    found = {f"mean at {level_g:g} g": float(np.nanmean(w_bar[i, band])) for i, level_g in enumerate(LEVELS_G)}
    i, k = np.unravel_index(np.nanargmax(w_bar), w_bar.shape)
    found |= {
        "largest": float(w_bar[i, k]),
        "its level": LEVELS_G[i],
        "its ω̄": float(omega_bar[k]),
        "its ū": float(LEVELS_G[i] / omega_bar[k] ** 2),
        "β < 0": float(np.mean(beta[np.isfinite(beta)] < 0)),
    }
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw, and print what the map says.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(description="Maps of W̄ and β of both liquids, side by side.")
    parser.add_argument("windows", type=Path, help="windows.nc of the particles' campaign, from make shaker")
    parser.add_argument("output", type=Path)
    chosen = parser.parse_args(arguments)
    if not chosen.windows.is_file():
        parser.error(f"got no file {chosen.windows}; allowed: windows.nc; remedy: make shaker")
    results = json.loads(KEPT.read_text())
    second = {name: second_map(results, name) for name in _RANGES}
    with xr.open_dataset(chosen.windows) as windows:
        first = {name: first_map(windows, name) for name in _RANGES}
    write_bytes(chosen.output, maps_figure(first, second))
    for title, maps in (("particles", first), ("liquid and gas", second)):
        told = ", ".join(f"{name} {value:.2f}" for name, value in facts(maps).items())
        sys.stdout.write(f"{title}: {told}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
