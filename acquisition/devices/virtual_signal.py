"""The virtual rig as the signal of a device.

At the nominal instants the counts are those of the run that `sloshlab virtual` writes for the same
settings. A device whose clock is off samples the motion and the forces themselves, at its own instants.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.devices.signal import Piece, Signal
from acquisition.samples.channel import Channel
from acquisition.sources.interface import SourceURL
from acquisition.sources.simulated_source import (
    MOST_SAMPLES,
    channel_of,
    counts_of,
    live_experiments,
    run_settings,
)
from acquisition.sources.urls import URLOptions
from acquisition.virtual_laboratory.sensors import CHANNELS, FORCE_CELLS, Laboratory, cell_forces
from acquisition.virtual_laboratory.shaker import SweepPlan
from acquisition.virtual_laboratory.shaker_run import (
    LAW_OF_EXPERIMENT,
    VirtualShaker,
    virtual_shaker,
    virtual_shaker_run,
)
from sloshlab.errors import InputError
from sloshlab.rig import Rig

FloatArray = NDArray[np.float64]


def virtual_signal(url: SourceURL, names: Sequence[str] | None = None) -> VirtualSignal:
    """The run that a URL describes.

    Parameters
    ----------
    url : SourceURL
        ``virtual:EXPERIMENT?rig=RIG.toml&…``; options as the settings of `sloshlab virtual`.
    names : sequence of str, optional
        Which channels.

    Raises
    ------
    InputError
        If there is no rig, or a setting is out of range.
    """
    options = URLOptions(url)
    rig = options.text("rig")
    settings = run_settings(options)
    options.refuse_others()
    if url.target not in live_experiments():
        raise InputError(url.text, got=repr(url.target), allowed=", ".join(live_experiments()))
    if rig is None:
        raise InputError(f"{url.text}: rig", got="none", allowed="a rig description", remedy="add rig=RIG.toml")
    n_samples = settings["duration_s"] * settings["sampling_rate_hz"]
    if n_samples > MOST_SAMPLES:
        raise InputError(f"{url.text}: length", got=f"{n_samples:g} samples", allowed=f"≤ {MOST_SAMPLES}")
    return VirtualSignal(Rig.from_toml(Path(rig)), url.target, settings, names)


class VirtualSignal(Signal):
    """A run of the virtual shaker.

    Parameters
    ----------
    rig : Rig
    experiment : str
    settings : dict
        Arguments of `virtual_shaker_run`.
    names : sequence of str, optional
        Which channels.
    """

    def __init__(
        self, rig: Rig, experiment: str, settings: dict[str, Any], names: Sequence[str] | None = None
    ) -> None:
        run = virtual_shaker_run(rig, experiment=experiment, **settings)  # type: ignore[arg-type]
        self._names = tuple(names) if names is not None else CHANNELS
        if not self._names or set(self._names) - set(CHANNELS) or len(set(self._names)) < len(self._names):
            raise InputError("--channels", got=", ".join(self._names)[:200], allowed=", ".join(CHANNELS))
        self._rate_hz = float(settings["sampling_rate_hz"])
        self._channels = tuple(channel_of(run[name]) for name in self._names)
        self._counts = np.stack([counts_of(run[name]) for name in self._names], axis=1)
        ranges = {name: (run[name].attrs["range_max"], run[name].attrs["noise_std"]) for name in CHANNELS}
        self._truth = _Truth(rig, experiment, settings, ranges)

    @property
    def sampling_rate_hz(self) -> float:
        """As set."""
        return self._rate_hz

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Force cells and accelerometers."""
        return self._channels

    @property
    def n_samples(self) -> int:
        """Length of the run."""
        return len(self._counts)

    def piece(self, start: int, stop: int) -> Piece:
        """Samples start … stop − 1 of the nominal run."""
        return Piece.of(self._counts[start:stop])

    def piece_at(self, positions: FloatArray) -> Piece:
        """The rig at any instants, read by its sensors."""
        # the motion itself at these instants, not an interpolation of what was sampled
        readings = self._truth.readings(positions / self._rate_hz)
        columns = []
        for channel in self._channels:
            limit = round((channel.range_max or 0.0) / channel.scale_factor)
            # rounded and clipped as the converter of the recording does
            columns.append(np.clip(np.rint(readings[channel.name] / channel.scale_factor), -limit, limit))
        return Piece.of(np.stack(columns, axis=1))


class _Truth:
    """Motion, forces and sensors of the run, at any time; its sensor noise is drawn anew."""

    def __init__(
        self, rig: Rig, experiment: str, settings: dict[str, Any], ranges: dict[str, tuple[float, float]]
    ) -> None:
        self._ranges = ranges  # half scale and noise of each channel, in units
        known = {"start_hz": 5.0, "stop_hz": 20.0}
        first, last = known.values() if settings["direction"] == "up" else reversed(known.values())
        plan = SweepPlan(
            acceleration_g=settings["acceleration_g"],
            law=LAW_OF_EXPERIMENT.get(experiment, settings["law"]),
            start_hz=first,
            stop_hz=last,
            duration_s=settings["duration_s"],
        )
        # gains and offsets do not depend on the seed of the run
        self._laboratory: Laboratory = settings["laboratory"]
        self._shaker: VirtualShaker = virtual_shaker(
            rig,
            plan,
            configuration=settings["configuration"],
            seed=settings["seed"],
            imperfect=settings["imperfect"],
            laboratory=self._laboratory,
        )
        self._noise = np.random.default_rng([settings["seed"], 13])
        self._is_noisy = bool(settings["imperfect"])

    def readings(self, time_s: FloatArray) -> dict[str, FloatArray]:
        """What each sensor reads, in units, before the converter rounds."""
        moved = self._shaker.motion.at(time_s)
        forces = cell_forces(self._shaker.external_force_n(time_s, moved), time_s, self._laboratory)
        truths = dict.fromkeys(CHANNELS, moved.acceleration) | dict(zip(FORCE_CELLS, forces, strict=True))
        return {name: self._read(name, truth) for name, truth in truths.items()}

    def _read(self, name: str, truth: FloatArray) -> FloatArray:
        half_scale, noise_std = self._ranges[name]
        noise = noise_std * self._noise.standard_normal(truth.size) if self._is_noisy else 0.0
        offset = self._laboratory.offset_share[name] * half_scale
        return np.asarray(truth * self._laboratory.gain[name] + offset + noise)
