"""Which reader reads a file: stated in the map, or found from the content, never from hope."""

from __future__ import annotations

import codecs
import contextlib
import importlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from acquisition.files.channel_map import SourceSection
from acquisition.files.file_format import FILE_FORMATS, FileFormat, format_begun, format_called, format_names
from acquisition.files.reading_limits import checked_size, library, limits_for
from acquisition.files.table import Table, plain_table, table_of_plain
from sloshlab.errors import FileFormatError, MissingExtraError
from sloshlab.limited_process import UntrustedFile

_HDF5 = b"\x89HDF\r\n\x1a\n"
# each with its reason: what looks like a damaged file of another format would send a person the wrong way
_REFUSED: Final[dict[bytes, str]] = {
    b"\x93NUMPY": "a NumPy .npy array (it can carry pickled code, states no units and no rate)",
    b"PK\x03\x04": "a zip archive",
    b"\x1f\x8b": "a gzip archive",
    b"TDSh": "a TDMS index file (give the .tdms file beside it)",
    b"UnFinMF": "an MDF file that its recorder did not finish",
    b"%PDF": "a PDF document",
}
_N_BYTES_LOOKED_AT = 4096


def read_table(path: Path, settings: SourceSection) -> Table:
    """Read one source file.

    Parameters
    ----------
    path : Path
        The file.
    settings : SourceSection
        The ``[source]`` section; `settings.format` chooses the reader, otherwise the content does.

    Returns
    -------
    Table

    Raises
    ------
    FileFormatError
        If the file is not of a supported format, or is damaged.
    MissingExtraError
        If its reader is not installed.
    """
    size = checked_size(path)
    chosen = file_format(path, settings.format)
    _import_for(FILE_FORMATS[chosen])
    file = UntrustedFile(f"source {path}", limits_for(size), FileFormatError)
    table = table_of_plain(file.read(_read_here, str(path), chosen, settings.model_dump()))
    columns = tuple(
        column if column.number else replace(column, number=number)
        for number, column in enumerate(table.columns, start=1)
    )
    return replace(table, format=chosen, columns=columns)


def _import_for(chosen: FileFormat) -> None:
    """Import what the reader needs, so that a forked child has it; what is missing the reader tells itself."""
    for package in chosen.packages:
        with contextlib.suppress(MissingExtraError):
            library(package, "reading")
    importlib.import_module(f"acquisition.files.{chosen.reader}")


def _read_here(path: str, chosen: str, settings: Mapping[str, Any]) -> dict[str, Any]:
    """What the reader returns, as plain values, read in this process."""
    section = SourceSection(**settings).model_copy(update={"format": chosen})
    module = importlib.import_module(f"acquisition.files.{FILE_FORMATS[chosen].reader}")
    return plain_table(module.read(Path(path), section))


def file_format(path: Path, stated: str | None = None) -> str:
    """Name of the format of a file, one of `FILE_FORMATS`.

    Raises
    ------
    FileFormatError
        If the content belongs to no supported format, or contradicts a stated one.
    """
    with path.open("rb") as stream:
        start = stream.read(_N_BYTES_LOOKED_AT)
        # MAT v7.3 has 512 bytes of its own before the HDF5 signature
        stream.seek(512)
        has_hdf5_userblock = stream.read(8) == _HDF5
    for magic, description in _REFUSED.items():
        if start.startswith(magic):
            raise FileFormatError(
                f"source {path}",
                got=description,
                allowed=", ".join(format_names()),
                remedy="save the signals as CSV, MAT v5 or netCDF",
            )
    found = _by_magic(path, start, has_hdf5_userblock) or _by_text(start)
    if stated is not None:
        return _agreed(path, stated, found)
    if found is not None:
        return found
    suffix = path.suffix.lower()
    expected = format_called(suffix)
    if expected is not None:
        raise FileFormatError(
            f"source {path}",
            got=f"a file that is named {suffix} but does not begin like {expected}",
            allowed=f"a complete {expected} file",
            remedy="it is damaged or of another format; state format in [source] if the name is wrong",
        )
    if not _looks_like_text(start):
        raise FileFormatError(
            f"source {path}",
            got="binary content of an unknown format",
            allowed=", ".join(format_names()),
        )
    return "csv"


def _by_magic(path: Path, start: bytes, has_hdf5_userblock: bool) -> str | None:
    if start.startswith(b"MDF     "):
        if start[8:9] != b"4":
            raise FileFormatError(
                f"source {path}",
                got=f"MDF version {start[8:12].decode('latin-1').strip()}",
                allowed="MDF 4.x",
                remedy="convert it to MF4",
            )
        return "mf4"
    if has_hdf5_userblock and start.startswith(b"MATLAB 7.3"):
        return "mat73"
    if start.startswith(_HDF5):
        return "mat73" if path.suffix.lower() == ".mat" else "netcdf"
    if start[126:128] in (b"IM", b"MI") and start[124:126] in (b"\x00\x01", b"\x01\x00"):
        return "mat"
    return format_begun(start)


def _by_text(start: bytes) -> str | None:
    text = start.removeprefix(codecs.BOM_UTF8).decode("latin-1")
    lines = [line.strip() for line in text.splitlines()[:12]]
    filled = [line for line in lines if line]
    if not filled:
        return None
    if filled[0].startswith("LabVIEW Measurement"):
        return "lvm"
    if filled[0] == "-1" and len(filled) > 1 and filled[1][:4].strip("b ").isdigit():
        return "uff"
    if filled[0].startswith((";$FILEVERSION", ";####")):
        return "trc"
    if filled[0].lower().startswith("date ") and len(filled) > 1 and filled[1].lower().startswith("base "):
        return "asc"
    return None


def _agreed(path: Path, stated: str, found: str | None) -> str:
    if stated == "mat" and found == "mat73":
        return "mat73"
    if stated == "netcdf" and found == "mat73":
        return "netcdf"
    # a stated format that contradicts the content is a mistake; any text may be read as CSV
    if found not in (None, stated) and stated != "csv":
        raise FileFormatError(
            f"source {path}: format", got=f"format = '{stated}' for a {found} file", allowed=f"'{found}'"
        )
    return stated


def _looks_like_text(start: bytes) -> bool:
    if start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return True
    # text has tabs and line ends, but no other control characters
    control = sum(byte < 9 or 13 < byte < 32 for byte in start)
    return control == 0
