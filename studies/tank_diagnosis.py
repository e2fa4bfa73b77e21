"""The numerical tank diagnosed: what a twin with a simpler liquid leaves out, its recordings should tell.

The liquid's own physics acts behind structure and sensors. Each case believes in less than the liquid does, and
gets recordings of the numerical tank: sweeps and sudden starts on the shaker, decays on the beam. Recordings come
at a low rate: what the vocabulary has of a liquid are its mass and its work per cycle, and those are in the
fundamental; splashes and slaps are above it.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
import xarray as xr
from scipy.signal import butter, sosfiltfilt

from pipelines.diagnosis.diagnose import diagnose_case
from pipelines.report.outputs import write_dataset
from pipelines.report.progress import progress
from pipelines.sweep.shaker import ShakerSettings, analyse_shaker
from sloshlab import atomic_file
from sloshlab.errors import InputError
from sloshlab.recording import read_recording, write_recording

_FROZEN: Final = 'tank_model = "frozen"'
_VISCOUS: Final = 'tank_model = "viscous"\nparameters = {{ damping_kg_per_s = {:g} }}'
_MAPS: Final = 'tank_model = "viscous"\nparameters = {{ maps = "{}", metric = "map", effective_mass = {} }}'
_MAPS_FILE: Final = "maps.nc"
_OF_SWEEPS: Final = "shaker/rig_fill_0.50.toml"
_ORDER: Final = 8
_MIRRORED: Final = 20
"""Samples of the lower rate; further a filter does not reach."""
_SHARE_OF_BAND: Final = 0.8
"""Of what a lower rate leaves, to which recordings are filtered; there and back a filter halves at its corner."""
_THREE_MODES: Final = (
    "frequencies_hz = [10.87, 78.31, 226.5]",
    "damping_ratios = [0.0032, 0.0090, 0.0176]",
    "modal_masses_kg = [0.8956, 1.0692, 0.9655]",
    "tip_mode_shape = [1.0, 1.0, 1.0]",
)
"""Of the beam; where fewer than every second sample is kept, two of them are within the band."""


@dataclass(frozen=True)
class TankCase:
    """Recordings and what the laboratory believes of the liquid.

    Attributes
    ----------
    name : str
    rig : str
        In the folder of recordings.
    recordings : tuple of str
        Patterns in the same folder.
    twin : str
        What stands for the liquid in the rig file.
    left_out : str
        What is known to be missing.
    every : int
        Of how many samples one is kept, after a low-pass filter without delay.
    below_hz : float
        To which recordings are filtered; liquids answer at twice and three times the frequency, too.
    within_s : tuple of float
        The part of recordings that is taken: of a sweep the frequencies at which something happens.
    maps_from : tuple of str
        Patterns of the sweeps that gave the maps of the liquid, where `twin` names maps.
    work_known_below_g : float
        At higher levels the maps have the W̄ of this one at the same frequency: work that goes on growing with the
        square of the level.
    """

    name: str
    rig: str
    recordings: tuple[str, ...]
    twin: str
    left_out: str
    every: int
    below_hz: float = np.inf
    within_s: tuple[float, float] = (0.0, np.inf)
    maps_from: tuple[str, ...] = ()
    work_known_below_g: float = np.inf


_STRONG_SWEEPS: Final = tuple(f"shaker/fill_0.50_sweep_{level}g*.nc" for level in ("3.00", "4.00", "5.00", "6.00"))
_LONG_STROKE_SWEEPS: Final = ("long_stroke/fill_0.50_long_stroke_sweep_*.nc",)
_DECAYS_OF_THE_BEAM: Final = ("transients/beam_decay_*.nc", "beam/decay_sloshing_repeat_[12].nc")
_ALL_SWEEPS: Final = ("shaker/fill_0.50_sweep_1.50g.nc", "shaker/fill_0.50_sweep_2.00g.nc", *_STRONG_SWEEPS)

CASES: Final = (
    TankCase(
        "shaker_frozen",
        "shaker/rig_fill_0.50.toml",
        tuple(f"shaker/fill_0.50_sweep_{level}g*.nc" for level in ("0.50", "1.50", "3.00", "5.00")),
        _FROZEN,
        "dissipation above a threshold, effective mass",
        8,
    ),
    TankCase(
        "shaker_maps",
        "shaker/rig_fill_0.50.toml",
        _STRONG_SWEEPS,
        _MAPS.format(_MAPS_FILE, "false"),
        "effective mass",
        12,
        below_hz=16.0,
        within_s=(80.0, 180.0),
        maps_from=_STRONG_SWEEPS,
    ),
    TankCase(
        "starts_maps",
        "transients/rig_fill_0.50.toml",
        ("transients/fill_0.50_sudden_start_1[01].?hz_[234].??g_*.nc",),
        _MAPS.format(_MAPS_FILE, "true"),
        "break-up after some cycles",
        12,
        below_hz=16.0,
        maps_from=_ALL_SWEEPS,
    ),
    TankCase(
        "starts_viscous",
        "transients/rig_fill_0.50.toml",
        ("transients/fill_0.50_sudden_start_1[012].?hz_[345].??g_*.nc",),
        _VISCOUS.format(4.0),
        "break-up after some cycles, effective mass",
        12,
    ),
    TankCase(
        "high_g_maps",
        "shaker/rig_fill_0.50.toml",
        _STRONG_SWEEPS,
        _MAPS.format(_MAPS_FILE, "true"),
        "dissipation that grows no more at high accelerations",
        12,
        below_hz=16.0,
        within_s=(100.0, 145.0),
        maps_from=_ALL_SWEEPS,
        work_known_below_g=3.2,
    ),
    TankCase(
        "long_stroke_maps",
        "long_stroke/rig_fill_0.50.toml",
        _LONG_STROKE_SWEEPS,
        _MAPS.format(_MAPS_FILE, "true"),
        "dissipation that grows no more at high accelerations",
        12,
        below_hz=16.0,
        within_s=(3.0, 43.0),
        maps_from=(*_ALL_SWEEPS, *_LONG_STROKE_SWEEPS),
        work_known_below_g=3.2,
    ),
    TankCase(
        "beam_maps",
        "beam/rig_beam.toml",
        _DECAYS_OF_THE_BEAM,
        _MAPS.format(_MAPS_FILE, "true"),
        "break-up after some cycles",
        4,
        maps_from=_ALL_SWEEPS,
    ),
    TankCase(
        "beam_frozen",
        "beam/rig_beam.toml",
        _DECAYS_OF_THE_BEAM,
        _FROZEN,
        "dissipation above a threshold, effective mass, break-up after some cycles",
        2,
    ),
)


def diagnose_tank(recordings: Path, output: Path) -> list[str]:
    """Make the cases, diagnose each, and return one line per case.

    Parameters
    ----------
    recordings : Path
        Made by ``sloshlab virtual campaign --liquid numerical``.
    output : Path
        One folder per case; those that have a verdict are left as they are.
    """
    lines = []
    with progress("diagnosing the numerical tank", len(CASES)) as said:
        for case in CASES:
            folder = output / case.name
            if not (folder / "recordings").exists():
                make_case(recordings, case, folder)
            if not (folder / "diagnosis" / "verdict.json").exists():
                found = diagnose_case(folder, None, command=f"tank_diagnosis {case.name}")
                lines.append(f"{case.name} ({case.left_out}): {found['statement']}")
            said(case.name)
    return lines


def make_case(recordings: Path, case: TankCase, folder: Path) -> None:
    """Write a case folder: the rig with its belief of the liquid, and the recordings.

    Raises
    ------
    InputError
        If recordings are missing.
    """
    chosen = [file for pattern in case.recordings for file in sorted(recordings.glob(pattern))]
    if not chosen:
        raise InputError(str(recordings), got=f"no {case.recordings[0]}", allowed="those of the numerical tank")
    with atomic_file.filled_folder(folder) as complete:
        rig = (recordings / case.rig).read_text().replace(_FROZEN, case.twin)
        for numbers in _THREE_MODES if case.every > 2 else ():
            rig = rig.replace(numbers, numbers.rpartition(",")[0] + "]")
        (complete / "rig.toml").write_text(rig)
        if _MAPS_FILE in case.twin:
            settings = ShakerSettings.checked(p=6, m=24, boundaries="measured", allow_incomplete=False)
            sweeps = [file for pattern in case.maps_from for file in sorted(recordings.glob(pattern))]
            maps = analyse_shaker(sweeps, [recordings / _OF_SWEEPS], settings).maps
            maps = maps.assign(w_bar=constant_beyond(maps["w_bar"], case.work_known_below_g))
            write_dataset(maps, complete / _MAPS_FILE)
        (complete / "recordings").mkdir()
        for file in chosen:
            part = part_of(read_recording(file), *case.within_s)
            write_recording(at_lower_rate(part, case.every, case.below_hz), complete / "recordings" / file.name)


def constant_beyond(w_bar: xr.DataArray, level_g: float) -> xr.DataArray:
    """A map whose W̄ beyond a level is, at every frequency, the last that is known below it.

    A twin fills what a map does not know with what is measured nearest, which may be at another frequency and
    lower, as if saturation were known.

    Parameters
    ----------
    w_bar : xarray.DataArray, shape (omega_bar, u_bar)
    level_g : float
        Acceleration amplitude ω̄² ū in g; infinite for the map as it is.
    """
    is_beyond = (w_bar["omega_bar"] ** 2 * w_bar["u_bar"]).transpose(*w_bar.dims) >= level_g
    last_known = pd.DataFrame(w_bar.where(~is_beyond).to_numpy()).ffill(axis="columns")
    return w_bar.where(~is_beyond, w_bar.copy(data=last_known.to_numpy()))


def part_of(recording: xr.Dataset, from_s: float, to_s: float) -> xr.Dataset:
    """A recording between two times after its beginning; its times begin with zero again."""
    chosen = (recording["time"].values >= from_s) & (recording["time"].values < to_s)
    part = recording.isel(time=np.flatnonzero(chosen))
    return part.assign_coords(time=recording["time"].values[: part.sizes["time"]])


def at_lower_rate(recording: xr.Dataset, every: int, below_hz: float = np.inf) -> xr.Dataset:
    """A recording of one sample in `every`, low-pass filtered before without delay.

    At both ends the filter sees the recording mirrored: a release begins with its largest displacement, and a jump
    from nothing to that would ring in the samples about it.

    Parameters
    ----------
    recording : xarray.Dataset
    every : int
    below_hz : float
        Where the filter has fallen to a half, if that is lower than 0.8 of the band that is left.
    """
    rate = float(recording.attrs["sampling_rate_hz"])
    low_pass = butter(_ORDER, min(below_hz, _SHARE_OF_BAND * 0.5 * rate / every), fs=rate, output="sos")
    kept: dict[str, xr.DataArray] = {}
    for name, variable in recording.data_vars.items():
        if variable.dims != ("time",):
            kept[str(name)] = variable
        elif variable.dtype.kind == "f":
            n_mirrored = min(_MIRRORED * every, variable.size - 1)
            values = sosfiltfilt(low_pass, variable.values.astype(float), padtype="even", padlen=n_mirrored)
            kept[str(name)] = variable[::every].copy(data=values[::every])
            if "noise_std" in variable.attrs:
                kept[str(name)].attrs["noise_std"] = float(variable.attrs["noise_std"]) / np.sqrt(every)
        else:
            kept[str(name)] = variable[::every]
    return xr.Dataset(kept, attrs={**recording.attrs, "sampling_rate_hz": rate / every})


if __name__ == "__main__":
    sys.stdout.write("\n".join(diagnose_tank(Path(sys.argv[1]), Path(sys.argv[2]))) + "\n")
