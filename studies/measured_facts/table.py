"""What the thesis measured on its shaker, beside what an analysis of other recordings gives, as one table.

The found column is computed from `windows.nc` and `maps.nc` of `sloshlab shaker`, or from windows alone where a
liquid was computed at single points; the spread between repeats of one sweep is given with it.
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
from studies.measured_facts.laboratory import (
    BEAM,
    FACTS,
    FILLING_LEVEL,
    FULL_BAND,
    ONSET_W_BAR,
    SHARE_OF_LARGEST,
    WEAKEST_G,
)
from studies.measured_facts.map_readings import facts_of, half_filled

FloatArray = npt.NDArray[np.float64]

_LEVEL_TOLERANCE: Final = 0.1
_NEAR_FREQUENCY: Final = 0.02
NOT_COMPUTED: Final = "not computed"


@dataclass(frozen=True)
class Fact:
    """One line of the table.

    Attributes
    ----------
    what, published, found : str
    agrees : bool or None
        None where the source gives no number or the recordings do not reach so far.
    name : str
        As in ``laboratory.toml``; empty for what is no fact of the source.
    """

    what: str
    published: str
    found: str
    agrees: bool | None
    name: str = ""


@dataclass(frozen=True)
class Results:
    """Windows and maps of an analysis.

    Attributes
    ----------
    windows : xarray.Dataset
        As `sloshlab shaker` writes them, or of single points.
    maps : xarray.Dataset, optional
        As `sloshlab shaker` writes them.
    """

    windows: xr.Dataset
    maps: xr.Dataset | None = None

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
        if self.maps is None:
            return None
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
    """Yield all facts in the order of the source; where a liquid tells nothing of one, it is not computed.

    Parameters
    ----------
    results : Results
        Of any liquid.
    """
    makers: tuple[Callable[[Results], Iterator[Fact]], ...] = (
        _levels,
        _maximum,
        _reference_points,
        _effective_mass,
        _fill_levels,
        _work,
    )
    made = {fact.name: fact for make in makers for fact in make(results)}
    yield from (made.get(name) or _fact(name, "", None) for name in FACTS)
    yield from _repeats(results)


def _fact(name: str, found: str, agrees: bool | None) -> Fact:
    """A fact of the source with what was found; nothing is found where a value is not finite."""
    of_source = FACTS[name]
    told = found if found and "nan" not in found else NOT_COMPUTED
    return Fact(of_source.what, of_source.published, told, agrees if told != NOT_COMPUTED else None, name)


def _number(name: str, value: float, found: str) -> Fact:
    return _fact(name, found, FACTS[name].agrees(value) if np.isfinite(value) else None)


def _mean(values: xr.DataArray) -> float:
    return float(values.mean()) if values.size else np.nan


def _signed(text: str) -> str:
    return text.replace("-", "−")


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
    yield _number("threshold", onset, f"{onset:.2f} g")
    listed = _signed(
        ", ".join(f"{level:g} g {round(mean, 2) + 0.0:.2f}" for level, mean in zip(levels, means, strict=True))
    )
    quiet = means[levels < FACTS["threshold"].numbers["value"]]
    yield _fact("quiet", listed, all(FACTS["quiet"].agrees(mean) for mean in quiet) if quiet.size else None)
    best = int(np.argmax(means)) if means.size else 0
    beyond = means.size > 0 and levels[-1] > FACTS["falls"].numbers["value"]
    falls = bool(means[-1] < means[best]) if beyond else None
    yield _fact("falls", "" if falls is None else _yes(falls), falls)


def _yes(value: bool) -> str:
    return "yes" if value else "no"


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
    told = f"{found.w_bar:.2f} at ω̄ = {omega_bar:.2f}, ū = {u_bar:.2f} ({u_bar * omega_bar**2:.1f} g)"
    yield _number("largest", found.w_bar, told)
    numbers = FACTS["place"].numbers
    (slow, fast), (small, large) = numbers["omega_bar_range"], numbers["u_bar_range"]
    inside = bool(slow <= omega_bar <= fast and small <= u_bar <= large)
    yield _fact("place", "inside" if inside else "outside", inside)


def _reference_points(results: Results) -> Iterator[Fact]:
    maps = results.map_of(FILLING_LEVEL)
    value = _at_beam(results) if maps is None else facts_of(half_filled(maps)).w_bar_of_beam
    yield _number("beam", value, f"{value:.2f}")
    if maps is None:
        return
    numbers = FACTS["row"].numbers
    w_bar = _measured(maps)
    row = w_bar.to_numpy()[np.abs(maps.omega_bar.to_numpy() - numbers["omega_bar"]).argmin()]
    counts = np.isfinite(row) & (maps.u_bar.to_numpy() * numbers["omega_bar"] ** 2 >= numbers["from_g"])
    mean = float(row[counts].mean()) if counts.any() else np.nan
    yield _number("row", mean, f"{mean:.2f}")


def _at_beam(results: Results) -> float:
    """W̄ of the windows at the beam's own point, where there are some."""
    level = results.level(BEAM.u_bar * BEAM.omega_bar**2)
    return _mean(level.w_bar[np.flatnonzero(np.abs(level.omega_bar / BEAM.omega_bar - 1) < _NEAR_FREQUENCY)])


