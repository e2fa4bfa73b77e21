"""CAN logs (.asc, .blf, .trc), read by python-can and decoded with a DBC by cantools.

Messages with a sample counter are placed by it (`acquisition.files.can_device_log`), all others by time stamps.
Error frames, remote frames and frames without a description are counted, never passed over.
"""

from __future__ import annotations

import io
import mmap
import struct
import zlib
from array import array
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.files.can_device_log import DeviceLog
from acquisition.files.channel_map import SourceSection
from acquisition.files.database_text import decoded_text, loaded_database
from acquisition.files.reading_limits import (
    BoundedReader,
    DeclaredBytes,
    ReaderGuard,
    checked_size,
    decoded_allowance,
)
from acquisition.files.table import Column, Table
from sloshlab.errors import FileFormatError

_LARGEST_LOG_BYTES = 1 << 30
_LARGEST_DATABASE_BYTES = 32 << 20
_MOST_FRAMES = 50_000_000
# frames wait for the bus; from half a step on a time stamp could be that of the next sample
_JITTER_ALLOWED_STEPS = 0.4
_BLF_RESOLUTION_S = 5e-7
"""python-can gives BLF times as seconds since 1970 in float64."""

_LOG_CONTAINER = 10
_BLF_FILE_SIZE_AT = 16
_OBJECT_HEADER = struct.Struct("<4sHHII")


_Key = tuple[str, str, Any]
"""Message (or identifier), signal (or number of the byte), bus."""


@dataclass
class _Log:
    """What is collected while frames are read."""

    n_frames: int = 0
    n_error: int = 0
    n_remote: int = 0
    n_backwards: int = 0
    unknown: Counter[str] = field(default_factory=Counter)
    undecodable: Counter[str] = field(default_factory=Counter)
    first_time_s: float | None = None
    buses: dict[str, set[Any]] = field(default_factory=lambda: defaultdict(set))
    # arrays of numbers: a list of objects takes four times the memory
    times: dict[_Key, array[float]] = field(default_factory=lambda: defaultdict(lambda: array("d")))
    values: dict[_Key, array[float]] = field(default_factory=lambda: defaultdict(lambda: array("d")))


def read(path: Path, settings: SourceSection) -> Table:
    """Read a CAN log.

    With ``database`` in the map the signals of each message become columns ``message.signal``;
    without, the bytes of each frame become columns ``0x123[1]`` … so that a file can be looked at.

    Raises
    ------
    FileFormatError
        If log or database are damaged, or hold no data frames.
    MissingExtraError
        If cantools is not installed.
    """
    kind = settings.format or path.suffix.lower().lstrip(".")
    checked_size(path, _LARGEST_LOG_BYTES)
    missing = _check_blf(path) if kind == "blf" else _missing_end(path)
    database = _database(Path(settings.database)) if settings.database else None
    device = _device(path, settings.database, database)
    log = _Log()
    with ReaderGuard(path, f"CAN {kind}", loggers=("can",)) as guard:
        for message in _messages(path, kind):
            _take(message, log, database, settings.can_channel, device)
        if device is not None:
            device.finish()
    counted = tuple(device.columns()) if device is not None else ()
    if not log.times and not counted:
        raise FileFormatError(
            f"source {path}",
            got=_counts(log),
            allowed="data frames" + (" that the database describes" if database is not None else ""),
            remedy="check the log, database and can_channel",
        )
    return Table(
        kind,
        (*counted, *_columns(log, database, kind)),
        traps=(*(device.traps() if device is not None else ()), *_traps(log, database, kind, guard.traps)),
        unusable={f"frame {name}": f"{n} frames, not in the database" for name, n in log.unknown.items()},
        truncated=missing,
        jitter_allowed_steps=_JITTER_ALLOWED_STEPS,
        hint="" if database is not None else "state database = 'FILE.dbc' in [source] to decode signals",
    )


def _messages(path: Path, kind: str) -> Iterator[Any]:
    import can

    if kind == "blf":
        with BoundedReader(path) as stream:
            yield from can.BLFReader(stream)
        return
    with _WholeLines(path.open("rb"), encoding="utf-8", errors="replace") as stream:
        yield from can.ASCReader(stream) if kind == "asc" else can.TRCReader(stream)


class _WholeLines(io.TextIOWrapper):
    """Text without a last line that has no end: half a number is another number."""

    def __next__(self) -> str:  # type: ignore[override]  # of bytes, say the stubs of its base
        line = super().__next__()
        if not line.endswith("\n"):
            raise StopIteration
        return line


