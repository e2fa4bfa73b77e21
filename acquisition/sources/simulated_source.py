"""The virtual laboratory as a source: ``sim:shaker_sweep?rig=RIG.toml&acceleration_g=3``.

The counts are those that `sloshlab virtual` writes for the same settings. The amplifier range of each
sensor follows from the largest value of the whole run, so the run is made as a whole when the source is
opened; its length is limited so that this needs about 1 GiB at most.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
import xarray as xr

from acquisition.samples.channel import Channel
from acquisition.samples.delivery import CountArray
from acquisition.sources.interface import SourceInfo, SourceURL
from acquisition.sources.playback import PlayedSource
from acquisition.sources.urls import URLOptions
from acquisition.virtual_laboratory.sensors import CHANNELS, LOST_COUNT, Laboratory
from acquisition.virtual_laboratory.shaker_run import SWEEP_LAWS, virtual_shaker_run
from sloshlab.configurations import CONFIGURATIONS, SLOSHING
from sloshlab.errors import InputError, SourceError
from sloshlab.experiments import experiment_names
from sloshlab.rig import Rig

MOST_SAMPLES: Final = 4_000_000
"""Two hours at 512 Hz."""


def live_experiments() -> tuple[str, ...]:
    """Experiments that the virtual shaker can run live: those that recordings name."""
    return experiment_names(lambda experiment: experiment.moves == "shaker" and experiment.is_recorded)


class SimulatedSource(PlayedSource):
    """A run of the virtual shaker, live; in real time unless the URL says otherwise.

    Options beside those of `PlayedSource`: ``rig=RIG.toml`` (needed), ``acceleration_g``, ``duration_s``,
    ``sampling_rate_hz``, ``seed``, ``start_hz``, ``stop_hz``, ``n_steps``, ``direction=up|down``,
    ``law=octave|linear|stepped``, ``configuration=sloshing|frozen|empty``, ``imperfect=yes|no``,
    ``laboratory_seed`` (without it the rig is as told).

    Parameters
    ----------
    url : SourceURL
        Its target is the experiment.
    **clocks : callable
        As for `PlayedSource`.
    """

    def __init__(self, url: SourceURL, **clocks: Any) -> None:
        super().__init__(url, device="virtual_shaker", real_time=True, **clocks)
        if url.target not in live_experiments():
            raise SourceError(f"source {url.text}", got=repr(url.target), allowed=", ".join(live_experiments()))
        self._rig = self._options.text("rig")
        self._settings = {"experiment": url.target, **self._read_settings()}
        self._options.refuse_others()
        self._table: CountArray = np.empty((0, len(CHANNELS)), np.int32)

    def open(self) -> None:
        """Make the run.

        Raises
        ------
        SourceError
            If there is no rig, or a setting is out of range.
        """
        # before the run is made, which needs its memory at once
        self._check_length()
        try:
            if self._rig is None:
                raise InputError("rig", got="none", allowed="a rig description", remedy="add rig=RIG.toml")
            run = virtual_shaker_run(Rig.from_toml(Path(self._rig)), **self._settings)
        except InputError as error:
            raise SourceError(
                f"source {self.url}: {error.what}", got=error.got, allowed=error.allowed, remedy=error.remedy
            ) from error
        self._table = np.stack([counts_of(run[name]) for name in CHANNELS], axis=1)
        channels = tuple(channel_of(run[name]) for name in CHANNELS)
        rate_hz = self._settings["sampling_rate_hz"]
        self._info = SourceInfo(self._device, self.url, rate_hz, channels, (tuple(range(len(channels))),))

    def close(self) -> None:
        """Forget the run; may be called twice."""
        super().close()
        self._table = self._table[:0].copy()

    def _n_samples(self) -> int:
        return len(self._table)

    def _counts(self, start: int, stop: int) -> CountArray:
        return self._table[start:stop].copy()

    def _read_settings(self) -> dict[str, Any]:
        options = self._options
        return run_settings(options) | {
            "start_hz": options.number("start_hz", 5.0, lowest=0, highest=1e4),
            "stop_hz": options.number("stop_hz", 20.0, lowest=0, highest=1e4),
            "n_steps": options.integer("n_steps", 24, lowest=2, highest=1000),
        }

    def _check_length(self) -> None:
        n_samples = round(self._settings["duration_s"] * self._settings["sampling_rate_hz"])
        if n_samples > MOST_SAMPLES:
            raise SourceError(
                f"source {self.url}: length",
                got=f"{n_samples} samples",
                allowed=f"≤ {MOST_SAMPLES}",
                remedy="a shorter run or a lower sampling rate",
            )


def run_settings(options: URLOptions) -> dict[str, Any]:
    """Settings of a run by a URL; limits that the virtual laboratory knows better are left to it."""
    return {
        "acceleration_g": options.number("acceleration_g", 3.0, lowest=0, highest=1e4),
        "duration_s": options.number("duration_s", 240.0, lowest=0, highest=1e5),
        "sampling_rate_hz": options.number("sampling_rate_hz", 512.0, lowest=1, highest=1e6),
        "seed": options.integer("seed", 0, lowest=0, highest=2**31 - 1),
        "direction": options.choice("direction", "up", ("up", "down")),
        "law": options.choice("law", SWEEP_LAWS[0], SWEEP_LAWS),
        "configuration": options.choice("configuration", SLOSHING, CONFIGURATIONS),
        "imperfect": options.yes("imperfect", True),
        "laboratory": _laboratory(options),
    }


def _laboratory(options: URLOptions) -> Laboratory:
    """The laboratory that is asked for; the rig as it is told if none is."""
    if options.text("laboratory_seed") is None:
        return Laboratory.perfect()
    return Laboratory.drawn(options.integer("laboratory_seed", 0, lowest=0, highest=2**31 - 1))


def counts_of(channel: xr.DataArray) -> CountArray:
    """Counts behind the values of a virtual sensor; the division is exact to far less than half a count."""
    counts = np.rint(channel.values / channel.encoding["scale_factor"])
    # the count by which the virtual sensors mark a lost sample on disk
    return np.where(np.isnan(counts), LOST_COUNT, counts).astype(np.int32)


def channel_of(channel: xr.DataArray) -> Channel:
    """What the counts of a virtual sensor mean."""
    scale = channel.encoding["scale_factor"]
    return Channel(str(channel.name), bits=16, scale_factor=scale, missing_count=LOST_COUNT, **channel.attrs)
