"""Twins of the recordings of a folder, with models of the liquid, for `make beam` and `make sdof`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from pipelines.progress import progress
from pipelines.simulate import SimulationSettings, simulate_run
from sloshlab import atomic_file
from sloshlab.recording import read_attributes

TWINS: Final[Mapping[str, Mapping[str, str]]] = {
    "beam_free": {
        "frozen": 'tank_model = "frozen"',
        "c1": 'tank_model = "viscous"\nparameters = {damping_kg_per_s = 3.40}',
        "c2": 'tank_model = "viscous"\nparameters = {damping_kg_per_s = 4.69}',
        "c3": 'tank_model = "viscous"\nparameters = {damping_kg_per_s = 4.40}',
    },
    "beam_random": {
        "frozen": 'tank_model = "frozen"',
        "c_rand": 'tank_model = "viscous"\nparameters = {damping_kg_per_s = 3.686}',
    },
    "sdof_free": {
        "frozen": 'tank_model = "frozen"',
        "ball": 'tank_model = "bouncing_ball"\nparameters = {radius_m = 0.0244, stiffness_n_per_m = 1103.0, '
        "damping_kg_per_s = 13.04, hardening_per_m = 74.04, beta = 0.0017}",
    },
}
"""Tables [twin] by experiment: the dampers of Appendix E, and the bouncing ball of Table 2.2."""

_TWIN_TABLES: Final = re.compile(r"^\[twin(\.[^\]]*)?\].*?(?=^\[(?!twin)|\Z)", re.MULTILINE | re.DOTALL)


def simulated_twins(folder: Path, rig: Path, output: Path) -> list[Path]:
    """Simulate every sloshing recording of a folder with the twins of its experiment.

    Parameters
    ----------
    folder : Path
        With the recordings.
    rig : Path
        Their rig.
    output : Path
        Folder for the rig files of the twins and the simulated recordings.

    Returns
    -------
    list of Path
        The simulated recordings.
    """
    text = rig.read_text(encoding="utf-8")
    planned = []
    for path in sorted(folder.glob("*.nc")):
        attributes = read_attributes(path)
        if attributes.configuration == "sloshing":
            planned += [(path, name, table) for name, table in TWINS.get(attributes.experiment, {}).items()]
    made = []
    with progress("twins", len(planned)) as advance:
        for path, name, table in planned:
            twin_rig = output / f"{name}.toml"
            atomic_file.write_bytes(twin_rig, with_twin(text, table).encode("utf-8"))
            made.append(output / f"{path.stem}_{name}.nc")
            simulate_run(SimulationSettings(rig=twin_rig, run=path, output=made[-1]))
            advance(made[-1].name)
    return made


def with_twin(rig_text: str, table: str) -> str:
    """The text of a rig with another table [twin].

    Examples
    --------
    >>> print(with_twin("[tank]\\na = 1\\n[twin]\\nb = 2\\n[twin.parameters]\\nc = 3\\n", "d = 4"))
    [tank]
    a = 1
    <BLANKLINE>
    [twin]
    d = 4
    <BLANKLINE>
    """
    return f"{_TWIN_TABLES.sub('', rig_text)}\n[twin]\n{table}\n"
