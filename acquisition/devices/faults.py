"""What can go wrong with a simulated device, described in a TOML file.

Every table and key is optional; an empty file is a device without faults. ``docs/simulated_devices.md``
lists them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Final, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from acquisition.samples.channel import Channel
from sloshlab.errors import FaultsError
from sloshlab.recording import CLIPPED, STUCK
from sloshlab.toml_file import parse_toml, read_toml

SENSOR_FAULTS: Final[Mapping[str, int | None]] = {"swapped": None, "clipped": CLIPPED, "stuck": STUCK}
"""Tables of sensors' faults in the order in which they act on a reading, and the flag of a recording that has the
same word. Recordings have no flag for an exchange."""

_LATEST_S = 1e7

# Every number has limits and every list a length: the file is a person's, and a slip must end in one line.
Probability = Annotated[float, Field(ge=0, le=1)]
Counters = Annotated[tuple[Annotated[int, Field(ge=0, lt=1 << 62)], ...], Field(max_length=100_000)]
Time = Annotated[float, Field(ge=0, le=_LATEST_S, allow_inf_nan=False)]
# infinite where a fault lasts to the end
TimeOrNever = Annotated[float, Field(ge=0)]


class _Table(BaseModel):
    # a misspelt fault must not pass for a device without it
    model_config = ConfigDict(frozen=True, extra="forbid", strict=False)


class ClockFaults(_Table):
    """The oscillator; see `acquisition.devices.device_clock.DeviceClock`."""

    drift_ppm: Annotated[float, Field(ge=-1e5, le=1e5)] = 0.0
    offset_s: Time = 0.0
    jitter_s: Annotated[float, Field(ge=0, le=1)] = 0.0
    counter_start: Annotated[int, Field(ge=0, le=1 << 53)] = 0


class FrameFault(_Table):
    """Strikes frames by chance, and those that hold stated counters."""

    probability: Probability = 0.0
    at_counters: Counters = ()


class ReorderFault(FrameFault):
    """The frame leaves after so many later ones."""

    distance: Annotated[int, Field(ge=1, le=1000)] = 1


class CorruptFault(FrameFault):
    """So many bits of the frame are flipped."""

    n_bits: Annotated[int, Field(ge=1, le=1000)] = 1


class GarbageFault(FrameFault):
    """A burst of so many foreign bytes before the frame."""

    n_bytes: Annotated[int, Field(ge=1, le=1 << 20)] = 32


class Stall(_Table):
    """The host does not read."""

    at_s: Time
    for_s: Annotated[float, Field(gt=0, le=_LATEST_S)]


class OverrunFault(_Table):
    """A line slower than the device, or a host that does not read, and a small buffer before it."""

    baud_rate: Annotated[float, Field(gt=0, le=1e10)] | None = None
    bits_per_byte: Annotated[float, Field(ge=8, le=16)] = 10.0
    fifo_bytes: Annotated[int, Field(ge=1, le=1 << 24)] = 4096
    bit_rate: Annotated[float, Field(gt=0, le=1e8)] | None = None
    queue_frames: Annotated[int, Field(ge=1, le=1 << 20)] = 64
    stalls: Annotated[tuple[Stall, ...], Field(max_length=1000)] = ()


class DisconnectFault(_Table):
    """The plug is pulled and put back; with `restart` the device loses power meanwhile."""

    at_s: Time
    for_s: Annotated[float, Field(gt=0, le=_LATEST_S)]
    restart: bool = False


class _Interval(_Table):
    from_s: Time = 0.0
    to_s: TimeOrNever = math.inf

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not self.from_s < self.to_s:
            raise ValueError(f"from_s {self.from_s:g} must be before to_s {self.to_s:g}")
        return self


class StuckFault(_Interval):
    """The channel keeps the count that it has at `from_s`."""

    channel: str


class ClippedFault(_Interval):
    """The channel does not exceed ± `limit`, in its units."""

    channel: str
    limit: Annotated[float, Field(gt=0, allow_inf_nan=False)]


class SwappedFault(_Interval):
    """Two channels measure what the other one should; `announced` if the device knows and tells."""

    channels: tuple[str, str]
    announced: bool = False

    @model_validator(mode="after")
    def _two(self) -> Self:
        if self.channels[0] == self.channels[1]:
            raise ValueError(f"{self.channels[0]!r} twice; two channels are exchanged")
        return self


class Faults(_Table):
    """All faults of one device."""

    seed: Annotated[int, Field(ge=0, lt=1 << 62)] = 0
    clock: ClockFaults = ClockFaults()
    drop: FrameFault = FrameFault()
    duplicate: FrameFault = FrameFault()
    reorder: ReorderFault = ReorderFault()
    corrupt: CorruptFault = CorruptFault()
    garbage: GarbageFault = GarbageFault()
    overrun: OverrunFault | None = None
    disconnect: Annotated[tuple[DisconnectFault, ...], Field(max_length=1000)] = ()
    stuck: Annotated[tuple[StuckFault, ...], Field(max_length=1000)] = ()
    clipped: Annotated[tuple[ClippedFault, ...], Field(max_length=1000)] = ()
    swapped: Annotated[tuple[SwappedFault, ...], Field(max_length=1000)] = ()

    @model_validator(mode="after")
    def _disjoint(self) -> Self:
        ordered = sorted(self.disconnect, key=lambda fault: fault.at_s)
        for earlier, later in itertools.pairwise(ordered):
            if earlier.at_s + earlier.for_s >= later.at_s:
                raise ValueError(
                    f"disconnect at {later.at_s:g} s begins before the one at {earlier.at_s:g} s ends"
                )
        return self

    @classmethod
    def from_toml(cls, path: Path) -> Faults:
        """Read a file.

        Raises
        ------
        FaultsError
            If it cannot be read, or has a key or a value that is not allowed.
        """
        return cls._from_document(read_toml(path, f"faults {path}", error=FaultsError), str(path))

    @classmethod
    def from_toml_text(cls, text: str, *, name: str = "faults") -> Faults:
        """Read TOML text.

        Examples
        --------
        >>> faults = Faults.from_toml_text("[drop]\\nprobability = 0.01\\n[[disconnect]]\\nat_s = 2\\nfor_s = 1")
        >>> faults.drop.probability, faults.disconnect[0].restart
        (0.01, False)
        """
        return cls._from_document(parse_toml(text, name, error=FaultsError), name)

    @classmethod
    def _from_document(cls, document: Mapping[str, Any], name: str) -> Faults:
        try:
            return cls.model_validate(document)
        except ValidationError as error:
            raise _first_of(error, name) from None

    def require_channels(self, channels: Sequence[Channel], *, can_announce: bool) -> None:
        """Refuse what a device with these channels cannot do.

        Parameters
        ----------
        channels : sequence of Channel
        can_announce : bool
            Whether the device can describe its channels anew while it runs.

        Raises
        ------
        FaultsError
            If a channel is not there, two of different quantities are exchanged, or an exchange is to be
            announced by a CAN device, which describes itself only in its DBC file.
        """
        known = {channel.name: channel for channel in channels}
        named = [fault.channel for fault in self.stuck] + [fault.channel for fault in self.clipped]
        for name in (*named, *(name for fault in self.swapped for name in fault.channels)):
            if name not in known:
                raise FaultsError("faults: channel", got=repr(name), allowed=", ".join(known)[:400])
        for fault in self.swapped:
            quantities = [known[name].quantity for name in fault.channels]
            if quantities[0] != quantities[1]:
                raise FaultsError(
                    "faults: swapped", got=" and ".join(quantities), allowed="two channels of one quantity"
                )
            if fault.announced and not can_announce:
                remedy = "leave `announced` out, or play as a serial device"
                raise FaultsError(
                    "faults: swapped.announced", got="true", allowed="false for a CAN device", remedy=remedy
                )


def _first_of(error: ValidationError, name: str) -> FaultsError:
    first: Any = error.errors(include_url=False, include_context=False)[0]
    place = ".".join(str(part)[:40] for part in first["loc"]) or "faults"
    unknown = first["type"] == "extra_forbidden"
    return FaultsError(
        f"{name}: {place}",
        got="an unknown key" if unknown else repr(first["input"])[:80],
        allowed="the keys of docs/simulated_devices.md" if unknown else first["msg"].removeprefix("Value error, "),
    )
