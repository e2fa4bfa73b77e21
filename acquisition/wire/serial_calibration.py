"""What a serial device says about itself: JSON text, validated before anything believes it.

The text comes from a device that may be broken, of a later version, or no device of ours at all.
"""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Sequence
from typing import Annotated, Any, Final, Literal, NamedTuple, NoReturn, Protocol, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from acquisition.samples.channel import HIGHEST_SAMPLING_RATE_HZ, MOST_CHANNELS, Channel
from acquisition.wire.serial_frames import LONGEST_TEXT
from sloshlab.errors import InputError, SourceError, UnitsError
from sloshlab.units import SI_UNITS, ChannelQuantity, factor_to_si

_CHANNEL_NAME: Final = re.compile(rf"({'|'.join(SI_UNITS)})_[A-Za-z0-9_]{{1,100}}")
_REMEDY: Final = "check the device's firmware against docs/serial_protocol.md"

FiniteFloat = Annotated[float, Field(allow_inf_nan=False)]
DeviceName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]{1,64}$")]
BlockName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]{1,40}$")]
SerialNumber = Annotated[str, Field(pattern=r"^[ -~]{1,64}$")]


class Calibration(NamedTuple):
    """What a device says about itself.

    Attributes
    ----------
    device : str
        Its name.
    sampling_rate_hz : float
    clock_hz : float or None
        Ticks per second of the device clock; None without one.
    channels : tuple of Channel
    """

    device: str
    sampling_rate_hz: float
    clock_hz: float | None
    channels: tuple[Channel, ...]


class DescribedDevice(Protocol):
    """Whatever has a name, a rate, a clock and channels: `Calibration`, `SourceInfo`."""

    @property
    def device(self) -> str:
        """Its name."""

    @property
    def sampling_rate_hz(self) -> float:
        """Nominal rate of the sample counter."""

    @property
    def clock_hz(self) -> float | None:
        """Ticks per second of the device clock."""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """In the order of the device."""


class _ChannelText(BaseModel):
    """One channel as the text has it: the fields of `Channel`, checked."""

    # strict, as a number written as text is a mistake; a misspelt range_min must not pass for a sensor without
    # limits
    model_config = ConfigDict(strict=True, extra="forbid")

    name: str
    quantity: ChannelQuantity
    units: str
    bits: Literal[16, 24, 32] = 16
    scale_factor: FiniteFloat = 1.0
    add_offset: FiniteFloat = 0.0
    missing_count: int | None = None
    range_min: FiniteFloat | None = None
    range_max: FiniteFloat | None = None
    noise_std: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    x_m: FiniteFloat | None = None
    block_from: BlockName | None = None
    block_to: BlockName | None = None
    sensor_serial: SerialNumber | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if not _CHANNEL_NAME.fullmatch(self.name) or not self.name.startswith(f"{self.quantity}_"):
            raise ValueError(f"name {self.name[:40]!r} must be {self.quantity}_<letters, digits, _>")
        try:
            factor_to_si(self.units, self.quantity)
        except UnitsError as error:
            raise ValueError(str(error)) from None
        if self.scale_factor == 0.0:
            raise ValueError("scale_factor must not be 0")
        limit = 1 << (self.bits - 1)
        if self.missing_count is not None and not -limit <= self.missing_count < limit:
            raise ValueError(f"missing_count {self.missing_count} does not fit into {self.bits} bits")
        if None not in (self.range_min, self.range_max) and self.range_min >= self.range_max:  # type: ignore[operator]
            raise ValueError("range_min must be less than range_max")
        return self


class _DeviceText(BaseModel):
    """The whole text but its channels."""

    model_config = ConfigDict(strict=True, extra="forbid")

    device: DeviceName
    sampling_rate_hz: Annotated[float, Field(gt=0, le=HIGHEST_SAMPLING_RATE_HZ)]
    clock_hz: Annotated[float, Field(gt=0, le=1e12)] | None = None
    # of anything: their number is checked before a million of them are looked at
    channels: list[Any]