def _effective_mass(results: Results) -> Iterator[Fact]:
    windows = results.at(FILLING_LEVEL)
    negative = float((windows.beta < 0).mean()) if windows.sizes["window"] else np.nan
    yield _number("effective_mass", negative, f"in {100 * negative:.0f} % of the windows")
    quiet = _mean(results.level(WEAKEST_G, band=(0.0, np.inf)).beta)
    yield _number("weakest", quiet, _signed(f"{quiet:.3f}"))


def _region(results: Results, fill_level: float) -> Region | None:
    maps = results.map_of(fill_level)
    return None if maps is None else region_near_largest(_measured(maps), SHARE_OF_LARGEST)


def _fill_levels(results: Results) -> Iterator[Fact]:
    regions = {fill: _region(results, fill) for fill in (0.25, 0.5, 0.75)}
    known = {fill: region for fill, region in regions.items() if region is not None}
    for fill, region in known.items():
        yield _number(
            f"region_{fill:g}",
            region.mean_u_bar,
            f"ū = {region.lowest_u_bar:.2f} … {region.highest_u_bar:.2f}, mean {region.mean_u_bar:.2f}, "
            f"{100 * region.share:.0f} % of the measured region",
        )
    if len(known) == 3:
        means = [known[fill].mean_u_bar for fill in (0.25, 0.5, 0.75)]
        shares = [known[fill].share for fill in (0.25, 0.5, 0.75)]
        moves = bool(means[0] > means[1] > means[2])
        widens = bool(shares[0] < shares[1] < shares[2])
        listed = " > ".join(f"{mean:.2f}" for mean in means)
        yield _fact("moves", f"{_yes(moves)} ({listed})", moves)
        listed = ", ".join(f"{100 * share:.0f} %" for share in shares)
        yield _fact("widens", f"{_yes(widens)} ({listed})", widens)


def _work(results: Results) -> Iterator[Fact]:
    for name, fact in FACTS.items():
        if "half_filled_is_largest" not in fact.numbers:
            continue
        level, frequency_hz = fact.numbers["acceleration_g"], fact.numbers["frequency_hz"]
        work = {fill: _work_at(results, fill, level, frequency_hz) for fill in (0.25, 0.5, 0.75)}
        if not all(np.isfinite(value) for value in work.values()):
            continue
        largest = max(work, key=lambda fill: work[fill])
        listed = ", ".join(f"{1000 * value:.2f}" for value in work.values())
        agrees = (largest == FILLING_LEVEL) == fact.numbers["half_filled_is_largest"]
        yield _fact(name, f"{largest:g} ({listed} mJ)", agrees)


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
