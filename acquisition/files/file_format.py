"""The formats of files that can be imported: names, readers, how such files are called and begin."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

from sloshlab.registry import Registry, one_of


@dataclass(frozen=True)
class FileFormat:
    """One format.

    Attributes
    ----------
    reader : str
        Module of `acquisition.files` with a function ``read(path, settings) -> Table``.
    suffixes : tuple of str
        Of file names, with the dot; a file that is called so and does not begin so is damaged.
    signatures : tuple of bytes
        What a file of the format begins with, where that alone tells it.
    packages : tuple of str
        What the reader imports; imported before, a forked child has it already.
    can_be_stated : bool
        Whether a map may name it; False for a version that only the content tells.
    """

    reader: str
    suffixes: tuple[str, ...] = ()
    signatures: tuple[bytes, ...] = ()
    packages: tuple[str, ...] = ()
    can_be_stated: bool = True


FILE_FORMATS: Final[Registry[FileFormat]] = Registry("format")

for _name, _format in {
    "csv": FileFormat("delimited_text", packages=("pandas",)),
    "mat": FileFormat("matlab5", (".mat",), packages=("scipy.io",)),
    # a map says "mat" for both versions; the content tells which
    "mat73": FileFormat("matlab73", packages=("h5py",), can_be_stated=False),
    "uff": FileFormat("universal58", (".uff", ".unv"), packages=("pyuff",)),
    "tdms": FileFormat("labview_tdms", (".tdms",), (b"TDSm",), ("nptdms",)),
    "lvm": FileFormat("labview_text", (".lvm",), packages=("lvm_read",)),
    "mf4": FileFormat("measurement_data", (".mf4",), packages=("asammdf",)),
    "asc": FileFormat("can_log", (".asc",), packages=("can", "cantools")),
    "blf": FileFormat("can_log", (".blf",), (b"LOGG",), ("can", "cantools")),
    "trc": FileFormat("can_log", (".trc",), packages=("can", "cantools")),
    "netcdf": FileFormat(
        "network_common_data",
        (".nc", ".nc4", ".cdf"),
        (b"CDF\x01", b"CDF\x02", b"CDF\x05"),
        ("netCDF4", "h5py"),
    ),
}.items():
    FILE_FORMATS.add(_name, _format)


def format_names() -> tuple[str, ...]:
    """Names that a map may state.

    Examples
    --------
    >>> "mat" in format_names(), "mat73" in format_names()
    (True, False)
    """
    return tuple(name for name in FILE_FORMATS.names if FILE_FORMATS[name].can_be_stated)


def format_called(suffix: str) -> str | None:
    """Name of the format whose files have this suffix, None if there is none."""
    return next((name for name in FILE_FORMATS.names if suffix in FILE_FORMATS[name].suffixes), None)


def format_begun(start: bytes) -> str | None:
    """Name of the format whose signature a file begins with, None if there is none."""
    return next((name for name in FILE_FORMATS.names if start.startswith(FILE_FORMATS[name].signatures)), None)


FormatName = Annotated[str, one_of(format_names)]
