"""MDF version 4 (.mf4), read by asammdf; conversions given as formulas are not evaluated."""

from __future__ import annotations

import struct
import traceback
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from acquisition.files.channel_map import SourceSection
from acquisition.files.reading_limits import BoundedReader, DeclaredBytes, ReaderGuard, checked_size, library
from acquisition.files.table import Column, Table, as_float64, unique_names
from sloshlab.errors import FileFormatError

# type 3 is a formula, which would be evaluated
_NUMERIC_CONVERSIONS = frozenset({0, 1, 2, 4, 5})
"""None, linear, rational, and tables from number to number."""

_MASTER_TYPES = (2, 3)
_VIRTUAL_MASTER = 3
_LAST_NUMERIC_DATA_TYPE = 5
_HAS_INVALIDATION_BIT = 2
_CHAINED = (b"##DG", b"##CG", b"##CN", b"##DL", b"##FH", b"##CH", b"##AT", b"##EV")
"""Blocks whose first link is the next of their kind."""

_BLOCK = struct.Struct("<4s4xQQ")
_FIRST_BLOCK = 64
_MOST_BLOCKS = 5_000_000


def read(path: Path, settings: SourceSection) -> Table:
    """Read the numeric channels of all groups, of one if the map names it.

    A column has the time stamps of its group; of several groups with the same channel the later
    ones are called ``name (2)`` and so on.

    Raises
    ------
    FileFormatError
        If the file is damaged, or holds no numeric channel.
    MissingExtraError
        If asammdf is not installed.
    """
    asammdf = library("asammdf", "reading MF4 files")
    checked_size(path)
    found: list[Column] = []
    unusable: dict[str, str] = {}
    start: str | None = None
    # before asammdf reads anything: its C code trusts declared records
    n_data_bytes = _check_links(path)
    guard = ReaderGuard(path, "MF4", loggers=("asammdf",))
    # given a stream, asammdf neither copies nor finishes the file
    with guard, BoundedReader(path) as stream, _opened(asammdf, stream) as source:
        declared = DeclaredBytes(path)
        for group in source.groups:
            described = group.channel_group
            # each channel becomes eight bytes a sample, and so do the time stamps, however short they are stored
            n_bytes = max(described.samples_byte_nr + described.invalidation_bytes_nr, 8 * len(group.channels))
            declared.add("a channel group", described.cycles_nr * (n_bytes + 8))
        _check_records(path, source.groups, n_data_bytes)
        for number in range(len(source.groups)):
            found += _group(source, number, settings, unusable)
        if source.header.start_time.tzinfo is not None and source.header.start_time.year > 1970:
            start = source.header.start_time.isoformat()
    if not found:
        raise FileFormatError(
            f"source {path}",
            got=f"no channel of numbers ({', '.join(list(unusable)[:6])})" if unusable else "no channels",
            allowed="numeric channels over time",
        )
    names = unique_names([column.name for column in found])
    columns = tuple(Column(**{**column.__dict__, "name": name}) for column, name in zip(found, names, strict=True))
    traps = tuple(f"asammdf: {trap}" for trap in guard.traps)
    return Table("mf4", columns, traps=traps, unusable=unusable, start_time_utc=start)


def _opened(asammdf: Any, stream: BinaryIO) -> Any:
    """Open a stream; an object that fails halfway is closed here, because its own destructor cannot."""
    try:
        return asammdf.MDF(stream)
    except Exception as error:
        for frame, _ in traceback.walk_tb(error.__traceback__):
            unfinished: Any = frame.f_locals.get("self")
            if type(unfinished).__module__.startswith("asammdf") and hasattr(unfinished, "_tempfile"):
                unfinished._tempfile.close()
                unfinished._closed = True
        raise


def _group(source: Any, number: int, settings: SourceSection, unusable: dict[str, str]) -> list[Column]:
    group = source.groups[number]
    group_name = str(getattr(group.channel_group, "acq_name", "") or f"group {number + 1}")
    columns = []
    for index, channel in enumerate(group.channels):
        if channel.channel_type in _MASTER_TYPES:
            continue
        name = str(channel.name)
        if settings.group not in (None, group_name, f"group {number + 1}"):
            unusable[f"{group_name}/{name}"] = "of another group"
            continue
        conversion = channel.conversion
        if conversion is not None and conversion.conversion_type not in _NUMERIC_CONVERSIONS:
            unusable[name] = "converted by a formula or to text, which is not evaluated"
            continue
        if group.channel_group.cycles_nr == 0:
            unusable[name] = "empty"
            continue
        signal = source.get(group=number, index=index, raw=False)
        values = np.asarray(signal.samples)
        if values.dtype.names or values.ndim != 1 or values.dtype.kind not in "fiub":
            unusable[name] = "not real numbers"
            continue
        columns.append(_column(name, group_name, signal, values))
    return columns


