"""The numerical tank diagnosed: what a twin with a simpler liquid leaves out, its recordings should tell.

The liquid's own physics acts behind structure and sensors. Each case believes in a frozen or a viscous liquid, and
gets recordings of the numerical tank: sweeps and sudden starts on the shaker, decays on the beam.
"""

from __future__ import annotations

import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pipelines.diagnose import diagnose_case
from pipelines.progress import progress
from sloshlab import atomic_file
from sloshlab.errors import InputError

_FROZEN: Final = 'tank_model = "frozen"'
_VISCOUS: Final = 'tank_model = "viscous"\nparameters = {{ damping_kg_per_s = {:g} }}'


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
    """

    name: str
    rig: str
    recordings: tuple[str, ...]
    twin: str
    left_out: str


CASES: Final = (
    TankCase(
        "shaker_frozen",
        "shaker/rig_fill_0.50.toml",
        tuple(f"shaker/fill_0.50_sweep_{level}g*.nc" for level in ("0.50", "1.50", "3.00", "5.00")),
        _FROZEN,
        "dissipation above a threshold, effective mass",
    ),
    TankCase(
        "shaker_viscous",
        "shaker/rig_fill_0.50.toml",
        tuple(f"shaker/fill_0.50_sweep_{level}g*.nc" for level in ("1.50", "2.00", "3.00", "6.00")),
        _VISCOUS.format(2.0),
        "dissipation that stops growing, effective mass",
    ),
    TankCase(
        "starts_viscous",
        "transients/rig_fill_0.50.toml",
        ("transients/fill_0.50_sudden_start_1[013].0hz_*.nc",),
        _VISCOUS.format(2.0),
        "break-up after some cycles",
    ),
    TankCase(
        "beam_frozen",
        "beam/rig_beam.toml",
        ("transients/beam_decay_*.nc", "beam/decay_sloshing_repeat_[12].nc"),
        _FROZEN,
        "dissipation above a threshold",
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
        rig = (recordings / case.rig).read_text()
        (complete / "rig.toml").write_text(rig.replace(_FROZEN, case.twin))
        (complete / "recordings").mkdir()
        for file in chosen:
            shutil.copyfile(file, complete / "recordings" / file.name)


if __name__ == "__main__":
    sys.stdout.write("\n".join(diagnose_tank(Path(sys.argv[1]), Path(sys.argv[2]))) + "\n")
