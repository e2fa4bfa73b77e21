"""A recording played as a source: ``file:RUN.nc``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from acquisition.samples.delivery import CountArray
from acquisition.sources.interface import SourceInfo, SourceURL
from acquisition.sources.playback import PlayedSource
from acquisition.sources.stored_counts import StoredCounts
from sloshlab.errors import RecordingError, SourceError


class FileSource(PlayedSource):
    """A recording, played: counts as `StoredCounts` gives them, sample k of the file with counter k.

    Option beside those of `PlayedSource`: ``channels=a,b`` plays only these, in this order.

    Parameters
    ----------
    url : SourceURL
        Its target is the file.
    **clocks : callable
        As for `PlayedSource`.
    """

    def __init__(self, url: SourceURL, **clocks: Any) -> None:
        super().__init__(url, device=Path(url.target).stem, **clocks)
        self._file = Path(url.target)
        chosen = self._options.text("channels")
        self._chosen = None if chosen is None else chosen.split(",")
        self._options.refuse_others()
        self._stored: StoredCounts | None = None

    def open(self) -> None:
        """Open the file and learn its channels.

        Raises
        ------
        SourceError
            If it is no recording, has no such channel, or a channel cannot become counts.
        """
        try:
            stored = self._stored = StoredCounts(self._file, self._chosen)
        except RecordingError as error:
            raise self._as_source_error(error) from error
        groups = (tuple(range(len(stored.channels))),)
        self._info = SourceInfo(self._device, self.url, stored.sampling_rate_hz, stored.channels, groups)

    def close(self) -> None:
        """Close the file; may be called twice."""
        super().close()
        if self._stored is not None:
            self._stored.close()

    def _n_samples(self) -> int:
        assert self._stored is not None
        return self._stored.n_samples

    def _counts(self, start: int, stop: int) -> CountArray:
        assert self._stored is not None
        try:
            return self._stored.counts(start, stop)
        except RecordingError as error:
            raise self._as_source_error(error) from error

    def _as_source_error(self, error: RecordingError) -> SourceError:
        return SourceError(
            f"source {self.url}: {error.what}", got=error.got, allowed=error.allowed, remedy=error.remedy
        )