def calibration_text(described: DescribedDevice) -> bytes:
    """The text that `channels_from_calibration` reads; fields that have their default are left out.

    Raises
    ------
    InputError
        If it would be longer than a frame may be.

    Examples
    --------
    >>> calibration_text(Calibration("daq", 100.0, None, (Channel("force_cell_1", "force", "N"),)))
    b'{"device":"daq","sampling_rate_hz":100.0,"clock_hz":null,"channels":[{"name":"force_cell_1",\
"quantity":"force","units":"N"}]}'
    """
    text = json.dumps(
        {
            "device": described.device,
            "sampling_rate_hz": described.sampling_rate_hz,
            "clock_hz": described.clock_hz,
            "channels": [_without_defaults(channel) for channel in described.channels],
        },
        separators=(",", ":"),
        allow_nan=False,
    ).encode()
    if len(text) > LONGEST_TEXT:
        raise InputError("calibration", got=f"{len(text)} bytes", allowed=f"≤ {LONGEST_TEXT} bytes")
    return text


def _without_defaults(channel: Channel) -> dict[str, Any]:
    defaults = {f.name: f.default for f in dataclasses.fields(Channel)}
    return {name: value for name, value in dataclasses.asdict(channel).items() if value != defaults[name]}


def channels_from_calibration(text: bytes) -> Calibration:
    """What `text` says, after every check.

    Raises
    ------
    SourceError
        If the text is too long, no JSON object, or describes what no device can be: more than 256
        channels, none, one name twice, numbers that are not finite, unknown fields, foreign units.

    Examples
    --------
    >>> device, rate, clock, channels = channels_from_calibration(
    ...     b'{"device": "daq", "sampling_rate_hz": 100,'
    ...     b' "channels": [{"name": "force_cell_1", "quantity": "force", "units": "N"}]}'
    ... )
    >>> device, rate, clock, channels[0].bits
    ('daq', 100.0, None, 16)
    """
    loaded = _loaded(text)
    try:
        device = _DeviceText.model_validate(loaded)
        if not 1 <= len(device.channels) <= MOST_CHANNELS:
            raise SourceError(
                "calibration of the device",
                got=f"{len(device.channels)} channels",
                allowed=f"1 to {MOST_CHANNELS}",
                remedy=_REMEDY,
            )
        texts = [_ChannelText.model_validate(channel) for channel in device.channels]
    except ValidationError as error:
        raise _first_of(error) from None
    _require_distinct([channel.name for channel in texts])
    channels = tuple(Channel(**channel.model_dump()) for channel in texts)
    return Calibration(device.device, device.sampling_rate_hz, device.clock_hz, channels)


def _loaded(text: bytes) -> Any:
    if len(text) > LONGEST_TEXT:
        raise SourceError("calibration of the device", got=f"{len(text)} bytes", allowed=f"≤ {LONGEST_TEXT}")
    try:
        # Python reads NaN and Infinity, which JSON does not have
        return json.loads(text.decode(), parse_constant=_refuse_constant)
    # brackets nested deeply enough end in a RecursionError
    except (ValueError, RecursionError) as error:
        raise SourceError(
            "calibration of the device", got=f"no JSON ({str(error)[:80]})", remedy=_REMEDY
        ) from None


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number")


def _first_of(error: ValidationError) -> SourceError:
    first = error.errors(include_url=False, include_context=False)[0]
    place = ".".join(str(part)[:40] for part in first["loc"])
    return SourceError(
        f"calibration of the device{': ' + place if place else ''}",
        got=ascii(first["input"])[:80],
        allowed=first["msg"].removeprefix("Value error, "),
        remedy=_REMEDY,
    )


def _require_distinct(names: Sequence[str]) -> None:
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise SourceError(
            "calibration of the device", got=f"channel {min(twice)} twice", allowed="each once", remedy=_REMEDY
        )