def _missing_end(path: Path) -> str:
    """What tells that a text log was cut off; empty where nothing does."""
    with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content:
        # not the whole words: programs write them with large and small letters
        begun, ended = content.rfind(b"Begin Trigger"), content.rfind(b"End Trigger")
        # what follows the end of the block has no frames, so that its last line may be open
        is_open = content[-1:] not in b"\r\n" and ended <= begun
    if is_open:
        return "the last line has no line end: the file is cut short, and that line is left out"
    return "'End TriggerBlock' is missing: the file is cut short" if begun > ended else ""


def _device(path: Path, name: str | None, database: Any) -> DeviceLog | None:
    if name is None or database is None:
        return None
    signals = {signal.name for message in database.values() for signal in message.signals}
    return DeviceLog.of_database(path, Path(name), signals)


def _take(message: Any, log: _Log, database: Any, wanted_bus: int | None, device: DeviceLog | None) -> None:
    log.n_frames += 1
    if log.first_time_s is None:
        log.first_time_s = float(message.timestamp)
    if log.n_frames > _MOST_FRAMES:
        raise ValueError(f"more than {_MOST_FRAMES} frames")
    if message.is_error_frame:
        log.n_error += 1
        return
    if message.is_remote_frame:
        log.n_remote += 1
        return
    if wanted_bus is not None and message.channel != wanted_bus:
        return
    if device is not None and device.takes(message):
        return
    identifier = f"0x{message.arbitration_id:X}{'x' if message.is_extended_id else ''}"
    if database is None:
        name, decoded = identifier, {str(n): float(byte) for n, byte in enumerate(message.data, start=1)}
    else:
        found = database.get((message.arbitration_id, bool(message.is_extended_id)))
        if found is None:
            log.unknown[identifier] += 1
            return
        name, decoded = found.name, _decoded(found, bytes(message.data), log)
    log.buses[name].add(message.channel)
    for signal, value in decoded.items():
        key = (name, signal, message.channel)
        stamps = log.times[key]
        # counted and kept: the time base refuses time that runs back, and names the place
        if stamps and message.timestamp < stamps[-1]:
            log.n_backwards += 1
        stamps.append(float(message.timestamp))
        log.values[key].append(value)


def _decoded(found: Any, data: bytes, log: _Log) -> dict[str, float]:
    try:
        # numbers and not the names of choices; half a frame must not become zeros
        signals = found.decode(data, decode_choices=False, scaling=True, allow_truncated=False)
    except (ValueError, KeyError, TypeError, ArithmeticError, struct.error) as error:
        log.undecodable[f"{found.name}: {type(error).__name__}: {error}"[:120]] += 1
        return {}
    except Exception as error:
        # cantools' errors are children of Exception alone; any other error is not about the frame
        if not type(error).__module__.startswith("cantools"):
            raise
        log.undecodable[f"{found.name}: {error}"[:120]] += 1
        return {}
    return {name: float(value) for name, value in signals.items() if isinstance(value, (int, float, np.number))}


def _database(path: Path) -> dict[tuple[int, bool], Any]:
    checked_size(path, _LARGEST_DATABASE_BYTES)
    loaded = loaded_database(decoded_text(path.read_bytes()), str(path))
    with ReaderGuard(path, "DBC", loggers=("cantools",)):
        return {(message.frame_id, bool(message.is_extended_frame)): message for message in loaded.messages}


def _columns(log: _Log, database: Any, kind: str) -> list[Column]:
    units: dict[tuple[str, str], str | None] = {}
    if database is not None:
        units = {(m.name, s.name): s.unit for m in database.values() for s in m.signals}
    # BLF times are seconds since 1970, in which float64 holds no step to 1e-6
    origin = log.first_time_s if kind == "blf" and log.first_time_s is not None else 0.0
    clocks: dict[bytes, np.ndarray] = {}
    n_called = Counter(signal for _, signal, _ in log.times)
    columns = []
    for key in sorted(
        log.times, key=lambda key: (key[0], len(key[1]) if database is None else 0, key[1], str(key[2]))
    ):
        message, signal, bus = key
        stamps = np.asarray(log.times[key]) - origin
        name = f"{message}.{signal}" if database is not None else f"{message}[{signal}]"
        if len(log.buses[message]) > 1:
            name += f" [channel {bus}]"
        columns.append(
            Column(
                name,
                np.asarray(log.values[key]),
                units=(units.get((message, signal)) or "").strip() or None,
                time_s=clocks.setdefault(stamps.tobytes(), stamps),
                time_resolution_s=_BLF_RESOLUTION_S if kind == "blf" else 0.0,
                aliases=(signal,) if database is not None and n_called[signal] == 1 else (),
            )
        )
    return columns


