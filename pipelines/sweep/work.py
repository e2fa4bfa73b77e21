"""Work per cycle of any structure: one force, one motion, no tank."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.inputs.recordings import RunSource, recording_of, work_of
from pipelines.report.progress import progress
from pipelines.sweep.results import RunResult, SweepExperiment, SweepOptions, SweepSignals
from pipelines.sweep.stages import (
    analyse_sweep,
    examined_recording,
    naming,
    not_measured,
    require_usable,
)
from sloshlab.conditioning.differentiation import differentiated
from sloshlab.errors import AnalysisError, InputError
from sloshlab.maps.energy_maps import energy_maps
from sloshlab.recording import channels
from sloshlab.sweep.passivity import gives_energy
from sloshlab.sweep.windows import WindowSettings

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class WorkSettings(SweepOptions):
    """Which channels are the force and the motion.

    Attributes
    ----------
    force, motion : str
        Channel names.
    motion_quantity : str
        ``acceleration``, ``velocity`` or ``displacement``.
    phase_reference : str
        Channel whose phase counts the cycles; empty for the motion.
    """

    force: str = ""
    motion: str = ""
    motion_quantity: str = "acceleration"
    phase_reference: str = ""

    @classmethod
    def checked(
        cls, *, p: int, m: int, force: str, motions: Mapping[str, str], phase_reference: str
    ) -> WorkSettings:
        """Settings from the command line.

        Raises
        ------
        InputError
            If not exactly one motion is named.
        """
        named = {quantity: name for quantity, name in motions.items() if name}
        if len(named) != 1:
            raise InputError(
                "motion channel",
                got=f"{len(named)} of --acceleration, --velocity, --displacement",
                allowed="exactly one",
            )
        [(quantity, motion)] = named.items()
        windows = WindowSettings(half_width_cycles=p, spacing_cycles=m)
        return cls(
            windows,
            "measured",
            True,
            force=force,
            motion=motion,
            motion_quantity=quantity,
            phase_reference=phase_reference,
        )


def analyse_work(
    paths: Sequence[RunSource], settings: WorkSettings, *, keep_signals: bool = False
) -> SweepExperiment:
    """Analyse sweeps with one force and one motion channel; their signals stay in memory if they are to be kept.

    Raises
    ------
    InputError
        If a run or a channel is bad; nothing has been written then.
    """
    results: list[RunResult] = []
    with progress("work", len(paths), work_of(paths)) as advance:
        for path in paths:
            with naming(path):
                results.append(_analysed(path, settings, keep_signals))
            advance(path.name)
    windows = xr.concat([result.windows for result in results], dim="window", combine_attrs="drop")
    _check_energy_sign(windows, settings)
    maps = energy_maps(windows)
    return SweepExperiment(
        title="Work per cycle",
        inputs=tuple(paths),
        kind="work",
        runs=tuple(results),
        rigs=(),
        windows=windows,
        maps=maps.dataset,
        work_maps=maps,
        settings=settings,
        flags=tuple(flag for result in results for flag in result.flags),
    )


def _analysed(path: RunSource, settings: WorkSettings, keep_signals: bool) -> RunResult:
    recording = recording_of(path)
    quality = require_usable(recording, path)
    used = [name for name in (settings.force, settings.motion, settings.phase_reference) if name in recording]
    recording, examination = examined_recording(recording, path, names=used)
    force = _channel(recording, path, settings.force, "force")
    motion = _channel(recording, path, settings.motion, settings.motion_quantity)
    reference = None
    if settings.phase_reference:
        reference = np.asarray(_channel(recording, path, settings.phase_reference, None), dtype=np.float64)
    if settings.motion_quantity == "displacement":
        motion = differentiated(np.asarray(motion, dtype=np.float64), float(recording.attrs["sampling_rate_hz"]))
    signals = SweepSignals(
        force_n=force,
        motion=motion,
        motion_is_velocity=settings.motion_quantity != "acceleration",
        phase_motion=reference,
        not_measured=not_measured(recording, [settings.force, settings.motion], quality),
    )
    result = analyse_sweep(recording, path, signals, settings, quality=quality, keep_signals=keep_signals)
    return dataclasses.replace(result, examination=examination)


def _channel(recording: xr.Dataset, path: RunSource, name: str, quantity: str | None) -> FloatArray:
    available = channels(recording, quantity)
    if name not in available:
        raise AnalysisError(
            f"{path}: channel",
            got=repr(name),
            allowed=", ".join(available) or f"no {quantity} channel is there",
            remedy="name one of these",
        )
    return np.asarray(recording[name].values)


def _check_energy_sign(windows: xr.Dataset, settings: WorkSettings) -> None:
    if gives_energy(windows):
        share = np.mean(windows["dissipated_mass_kg"].values < 0)
        raise AnalysisError(
            f"sign of {settings.force} or {settings.motion}",
            got=f"negative work in {100 * share:.0f} % of the windows",
            allowed="a structure that takes energy",
            remedy=f"set sign = -1 for {settings.force} in the channel map and import again",
        )
