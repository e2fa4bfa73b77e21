"""Attributes of runs and channels: what they are called, and what is refused."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Annotated, Any, Final, Literal, TypeVar

import numpy as np
import xarray as xr
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from sloshlab.configurations import CONFIGURATIONS
from sloshlab.errors import RecordingError, UnitsError
from sloshlab.experiments import EXPERIMENTS, recorded_experiments
from sloshlab.registry import one_of
from sloshlab.units import SI_UNITS, ChannelQuantity, factor_to_si

FORMAT: Final = "1"
RecordedExperiment = Annotated[str, one_of(recorded_experiments)]

Configuration = Annotated[str, one_of(lambda: CONFIGURATIONS)]
"""Fields that take a name of their vocabulary."""
PositiveFloat = Annotated[float, Field(gt=0, allow_inf_nan=False)]
FiniteFloat = Annotated[float, Field(allow_inf_nan=False)]


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


def run_attributes(recording: xr.Dataset, *, name: str = "recording") -> RunAttributes:
    """The validated global attributes of a recording.

    Raises
    ------
    RecordingError
        If one is missing or of a wrong type.
    """
    return validated_attributes(RunAttributes, recording.attrs, what=name)


def channel_attributes(channel: str, attributes: Mapping[str, Any], name: str) -> ChannelAttributes:
    """The validated attributes of a channel.

    Raises
    ------
    RecordingError
        If one is missing or of a wrong type, or the channel is named as another quantity.
    """
    described = validated_attributes(ChannelAttributes, attributes, what=f"{name}: {channel}")
    prefix = channel.partition("_")[0]
    if prefix in SI_UNITS and prefix != described.quantity:
        raise RecordingError(
            f"{name}: {channel}: quantity",
            got=repr(described.quantity),
            allowed=f"'{prefix}', as the channel is named",
            remedy="rename it or correct `quantity`",
        )
    return described


def factor_to_si_of(channel: str, described: ChannelAttributes, name: str) -> float:
    """Factor from the units of a channel to those of its quantity in SI.

    Raises
    ------
    RecordingError
        If the units are not those of the quantity.
    """
    try:
        return factor_to_si(described.units, described.quantity)
    except UnitsError as error:
        raise RecordingError(
            f"{name}: {channel}: {error.what}", got=error.got, allowed=error.allowed, remedy=error.remedy
        ) from error


def attributes_of(source: Any) -> dict[str, Any]:
    """Attributes of an opened netCDF file or of a variable in it, as plain Python values."""
    attributes: dict[str, Any] = {}
    for key in source.ncattrs():
        value = source.getncattr(key)
        attributes[key] = value.item() if isinstance(value, np.generic) else value
    return attributes


def validated_attributes(model: type[M], attributes: Mapping[Any, Any], *, what: str) -> M:
    """Attributes as their model; NumPy scalars count as the plain values that they hold.

    Raises
    ------
    RecordingError
        At the first that is missing or of a wrong type.
    """
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