def _counts(log: _Log) -> str:
    return (
        f"{log.n_frames} frames: {log.n_error} error frames, {log.n_remote} remote frames, "
        f"{sum(log.unknown.values())} not in the database, {sum(log.undecodable.values())} not decodable"
    )


def _traps(log: _Log, database: Any, kind: str, reader_traps: list[str]) -> list[str]:
    traps = [f"python-can: {trap}" for trap in reader_traps]
    if log.n_error or log.n_remote:
        traps.append(f"{log.n_error} error frames and {log.n_remote} remote frames carry no data")
    traps += [f"{count} frames not decoded: {reason}" for reason, count in log.undecodable.items()]
    traps += [
        f"{name} is on channels {', '.join(sorted(map(str, buses)))}: name the channel, or state can_channel"
        for name, buses in log.buses.items()
        if len(buses) > 1
    ]
    if log.n_backwards:
        traps.append(f"{log.n_backwards} frames have an earlier time stamp than the one before")
    if log.times and kind == "blf":
        traps.append("time counts from the first frame")
    if database is None:
        traps.append("no database: bytes of frames are listed, not signals")
    return traps


def _check_blf(path: Path) -> str:
    """Walk over all objects of a BLF file, so that no declared size can stall or swamp its reader.

    Returns what is missing of it by its header, empty for a whole file.
    """
    content = path.read_bytes()
    if len(content) < 144 or content[:4] != b"LOGG":
        raise _damaged(path, "no BLF header")
    header_size = struct.unpack_from("<I", content, 4)[0]
    if not 72 <= header_size <= 4096:
        raise _damaged(path, f"a header of {header_size} bytes")
    # objects may cross the borders of containers, so that all of them are put together first
    inner = bytearray()
    declared = DeclaredBytes(path)
    position = header_size
    while position + _OBJECT_HEADER.size <= len(content):
        signature, _, _, size, kind = _OBJECT_HEADER.unpack_from(content, position)
        if signature != b"LOBJ" or size < _OBJECT_HEADER.size or position + size > len(content):
            raise _damaged(path, f"a broken object at byte {position}")
        if kind == _LOG_CONTAINER:
            container = _container(path, content[position + _OBJECT_HEADER.size : position + size])
            declared.add("a log container", len(container))
            inner += container
        position += size + size % 4
    _check_objects(path, bytes(inner))
    (n_bytes,) = struct.unpack_from("<Q", content, _BLF_FILE_SIZE_AT)
    is_short = n_bytes > len(content)
    return f"the header declares {n_bytes} bytes of which {len(content)} are there" if is_short else ""


def _container(path: Path, body: bytes) -> bytes:
    if len(body) < 16:
        raise _damaged(path, "a log container without content")
    method = struct.unpack_from("<H", body)[0]
    if method == 0:
        return body[16:]
    if method != 2:
        raise _damaged(path, f"compression method {method}")
    try:
        stream = zlib.decompressobj()
        # bounded: a few kilobytes may unpack to terabytes
        data = stream.decompress(body[16:], decoded_allowance(path.stat().st_size))
    except zlib.error as error:
        raise _damaged(path, f"a log container that cannot be opened ({error})") from error
    if stream.unconsumed_tail:
        raise _damaged(path, f"a log container of more than {len(data)} bytes")
    return data


def _check_objects(path: Path, data: bytes) -> None:
    position = 0
    while position + 32 <= len(data):
        at = data.find(b"LOBJ", position, position + 8)
        if at < 0:
            raise _damaged(path, "an object where none begins")
        _, _, version, size, _ = _OBJECT_HEADER.unpack_from(data, at)
        if size < 32 or version not in (1, 2):
            raise _damaged(path, f"an object of {size} bytes, version {version}")
        if at + size > len(data):
            raise _damaged(path, "half an object at its end")
        position = at + size


def _damaged(path: Path, what: str) -> FileFormatError:
    return FileFormatError(
        f"source {path}",
        got=what,
        allowed="a complete BLF file",
        remedy="the log is cut short or damaged; copy it again",
    )
