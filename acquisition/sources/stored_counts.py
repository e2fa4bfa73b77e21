"""The samples of a recording as counts, piece by piece, never the whole file in memory.

Channels stored as scaled integers of up to 32 bits are taken count by count as they are stored.
Channels stored as floating-point numbers, or as wider integers, become 32-bit counts. Their step is a
power of two, 2⁻³⁰ … 2⁻²⁹ of the full scale (the larger of range and largest value): 30 bits of it are
kept, and float32 values above 2⁻⁶ of it exactly.
"""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
import xarray as xr

from acquisition.samples.channel import HIGHEST_SAMPLING_RATE_HZ, MOST_CHANNELS, Channel
from acquisition.samples.delivery import CountArray
from sloshlab.errors import RecordingError
from sloshlab.file_structure import require_sound_structure
from sloshlab.netcdf_lock import NETCDF_ERRORS, NETCDF_LOCK
from sloshlab.recording import JITTER_ALLOWED_STEPS, read_attributes, validate_recording
from sloshlab.units import SI_UNITS

MISSING_COUNT: Final = -(2**31)
"""Count that stands for NaN in channels that are stored as floating-point numbers."""

_QUANTISED_BITS = 30
_PIECE_SAMPLES = 1 << 16
# a file chooses its own chunks, and each is decompressed as a whole
_LARGEST_STORAGE_CHUNK = 1 << 26
_DESCRIPTIVE = ("range_min", "range_max", "noise_std", "x_m", "block_from", "block_to", "sensor_serial")


@dataclass(frozen=True)
class _StoredChannel:
    """One channel and the way from what is stored to its counts."""

    channel: Channel
    to_counts: Callable[[np.ndarray], CountArray]


