"""The recording format: one run is one netCDF-4 file.

Readers accept exactly the format; variables and attributes that it does not know are kept. Units
are converted to SI once, on reading. Sizes are checked before anything is allocated.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeVar

import numpy as np
import numpy.typing as npt
import xarray as xr
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from sloshlab import atomic_file, interrupt, limited_process
from sloshlab.configurations import CONFIGURATIONS
from sloshlab.errors import RecordingError, SloshlabError, UnitsError
from sloshlab.experiments import EXPERIMENTS, recorded_experiments
from sloshlab.file_structure import require_recording_file, require_sound_structure
from sloshlab.hdf5_contents import require_self_contained
from sloshlab.limited_process import ReadingLimits, UntrustedFile
from sloshlab.netcdf_lock import NETCDF_LOCK
from sloshlab.registry import one_of
from sloshlab.units import SI_UNITS, ChannelQuantity, factor_to_si

FORMAT: Final = "1"
MAXIMUM_DECODED_BYTES: Final = 6 * 2**30
"""Recordings that would need more memory than this once decoded are refused before allocation."""

JITTER_ALLOWED_STEPS: Final = 1e-6
"""Largest deviation of the time coordinate from a uniform one, in steps."""

LOST, CLIPPED, CRC_REPAIRED, OUT_OF_ORDER, STUCK = 1, 2, 4, 8, 16
"""Bits of `quality(time)`."""

_QUALITY_MEANINGS: Final = {
    LOST: "lost",
    CLIPPED: "clipped",
    CRC_REPAIRED: "crc_repaired",
    OUT_OF_ORDER: "out_of_order",
    STUCK: "stuck",
}

_LIMITS: Final = ReadingLimits(memory_bytes=MAXIMUM_DECODED_BYTES + 2**31, computing_s=300.0)
"""Beside the recording its time coordinate and blocks are in memory. The largest recording takes 90 s to decode
(70 MB/s, raw_data/numerical_tank on one core of 2 GHz); more than three times that is no reading any more."""

# Times are checked part by part, so that no copy of a long coordinate is made.
_TIME_CHUNK = 1 << 18
_DECODING_BLOCK = 1 << 20

RecordedExperiment = Annotated[str, one_of(recorded_experiments)]
Configuration = Annotated[str, one_of(lambda: CONFIGURATIONS)]
"""Fields that take a name of their vocabulary."""

PositiveFloat = Annotated[float, Field(gt=0, allow_inf_nan=False)]
FiniteFloat = Annotated[float, Field(allow_inf_nan=False)]


def quality_attributes() -> dict[str, Any]:
    """Attributes of `quality(time)` that say what its bits mean, in CF's words.

    Returns
    -------
    dict
        ``flag_masks`` (ndarray of uint8) and ``flag_meanings`` (str), in the same order.

    Examples
    --------
    >>> quality_attributes()["flag_masks"].tolist(), quality_attributes()["flag_meanings"]
    ([1, 2, 4, 8, 16], 'lost clipped crc_repaired out_of_order stuck')
    """
    masks = np.array(list(_QUALITY_MEANINGS), dtype=np.uint8)
    return {"flag_masks": masks, "flag_meanings": " ".join(_QUALITY_MEANINGS.values())}


class RunAttributes(BaseModel):
    """Global attributes of a recording; unknown ones are kept."""

    model_config = ConfigDict(frozen=True, extra="allow", strict=True)

    sloshlab_format: Literal["1"]
    run_id: Annotated[str, Field(min_length=1, max_length=200)]
    experiment: RecordedExperiment
    configuration: Configuration
    rig: str
    sampling_rate_hz: PositiveFloat
    start_time_utc: str
    initial_displacement_m: FiniteFloat | None = None
    sweep_start_hz: PositiveFloat | None = None
    sweep_rate_octave_per_s: FiniteFloat | None = None
    acceleration_g: FiniteFloat | None = None
    repeat: int | None = None

    @field_validator("start_time_utc")
    @classmethod
    def _iso_8601(cls, value: str) -> str:
        try:
            datetime.fromisoformat(value)
        except ValueError:
            raise ValueError("must be ISO 8601, for example 2026-01-31T12:00:00Z") from None
        return value

    @model_validator(mode="after")
    def _complete_for_its_experiment(self) -> RunAttributes:
        given = self.model_dump(exclude_none=True)
        for name in EXPERIMENTS[self.experiment].required_attributes:
            if name not in given:
                raise ValueError(f"{name} among the attributes of a run of {self.experiment}")
        return self


class ChannelAttributes(BaseModel):
    """Attributes of one channel; unknown ones are kept."""

    model_config = ConfigDict(frozen=True, extra="allow", strict=True)

    units: str
    quantity: ChannelQuantity
    block_from: str | None = None
    block_to: str | None = None
    x_m: FiniteFloat | None = None
    range_min: FiniteFloat | None = None
    range_max: FiniteFloat | None = None
    noise_std: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    known_to: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None


M = TypeVar("M", bound=BaseModel)

_SCALED_ATTRIBUTES = ("range_min", "range_max", "noise_std", "known_to")
_STORAGE_ATTRIBUTES = ("scale_factor", "add_offset", "_FillValue", "missing_value")


def channels(recording: xr.Dataset, quantity: str | None = None) -> list[str]:
    """Names of the channels of a recording, of one quantity if given, sorted.

    Examples
    --------
    >>> channels(xr.Dataset({"force_cell_1": ("time", [0.0], {"quantity": "force"})}))
    ['force_cell_1']
    """
    return sorted(
        str(name)
        for name, variable in recording.data_vars.items()
        if variable.dims == ("time",)
        and variable.attrs.get("quantity") in SI_UNITS
        and quantity in (None, variable.attrs["quantity"])
    )


def with_values(recording: xr.Dataset, channel: str, values: npt.ArrayLike) -> xr.Dataset:
    """The same recording with other values of a channel; nothing else is copied, and nothing compared.

    Parameters
    ----------
    recording : xarray.Dataset
    channel : str
        Which it has.
    values : array_like, shape (n_times,)
    """
    # `assign` compares all coordinates, which takes ten times as long as all that is needed here
    changed = recording.copy(deep=False)
    changed[channel].variable.data = np.asarray(values)
    return changed


def run_attributes(recording: xr.Dataset, *, name: str = "recording") -> RunAttributes:
    """The validated global attributes of a recording.

    Raises
    ------
    RecordingError
        If one is missing or of a wrong type.
    """
    return _validated(RunAttributes, recording.attrs, what=name)


def read_recording(
    path: str | os.PathLike[str],
    *,
    maximum_decoded_bytes: int = MAXIMUM_DECODED_BYTES,
) -> xr.Dataset:
    """Read and validate one recording.

    Parameters
    ----------
    path : path-like
        A netCDF-4 file in the recording format.
    maximum_decoded_bytes : int
        Recordings that need more memory than this are refused before anything is allocated.

    Returns
    -------
    xarray.Dataset
        Dimension ``time``; channels float64 (float32 where stored so, or as counts of up to 16 bits) in
        SI units, NaN where lost; ``quality`` uint8 where present. Upward positive.

    Raises
    ------
    RecordingError
        If the file is not a recording, or holds what no analysis can use.
    """
    read = _untrusted(Path(path)).read(_read_here, os.fspath(path), maximum_decoded_bytes)
    variables = {name: xr.Variable(*parts) for name, parts in read["variables"].items()}
    recording = xr.Dataset(variables, coords=_time_coordinate(read["time"]), attrs=read["attributes"])
    recording["time"].attrs["units"] = "s"
    return recording


def _untrusted(file: Path) -> UntrustedFile:
    """The file, after what can be told without a child process."""
    require_recording_file(file)
    # heavy, and so imported only where a file is opened; here, so that every child has them already
    import h5py  # noqa: F401
    import netCDF4  # noqa: F401

    return UntrustedFile(f"recording {file}", _LIMITS, RecordingError)


def _read_here(path: str, maximum_decoded_bytes: int) -> dict[str, Any]:
    """The parts of a recording, read in this process."""
    with _opened(Path(path)) as source:
        recording = _decoded(source, path, maximum_decoded_bytes)
    return {
        "attributes": recording.attrs,
        "time": recording["time"].values,
        "variables": {
            name: (variable.dims, variable.values, variable.attrs)
            for name, variable in recording.data_vars.items()
        },
    }


def _attributes_here(path: str) -> dict[str, Any]:
    with _opened(Path(path)) as source:
        return _attributes_of(source)


@contextlib.contextmanager
def _opened(file: Path) -> Iterator[Any]:
    """Open a netCDF file for reading; whatever the reader stumbles over becomes one `RecordingError`."""
    import netCDF4

    try:
        # before the library opens it: a damaged heap keeps HDF5 busy for ever, and no exception ends that
        require_sound_structure(file)
        require_self_contained(file, what=f"recording {file}")
        with NETCDF_LOCK, netCDF4.Dataset(file, mode="r") as source:
            # counts are scaled here, block by block, so that only the result is large
            source.set_auto_maskandscale(False)
            yield source
    except RecordingError:
        raise
    except (
        OSError,
        RuntimeError,
        UnicodeError,
        AttributeError,
        LookupError,
        TypeError,
        ValueError,
        OverflowError,
    ) as error:
        raise RecordingError(
            f"recording {file}",
            got=f"a file that cannot be read ({error})",
            allowed="a complete netCDF-4 file",
            remedy="the file is cut short, damaged or of another format; copy it again or use `sloshlab import`",
        ) from error


def _attributes_of_many_here(paths: list[str]) -> list[dict[str, Any] | None]:
    found: list[dict[str, Any] | None] = []
    for path in paths:
        try:
            found.append(_attributes_here(path))
        except RecordingError:
            found.append(None)
    return found


def read_attributes_of_many(paths: Sequence[str | os.PathLike[str]]) -> list[RunAttributes]:
    """Read and validate the global attributes of recordings; many in one go, which costs a fraction.

    Raises
    ------
    RecordingError
        As `read_attributes`, for the first recording of which it would be raised.
    """
    try:
        read = _untrusted(Path(paths[0])).read(_attributes_of_many_here, [os.fspath(path) for path in paths])
    except SloshlabError:
        # one of them has ended the process that read them: which, and why, tells a process each
        read = [None] * len(paths)
    return [
        read_attributes(path) if attributes is None else _validated(RunAttributes, attributes, what=str(path))
        for path, attributes in zip(paths, read, strict=True)
    ]


def read_attributes(path: str | os.PathLike[str]) -> RunAttributes:
    """Read and validate only the global attributes of a recording.

    Raises
    ------
    RecordingError
        If the file cannot be opened, or an attribute is missing or of a wrong type.
    """
    attributes = _untrusted(Path(path)).read(_attributes_here, os.fspath(path))
    return _validated(RunAttributes, attributes, what=str(path))


def write_recording(
    recording: xr.Dataset,
    path: str | os.PathLike[str],
    *,
    encoding: Mapping[str, Mapping[str, Any]] | None = None,
) -> None:
    """Validate a recording and write it atomically.

    Parameters
    ----------
    recording : xarray.Dataset
        In the recording format, units stated on every channel.
    path : path-like
        Where to write.
    encoding : mapping, optional
        Per variable, as for `xarray.Dataset.to_netcdf`; scaled integers are given here.

    Raises
    ------
    RecordingError
        If the data set breaks the format; nothing is written then.
    """
    # nothing is written that `read_recording` would refuse
    validate_recording(recording, name=str(path))
    chosen: dict[str, dict[str, Any]] = {}
    for name, variable in recording.variables.items():
        compressed = {"zlib": True, "complevel": 4, "shuffle": True} if variable.ndim else {}
        # texts of varying length cannot be compressed
        if variable.dtype.kind not in "fiu":
            compressed = {}
        chosen[str(name)] = {**compressed, **(encoding or {}).get(str(name), {})}
    # an interrupt within xarray's call would leave its lock taken and closing would wait for ever: it is held
    # back
    with atomic_file.replaced(path) as temporary, NETCDF_LOCK, interrupt.held():
        recording.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=chosen)


def validate_recording(recording: xr.Dataset, *, name: str = "recording") -> RunAttributes:
    """Check an in-memory recording against the format.

    Returns
    -------
    RunAttributes
        Its validated global attributes.

    Raises
    ------
    RecordingError
        On the first breach found.
    """
    attributes = run_attributes(recording, name=name)
    if "time" not in recording.coords or recording["time"].dims != ("time",):
        raise RecordingError(f"{name}: time", got="no coordinate time(time)", allowed="seconds, uniform")
    time = np.asarray(recording["time"].values)
    _check_time(time, attributes.sampling_rate_hz, name)
    found = False
    for channel, variable in recording.data_vars.items():
        if not _is_channel(str(channel), variable.dims, variable.attrs):
            continue
        found = True
        described = _channel_attributes(str(channel), variable.attrs, name)
        _checked_factor(str(channel), described, name)
    if not found:
        raise _no_channel(name)
    _check_lost_are_flagged(recording, name)
    return attributes


def _decoded(source: Any, name: str, maximum_decoded_bytes: int) -> xr.Dataset:
    attributes = _validated(RunAttributes, _attributes_of(source), what=name)
    if "time" not in source.dimensions or "time" not in source.variables:
        raise RecordingError(
            f"{name}: time",
            got="no dimension and coordinate 'time'",
            allowed="time(time), seconds from the trigger",
        )
    n_samples = len(source.dimensions["time"])
    _check_size(source, n_samples, name, maximum_decoded_bytes)
    time_variable = source.variables["time"]
    if time_variable.dimensions != ("time",) or np.dtype(time_variable.dtype) != np.float64:
        raise RecordingError(
            f"{name}: time", got=f"{time_variable.dtype}{time_variable.dimensions}", allowed="float64(time)"
        )
    units = _attributes_of(time_variable).get("units", "s")
    if units not in ("s", "second", "seconds"):
        raise RecordingError(f"{name}: units of time", got=repr(units), allowed="'s', seconds from the trigger")
    time = limited_process.empty(n_samples, np.float64)
    time[:] = time_variable[:]
    _check_time(time, attributes.sampling_rate_hz, name)
    variables: dict[str, xr.Variable] = {}
    for channel, variable in source.variables.items():
        if channel == "time":
            continue
        its_attributes = _attributes_of(variable)
        if len(set(variable.dimensions)) < len(variable.dimensions):
            raise RecordingError(
                f"{name}: {channel}", got=f"dimensions {variable.dimensions}", allowed="each dimension once"
            )
        if _is_channel(channel, variable.dimensions, its_attributes):
            variables[channel] = _decoded_channel(channel, variable, its_attributes, name)
        elif np.dtype(variable.dtype).kind in "fiub" or variable.dtype is str:
            stored = {key: value for key, value in its_attributes.items() if key != "_FillValue"}
            variables[channel] = xr.Variable(variable.dimensions, variable[...], stored)
    if not any("quantity" in variable.attrs for variable in variables.values()):
        raise _no_channel(name)
    recording = xr.Dataset(variables, coords=_time_coordinate(time), attrs=_attributes_of(source))
    recording["time"].attrs["units"] = "s"
    _check_lost_are_flagged(recording, name)
    return recording


def _time_coordinate(time: np.ndarray) -> xr.Coordinates:
    """Coordinate whose index is the array itself; built from values it would be a copy."""
    import pandas as pd
    from xarray.indexes import PandasIndex

    return xr.Coordinates.from_xindex(PandasIndex(pd.Index(time, copy=False), "time"))


def _check_size(source: Any, n_samples: int, name: str, maximum_decoded_bytes: int) -> None:
    if n_samples == 0:
        raise RecordingError(f"{name}: time", got="0 samples", allowed="≥ 2 samples", remedy="record again")
    if n_samples == 1:
        raise RecordingError(f"{name}: time", got="1 sample", allowed="≥ 2 samples", remedy="record again")
    needed = 0
    for variable in source.variables.values():
        size = 1
        for dimension in variable.dimensions:
            size *= len(source.dimensions[dimension])
        # declared sizes, eight bytes each once decoded; nothing is read yet
        needed += 8 * size
    if needed > maximum_decoded_bytes:
        raise RecordingError(
            f"{name}: size",
            got=f"{n_samples} samples, {needed / 2**30:.1f} GiB decoded",
            allowed=f"≤ {maximum_decoded_bytes / 2**30:.1f} GiB",
            remedy="split the run into shorter files",
        )


def _chunks(values: np.ndarray) -> Iterable[tuple[int, np.ndarray]]:
    for start in range(0, values.size, _TIME_CHUNK):
        yield start, values[start : start + _TIME_CHUNK]


def _check_time(time: np.ndarray, rate_hz: float, name: str) -> None:
    if time.size < 2:
        raise RecordingError(
            f"{name}: time", got=f"{time.size} samples", allowed="≥ 2 samples", remedy="record again"
        )
    step = 1.0 / rate_hz
    if not np.isfinite(step * time.size):
        raise RecordingError(
            f"{name}: sampling_rate_hz",
            got=f"{rate_hz:g} Hz",
            allowed="a rate whose samples come within finite time",
            remedy="state the rate of the time coordinate",
        )
    worst = 0.0
    for start, chunk in _chunks(time):
        if not np.isfinite(chunk).all():
            raise RecordingError(
                f"{name}: time",
                got="NaN or infinity in the time coordinate",
                allowed="uniform seconds",
                remedy="time is never lost: keep it and flag the samples",
            )
        # against the grid, not from step to step: small errors of steps may add up to a gap
        deviation = np.abs(chunk - (time[0] + step * np.arange(start, start + chunk.size)))
        worst = max(worst, float(deviation.max()))
    # late times of a long run have fewer digits behind the point than a millionth of a step
    resolution = 4 * np.spacing(max(abs(float(time[0])), abs(float(time[-1]))))
    if worst > JITTER_ALLOWED_STEPS * step + resolution:
        raise _time_error(time, step, worst, name)


def _time_error(time: np.ndarray, step: float, worst: float, name: str) -> RecordingError:
    """A wrong rate if the mean and the usual step both differ from the stated one, else jitter or a jump."""
    mean_step = float(time[-1] - time[0]) / (time.size - 1)
    # a gap changes the mean step, not the usual one: only both together mean a wrong rate
    usual_step = float(np.median(np.diff(time)))
    rate_error = abs(mean_step - step) * (time.size - 1)
    off = min(abs(mean_step / step - 1), abs(usual_step / step - 1))
    if mean_step <= 0 or (rate_error > 0.5 * worst and off > JITTER_ALLOWED_STEPS):
        return RecordingError(
            f"{name}: sampling_rate_hz",
            got=f"{1 / step:.9g} Hz, but the mean time step is {mean_step:.9g} s",
            allowed="the rate of the time coordinate",
            remedy="correct the attribute or the time coordinate",
        )
    jitter_s, first = largest_jitter(time - (time[0] + step * np.arange(time.size)))
    return RecordingError(
        f"{name}: time is not uniform",
        got=f"jitter of {jitter_s / step:.3g} steps ({jitter_s:.3g} s) at sample {first}",
        allowed=f"≤ {JITTER_ALLOWED_STEPS:g} steps",
        remedy="resample on the device's sample counter, or mark the gap in `quality`",
    )


def largest_jitter(deviation_s: np.ndarray) -> tuple[float, int]:
    """How far time stamps lie off the grid that begins at the first of them, and which sample shows it.

    Parameters
    ----------
    deviation_s : ndarray, shape (n,)
        Time stamps minus grid points [s].

    Returns
    -------
    tuple
        Largest distance [s], and the first sample, counted from 0, that has it within a thousandth.

    Examples
    --------
    >>> largest_jitter(np.array([0.0, 0.1, -0.3, 0.3]))
    (0.3, 2)
    """
    distance = np.abs(deviation_s)
    worst = float(distance.max())
    return worst, int(np.argmax(distance >= 0.999 * worst))


def _is_channel(name: str, dimensions: tuple[Any, ...], attributes: Mapping[str, Any]) -> bool:
    if tuple(dimensions) != ("time",) or name == "quality":
        return False
    return "quantity" in attributes or name.partition("_")[0] in SI_UNITS


def _decoded_channel(channel: str, variable: Any, attributes: dict[str, Any], name: str) -> xr.Variable:
    described = _channel_attributes(channel, attributes, name)
    factor = _checked_factor(channel, described, name)
    kind = np.dtype(variable.dtype).kind
    if kind not in "fiu":
        raise RecordingError(f"{name}: {channel}", got=f"values of type {variable.dtype}", allowed="numbers")
    # units once, on reading: counts go to SI in one multiplication
    scale = _number(attributes, "scale_factor", 1.0, channel, name) * factor
    offset = _number(attributes, "add_offset", 0.0, channel, name) * factor
    fill = attributes.get("_FillValue", attributes.get("missing_value"))
    values = _decoded_values(variable, scale, offset, None if fill is None or np.ndim(fill) else fill)
    kept = {key: value for key, value in attributes.items() if key not in _STORAGE_ATTRIBUTES}
    kept["units"] = SI_UNITS[described.quantity]
    if kind in "iu":
        # clipping is judged by half a step of the converter, which floats no longer show
        kept["adc_step"] = abs(scale)
    for key in _SCALED_ATTRIBUTES:
        if key in kept:
            kept[key] = float(kept[key]) * factor
    return xr.Variable(("time",), values, kept)


def _decoded_values(variable: Any, scale: float, offset: float, fill: float | None) -> np.ndarray:
    """Counts × scale + offset, NaN where they are the fill value.

    Block by block, so that only the result is large. Up to 16 bits float32 has no rounding that matters.
    """
    stored = np.dtype(variable.dtype)
    # 24 bits of precision are enough for 16 of a converter, unless a large offset takes them
    few_bits = stored.kind in "iu" and stored.itemsize <= 2 and abs(offset) <= 2**15 * abs(scale)
    values = limited_process.empty(len(variable), np.float32 if few_bits or stored == np.float32 else np.float64)
    storage = variable.chunking()
    block = storage[0] if isinstance(storage, list) else _DECODING_BLOCK
    # whole storage chunks, or each would be decompressed twice
    block = max(block, _DECODING_BLOCK // block * block)
    for start in range(0, values.size, block):
        raw = variable[start : start + block]
        part = values[start : start + block]
        np.multiply(raw, values.dtype.type(scale), out=part, dtype=values.dtype)
        if offset:
            np.add(part, values.dtype.type(offset), out=part)
        if fill is not None:
            part[raw == fill] = np.nan
    return values


def _number(attributes: Mapping[str, Any], key: str, default: float, channel: str, name: str) -> float:
    value = attributes.get(key, default)
    if isinstance(value, str) or np.ndim(value) != 0 or not np.isfinite(value):
        raise RecordingError(f"{name}: {channel}: {key}", got=repr(value), allowed="a finite number")
    return float(value)


def _channel_attributes(channel: str, attributes: Mapping[str, Any], name: str) -> ChannelAttributes:
    described = _validated(ChannelAttributes, attributes, what=f"{name}: {channel}")
    prefix = channel.partition("_")[0]
    if prefix in SI_UNITS and prefix != described.quantity:
        raise RecordingError(
            f"{name}: {channel}: quantity",
            got=repr(described.quantity),
            allowed=f"'{prefix}', as the channel is named",
            remedy="rename it or correct `quantity`",
        )
    return described


def _checked_factor(channel: str, described: ChannelAttributes, name: str) -> float:
    try:
        return factor_to_si(described.units, described.quantity)
    except UnitsError as error:
        raise RecordingError(
            f"{name}: {channel}: {error.what}", got=error.got, allowed=error.allowed, remedy=error.remedy
        ) from error


def _check_lost_are_flagged(recording: xr.Dataset, name: str) -> None:
    flags = recording.get("quality")
    if flags is not None and (flags.dims != ("time",) or flags.dtype.kind not in "ui"):
        raise RecordingError(f"{name}: quality", got=f"{flags.dtype}{flags.dims}", allowed="uint8(time)")
    for channel in channels(recording):
        values = recording[channel].values
        # one pass without an array of flags; most channels are whole
        if np.isfinite(values.sum()):
            continue
        not_finite = ~np.isfinite(values)
        if np.isinf(values[not_finite]).any():
            raise RecordingError(f"{name}: {channel}", got="infinite values", allowed="numbers, NaN where lost")
        unflagged = not_finite if flags is None else not_finite & ((flags.values & LOST) == 0)
        count = int(unflagged.sum())
        if count:
            at = float(recording["time"].values[int(unflagged.argmax())])
            raise RecordingError(
                f"{name}: {channel}",
                got=f"{count} NaN samples that are not flagged as lost, the first at {at:.6g} s",
                allowed="NaN only where `quality` has bit 1 (lost)",
                remedy="flag them in `quality`, or find out where they come from",
            )


def _no_channel(name: str) -> RecordingError:
    return RecordingError(
        f"{name}: channels",
        got="none",
        allowed="at least one variable(time) with `quantity`",
        remedy="use `sloshlab import` with a channel map",
    )


def _attributes_of(source: Any) -> dict[str, Any]:
    attributes: dict[str, Any] = {}
    for key in source.ncattrs():
        value = source.getncattr(key)
        attributes[key] = value.item() if isinstance(value, np.generic) else value
    return attributes


def _validated(model: type[M], attributes: Mapping[Any, Any], *, what: str) -> M:
    plain = {
        str(key): value.item() if isinstance(value, np.generic) else value for key, value in attributes.items()
    }
    try:
        return model.model_validate(plain)
    except ValidationError as error:
        # the first breach only: one line names one place and its remedy
        first = error.errors()[0]
        place = str(first["loc"][0]) if first["loc"] else "attributes"
        missing = first["type"] == "missing"
        raise RecordingError(
            f"{what}: attribute {place}",
            got="nothing" if missing else repr(first["input"])[:80],
            allowed=first["msg"].removeprefix("Value error, ").removeprefix("Input should be "),
            remedy="set it" if missing else "correct it",
        ) from error
