"""The TOML map from columns of foreign files to channels of a recording.

Unknown keys are refused with the nearest known one; nothing has a default that could change numbers.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from acquisition.files.file_format import FormatName
from sloshlab.errors import ChannelMapError
from sloshlab.key_spelling import nearest_key
from sloshlab.recording import Configuration, RecordedExperiment
from sloshlab.toml_file import parse_toml, read_toml
from sloshlab.units import SI_UNITS, ChannelQuantity

_CHANNEL_NAME = re.compile(rf"({'|'.join(SI_UNITS)})_[A-Za-z0-9_]{{1,100}}")
# keys with a meaning of their own in a recording: a free attribute would change what the numbers mean
_RECORDING_KEYS = frozenset(
    [
        "units",
        "quantity",
        "scale_factor",
        "add_offset",
        "_FillValue",
        "missing_value",
        "dtype",
        "calendar",
        "sloshlab_format",
        "sampling_rate_hz",
        "valid_min",
        "valid_max",
        "valid_range",
    ]
)

# TOML knows nan and inf, with which no channel can be converted
FiniteFloat = Annotated[float, Field(allow_inf_nan=False)]
PositiveFloat = Annotated[float, Field(gt=0, allow_inf_nan=False)]
ColumnReference = str | int | tuple[str, int]
FreeAttributes = dict[str, str | int | float]


class _Section(BaseModel):
    # an unknown key is a misspelt one, and its default would stand in silence
    model_config = ConfigDict(frozen=True, extra="forbid", strict=False, populate_by_name=True)


class RunSection(_Section):
    """Global attributes of the recording; see the recording format."""

    run_id: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    experiment: RecordedExperiment
    configuration: Configuration
    start_time_utc: str | None = None
    rig: str | None = None
    initial_displacement_m: FiniteFloat | None = None
    sweep_start_hz: PositiveFloat | None = None
    sweep_rate_octave_per_s: FiniteFloat | None = None
    acceleration_g: FiniteFloat | None = None
    repeat: int | None = None
    attributes: FreeAttributes = Field(default_factory=dict)

    @field_validator("attributes")
    @classmethod
    def _storable(cls, value: FreeAttributes) -> FreeAttributes:
        return _checked_attributes(value)


class SourceSection(_Section):
    """How the files are to be read; `docs/import.md` explains each key."""

    format: FormatName | None = None
    join: Literal["channels", "time"] | None = None
    time: ColumnReference | None = None
    time_units: Literal["s", "ms", "us", "ns", "min", "h"] = "s"
    sampling_rate_hz: PositiveFloat | None = None
    sampling_rate_variable: str | None = None
    jitter_allowed_steps: Annotated[float, Field(gt=0, lt=0.5)] | None = None
    quality: ColumnReference | None = None
    accept_truncated: bool = False
    # delimited text
    delimiter: Annotated[str, Field(min_length=1, max_length=1)] | None = None
    decimal: Literal[".", ","] | None = None
    header_rows: Annotated[int, Field(ge=0, le=10_000)] | None = None
    names_row: Annotated[int, Field(ge=1, le=10_000)] | None = None
    units_row: Annotated[int, Field(ge=1, le=10_000)] | None = None
    encoding: Literal["utf-8", "utf-16", "latin-1", "cp1252", "ascii"] | None = None
    # others
    group: str | None = None
    segment: Annotated[int, Field(ge=1)] | None = None
    database: str | None = None
    can_channel: int | None = None


class Calibration(_Section):
    """value in `to` = `factor` · (value in `from`) + `offset`."""

    factor: FiniteFloat
    offset: FiniteFloat = 0.0
    from_units: Annotated[str, Field(alias="from", max_length=64)]
    to_units: Annotated[str, Field(alias="to", max_length=64)]

    @model_validator(mode="after")
    def _not_zero(self) -> Calibration:
        if self.factor == 0:
            raise ValueError("factor must not be 0")
        return self


class ChannelSection(_Section):
    """One channel: which column it is and what its numbers mean."""

    column: ColumnReference
    source: Annotated[int, Field(ge=1)] | None = None
    quantity: ChannelQuantity | None = None
    units: Annotated[str, Field(max_length=64)] | None = None
    units_override: bool = False
    sign: Literal[1, -1] = 1
    delay_s: FiniteFloat = 0.0
    delay: Literal["compensate", "record"] = "compensate"
    calibration: Calibration | None = None
    range_min: FiniteFloat | None = None
    range_max: FiniteFloat | None = None
    noise_std: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    block_from: str | None = None
    block_to: str | None = None
    x_m: FiniteFloat | None = None
    attributes: FreeAttributes = Field(default_factory=dict)

    @field_validator("attributes")
    @classmethod
    def _storable(cls, value: FreeAttributes) -> FreeAttributes:
        return _checked_attributes(value)

    @model_validator(mode="after")
    def _range_is_one(self) -> ChannelSection:
        if self.range_min is not None and self.range_max is not None and self.range_min >= self.range_max:
            raise ValueError("range_min must be below range_max")
        return self


class ChannelMap(_Section):
    """A whole map file."""

    run: RunSection
    source: SourceSection = SourceSection()
    channels: Annotated[dict[str, ChannelSection], Field(min_length=1, max_length=10_000)]

    @field_validator("channels")
    @classmethod
    def _named_by_quantity(cls, value: dict[str, ChannelSection]) -> dict[str, ChannelSection]:
        for name, channel in value.items():
            if not _CHANNEL_NAME.fullmatch(name):
                raise ValueError(
                    f"channel {name[:60]!r} must be <quantity>_<place>, quantity one of {', '.join(SI_UNITS)}"
                )
            if channel.quantity not in (None, quantity_of(name)):
                raise ValueError(f"channel {name!r} says quantity {channel.quantity!r}; rename it or correct it")
        return value


def quantity_of(channel: str) -> str:
    """The quantity in a channel's name.

    Examples
    --------
    >>> quantity_of("force_cell_1")
    'force'
    """
    return channel.partition("_")[0]


def read_channel_map(path: Path) -> ChannelMap:
    """Read and validate a map file.

    Raises
    ------
    ChannelMapError
        If it is missing, not TOML, or not a map.
    """
    document = read_toml(path, f"map {path}", error=ChannelMapError, remedy="check the path given to --map")
    return channel_map_from_document(document, name=str(path))


def channel_map_from_text(text: str, *, name: str = "text") -> ChannelMap:
    """Validate the text of a map.

    Raises
    ------
    ChannelMapError
        On the first thing wrong with it.

    Examples
    --------
    >>> channel_map_from_text('''
    ... [run]
    ... experiment = "other"
    ... configuration = "frozen"
    ... [channels.force_cell_1]
    ... column = "F"
    ... untis = "N"
    ... ''')
    Traceback (most recent call last):
    ...
    sloshlab.errors.ChannelMapError: map text: channels.force_cell_1.untis: got an unknown key; allowed: \