class StoredCounts:
    """A recording opened for its counts; a context manager. Several may be read at once, each in its thread.

    Parameters
    ----------
    path : path-like
        A recording.
    chosen : sequence of str, optional
        Only these channels, in this order; all by default, as the file has them.

    Attributes
    ----------
    sampling_rate_hz : float
    n_samples : int
    channels : tuple of Channel
        Units, ranges and noise as the file states them.

    Raises
    ------
    RecordingError
        If it is no recording, has no such channel, or a channel cannot become counts.
    """

    def __init__(self, path: str | os.PathLike[str], chosen: Sequence[str] | None = None) -> None:
        self._file = Path(path)
        # the library lets other threads run while it reads, and is not made for them: two recordings played at
        # once ended in a segmentation fault
        with NETCDF_LOCK, contextlib.ExitStack() as closing:
            attributes = read_attributes(self._file)
            # with a damaged heap the HDF5 library would never come to an end
            require_sound_structure(self._file)
            with self._as_recording_error():
                self._dataset = _opened(self._file, closing)
                self.sampling_rate_hz = attributes.sampling_rate_hz
                names = self._channel_names(chosen)
                self._check_attributes(names)
                self.n_samples = self._checked_length()
                self._piece_length = self._checked_piece_length(names)
                self._stored = tuple(self._stored_channel(self._dataset[name]) for name in names)
            self.channels = tuple(stored.channel for stored in self._stored)
            self._piece_start, self._piece = 0, np.empty((0, len(names)), np.int32)
            self._closing = closing.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; may be called twice."""
        with NETCDF_LOCK:
            self._closing.close()
        self._piece = self._piece[:0]

    def counts(self, start: int, stop: int) -> CountArray:
        """Counts of the samples start … stop − 1.

        Parameters
        ----------
        start, stop : int
            0 ≤ start ≤ stop ≤ `n_samples`.

        Returns
        -------
        ndarray of int32, shape (stop − start, n_channels)

        Raises
        ------
        RecordingError
            If the file is damaged there.
        """
        parts = [self._piece[:0]]
        while start < stop:
            offset = start - self._piece_start
            if not 0 <= offset < len(self._piece):
                self._load_piece(start)
                offset = start - self._piece_start
            parts.append(self._piece[offset : offset + stop - start])
            start += len(parts[-1])
        return np.concatenate(parts)

    def _load_piece(self, sample: int) -> None:
        first = sample // self._piece_length * self._piece_length
        rows = slice(first, min(first + self._piece_length, self.n_samples))
        with NETCDF_LOCK, self._as_recording_error():
            columns = [stored.to_counts(self._dataset[stored.channel.name][rows]) for stored in self._stored]
        self._piece_start, self._piece = first, np.stack(columns, axis=1)

    @contextlib.contextmanager
    def _as_recording_error(self) -> Iterator[None]:
        try:
            yield
        except RecordingError:
            raise
        except NETCDF_ERRORS as error:
            raise RecordingError(
                f"recording {self._file}",
                got=f"a file that cannot be read ({error})",
                remedy="copy the file again",
            ) from error

    def _channel_names(self, chosen: Sequence[str] | None) -> tuple[str, ...]:
        there = [str(name) for name, variable in self._dataset.variables.items() if _is_channel(name, variable)]
        names = tuple(there if chosen is None else chosen)
        if not 1 <= len(names) <= MOST_CHANNELS or len(set(names)) < len(names) or not set(names) <= set(there):
            got = f"{len(names)} channels" if chosen is None else repr(",".join(names))[:80]
            allowed = f"1 … {MOST_CHANNELS} of {', '.join(there)[:400] or 'none'}, each once"
            raise RecordingError(f"recording {self._file}: channels", got=got, allowed=allowed)
        return names

    def _check_attributes(self, names: Sequence[str]) -> None:
        """Attributes, units and names by the rules of the recording format, on two samples made up for it."""
        described = {name: ("time", np.zeros(2), _attributes(self._dataset[name])) for name in names}
        time = np.arange(2) / self.sampling_rate_hz
        # by the reader's own rules, without reading the samples
        made_up = xr.Dataset(described, coords={"time": time}, attrs=_attributes(self._dataset))
        validate_recording(made_up, name=f"recording {self._file}")

    def _checked_length(self) -> int:
        """Number of samples; the time coordinate must be uniform, as in every recording."""
        what, rate_hz = f"recording {self._file}: time", self.sampling_rate_hz
        if rate_hz > HIGHEST_SAMPLING_RATE_HZ:
            raise RecordingError(what, got=f"{rate_hz:g} Hz", allowed=f"≤ {HIGHEST_SAMPLING_RATE_HZ:g} Hz")
        time = self._dataset.variables.get("time")
        if time is None or time.dimensions != ("time",) or np.dtype(time.dtype) != np.float64 or len(time) < 2:
            raise RecordingError(what, got="none", allowed="time(time), float64, at least 2 samples")
        first, length = float(time[0]), self._checked_piece_length(("time",))
        for start in range(0, len(time), length):
            piece = np.asarray(time[start : start + length])
            expected = first + np.arange(start, start + len(piece)) / rate_hz
            allowed = JITTER_ALLOWED_STEPS / rate_hz + 4 * np.spacing(np.abs(expected).max())
            if not (np.abs(piece - expected) <= allowed).all():
                raise RecordingError(
                    what, got=f"steps that differ after sample {start}", allowed="1/sampling_rate_hz"
                )
        return len(time)

    def _checked_piece_length(self, names: Sequence[str]) -> int:
        """Samples to read at once: whole chunks of the file, since each is decompressed as a whole."""
        storage = [self._dataset[name].chunking() for name in names]
        chunk = max((layout[0] for layout in storage if isinstance(layout, list)), default=1)
        if chunk * len(names) > _LARGEST_STORAGE_CHUNK:
            raise RecordingError(
                f"recording {self._file}: chunks",
                got=f"{chunk} samples of {len(names)} channels",
                allowed=f"≤ {_LARGEST_STORAGE_CHUNK} samples in all",
                remedy="write it with smaller chunks",
            )
        return max(chunk, _PIECE_SAMPLES // chunk * chunk)

    def _stored_channel(self, variable: Any) -> _StoredChannel:
        attributes, dtype = _attributes(variable), np.dtype(variable.dtype)
        if dtype.kind not in "fiu":
            raise RecordingError(
                f"{self._file}: {variable.name}", got=f"values of type {dtype}", allowed="numbers"
            )
        scale, offset = float(attributes.get("scale_factor", 1.0)), float(attributes.get("add_offset", 0.0))
        if not (math.isfinite(scale) and scale != 0 and math.isfinite(offset)):
            got = f"scale_factor {scale:g}, add_offset {offset:g}"
            raise RecordingError(f"{self._file}: {variable.name}", got=got, allowed="finite, scale_factor not 0")
        known = {key: attributes[key] for key in _DESCRIPTIVE if key in attributes}
        channel = Channel(
            variable.name,
            attributes["quantity"],
            attributes["units"],
            scale_factor=scale,
            add_offset=offset,
            **known,
        )
        fill = attributes.get("_FillValue", attributes.get("missing_value"))
        # an attribute may be anything; what no count can equal marks none
        fill = None if fill is None or isinstance(fill, str) or np.ndim(fill) else fill
        if dtype.kind == "f" or dtype.itemsize > 4:
            return self._quantised(variable, channel, fill)
        return _as_stored(dtype, channel, fill)

    def _quantised(self, variable: Any, channel: Channel, fill: float | None) -> _StoredChannel:
        def values(raw: np.ndarray) -> np.ndarray:
            scaled = raw.astype(np.float64) * channel.scale_factor + channel.add_offset
            return scaled if fill is None else np.where(raw == fill, np.nan, scaled)

        # a power of two, so that float32 values above 2⁻⁶ of the full scale come back exactly
        step = _step(self._full_scale(variable, channel, values))

        def counts(raw: np.ndarray) -> CountArray:
            steps = np.rint(values(raw) / step)
            return np.where(np.isnan(steps), MISSING_COUNT, steps).astype(np.int32)

        described = replace(channel, bits=32, scale_factor=step, add_offset=0.0, missing_count=MISSING_COUNT)
        return _StoredChannel(described, counts)

    def _full_scale(self, variable: Any, channel: Channel, values: Callable[[np.ndarray], np.ndarray]) -> float:
        largest = max(abs(channel.range_min or 0.0), abs(channel.range_max or 0.0))
        for start in range(0, self.n_samples, self._piece_length):
            piece = np.abs(values(variable[start : start + self._piece_length]))
            largest = max(largest, float(np.max(piece, where=~np.isnan(piece), initial=0.0)))
        if not math.isfinite(largest):
            raise RecordingError(
                f"{self._file}: {channel.name}", got="infinite values", allowed="numbers, NaN where lost"
            )
        return largest


def _as_stored(dtype: np.dtype[Any], channel: Channel, fill: float | None) -> _StoredChannel:
    """Integers that fit: the same counts; unsigned ones of 32 bits move down by half their range."""
    shift = 2**31 if dtype == np.uint32 else 0
    bits = 16 if dtype.itemsize == 1 or dtype == np.int16 else 24 if dtype == np.uint16 else 32
    described = replace(
        channel,
        bits=bits,
        add_offset=channel.add_offset + channel.scale_factor * shift,
        missing_count=int(fill) - shift if fill is not None and _is_count(fill, dtype) else None,
    )
    # in 64 bits meanwhile: unsigned counts of 32 bits do not fit before they are moved down
    return _StoredChannel(described, lambda raw: (raw.astype(np.int64) - shift).astype(np.int32))


def _is_count(fill: float, dtype: np.dtype[Any]) -> bool:
    """Whether a stored integer can equal the fill value; half a count, NaN, or one beyond the type marks none."""
    limits = np.iinfo(dtype)
    return bool(limits.min <= fill <= limits.max and fill == int(fill))


def _step(full_scale: float) -> float:
    """The power of two of which the full scale has 2²⁹ … 2³⁰."""
    if full_scale == 0:
        return 2.0**-_QUANTISED_BITS
    mantissa, exponent = math.frexp(full_scale)
    exponent -= mantissa == 0.5  # a power of two is its own full scale
    return max(math.ldexp(1.0, exponent - _QUANTISED_BITS), 5e-324)


def _opened(file: Path, closing: contextlib.ExitStack) -> Any:
    import netCDF4

    dataset = netCDF4.Dataset(file, mode="r")
    closing.callback(dataset.close)
    # the counts themselves: the library would turn them into scaled values and masks
    dataset.set_auto_maskandscale(False)
    return dataset


def _is_channel(name: str, variable: Any) -> bool:
    if variable.dimensions != ("time",) or name == "quality":
        return False
    return "quantity" in variable.ncattrs() or name.partition("_")[0] in SI_UNITS


def _attributes(source: Any) -> Mapping[str, Any]:
    found = {key: source.getncattr(key) for key in source.ncattrs()}
    return {key: value.item() if isinstance(value, np.generic) else value for key, value in found.items()}
