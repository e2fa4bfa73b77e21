"""Generalised forces kept in netCDF, under a hash of everything that made them.

A second file holds the SHA-256 of the first: a damaged one is noticed before the netCDF library reads it.
"""

from __future__ import annotations

import enum
import hashlib
from pathlib import Path

import numpy as np
import xarray as xr

from sloshlab import atomic_file, interrupt
from sloshlab.aeroelastic.arrays import FloatArray
from sloshlab.aeroelastic.generalised_forces import GeneralisedForces, generalised_forces
from sloshlab.aeroelastic.lattice import Progress, panelaero_version
from sloshlab.aeroelastic.planform import Boxes
from sloshlab.aeroelastic.splines import BoxMotion
from sloshlab.netcdf_lock import NETCDF_LOCK

_FORMAT = "generalised forces 1"
_HASH_DIGITS = 24


class CacheStatus(enum.Enum):
    """How generalised forces were obtained; the value says it in words."""

    MADE = "computed and kept"
    READ = "read from the cache"
    DAMAGED = "computed anew, because the kept ones were damaged"


def cached_generalised_forces(
    folder: Path,
    boxes: Boxes,
    motion: BoxMotion,
    reduced_frequency: FloatArray,
    *,
    semi_chord_m: float,
    mach: float,
    n_gust_zones: int = 1,
    progress: Progress | None = None,
) -> tuple[GeneralisedForces, CacheStatus]:
    """Generalised forces from the cache, or computed and kept.

    Parameters
    ----------
    folder : Path
        Of the cache; made if missing.
    boxes, motion, reduced_frequency, semi_chord_m, mach, n_gust_zones, progress
        As for `generalised_forces`.

    Returns
    -------
    GeneralisedForces
        The forces.
    CacheStatus
        Where they are from.
    """
    key = _key(boxes, motion, np.asarray(reduced_frequency, dtype=float), (semi_chord_m, mach, n_gust_zones))
    place = folder / f"generalised_forces_{key}.nc"
    kept = _read(place) if place.exists() else None
    if kept is not None:
        return kept, CacheStatus.READ
    status = CacheStatus.DAMAGED if place.exists() else CacheStatus.MADE
    made = generalised_forces(
        boxes,
        motion,
        reduced_frequency,
        semi_chord_m=semi_chord_m,
        mach=mach,
        n_gust_zones=n_gust_zones,
        progress=progress,
    )
    _write(made, place, key)
    return made, status


def _key(boxes: Boxes, motion: BoxMotion, reduced_frequency: FloatArray, numbers: tuple[float, float, int]) -> str:
    digest = hashlib.sha256(f"{_FORMAT} PanelAero {panelaero_version()} {numbers!r}".encode())
    arrays = (
        boxes.corner_m,
        motion.control_displacement,
        motion.control_slope,
        motion.load_displacement,
        reduced_frequency,
    )
    for array in arrays:
        digest.update(f"{array.shape}".encode())
        digest.update(np.ascontiguousarray(array, dtype="<f8").tobytes())
    return digest.hexdigest()[:_HASH_DIGITS]


def _checksum_of(place: Path) -> Path:
    return place.with_suffix(".sha256")


def _write(forces: GeneralisedForces, place: Path, key: str) -> None:
    variables = {
        "motion": (("reduced_frequency", "force", "coordinate", "part"), _parts(forces.motion)),
        "gust": (("reduced_frequency", "force", "zone", "part"), _parts(forces.gust)),
        "travelling_gust": (("reduced_frequency", "force", "part"), _parts(forces.travelling_gust)),
        "zone_place_m": ("zone", forces.zone_place_m),
    }
    dataset = xr.Dataset(
        variables,
        {"reduced_frequency": forces.reduced_frequency, "part": ["real", "imag"]},
        {"title": _FORMAT, "made_of": key, "semi_chord_m": forces.semi_chord_m, "mach": forces.mach},
    )
    with atomic_file.together() as stagings:
        temporary = stagings.file(place)
        with NETCDF_LOCK, interrupt.held():
            dataset.to_netcdf(temporary, engine="netcdf4", format="NETCDF4")
        digest = hashlib.sha256(temporary.read_bytes()).hexdigest()
        stagings.file(_checksum_of(place)).write_text(digest, encoding="ascii")


def _read(place: Path) -> GeneralisedForces | None:
    """What is kept, None if it is damaged."""
    try:
        stated = _checksum_of(place).read_text(encoding="ascii")
        if hashlib.sha256(place.read_bytes()).hexdigest() != stated:
            return None
    except (OSError, UnicodeDecodeError):
        return None
    with NETCDF_LOCK, interrupt.held(), xr.open_dataset(place, engine="netcdf4") as opened:
        dataset = opened.load()
    return GeneralisedForces(
        dataset["reduced_frequency"].values,
        _whole(dataset["motion"].values),
        _whole(dataset["gust"].values),
        _whole(dataset["travelling_gust"].values),
        dataset["zone_place_m"].values,
        float(dataset.attrs["semi_chord_m"]),
        float(dataset.attrs["mach"]),
    )


def _parts(values: np.ndarray) -> FloatArray:
    return np.stack([values.real, values.imag], axis=-1)


def _whole(parts: np.ndarray) -> np.ndarray:
    return np.asarray(parts[..., 0] + 1j * parts[..., 1], dtype=complex)
