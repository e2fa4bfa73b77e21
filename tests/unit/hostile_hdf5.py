"""HDF5 files that lead out of themselves or never end, each built from a good one or from nothing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

SECRET = np.arange(240.0) + 1000.0
"""What another file of the machine holds, and no reader may hand on."""


def secret_file(folder: Path) -> Path:
    path = folder / "secret.h5"
    if not path.exists():
        with h5py.File(path, "w") as file:
            file["x"] = SECRET
        (folder / "secret.bin").write_bytes(SECRET.tobytes())
    return path


def external_storage(file: h5py.File, name: str, folder: Path) -> None:
    secret_file(folder)
    file.create_dataset(name, SECRET.shape, "f8", external=[(str(folder / "secret.bin"), 0, SECRET.nbytes)])


def virtual(file: h5py.File, name: str, folder: Path) -> None:
    layout = h5py.VirtualLayout(SECRET.shape, "f8")
    layout[:] = h5py.VirtualSource(str(secret_file(folder)), "x", SECRET.shape)
    file.create_virtual_dataset(name, layout)


def external_link(file: h5py.File, name: str, folder: Path) -> None:
    file[name] = h5py.ExternalLink(str(secret_file(folder)), "x")


def soft_link(file: h5py.File, name: str, folder: Path) -> None:
    file[name] = h5py.SoftLink("/")


def group_in_itself(file: h5py.File, name: str, folder: Path) -> None:
    group = file.create_group(name)
    for number in range(20):
        group[f"again_{number}"] = group


HOSTILE: dict[str, tuple[Callable[[h5py.File, str, Path], None], str]] = {
    "external storage": (external_storage, "data outside the file, not followed"),
    "virtual data set": (virtual, "data outside the file, not followed"),
    "external link": (external_link, "a link, not followed"),
    "soft link": (soft_link, "a link, not followed"),
    "group in itself": (group_in_itself, "a group that is there already, not entered again"),
}
"""What is put into a file, and what is said about it."""
