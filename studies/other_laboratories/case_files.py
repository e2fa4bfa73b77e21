"""A case as another laboratory would hand it over: a case folder, a twin beside it, and the truth beside both."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sloshlab.recording import write_recording

FloatArray = NDArray[np.float64]
_UNITS: Final = {"force": "N", "acceleration": "m s-2", "velocity": "m s-1", "displacement": "m", "voltage": "V"}


@dataclass(frozen=True, eq=False)
class Run:
    """One recording without the noise of its sensors.

    Attributes
    ----------
    name : str
    channels : mapping of str to ndarray, shape (n,)
        In SI units, upward positive.
    attributes : mapping
        Of the recording, beside those that every recording of the case has.
    """

    name: str
    channels: Mapping[str, FloatArray]
    attributes: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class RightAnswer:
    """One answer that is right.

    Attributes
    ----------
    verdict : str
        ``nothing_missing``, ``named``, ``indistinguishable``, ``unknown`` or ``refused``.
    effects : tuple of str
        All that have to be named, or among the alternatives; none for other verdicts.
    block : str
        In which an unknown effect has to be placed; empty where any place will do.
    says : str
        A word that a refusal, or a statement, has to contain.
    """

    verdict: str
    effects: tuple[str, ...] = ()
    block: str = ""
    says: str = ""


@dataclass(frozen=True, eq=False)
class LaboratoryCase:
    """A case and what is right to answer.

    Attributes
    ----------
    name : str
    story : str
        What this laboratory did, in one sentence.
    sampling_rate_hz : float
    runs : sequence of Run
    noise_std : mapping of str to float
        White noise per channel, stated in the recording; a channel that is absent is known exactly.
    right : sequence of RightAnswer
        Any of them will do.
    numbers : mapping of str to float
        True sizes of what is missing, with units in their names.
    twin : str
        Text of the module for ``--twin``; empty where there is a rig file.
    rig : str
        Text of ``rig.toml``; empty where there is a twin.
    seed : int
        Of the noise.
    """

    name: str
    story: str
    sampling_rate_hz: float
    runs: Sequence[Run]
    noise_std: Mapping[str, float]
    right: Sequence[RightAnswer]
    numbers: Mapping[str, float] = field(default_factory=dict)
    twin: str = ""
    rig: str = ""
    seed: int = 0


def write_case(case: LaboratoryCase, folder: Path) -> Path:
    """Write ``case/``, ``twin.py`` and ``truth.json`` below a folder of the case's name; return that folder.

    Parameters
    ----------
    case : LaboratoryCase
    folder : Path

    Notes
    -----
    Every channel of every run has its own noise, drawn in the order of runs and channels.
    """
    home = folder / case.name
    recordings = home / "case" / "recordings"
    recordings.mkdir(parents=True, exist_ok=True)
    if case.rig:
        (home / "case" / "rig.toml").write_text(case.rig, encoding="utf-8")
    if case.twin:
        (home / "twin.py").write_text(case.twin, encoding="utf-8")
    generator = np.random.default_rng(case.seed)
    for run in case.runs:
        write_recording(_recording(case, run, generator), recordings / f"{run.name}.nc")
    truth = {
        "case": case.name,
        "story": case.story,
        "right": [vars(answer) for answer in case.right],
        "numbers": dict(case.numbers),
    }
    (home / "truth.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")
    return home


def _recording(case: LaboratoryCase, run: Run, generator: np.random.Generator) -> xr.Dataset:
    variables = {}
    for name, values in run.channels.items():
        quantity = name.partition("_")[0]
        attributes: dict[str, Any] = {"units": _UNITS[quantity], "quantity": quantity}
        noise = case.noise_std.get(name, 0.0)
        if noise:
            attributes["noise_std"] = noise
        variables[name] = ("time", values + noise * generator.standard_normal(values.size), attributes)
    attributes = {
        "sloshlab_format": "1",
        "run_id": f"{case.name} {run.name}",
        "experiment": "other",
        "configuration": "frozen",
        "rig": "rig.toml" if case.rig else case.name,
        "sampling_rate_hz": case.sampling_rate_hz,
        "start_time_utc": "2026-01-01T00:00:00Z",
        **run.attributes,
    }
    n_samples = next(iter(run.channels.values())).size
    return xr.Dataset(variables, coords={"time": np.arange(n_samples) / case.sampling_rate_hz}, attrs=attributes)
