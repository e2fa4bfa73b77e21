"""A recording written stretch by stretch, so that its length does not matter to memory."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from numpy.typing import DTypeLike, NDArray

from sloshlab import atomic_file
from sloshlab.errors import RecordingError, SloshlabError
from sloshlab.netcdf_lock import NETCDF_LOCK
from sloshlab.recording import MAXIMUM_DECODED_BYTES

SAMPLES_PER_CHUNK: Final = 1 << 17
COMPRESSION_LEVEL: Final = 1
"""Higher levels take several times as long and save a few per cent."""

BYTES_PER_VALUE: Final = 8
"""Readers decode to 64 bits, whatever is on the disk."""

_FORMAT_REMEDY = "split the run; the journal keeps everything"


@dataclass(frozen=True)
class Variable:
    """One variable to write.

    Attributes
    ----------
    name, dimension : str
    dtype : dtype-like
    attributes : mapping
    fill : int or float or None
        Value that stands for a lost sample.
    """

    name: str
    dimension: str
    dtype: DTypeLike
    attributes: Mapping[str, Any] = field(default_factory=dict)
    fill: int | float | None = None


class RecordingFile:
    """An open file whose variables take values place by place."""

    def __init__(self, dataset: Any) -> None:
        self._dataset = dataset

    def put(self, name: str, start: int, values: NDArray[Any]) -> None:
        """Write `values` from place `start` on."""
        self._dataset.variables[name][start : start + values.size] = values


def require_readable_size(n_values: int, *, what: str, explanation: str = "") -> None:
    """Refuse what no reader would take, before anything is written.

    Parameters
    ----------
    n_values : int
        Values of all variables together.
    what : str
        For the message.
    explanation : str
        What made it so large.

    Raises
    ------
    RecordingError
        If more memory were needed than `read_recording` grants.
    """
    if BYTES_PER_VALUE * n_values <= MAXIMUM_DECODED_BYTES:
        return
    raise RecordingError(
        what,
        got=f"{BYTES_PER_VALUE * n_values / 2**30:.3g} GiB decoded{explanation and f' ({explanation})'}",
        allowed=f"≤ {MAXIMUM_DECODED_BYTES / 2**30:.1f} GiB",
        remedy=_FORMAT_REMEDY,
    )


@contextlib.contextmanager
def written_recording(
    path: Path, dimensions: Mapping[str, int], variables: Sequence[Variable], attributes: Mapping[str, Any]
) -> Iterator[RecordingFile]:
    """Write a recording; it appears under its name when the block ends without an error, forced to the disk.

    Parameters
    ----------
    path : Path
    dimensions : mapping of str to int
    variables : sequence of Variable
    attributes : mapping
        Global attributes.

    Raises
    ------
    RecordingError
        If it cannot be written; what was there before is there still.
    """
    import netCDF4

    with _refusals_named(path), atomic_file.replaced(path) as temporary:
        # The netCDF library is not made for threads and lets go of the interpreter; without the lock, writing
        # beside a source that reads a recording ended the process.
        with NETCDF_LOCK, netCDF4.Dataset(temporary, mode="w", format="NETCDF4") as dataset:
            # counts are stored as they came
            dataset.set_auto_maskandscale(False)
            for name, size in dimensions.items():
                dataset.createDimension(name, size)
            for variable in variables:
                _create(dataset, variable, dimensions[variable.dimension])
            dataset.setncatts(dict(attributes))
            yield RecordingFile(dataset)
        # the content before the new name, and the folder after it: whatever moment the power fails, there is the
        # old file or the whole new one
        _force_to_disk(temporary)
    _force_to_disk(path.absolute().parent)


@contextlib.contextmanager
def _refusals_named(path: Path) -> Iterator[None]:
    """Say in one line that the system, or the netCDF library, refuses to write."""
    try:
        yield
    except SloshlabError:
        raise
    except (OSError, RuntimeError) as error:
        # the library tells of a full disk when it closes the file, as an error of its own without the reason
        raise RecordingError(
            f"recording {path}",
            got=f"a file that cannot be written ({getattr(error, 'strerror', None) or error})",
            allowed="a disk with enough space that can be written",
            remedy="free space, or write to another disk",
        ) from error


def _create(dataset: Any, variable: Variable, size: int) -> None:
    chunk = min(size, SAMPLES_PER_CHUNK)
    created = dataset.createVariable(
        variable.name,
        variable.dtype,
        (variable.dimension,),
        compression="zlib",
        complevel=COMPRESSION_LEVEL,
        shuffle=True,
        # as long as a stretch is written at once, so that no chunk is compressed twice
        chunksizes=(chunk,),
        fill_value=False if variable.fill is None else variable.fill,
    )
    created.set_auto_maskandscale(False)
    # chunks are written whole: a cache would only hold memory
    created.set_var_chunk_cache(2 * BYTES_PER_VALUE * chunk, 11, 1.0)
    created.setncatts(dict(variable.attributes))


def _force_to_disk(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