def _column(name: str, group_name: str, signal: Any, values: np.ndarray) -> Column:
    numbers = as_float64(values)
    invalid = getattr(signal, "invalidation_bits", None)
    if invalid is not None:
        numbers = np.where(np.asarray(invalid, dtype=bool), np.nan, numbers)
    # stamps in float32 are as coarse as their spacing at the end of the run
    stamps = np.asarray(signal.timestamps)
    resolution = float(np.spacing(np.abs(stamps).max())) if stamps.dtype == np.float32 and stamps.size else 0.0
    units = str(signal.unit or "").strip()
    return Column(
        name,
        numbers,
        units=units or None,
        time_s=as_float64(stamps),
        time_resolution_s=resolution,
        aliases=(f"{group_name}/{name}",),
    )


def _check_links(path: Path) -> int:
    """Follow every link once: they must lie in the file, and no chain of blocks may bite its tail.

    Returns the number of bytes in all data blocks, once decompressed.
    """
    n_data_bytes = 0
    content = path.read_bytes()
    if len(content) < _FIRST_BLOCK + _BLOCK.size or any(content[60:64]):
        raise _damaged(path, "an MDF file that its recorder did not finish")
    following: dict[int, int] = {}
    seen: set[int] = set()
    waiting = [_FIRST_BLOCK]
    while waiting:
        address = waiting.pop()
        # links may share blocks; only chains must not lead back
        if address in seen:
            continue
        seen.add(address)
        if address + _BLOCK.size > len(content) or len(seen) > _MOST_BLOCKS:
            raise _damaged(path, f"a link to byte {address} of {len(content)}")
        kind, length, n_links = _BLOCK.unpack_from(content, address)
        # links and block must lie within the file before any of them is followed
        if not kind.startswith(b"##") or _BLOCK.size + 8 * n_links > length or address + length > len(content):
            raise _damaged(path, f"a broken block at byte {address}")
        links = struct.unpack_from(f"<{n_links}Q", content, address + _BLOCK.size)
        waiting.extend(link for link in links if link)
        if kind in (b"##DT", b"##DV"):
            n_data_bytes += length - _BLOCK.size
        elif kind == b"##DZ" and length >= _BLOCK.size + 24:
            n_data_bytes += struct.unpack_from("<Q", content, address + _BLOCK.size + 8)[0]
        if kind in _CHAINED and links and links[0]:
            following[address] = links[0]
    _check_chains(path, following)
    return n_data_bytes


def _check_records(path: Path, groups: Any, n_data_bytes: int) -> None:
    """Records must fit the data blocks, and channels their records: the reader's C code trusts both."""
    n_needed = 0
    for group in groups:
        described = group.channel_group
        record_bytes = described.samples_byte_nr
        n_needed += described.cycles_nr * (record_bytes + described.invalidation_bytes_nr)
        for channel in group.channels:
            # computed from the number of the record: it has no bytes
            if channel.channel_type == _VIRTUAL_MASTER:
                continue
            last = channel.byte_offset + (channel.bit_offset + channel.bit_count + 7) // 8
            is_number = channel.data_type <= _LAST_NUMERIC_DATA_TYPE
            if last > record_bytes or (is_number and not 0 < channel.bit_count <= 64):
                raise _damaged(path, f"channel {str(channel.name)[:40]!r} outside its record")
            # as far away as it is stated, asammdf reads it
            has_bit = channel.flags & _HAS_INVALIDATION_BIT
            if has_bit and channel.pos_invalidation_bit >= 8 * described.invalidation_bytes_nr:
                raise _damaged(
                    path, f"channel {str(channel.name)[:40]!r} with its invalidation bit outside the record"
                )
    if n_needed > n_data_bytes:
        raise _damaged(path, f"records of {n_needed} bytes in data of {n_data_bytes}")


def _check_chains(path: Path, following: dict[int, int]) -> None:
    finished: set[int] = set()
    for start in following:
        chain: set[int] = set()
        address = start
        while address in following and address not in finished:
            if address in chain:
                raise _damaged(path, f"a chain of blocks that returns to byte {address}")
            chain.add(address)
            address = following[address]
        finished |= chain


def _damaged(path: Path, what: str) -> FileFormatError:
    return FileFormatError(
        f"source {path}",
        got=what,
        allowed="a complete MF4 file",
        remedy="it is cut short or damaged; copy it again",
    )