attributes, block_from, block_to, calibration, column, delay, delay_s, noise_std, quantity, range_max, range_min, \
sign, source, units, units_override, x_m; remedy: did you mean 'units'?
    """
    return channel_map_from_document(parse_toml(text, f"map {name}", error=ChannelMapError), name=name)


def channel_map_from_document(document: Mapping[str, Any], *, name: str = "document") -> ChannelMap:
    """Validate a parsed map.

    Raises
    ------
    ChannelMapError
        On the first thing wrong with it.
    """
    try:
        return ChannelMap.model_validate(document)
    except (ValidationError, RecursionError) as error:
        if isinstance(error, RecursionError):
            raise ChannelMapError(f"map {name}", got="too deep a nesting", allowed="sections") from error
        raise _explained(error, name) from error


def _explained(error: ValidationError, name: str) -> ChannelMapError:
    problems = error.errors(include_url=False, include_context=False)
    # first, since a misspelt key often is the cause of one that is missing
    unknown = [problem for problem in problems if problem["type"] == "extra_forbidden"]
    first = unknown[0] if unknown else problems[0]
    keys = [str(part)[:80] for part in first["loc"] if not str(part).startswith(("function-", "tuple["))]
    place = ".".join(keys) or "map"
    if first["type"] == "extra_forbidden":
        allowed = _keys_beside(keys)
        near = nearest_key(keys[-1], allowed)
        remedy = f"did you mean '{near}'?" if near else "remove it"
        return ChannelMapError(
            f"map {name}: {place}", got="an unknown key", allowed=", ".join(allowed), remedy=remedy
        )
    missing = first["type"] == "missing"
    return ChannelMapError(
        f"map {name}: {place}",
        got="nothing" if missing else repr(first["input"])[:80],
        allowed=first["msg"].removeprefix("Value error, ").removeprefix("Input should be "),
        remedy="add it" if missing else "correct it",
    )


def _keys_beside(keys: list[str]) -> list[str]:
    section: type[BaseModel] = ChannelMap
    if keys[0] == "run" and len(keys) > 1:
        section = RunSection
    elif keys[0] == "source" and len(keys) > 1:
        section = SourceSection
    elif keys[0] == "channels" and len(keys) > 2:
        section = Calibration if "calibration" in keys[2:-1] else ChannelSection
    return sorted(field.alias or key for key, field in section.model_fields.items())


def _checked_attributes(attributes: FreeAttributes) -> FreeAttributes:
    for key, value in attributes.items():
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,63}", key) or key in _RECORDING_KEYS:
            raise ValueError(f"attribute {key[:60]!r} is not a free attribute name")
        # netCDF stores them with 64 bits
        if isinstance(value, int) and not -(2**63) <= value < 2**63:
            raise ValueError(f"attribute {key!r} is too large")
        if isinstance(value, str) and "\x00" in value:
            raise ValueError(f"attribute {key!r} holds a null character")
    return attributes
