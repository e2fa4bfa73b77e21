"""A folder of sweeps with the rigs beside them."""

from __future__ import annotations

from pathlib import Path


def recordings_and_rigs(folder: Path, rigs_folder: Path | None = None) -> tuple[list[Path], list[Path]]:
    """All recordings of a folder by name, and the rigs beside them or in another folder.

    The rig filled half comes first: the report begins with the fill level that the source begins with.
    """
    rigs = (rigs_folder or folder).glob("rig*.toml")
    return sorted(folder.glob("*.nc")), sorted(rigs, key=lambda path: ("0.50" not in path.name, path.name))
