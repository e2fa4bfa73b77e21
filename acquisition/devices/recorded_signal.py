"""A recording as the signal of a device: the stored counts, not their values.

Everything is read once, when the device is made, because the netCDF library is not made for several
threads. Long recordings are held in an unnamed temporary file instead of memory.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.devices.signal import Piece, Signal
from acquisition.samples.channel import HIGHEST_SAMPLING_RATE_HZ, MOST_CHANNELS, Channel
from sloshlab.errors import InputError, RecordingError
from sloshlab.file_structure import require_sound_structure
from sloshlab.netcdf_lock import NETCDF_LOCK
from sloshlab.recording import read_attributes
from sloshlab.units import SI_UNITS, factor_to_si

QUANTISED_BITS: Final = 24
"""Channels stored as floating-point numbers become counts of so many bits."""

_LARGEST_IN_MEMORY = 256 << 20
_LARGEST = 16 << 30
_AT_ONCE = 1 << 20
_OPTIONAL = ("range_min", "range_max", "noise_std", "x_m", "block_from", "block_to", "sensor_serial")


class RecordedSignal(Signal):
    """Counts of a recording.

    Scaled integers are played as they are stored. Floating-point channels are rounded to 24 bits with the
    scale max\\|x\\|/(2²³ − 1). A sample that is missing in all channels is not taken; where only some are
    missing, the channel's missing count is.

    Parameters
    ----------
    path : Path
        The recording.
    names : sequence of str, optional
        Which channels, in this order; all in the order of the file if not given.

    Raises
    ------
    RecordingError
        If it is no recording, has no such channel, or one that cannot be played.
    """

    def __init__(self, path: Path, names: Sequence[str] | None = None) -> None:
        self._rate_hz = read_attributes(path).sampling_rate_hz
        if self._rate_hz > HIGHEST_SAMPLING_RATE_HZ:
            allowed = f"≤ {HIGHEST_SAMPLING_RATE_HZ:g}"
            raise RecordingError(f"{path}: sampling_rate_hz", got=f"{self._rate_hz:g}", allowed=allowed)
        # with a damaged heap the HDF5 library would never come to an end
        require_sound_structure(path)
        try:
            self._channels, self._counts, self._lost = _read(path, names)
        except InputError:
            raise
        except (OSError, RuntimeError, UnicodeError, LookupError, TypeError, ValueError, OverflowError) as error:
            raise RecordingError(
                f"recording {path}",
                got=f"a file that cannot be played ({error})",
                remedy="see what `sloshlab check` says about it",
            ) from error

    @property
    def sampling_rate_hz(self) -> float:
        """As the recording states it."""
        return self._rate_hz

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The channels that are played."""
        return self._channels

    @property
    def n_samples(self) -> int:
        """Length of the recording, lost samples included."""
        return len(self._counts)

    def piece(self, start: int, stop: int) -> Piece:
        """Samples start … stop − 1."""
        return Piece(np.array(self._counts[start:stop]), ~self._lost[start:stop])


@dataclass(frozen=True)
class _Column:
    """How one stored variable becomes counts: rint((stored − `shift`)/`step`), `fill` → `missing`."""

    channel: Channel
    fill: float | None
    missing: int
    shift: int = 0
    step: float | None = None

    def read(self, variable: Any, rows: slice) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
        stored = np.asarray(variable[rows])
        if self.step is not None:
            missing = np.isnan(stored)
            counts = np.rint(np.where(missing, 0.0, stored) / self.step)
        else:
            missing = np.zeros(stored.shape, dtype=bool) if self.fill is None else stored == self.fill
            counts = stored.astype(np.int64) - self.shift
        return np.where(missing, self.missing, counts).astype(np.int32), missing


def _read(
    path: Path, names: Sequence[str] | None
) -> tuple[tuple[Channel, ...], NDArray[np.int32], NDArray[np.bool_]]:
    import netCDF4

    # beside a source that reads in another thread the library ended the process
    with NETCDF_LOCK, netCDF4.Dataset(path, mode="r") as file:
        file.set_auto_maskandscale(False)
        there = [name for name, variable in file.variables.items() if _is_channel(name, variable)]
        chosen = list(names) if names is not None else there
        if not chosen or len(chosen) > MOST_CHANNELS or len(set(chosen)) < len(chosen) or set(chosen) - set(there):
            raise RecordingError(
                f"{path}: channels", got=", ".join(chosen)[:200] or "none", allowed=", ".join(there)[:400]
            )
        n_samples = len(file.dimensions["time"])
        storage = _storage(path, n_samples, len(chosen))
        columns = [_column(path, name, file.variables[name]) for name in chosen]
        lost = np.empty(n_samples, dtype=bool)
        for start in range(0, n_samples, _AT_ONCE):
            rows = slice(start, min(start + _AT_ONCE, n_samples))
            lost[rows] = True
            for k, column in enumerate(columns):
                storage[rows, k], missing = column.read(file.variables[chosen[k]], rows)
                # lost only where all channels are: the counter of the device then jumps over the sample
                lost[rows] &= missing
    return tuple(column.channel for column in columns), storage, lost


def _is_channel(name: str, variable: Any) -> bool:
    described = "quantity" in variable.ncattrs() or name.partition("_")[0] in SI_UNITS
    return variable.dimensions == ("time",) and name != "quality" and described


