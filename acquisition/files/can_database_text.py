"""The text of a layout of ours as a DBC file, written by hand, so that every number keeps all its digits."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from acquisition.samples.channel import Channel
from acquisition.wire.can_bits import BitField
from acquisition.wire.can_layout import CanLayout, ControlMessage, SampleMessage
from acquisition.wire.serial_calibration import channels_from_calibration
from sloshlab.atomic_file import replaced
from sloshlab.errors import SourceError
from sloshlab.units import SI_UNITS

TEXT_ATTRIBUTES: Final = {"block_from": "BlockFrom", "block_to": "BlockTo", "sensor_serial": "SensorSerial"}
FLOAT_ATTRIBUTES: Final = {"noise_std": "NoiseStd", "x_m": "XM", "range_min": "RangeMin", "range_max": "RangeMax"}
_FRAME_FORMATS: Final = ["StandardCAN", "ExtendedCAN", *["reserved"] * 12, "StandardCAN_FD", "ExtendedCAN_FD"]

# DBC files mark identifiers of 29 bits by this bit of the number
_EXTENDED: Final = 1 << 31
SAMPLE_NAME: Final = re.compile(rf"((?:{'|'.join(SI_UNITS)})_[A-Za-z0-9_]+?)(?:__([0-9]{{1,2}}))?")

_DEFINITIONS: Final = f"""\
BA_DEF_ "DeviceName" STRING ;
BA_DEF_ BO_ "SamplingRateHz" FLOAT 0 10000000;
BA_DEF_ BO_ "DeviceClockHz" FLOAT 0 1000000000000;
BA_DEF_ BO_ "VFrameFormat" ENUM {",".join(f'"{name}"' for name in _FRAME_FORMATS)};
BA_DEF_ SG_ "MissingCount" INT -2147483648 2147483647;
{"".join(f'BA_DEF_ SG_ "{n}" FLOAT -1e308 1e308;{chr(10)}' for n in FLOAT_ATTRIBUTES.values())}\
{"".join(f'BA_DEF_ SG_ "{n}" STRING ;{chr(10)}' for n in TEXT_ATTRIBUTES.values())}\
BA_DEF_DEF_ "DeviceName" "";
BA_DEF_DEF_ "SamplingRateHz" 0;
BA_DEF_DEF_ "DeviceClockHz" 0;
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_DEF_DEF_ "MissingCount" 0;
{"".join(f'BA_DEF_DEF_ "{n}" 0;{chr(10)}' for n in FLOAT_ATTRIBUTES.values())}\
{"".join(f'BA_DEF_DEF_ "{n}" "";{chr(10)}' for n in TEXT_ATTRIBUTES.values())}"""


def dbc_text(layout: CanLayout) -> str:
    """The layout as a DBC file.

    Raises
    ------
    SourceError
        If the device describes itself impossibly, or with text that a DBC file cannot hold.
    """
    require_possible(layout)
    controls = [control for control in (layout.status, layout.command) if control is not None]
    parts = ['VERSION ""', "NS_ :", "BS_:", "BU_: device host"]
    parts += ["\n".join(_control_lines(control)) for control in controls]
    parts += ["\n".join(_message_lines(message, layout)) for message in layout.messages]
    parts += [_DEFINITIONS + "\n".join(_attribute_lines(layout, controls))]
    return "\n\n".join(parts) + "\n"


def write_dbc(layout: CanLayout, path: Path) -> None:
    """Write the DBC file, complete or not at all.

    Raises
    ------
    SourceError
        As `dbc_text`.
    """
    # cantools and others read DBC files as cp1252
    text = dbc_text(layout).encode("cp1252")
    with replaced(path) as temporary:
        temporary.write_bytes(text)


def require_possible(layout: CanLayout) -> tuple[Channel, ...]:
    """The channels, after the checks that every description of a device goes through."""
    fields = [{k: v for k, v in vars(channel).items() if v is not None} for channel in layout.channels]
    described = {
        "device": layout.device,
        "sampling_rate_hz": layout.sampling_rate_hz,
        "channels": fields,
        **({"clock_hz": layout.clock_hz} if layout.clock_hz is not None else {}),
    }
    for channel in layout.channels:
        match = SAMPLE_NAME.fullmatch(channel.name)
        if match is None or match[2] is not None:
            raise SourceError(
                f"channel {channel.name[:60]}: name",
                got=repr(channel.name[:60]),
                allowed="<quantity>_<place> that does not end in __ and digits",
            )
        # a quote would end the text in the file, and what follows would be read as a statement of its own
        if channel.sensor_serial is not None and re.search(r'["\\]', channel.sensor_serial):
            raise SourceError(
                f"channel {channel.name}: sensor_serial",
                got=repr(channel.sensor_serial),
                allowed="no quotes and backslashes",
            )
    return channels_from_calibration(json.dumps(described).encode()).channels


def _control_lines(message: ControlMessage) -> Iterator[str]:
    yield f"BO_ {_dbc_id(message)} {message.name}: {message.length} {_sender(message.name)}"
    for field in message.fields:
        yield _signal_line(field)


def _sender(name: str) -> str:
    return "host" if name == "host_command" else "device"


def _message_lines(message: SampleMessage, layout: CanLayout) -> Iterator[str]:
    yield f"BO_ {_dbc_id(message)} {message.name}: {message.length} device"
    for field in (message.crc, message.n_samples):
        if field is not None:
            yield _signal_line(field)
    for part in (*message.counter, *message.clock, *([message.flags] if message.flags else [])):
        mark = "M" if part.field == message.multiplexor else "".join(f"m{n}" for n in part.selectors)
        yield _signal_line(part.field, mark)
    for index, fields in zip(message.channels, message.samples, strict=True):
        for field in fields:
            yield _signal_line(field, "", layout.channels[index])


def _signal_line(field: BitField, mark: str = "", channel: Channel | None = None) -> str:
    scale, offset, limits, units = "1", "0", f"{field.lowest}|{field.highest}", ""
    if channel is not None:
        scale, offset, units = repr(channel.scale_factor), repr(channel.add_offset), channel.units
        both = channel.range_min is not None and channel.range_max is not None
        # 0|0 says "no limits" in DBC files; with one end alone known, attributes say which
        limits = f"{channel.range_min!r}|{channel.range_max!r}" if both else "0|0"
    order = "0" if field.big_endian else "1"
    sign = "-" if field.signed else "+"
    place = f"{field.start_bit}|{field.length}@{order}{sign}"
    name = " ".join([field.name, mark] if mark else [field.name])
    return f' SG_ {name} : {place} ({scale},{offset}) [{limits}] "{units}" host'


def _attribute_lines(layout: CanLayout, controls: Sequence[ControlMessage]) -> Iterator[str]:
    yield f'BA_ "DeviceName" "{layout.device}";'
    everything: list[SampleMessage | ControlMessage] = [*controls, *layout.messages]
    for message in everything:
        yield f'BA_ "VFrameFormat" BO_ {_dbc_id(message)} {14 * message.fd + message.extended};'
    for group in layout.messages:
        yield f'BA_ "SamplingRateHz" BO_ {_dbc_id(group)} {layout.sampling_rate_hz!r};'
        if layout.clock_hz is not None:
            yield f'BA_ "DeviceClockHz" BO_ {_dbc_id(group)} {layout.clock_hz!r};'
        for index, fields in zip(group.channels, group.samples, strict=True):
            place = f"SG_ {_dbc_id(group)} {fields[0].name}"
            for name, text in _channel_attributes(layout.channels[index]):
                yield f'BA_ "{name}" {place} {text};'


def _channel_attributes(channel: Channel) -> Iterator[tuple[str, str]]:
    if channel.missing_count is not None:
        yield "MissingCount", str(channel.missing_count)
    in_limits = channel.range_min is not None and channel.range_max is not None
    for key, name in FLOAT_ATTRIBUTES.items():
        value = getattr(channel, key)
        if value is not None and not (in_limits and key.startswith("range")):
            yield name, repr(float(value))
    for key, name in TEXT_ATTRIBUTES.items():
        if getattr(channel, key) is not None:
            yield name, f'"{getattr(channel, key)}"'


def _dbc_id(message: SampleMessage | ControlMessage) -> int:
    return message.arbitration_id | (_EXTENDED if message.extended else 0)
