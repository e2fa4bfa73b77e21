"""What the thesis measured on its shaker, beside what an analysis of other recordings gives, as one table.

The found column is computed from `windows.nc` and `maps.nc` of `sloshlab shaker`; the spread between repeats
of one sweep is given with it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab import interrupt
from sloshlab.errors import InputError
from sloshlab.maps.map_readings import Region, region_near_largest
from studies.measured_facts.map_readings import facts_of, half_filled
from studies.measured_facts.published import (
    BEAM,
    BETA_AT_WEAKEST,
    FILLING_LEVEL,
    ISOLINE_U_BAR,
    LARGEST,
    MEAN_AT_BEAM_FREQUENCY,
    PLACE_OF_LARGEST,
    SHARE_OF_LARGEST,
    THRESHOLD_G,
    WEAKEST_G,
)

FloatArray = npt.NDArray[np.float64]

FULL_BAND: Final = (3.0, 5.0)
"""Frequencies ω̄ between which levels of acceleration are compared."""
ONSET_W_BAR: Final = 0.2
"""W̄ from which the liquid counts as dissipating."""
_LEVEL_TOLERANCE = 0.1
NEAR: Final = 0.1
"""Two values of W̄ agree if they differ by no more than this share."""


@dataclass(frozen=True)
class Fact:
    """One line of the table.

    Attributes
    ----------
    what, published, found : str
    agrees : bool or None
        None where the source gives no number or the recordings do not reach so far.
    """

    what: str
    published: str
    found: str
    agrees: bool | None


@dataclass(frozen=True)
class Results:
    """Windows and maps of an analysis.

    Attributes
    ----------
    windows, maps : xarray.Dataset
        As `sloshlab shaker` writes them.
    """

    windows: xr.Dataset
    maps: xr.Dataset

    @classmethod
    def of_folder(cls, folder: Path) -> Results:
        """Read `windows.nc` and `maps.nc`.

        Raises
        ------
        InputError
            If one is missing or has no W̄.
        """
        found = []
        for name in ("windows.nc", "maps.nc"):
            if not (folder / name).is_file():
                raise InputError(
                    f"{folder / name}", got="no such file", remedy="run sloshlab shaker -o there first"
                )
            # an interrupt within xarray would leave its lock taken for ever
            with interrupt.held():
                found.append(xr.load_dataset(folder / name, decode_times=False))
            if "w_bar" not in found[-1]:
                raise InputError(f"{folder / name}", got="no w_bar", allowed="results of sloshlab shaker")
        return cls(*found)

    def at(self, fill_level: float) -> xr.Dataset:
        """Windows of one fill level."""
        return self.windows.isel(window=np.flatnonzero(np.isclose(self.windows.fill_level, fill_level)))

    def map_of(self, fill_level: float) -> xr.Dataset | None:
        """Map of one fill level; None if it was not measured."""
        if "fill_level" not in self.maps.dims:
            return self.maps if np.isclose(self.windows.fill_level, fill_level).all() else None
        there = np.flatnonzero(np.isclose(self.maps.fill_level, fill_level))
        return self.maps.isel(fill_level=int(there[0])) if there.size else None

    def level(
        self, acceleration_g: float, fill_level: float = FILLING_LEVEL, band: tuple[float, float] = FULL_BAND
    ) -> xr.Dataset:
        """Windows near one acceleration, between two frequencies ω̄."""
        windows = self.at(fill_level)
        near = np.abs(windows.acceleration_g / acceleration_g - 1) < _LEVEL_TOLERANCE
        inside = (windows.omega_bar > band[0]) & (windows.omega_bar < band[1])
        return windows.isel(window=np.flatnonzero(near & inside))


def facts(results: Results) -> Iterator[Fact]:
    """Yield all facts in the order of the source.

    Parameters
    ----------
    results : Results
    """
    makers: tuple[Callable[[Results], Iterator[Fact]], ...] = (
        _levels,
        _maximum,
        _reference_points,
        _effective_mass,
        _fill_levels,
        _work,
        _repeats,
    )
    for make in makers:
        yield from make(results)


def _mean(values: xr.DataArray) -> float:
    return float(values.mean()) if values.size else np.nan


def _levels(results: Results) -> Iterator[Fact]:
    levels = np.array([0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0])
    means = np.array([_mean(results.level(level).w_bar) for level in levels])
    known = np.isfinite(means)
    levels, means = levels[known], means[known]
    above = np.flatnonzero(means > ONSET_W_BAR)
    onset = np.nan
    if above.size and above[0] > 0:
        k = above[0]
        onset = float(np.interp(ONSET_W_BAR, means[k - 1 : k + 1], levels[k - 1 : k + 1]))
    yield Fact(
        f"threshold: mean W̄ over ω̄ = {FULL_BAND[0]:g} … {FULL_BAND[1]:g} passes {ONSET_W_BAR:g} at",
        f"about {THRESHOLD_G:g} g",
        f"{onset:.2f} g",
        bool(0.8 * THRESHOLD_G <= onset <= 1.5 * THRESHOLD_G) if np.isfinite(onset) else None,
    )
    listed = ", ".join(
        f"{level:g} g {round(mean, 2) + 0.0:.2f}".replace("-", "−")
        for level, mean in zip(levels, means, strict=True)
    )
    quiet = means[levels < 1]
    yield Fact(
        "mean W̄ there, by level", "≈ 0 below 1 g", listed, bool((quiet < 0.1).all()) if quiet.size else None
    )
    best = int(np.argmax(means)) if means.size else 0
    falls = bool(means[-1] < means[best]) if means.size and levels[-1] > 4 else None
    yield Fact("W̄ falls again at high acceleration", "yes, beyond about 4 g", _yes(falls), falls)


def _yes(value: bool | None) -> str:
    return "not measured" if value is None else "yes" if value else "no"


def _measured(maps: xr.Dataset) -> xr.DataArray:
    """W̄ over ω̄ and ū, NaN where it was not measured."""
    w_bar, measured = (maps[name].transpose("omega_bar", "u_bar") for name in ("w_bar", "measured"))
    return w_bar.where(measured.astype(bool))


def _maximum(results: Results) -> Iterator[Fact]:
    maps = results.map_of(FILLING_LEVEL)
    if maps is None:
        return
    found = facts_of(half_filled(maps)).largest
    omega_bar, u_bar = found.omega_bar, found.u_bar
    yield Fact(
        "maximum of W̄",
        f"{LARGEST.w_bar:g} at ω̄ = {LARGEST.omega_bar:g}, near {LARGEST.u_bar * LARGEST.omega_bar**2:.0f} g",
        f"{found.w_bar:.2f} at ω̄ = {omega_bar:.2f}, ū = {u_bar:.2f} ({u_bar * omega_bar**2:.1f} g)",
        abs(found.w_bar / LARGEST.w_bar - 1) < NEAR,
    )
    (slow, fast), (small, large) = PLACE_OF_LARGEST
    inside = bool(slow <= omega_bar <= fast and small <= u_bar <= large)
    place = f"ω̄ = {slow:g} … {fast:g}, ū = {small:g} … {large:g}"
    yield Fact("its place", place, "inside" if inside else "outside", inside)


def _reference_points(results: Results) -> Iterator[Fact]:
    maps = results.map_of(FILLING_LEVEL)
    if maps is None:
        return
    value = facts_of(half_filled(maps)).w_bar_of_beam
    yield Fact(
        f"W̄ at ω̄ = {BEAM.omega_bar:g} (10.7 Hz), ū = {BEAM.u_bar:g}",
        f"{BEAM.w_bar:g}",
        f"{value:.2f}",
        bool(abs(value / BEAM.w_bar - 1) < NEAR) if np.isfinite(value) else None,
    )
    w_bar = _measured(maps)
    row = w_bar.to_numpy()[np.abs(maps.omega_bar.to_numpy() - BEAM.omega_bar).argmin()]
    from_1_g = np.isfinite(row) & (maps.u_bar.to_numpy() * BEAM.omega_bar**2 >= THRESHOLD_G)
    mean = float(row[from_1_g].mean()) if from_1_g.any() else np.nan
    yield Fact(
        f"mean over ū at ω̄ = {BEAM.omega_bar:g}, from {THRESHOLD_G:g} g up",
        f"{MEAN_AT_BEAM_FREQUENCY:g}",
        f"{mean:.2f}",
        bool(abs(mean / MEAN_AT_BEAM_FREQUENCY - 1) < NEAR) if np.isfinite(mean) else None,
    )


def _effective_mass(results: Results) -> Iterator[Fact]:
    windows = results.at(FILLING_LEVEL)
    negative = float((windows.beta < 0).mean()) if windows.sizes["window"] else np.nan
    yield Fact("β < 0", "everywhere", f"in {100 * negative:.0f} % of the windows", negative > 0.95)
    quiet = _mean(results.level(WEAKEST_G, band=(0.0, np.inf)).beta)
    yield Fact(
        f"mean β at {WEAKEST_G:g} g, all frequencies",
        f"{BETA_AT_WEAKEST:.3f}".replace("-", "−"),
        f"{quiet:.3f}".replace("-", "−"),
        bool(abs(quiet - BETA_AT_WEAKEST) < 0.05) if np.isfinite(quiet) else None,
    )


def _region(results: Results, fill_level: float) -> Region | None:
    maps = results.map_of(fill_level)
    return None if maps is None else region_near_largest(_measured(maps), SHARE_OF_LARGEST)


def _fill_levels(results: Results) -> Iterator[Fact]:
    regions = {fill: _region(results, fill) for fill in (0.25, 0.5, 0.75)}
    known = {fill: region for fill, region in regions.items() if region is not None}
    lowest, highest = ISOLINE_U_BAR
    for fill, region in known.items():
        yield Fact(
            f"region above {100 * SHARE_OF_LARGEST:.0f} % of the maximum, α = {fill:g}",
            f"ū = {lowest:g} … {highest:g}",
            f"ū = {region.lowest_u_bar:.2f} … {region.highest_u_bar:.2f}, mean {region.mean_u_bar:.2f}, "
            f"{100 * region.share:.0f} % of the measured region",
            bool(lowest <= region.mean_u_bar <= highest),
        )
    if len(known) == 3:
        means = [known[fill].mean_u_bar for fill in (0.25, 0.5, 0.75)]
        shares = [known[fill].share for fill in (0.25, 0.5, 0.75)]
        moves = bool(means[0] > means[1] > means[2])
        widens = bool(shares[0] < shares[1] < shares[2])
        listed = " > ".join(f"{mean:.2f}" for mean in means)
        yield Fact("lower α moves it to larger ū", "yes", f"{_yes(moves)} ({listed})", moves)
        listed = ", ".join(f"{100 * share:.0f} %" for share in shares)
        yield Fact("higher α widens it", "yes", f"{_yes(widens)} ({listed})", widens)


def _work(results: Results) -> Iterator[Fact]:
    for level in (1.5, 3.0):
        for frequency_hz, half_is_largest in ((9.0, True), (13.0, True), (17.0, False)):
            work = {fill: _work_at(results, fill, level, frequency_hz) for fill in (0.25, 0.5, 0.75)}
            if not all(np.isfinite(value) for value in work.values()):
                continue
            largest = max(work, key=lambda fill: work[fill])
            listed = ", ".join(f"{1000 * value:.2f}" for value in work.values())
            yield Fact(
                f"α with the most work at {level:g} g, {frequency_hz:g} Hz",
                "0.5" if half_is_largest else "not 0.5",
                f"{largest:g} ({listed} mJ)",
                (largest == FILLING_LEVEL) == half_is_largest,
            )


def _work_at(results: Results, fill_level: float, level: float, frequency_hz: float) -> float:
    windows = results.at(fill_level)
    near = (np.abs(windows.acceleration_g / level - 1) < _LEVEL_TOLERANCE) & (
        np.abs(windows.frequency_hz - frequency_hz) < 0.5
    )
    return _mean(windows.work_j[np.flatnonzero(near)])


def _repeats(results: Results) -> Iterator[Fact]:
    windows = results.level(3.0)
    names = [name for name in np.unique(windows.run) if "sweep_3" in name]
    if len(names) < 2:
        return
    bins = np.linspace(*FULL_BAND, 7)
    means = []
    for name in names:
        run = windows.isel(window=np.flatnonzero(windows.run == name))
        place = np.digitize(run.omega_bar, bins)
        means.append([_mean(run.w_bar[np.flatnonzero(place == k)]) for k in range(1, len(bins))])
    spread = float(np.sqrt(np.nanmean(np.nanvar(np.array(means), axis=0, ddof=1))))
    yield Fact(
        f"spread of W̄ between {len(names)} sweeps at 3 g", "not given", f"{spread:.3f} (standard deviation)", None
    )


def table(all_facts: Sequence[Fact]) -> str:
    """Return the facts as a Markdown table.

    Parameters
    ----------
    all_facts : sequence of Fact

    Examples
    --------
    >>> print(table([Fact("maximum", "1.65", "1.60", True)]))
    | fact | measured | found | agrees |
    |---|---|---|---|
    | maximum | 1.65 | 1.60 | yes |
    """
    rows = ["| fact | measured | found | agrees |", "|---|---|---|---|"]
    verdict = {True: "yes", False: "**no**", None: "–"}
    rows += [f"| {fact.what} | {fact.published} | {fact.found} | {verdict[fact.agrees]} |" for fact in all_facts]
    return "\n".join(rows)