def _storage(path: Path, n_samples: int, n_channels: int) -> NDArray[np.int32]:
    size = 4 * n_samples * n_channels
    if n_samples < 1 or size > _LARGEST:
        raise RecordingError(
            f"{path}: size",
            got=f"{n_samples} samples, {size / 2**30:.1f} GiB of counts",
            allowed=f"1 sample … {_LARGEST >> 30} GiB",
            remedy="play a part of it with --channels, or loop a shorter one",
        )
    if size <= _LARGEST_IN_MEMORY:
        return np.empty((n_samples, n_channels), np.int32)
    # has no name: a process that is killed leaves nothing behind
    with tempfile.TemporaryFile() as unnamed:  # the mapping keeps it alive
        return np.memmap(unnamed, np.int32, mode="w+", shape=(n_samples, n_channels))


def _column(path: Path, name: str, variable: Any) -> _Column:
    attributes = {key: _plain(variable.getncattr(key)) for key in variable.ncattrs()}
    quantity, units = attributes.get("quantity"), attributes.get("units")
    if quantity not in SI_UNITS or not isinstance(units, str):
        raise RecordingError(
            f"{path}: {name}", got=f"quantity {quantity!r}, units {units!r}", allowed="as specified"
        )
    factor_to_si(units, quantity)
    dtype = np.dtype(variable.dtype)
    if dtype.kind == "f":
        return _quantised(path, name, variable, attributes)
    if dtype.kind not in "iu":
        raise RecordingError(f"{path}: {name}", got=f"values of type {dtype}", allowed="numbers")
    return _stored(path, name, variable, attributes)


def _stored(path: Path, name: str, variable: Any, attributes: Mapping[str, Any]) -> _Column:
    """A channel of scaled integers: narrowest width that holds them, unsigned ones shifted."""
    dtype = np.dtype(variable.dtype)
    shift = 1 << (8 * dtype.itemsize - 1) if dtype.kind == "u" else 0
    fill = attributes.get("_FillValue", attributes.get("missing_value"))
    # by the readings and not by the stored type: 24 bits of most recordings take a quarter less of the line
    lowest, highest = (value - shift for value in _extremes(variable, fill))
    missing = None if fill is None else int(fill) - shift
    bits = _width(8 * dtype.itemsize, lowest, highest)
    if bits is None:
        got = f"counts {lowest} … {highest}"
        raise RecordingError(
            f"{path}: {name}", got=got, allowed="32 bits, signed", remedy="store it in fewer bits"
        )
    limit = 1 << (bits - 1)
    if missing is not None and not -limit <= missing < limit:
        # a fill value beyond these bits cannot be sent: a count that no reading has stands for it
        missing = -limit if lowest > -limit else limit - 1
        if missing == highest:
            raise RecordingError(f"{path}: {name}", got="no count free for missing readings", allowed="one")
    scale = float(attributes.get("scale_factor", 1.0))
    offset = float(attributes.get("add_offset", 0.0)) + scale * shift
    return _Column(
        _channel(name, attributes, bits, scale=scale, offset=offset, missing=missing), fill, missing or 0, shift
    )


def _width(stored_bits: int, lowest: int, highest: int) -> int | None:
    """16 bits stay 16 bits; wider storage is what the readings need, the lowest count left for missing ones."""
    if stored_bits <= 16:
        return 16
    for bits in (24, 32):
        if -(1 << (bits - 1)) < lowest and highest < 1 << (bits - 1):
            return bits
    return 32 if lowest >= -(1 << 31) and highest < 1 << 31 else None


def _quantised(path: Path, name: str, variable: Any, attributes: Mapping[str, Any]) -> _Column:
    lowest, highest = _extremes(variable, None)
    largest = max(abs(lowest), abs(highest))
    if not np.isfinite(largest):
        raise RecordingError(f"{path}: {name}", got="infinite values", allowed="numbers, NaN where lost")
    # full scale is the largest value, so that the lowest count stays free for missing readings
    step = (largest or 1.0) / (2 ** (QUANTISED_BITS - 1) - 1)
    scale = step * float(attributes.get("scale_factor", 1.0))
    missing = -(1 << (QUANTISED_BITS - 1))
    offset = float(attributes.get("add_offset", 0.0))
    channel = _channel(name, attributes, QUANTISED_BITS, scale=scale, offset=offset, missing=missing)
    return _Column(channel, None, missing, step=step)


def _extremes(variable: Any, fill: Any) -> tuple[Any, Any]:
    """Smallest and largest value that is no fill value; 0, 0 if there is none."""
    lowest, highest = [], []
    for start in range(0, len(variable), _AT_ONCE):
        part = np.asarray(variable[start : start + _AT_ONCE])
        part = (
            part[~np.isnan(part)] if part.dtype.kind == "f" else part[part != fill] if fill is not None else part
        )
        if part.size:
            lowest.append(part.min().item())
            highest.append(part.max().item())
    return min(lowest, default=0), max(highest, default=0)


def _channel(
    name: str, attributes: Mapping[str, Any], bits: int, *, scale: float, offset: float, missing: int | None
) -> Channel:
    known = {key: attributes[key] for key in _OPTIONAL if key in attributes}
    for key in ("range_min", "range_max", "noise_std", "x_m"):
        if key in known:
            known[key] = float(known[key])
    return Channel(
        name, attributes["quantity"], attributes["units"], bits, scale, offset, missing_count=missing, **known
    )


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
