"""Results that are written as a folder: the data alone, or with the report."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from pathlib import Path


class FolderResult(ABC):
    """A result of several files, which its class lists."""

    def report(self, folder: str | os.PathLike[str]) -> Path:
        """Write the data, ``report.html`` and ``figures/*.png``, all together or none.

        Parameters
        ----------
        folder : path-like
            Made if it is not there; files of an earlier result go.

        Returns
        -------
        Path
            The report.

        Raises
        ------
        InputError
            If a file of somebody's own is in the way.
        """
        self._write(Path(folder), report=True)
        return Path(folder) / "report.html"

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Write the data alone, as `report` does; return the folder."""
        self._write(Path(folder), report=False)
        return Path(folder)

    @abstractmethod
    def _write(self, folder: Path, *, report: bool) -> None:
        """Put all files into a folder."""
