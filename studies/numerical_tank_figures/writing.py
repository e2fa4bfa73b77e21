"""Which pictures there are, what each needs, and writing them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import xarray as xr

from pipelines.report.progress import progress
from sloshlab import atomic_file, interrupt
from sloshlab.errors import InputError
from sloshlab.rig import Rig
from studies.numerical_tank_figures.beam_release import release_plate, released
from studies.numerical_tank_figures.film import film
from studies.numerical_tank_figures.maps import maps_figure
from studies.numerical_tank_figures.plates import conditions_plate, cycle_plate
from studies.numerical_tank_figures.snapshots import (
    CYCLES_TO_WAIT,
    FRAMES_PER_CYCLE,
    FREQUENCIES_HZ,
    LEVELS_G,
    Shaking,
    Snapshot,
    snapshots,
)

FILE_NAMES: Final = {
    "snapshots": "tank_snapshots.png",
    "cycle": "tank_cycle.png",
    "release": "beam_release.png",
    "film": "tank_film.gif",
    "maps": "tank_maps.png",
}
FILM_SHAKING: Final = Shaking(4.0, 11.4)
"""Where the measured dissipation is largest, ω̄ = 3.77."""
FILM_WAIT_CYCLES: Final = 12
FILM_CYCLES: Final = 3
PLATE_PHASE_DEG: Final = 240
"""The tank goes up and is slowed down: what was thrown up reaches the roof."""
_CYCLE_STRIDE: Final = FRAMES_PER_CYCLE // 12


@dataclass(frozen=True)
class PictureSettings:
    """What the pictures are made from.

    Attributes
    ----------
    rig : Path
        Description of the tank that is computed.
    maps : Path, optional
        `maps.nc` of the numerical tank's campaign; only the picture ``maps`` needs it.
    layers_per_height : int
        Height of the tank over the distance of the particles.
    seed : int
        Of the disturbance at the start of every run.
    """

    rig: Path
    maps: Path | None = None
    layers_per_height: int = 24
    seed: int = 0


def write_pictures(names: Sequence[str], settings: PictureSettings, folder: Path) -> list[Path]:
    """Compute and draw pictures and write each as soon as it is done; the same settings give the same bytes.

    Parameters
    ----------
    names : sequence of str
        Keys of `FILE_NAMES`.
    settings : PictureSettings
    folder : Path
        Made if missing; files of the same name are replaced.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    InputError
        If a name, the rig, the maps or the resolution cannot be used; nothing is computed then.
    InstabilityError
        If a computation cannot go on.
    """
    unknown = [name for name in names if name not in FILE_NAMES]
    if unknown:
        raise InputError("picture", got=", ".join(unknown), allowed=", ".join(FILE_NAMES))
    rig = Rig.from_toml(settings.rig)
    maps = _read_maps(settings.maps) if "maps" in names else None
    film_frames: list[Snapshot] = []
    drawn: dict[str, Callable[[], bytes]] = {
        "snapshots": lambda: conditions_plate(_conditions(rig, settings), rig.tank),
        "cycle": lambda: cycle_plate(
            _film_snapshots(rig, settings, film_frames)[: 12 * _CYCLE_STRIDE : _CYCLE_STRIDE], rig.tank
        ),
        "release": lambda: release_plate(
            released(rig, layers_per_height=settings.layers_per_height, seed=settings.seed), rig
        ),
        "film": lambda: film(_film_snapshots(rig, settings, film_frames), rig.tank),
    }
    if maps is not None:
        drawn["maps"] = lambda: maps_figure(maps, rig)
    written = []
    for name in names:
        atomic_file.write_bytes(folder / FILE_NAMES[name], drawn[name]())
        written.append(folder / FILE_NAMES[name])
    return written


def _read_maps(path: Path | None) -> xr.Dataset:
    if path is None:
        raise InputError("maps", got="no file", allowed="maps.nc of `sloshlab shaker`", remedy="give --maps")
    try:
        with interrupt.held(), xr.open_dataset(path, engine="netcdf4") as maps:
            return maps.load()
    except (OSError, ValueError) as error:
        raise InputError(f"{path}", got=f"{error}", allowed="maps.nc of `sloshlab shaker`") from error


def _conditions(rig: Rig, settings: PictureSettings) -> list[Snapshot]:
    """The twelve conditions at one phase, after the wait of their level."""
    found = []
    with progress("snapshots", len(LEVELS_G) * len(FREQUENCIES_HZ)) as advance:
        for level_g in LEVELS_G:
            for frequency_hz in FREQUENCIES_HZ:
                frame = CYCLES_TO_WAIT[level_g] * FRAMES_PER_CYCLE + PLATE_PHASE_DEG * FRAMES_PER_CYCLE // 360
                found += _computed(rig, settings, Shaking(level_g, frequency_hz), [frame])
                advance(f"{level_g:g} g, {frequency_hz:g} Hz")
    return found


def _film_snapshots(rig: Rig, settings: PictureSettings, known: list[Snapshot]) -> list[Snapshot]:
    """The frames of the film, computed once: kept in `known`."""
    if not known:
        first = FILM_WAIT_CYCLES * FRAMES_PER_CYCLE
        known += _computed(rig, settings, FILM_SHAKING, range(first, first + FILM_CYCLES * FRAMES_PER_CYCLE))
    return known


def _computed(rig: Rig, settings: PictureSettings, shaking: Shaking, frames: Sequence[int]) -> list[Snapshot]:
    layers, seed = settings.layers_per_height, settings.seed
    return list(snapshots(rig, shaking, frames, layers_per_height=layers, seed=seed))
