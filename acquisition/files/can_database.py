"""The layout that a DBC file of our convention describes.

Read through cantools, because other laboratories' files have more in them than ours, which `can_database_text`
writes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NoReturn

from acquisition.files.can_database_text import FLOAT_ATTRIBUTES, SAMPLE_NAME, TEXT_ATTRIBUTES, require_possible
from acquisition.files.database_text import decoded_text, loaded_database
from acquisition.samples.channel import MOST_CHANNELS, Channel
from acquisition.wire.can_bits import BitField
from acquisition.wire.can_layout import STREAM_BITS, CanLayout, ControlMessage, SampleMessage, Selected
from sloshlab.errors import FileFormatError, SourceError

LARGEST_DATABASE_BYTES: Final = 4 << 20

# A shorter counter comes round too soon to prove anything: 16 bits at 1000 Hz after 65 s already.
FEWEST_COUNTER_BITS: Final = 16
MOST_COUNTER_BITS: Final = 48

MOST_CLOCK_BITS: Final = 62
"""What an int64 holds; also of the number of samples in ``device_status``."""
_PART_NAME: Final = re.compile(r"(sample_counter|device_clock)_([0-9]{1,2})")
_REMEDY: Final = "see docs/can_protocol.md for what a DBC file must say"


def read_layout(source: Path | str) -> CanLayout:
    """The layout that a DBC file describes.

    Parameters
    ----------
    source : Path or str
        The file, or its text.

    Raises
    ------
    SourceError
        If it cannot be read, no message has both channels and ``sample_counter_0``, or it describes
        what no device can be.

    Examples
    --------
    >>> from acquisition.wire.can_layout import device_database
    >>> layout = device_database("cells", 1000.0, None, [Channel("force_cell_1", "force", "N")])
    >>> from acquisition.files.can_database_text import dbc_text
    >>> read_layout(dbc_text(layout)) == layout
    True
    """
    name = str(source) if isinstance(source, Path) else "DBC"
    text = _text_of(source)
    try:
        database = loaded_database(text, name)
    except FileFormatError as error:
        raise SourceError(error.what, got=error.got, allowed=error.allowed, remedy=error.remedy) from error
    return _DatabaseReader(name, database).layout()


def _text_of(source: Path | str) -> str:
    if isinstance(source, str):
        size = len(source)
        content = source.encode()
    else:
        try:
            size = source.stat().st_size
            with source.open("rb") as stream:
                content = stream.read(LARGEST_DATABASE_BYTES + 1)
        except OSError as error:
            raise SourceError(f"{source}", got=error.strerror or "no file", allowed="a DBC file") from error
    if max(size, len(content)) > LARGEST_DATABASE_BYTES:
        raise SourceError(f"{source}"[:200], got=f"{size} bytes", allowed=f"≤ {LARGEST_DATABASE_BYTES} bytes")
    return decoded_text(content)


class _DatabaseReader:
    """Takes the layout out of what cantools has read."""

    def __init__(self, name: str, database: Any) -> None:
        self._name = name
        self._messages = list(database.messages)
        self._attributes = dict(database.dbc.attributes) if database.dbc else {}
        self._channels: list[Channel] = []

    def layout(self) -> CanLayout:
        described = [message for message in self._messages if self._has_samples(message)]
        if not described:
            self._refuse("messages", "none with channels and sample_counter_0", "at least one")
        messages = tuple(self._sample_message(message) for message in described)
        device = str(self._attributes["DeviceName"].value) if "DeviceName" in self._attributes else ""
        layout = CanLayout(
            device or Path(self._name).stem,
            self._one_number(described, "SamplingRateHz", needed=True) or 0.0,
            self._one_number(described, "DeviceClockHz", needed=any(message.clock for message in messages)),
            tuple(self._channels),
            messages,
            self._status(messages),
            self._control("host_command", ("command",)),
        )
        return self._checked(layout)

    def _checked(self, layout: CanLayout) -> CanLayout:
        self._check_identifiers(layout)
        try:
            require_possible(layout)
        except SourceError as error:
            what = error.what.replace("calibration of the device", "device")
            raise SourceError(
                f"{self._name}: {what}", got=error.got, allowed=error.allowed, remedy=_REMEDY
            ) from error
        return layout

    def _check_identifiers(self, layout: CanLayout) -> None:
        """A frame must not be taken apart by two descriptions."""
        messages: list[SampleMessage | ControlMessage] = list(layout.messages)
        messages += [control for control in (layout.status, layout.command) if control is not None]
        names: dict[tuple[int, bool], str] = {}
        for message in messages:
            key = message.arbitration_id, message.extended
            if key in names:
                got = f"{message.arbitration_id:#x} of {names[key]} and {message.name}"
                self._refuse("identifiers", got, "each once")
            names[key] = message.name

    def _refuse(self, what: str, got: str, allowed: str) -> NoReturn:
        raise SourceError(f"{self._name}: {what}", got=got, allowed=allowed, remedy=_REMEDY)

    def _has_samples(self, message: Any) -> bool:
        names = {signal.name for signal in message.signals}
        return "sample_counter_0" in names and any(SAMPLE_NAME.fullmatch(name) for name in names)

    def _sample_message(self, message: Any) -> SampleMessage:
        signals = {signal.name: signal for signal in message.signals}
        if not 1 <= message.length <= 64:
            self._refuse(message.name, f"{message.length} bytes", "1 … 64 bytes")
        first = len(self._channels)
        samples = tuple(self._sample_fields(message, signals))
        counter = self._parts(message, signals, "sample_counter")
        flags = signals.get("device_flags")
        found = SampleMessage(
            name=message.name,
            arbitration_id=message.frame_id,
            length=message.length,
            channels=tuple(range(first, len(self._channels))),
            samples=samples,
            counter=counter,
            clock=self._parts(message, signals, "device_clock"),
            multiplexor=self._multiplexor(message, signals),
            crc=self._crc(message, signals),
            n_samples=self._always("n_samples_in_frame", message, signals),
            flags=Selected(_field(flags), 0, _selectors(flags)) if flags is not None else None,
            extended=bool(message.is_extended_frame),
            fd=bool(message.is_fd),
        )
        self._check_counter(found)
        return found

    def _multiplexor(self, message: Any, signals: dict[str, Any]) -> BitField | None:
        part_name = re.compile(r"(sample_counter|device_clock)_[0-9]+|device_flags")
        used = {
            s.multiplexer_signal for s in signals.values() if s.multiplexer_ids and part_name.fullmatch(s.name)
        }
        if not used:
            return None
        if len(used) > 1 or signals[min(used)].multiplexer_ids:
            self._refuse(f"{message.name}: multiplexors", ", ".join(sorted(used)), "one, itself in every frame")
        return _field(signals[min(used)])

    def _always(self, name: str, message: Any, signals: dict[str, Any]) -> BitField | None:
        signal = signals.get(name)
        if signal is None:
            return None
        if signal.multiplexer_ids or signal.is_signed or signal.is_float:
            self._refuse(f"{message.name}.{name}", "multiplexed, signed or float", "unsigned, in every frame")
        return _field(signal)

    def _crc(self, message: Any, signals: dict[str, Any]) -> BitField | None:
        crc = self._always("crc_16", message, signals)
        # the sum leaves out the two bytes in which it stands; bits of other signals there would not be protected
        if crc is not None and (crc.length != 16 or len(crc.pieces()) != 2):
            self._refuse(f"{message.name}.crc_16", f"bit {crc.start_bit}, {crc.length} bits", "two whole bytes")
        return crc

    def _parts(self, message: Any, signals: dict[str, Any], kind: str) -> tuple[Selected, ...]:
        parts = []
        for name, signal in signals.items():
            match = _PART_NAME.fullmatch(name)
            if match is None or match[1] != kind:
                continue
            if signal.is_signed or signal.is_float:
                self._refuse(f"{message.name}.{name}", "signed or float", "unsigned")
            parts.append(Selected(_field(signal), int(match[2]), _selectors(signal)))
        parts.sort(key=lambda part: part.bit)
        reached = 0
        for part in parts:
            # with a hole in the counter no place can be proved
            if part.bit != reached:
                self._refuse(
                    f"{message.name}.{part.field.name}", f"bit {part.bit}", f"bit {reached}, which is missing"
                )
            reached += part.field.length
        most = MOST_COUNTER_BITS if kind == "sample_counter" else MOST_CLOCK_BITS
        if reached > most:
            self._refuse(f"{message.name}.{kind}", f"{reached} bits", f"≤ {most}")
        return tuple(parts)

    def _check_counter(self, message: SampleMessage) -> None:
        n_bits = sum(part.field.length for part in message.counter)
        if n_bits < FEWEST_COUNTER_BITS:
            self._refuse(
                f"{message.name}: sample counter",
                f"{n_bits} bits",
                f"≥ {FEWEST_COUNTER_BITS} bits",
            )
        if message.counter[0].selectors:
            self._refuse(f"{message.name}.sample_counter_0", "multiplexed", "in every frame")
        latched = any(part.selectors for part in message.clock)
        # only then does a frame tell at which sample the clock was taken
        if latched and (message.multiplexor is None or message.multiplexor.name != "sample_counter_0"):
            self._refuse(
                f"{message.name}: device clock", "multiplexed by another signal", "sample_counter_0 as multiplexor"
            )

    def _sample_fields(self, message: Any, signals: dict[str, Any]) -> Iterator[tuple[BitField, ...]]:
        by_channel: dict[str, dict[int, Any]] = {}
        for name, signal in signals.items():
            match = SAMPLE_NAME.fullmatch(name)
            if match is not None:
                by_channel.setdefault(match[1], {})[int(match[2] or 0)] = signal
        lengths = {len(found) for found in by_channel.values()}
        for channel, found in by_channel.items():
            if sorted(found) != list(range(len(found))) or len(lengths) > 1:
                self._refuse(
                    f"{message.name}.{channel}",
                    f"samples {', '.join(map(str, sorted(found)))}",
                    "samples 0, 1, 2 … , as many for every channel",
                )
            if len(self._channels) >= MOST_CHANNELS:
                self._refuse("channels", f"more than {MOST_CHANNELS}", f"≤ {MOST_CHANNELS}")
            self._channels.append(self._channel(f"{message.name}.{channel}", channel, found))
            yield tuple(_field(found[k]) for k in range(len(found)))

    def _channel(self, place: str, name: str, found: dict[int, Any]) -> Channel:
        first = found[0]
        # counts are signed: an unsigned signal needs a bit more
        needed_bits = first.length + (0 if first.is_signed else 1)
        # a channel that is multiplexed would have no count for the other samples
        if any(signal.is_float or signal.multiplexer_ids for signal in found.values()) or needed_bits > 32:
            self._refuse(
                place, f"{first.length} bits, float or multiplexed", "integer of ≤ 32 bits in every frame"
            )
        same = {
            (signal.length, signal.is_signed, signal.scale, signal.offset, signal.unit)
            for signal in found.values()
        }
        if len(same) > 1:
            self._refuse(place, "samples with different scaling", "one scaling")
        attributes = {
            key: attribute.value for key, attribute in (first.dbc.attributes if first.dbc else {}).items()
        }
        given = {key: attributes[text] for key, text in TEXT_ATTRIBUTES.items() if attributes.get(text)}
        given |= {key: float(attributes[a]) for key, a in FLOAT_ATTRIBUTES.items() if a in attributes}
        if first.minimum is not None and first.maximum is not None:
            given |= {"range_min": float(first.minimum), "range_max": float(first.maximum)}
        return Channel(
            name=name,
            quantity=name.partition("_")[0],
            units=(first.unit or "").strip(),
            bits=next(bits for bits in (16, 24, 32) if needed_bits <= bits),
            scale_factor=float(first.scale),
            add_offset=float(first.offset),
            missing_count=int(attributes["MissingCount"]) if "MissingCount" in attributes else None,
            **given,
        )

    def _one_number(self, messages: Sequence[Any], attribute: str, *, needed: bool) -> float | None:
        found = [message.dbc.attributes.get(attribute) if message.dbc else None for message in messages]
        values = {float(entry.value) for entry in found if entry is not None}
        if len(values) > 1 or (needed and (not values or None in found)):
            self._refuse(
                f"attribute {attribute}",
                ", ".join(map(repr, sorted(values))) or "nothing",
                "one value, the same in every message",
            )
        return values.pop() if values else None

    def _status(self, messages: Sequence[SampleMessage]) -> ControlMessage | None:
        """``device_status``; one that counts less far than its samples would announce restarts without end."""
        status = self._control("device_status", ("state", "stream", "n_samples"))
        if status is None:
            return None
        _, stream, n_samples = status.fields[-3:]
        if stream.length > STREAM_BITS:
            self._refuse("device_status.stream", f"{stream.length} bits", f"≤ {STREAM_BITS} bits")
        needed = max(sum(part.field.length for part in message.counter) for message in messages)
        if not needed <= n_samples.length <= MOST_CLOCK_BITS:
            allowed = f"{needed} … {MOST_CLOCK_BITS} bits, all of the sample counter"
            self._refuse("device_status.n_samples", f"{n_samples.length} bits", allowed)
        return status

    def _control(self, name: str, needed: tuple[str, ...]) -> ControlMessage | None:
        message = next((message for message in self._messages if message.name == name), None)
        if message is None:
            return None
        signals = {signal.name: signal for signal in message.signals}
        missing = [field for field in needed if field not in signals]
        if missing:
            self._refuse(name, f"no {', '.join(missing)}", f"signals {', '.join(needed)}")
        self._crc(message, signals)
        fields = [self._always(field, message, signals) for field in ("crc_16", *needed)]
        return ControlMessage(
            name,
            message.frame_id,
            bool(message.is_extended_frame),
            message.length,
            tuple(field for field in fields if field is not None),
            bool(message.is_fd),
        )


def _field(signal: Any) -> BitField:
    return BitField(
        signal.name,
        signal.start,
        signal.length,
        signal.byte_order == "big_endian",
        bool(signal.is_signed),
    )


def _selectors(signal: Any) -> tuple[int, ...]:
    return tuple(int(selector) for selector in signal.multiplexer_ids or ())
