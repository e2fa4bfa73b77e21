"""A case folder: one rig and its recordings, grouped into tests and their repeats."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import xarray as xr

from sloshlab.errors import InputError
from sloshlab.experiments import EXPERIMENTS
from sloshlab.recording import RunAttributes, read_recording, run_attributes
from sloshlab.rig import Rig

# Sizes are checked before memory is allocated for all runs.
MOST_RUNS: Final = 200
_SAME_TEST: Final = (
    "experiment",
    "configuration",
    "initial_displacement_m",
    "acceleration_g",
    "sweep_start_hz",
    "sweep_rate_octave_per_s",
)
_NAME_OF_TEST: Final = "test"
"""Optional attribute: runs that differ in it are different tests, for example realisations of a random signal."""
_LEVELS_AGREE: Final = 0.1
"""Difference of the logarithms of the levels of two runs, up to which they are repeats."""
_LARGEST_CASE_BYTES: Final = 2 * 2**30


@dataclass(frozen=True, eq=False)
class CaseRun:
    """One recording of a case.

    Attributes
    ----------
    name : str
        File name without its ending.
    recording : xarray.Dataset
        In SI units.
    attributes : RunAttributes
    """

    name: str
    recording: xr.Dataset
    attributes: RunAttributes

    @property
    def is_free(self) -> bool:
        """Whether it starts from a release and nothing drives it."""
        return EXPERIMENTS[self.attributes.experiment].moves == "release"

    @property
    def duration_s(self) -> float:
        """Length of the recording."""
        return float(self.recording.sizes["time"] / self.attributes.sampling_rate_hz)


@dataclass(frozen=True, eq=False)
class Case:
    """A rig and what was recorded on it.

    Attributes
    ----------
    name : str
    folder : Path
    rig : Rig or None
        None where a twin of the user's own stands for it.
    runs : tuple of CaseRun
        In the order of their names.
    """

    name: str
    folder: Path
    rig: Rig | None
    runs: tuple[CaseRun, ...]

    def tests(self) -> list[tuple[CaseRun, ...]]:
        """Runs of one test together: those that share everything but `repeat`, and have the same level."""
        groups: list[list[CaseRun]] = []
        for run in self.runs:
            for group in groups:
                if _same_test(group[0], run):
                    group.append(run)
                    break
            else:
                groups.append([run])
        return [tuple(group) for group in groups]

    def names_by_test(self) -> list[list[str]]:
        """Names of the runs of every test."""
        return [[run.name for run in test] for test in self.tests()]

    @property
    def repeated(self) -> frozenset[str]:
        """Names of the runs whose test has others."""
        return frozenset(name for test in self.names_by_test() if len(test) > 1 for name in test)


def read_case(folder: str | Path, *, with_rig: bool = True) -> Case:
    """Read ``rig.toml`` and ``recordings/*.nc`` of a case folder.

    Parameters
    ----------
    folder : path
    with_rig : bool
        False where a twin of the user's own is simulated; ``rig.toml`` may then be absent and is not read.

    Raises
    ------
    InputError
        If the folder is no case, or holds more than can be judged.
    """
    path = Path(folder)
    rig_file = path / "rig.toml"
    wrong = ""
    if not path.is_dir():
        wrong = "a file" if path.exists() else "no such folder"
    elif with_rig and not rig_file.is_file():
        wrong = "no rig.toml"
    if wrong:
        allowed = "a folder with rig.toml and recordings/*.nc"
        raise InputError(f"case {path}", got=wrong, allowed=allowed, remedy="name a case folder")
    files = sorted((path / "recordings").glob("*.nc"))
    if not 1 <= len(files) <= MOST_RUNS:
        raise InputError(f"case {path}", got=f"{len(files)} recordings", allowed=f"1 … {MOST_RUNS}")
    rig = Rig.from_toml(rig_file) if with_rig else None
    runs, n_bytes = [], 0
    for file in files:
        recording = read_recording(file)
        n_bytes += recording.nbytes
        if n_bytes > _LARGEST_CASE_BYTES:
            raise InputError(
                f"case {path}", got="more than 2 GiB of samples", allowed="2 GiB", remedy="leave runs out"
            )
        runs.append(CaseRun(file.stem, recording, run_attributes(recording)))
    return Case(path.resolve().name, path, rig, tuple(runs))


def _same_test(first: CaseRun, other: CaseRun) -> bool:
    if any(getattr(first.attributes, name) != getattr(other.attributes, name) for name in _SAME_TEST):
        return False
    if _name_of_test(first) != _name_of_test(other):
        return False
    # Repeats are compared coefficient by coefficient.
    if first.recording.sizes["time"] != other.recording.sizes["time"]:
        return False
    # Recorded levels, as a driven run may state none: realisations of other sizes must not pass for scatter.
    return bool(abs(np.log(max(level(first), 1e-300) / max(level(other), 1e-300))) < _LEVELS_AGREE)


def _name_of_test(run: CaseRun) -> str:
    return str(run.recording.attrs.get(_NAME_OF_TEST, ""))


def level(run: CaseRun) -> float:
    """Level of a run: RMS of its mean acceleration signal [m/s²], or of what it has instead.

    Parameters
    ----------
    run : CaseRun
    """
    for quantity in ("acceleration", "displacement", "velocity", "force"):
        chosen = [values for name, values in run.recording.data_vars.items() if str(name).startswith(quantity)]
        known = [array[np.isfinite(array)] for array in (np.asarray(values, np.float64) for values in chosen)]
        # A channel whose samples were all lost has no level.
        levels = [float(values.std()) for values in known if values.size]
        if levels:
            return float(np.mean(levels))
    return 0.0
