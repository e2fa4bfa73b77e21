"""Twins of the recordings of a beam or a guided tank, with models of the liquid."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from pipelines.report.progress import progress
from pipelines.twin.simulate import simulate_run
from pipelines.twin.simulation_settings import SimulationSettings
from sloshlab import atomic_file
from sloshlab.errors import InputError, RigError
from sloshlab.recording import read_attributes
from sloshlab.reduced_order_model.storage import LARGEST_BYTES, load_model
from sloshlab.toml_file import read_toml, read_toml_text

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


def twins_of_runs(
    runs: Sequence[Path], rig: Path, output: Path, more: Mapping[str, str], *, with_known: bool = True
) -> list[Path]:
    """Simulate sloshing recordings with the twins of their experiment, and with more.

    Parameters
    ----------
    runs : sequence of Path
        Recordings; frozen and simulated ones are passed over.
    rig : Path
        Their rig.
    output : Path
        Folder for the rig files of the twins and the simulated recordings.
    more : mapping of str to str
        Tables [twin] by name, beside or instead of those of `TWINS`.
    with_known : bool
        Whether those of `TWINS` are simulated, too.

    Returns
    -------
    list of Path
        The simulated recordings.
    """
    text = read_toml_text(rig, f"rig {rig}", error=RigError)
    planned = []
    for path in runs:
        attributes = read_attributes(path)
        known = TWINS.get(attributes.experiment)
        is_measured = not (attributes.model_extra or {}).get("simulated_from")
        if attributes.configuration == "sloshing" and known is not None and is_measured:
            planned += [(path, name, table) for name, table in {**(known if with_known else {}), **more}.items()]
    made = []
    with progress("twins", len(planned)) as advance:
        for path, name, table in planned:
            twin_rig = output / f"{name}.toml"
            atomic_file.write_bytes(twin_rig, with_twin(text, table).encode("utf-8"))
            made.append(output / f"{path.stem}_{name}.nc")
            simulate_run(SimulationSettings(rig=twin_rig, run=path, output=made[-1]))
            advance(made[-1].name)
    return made


def tank_models(roms: Sequence[Path], balls: Sequence[Path], output: Path) -> dict[str, str]:
    """Tables [twin] of trained models and identified balls, by the names of their files.

    Parameters
    ----------
    roms : sequence of Path
        Models of `sloshlab train`; they are copied to `output`, where the rigs of the twins look for them.
    balls : sequence of Path
        Files `ball.toml` of `sloshlab ball`.
    output : Path
        Made if it is not there.

    Raises
    ------
    InputError
        If a file is no such model or table, or two have one name.
    """
    tables: dict[str, str] = {}
    for path in (*roms, *balls):
        if path.stem in tables:
            got = "a name that another model or ball has"
            raise InputError(f"twin {path}", got=got, allowed="one name each", remedy="rename it")
        tables[path.stem] = _rom_table(path, output) if path in roms else _ball_table(path)
    return tables


def _rom_table(path: Path, output: Path) -> str:
    load_model(path)  # says in one line what is wrong with it
    with path.open("rb") as file:
        content = file.read(LARGEST_BYTES)
    output.mkdir(parents=True, exist_ok=True)
    atomic_file.write_bytes(output / path.name, content)
    return f'tank_model = "rom"\nparameters = {{rom = {json.dumps(path.name)}}}'


def _ball_table(path: Path) -> str:
    document: Any = read_toml(path, f"ball {path}")
    try:
        table = document["twin"]
        if table["tank_model"] != "bouncing_ball":
            raise ValueError(repr(table["tank_model"]))
        numbers = ", ".join(f"{name} = {float(value)!r}" for name, value in table["parameters"].items())
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"ball {path}", got=f"no table of a ball ({error})"[:120], allowed="a ball.toml of `sloshlab ball`"
        ) from error
    return f'tank_model = "bouncing_ball"\nparameters = {{{numbers}}}'


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
