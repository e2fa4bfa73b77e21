"""Rivals that need no diagnosis: the commonest answer, and a classifier that sees everything but the signals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import xarray as xr

from sealed_trial.scoring.statistics import Rate, rate
from sloshlab.toml_file import read_toml

FloatArray = npt.NDArray[np.float64]

N_NEIGHBOURS: Final = 3


def commonest(classes: Sequence[str]) -> Rate:
    """How often the commonest class, said of every case, is right."""
    return rate(Counter(classes).most_common(1)[0][1], len(classes))


def metadata_features(case: Path) -> dict[str, float]:
    """Everything about a case that is not a sample: numbers of the rig, attributes, sizes of files, ranges."""
    features: dict[str, float] = {}
    if (case / "rig.toml").is_file():  # a twin of somebody's own has none
        _collect(read_toml(case / "rig.toml", f"rig {case / 'rig.toml'}"), "rig", features)
    recordings = sorted((case / "recordings").glob("*.nc"))
    features["n_recordings"] = len(recordings)
    for number, path in enumerate(recordings):
        features[f"{number} size"] = path.stat().st_size
        with xr.open_dataset(path, decode_times=False) as recording:
            features[f"{number} samples"] = recording.sizes["time"]
            _collect(dict(recording.attrs), f"{number}", features)
            for name, channel in recording.data_vars.items():
                _collect(dict(channel.attrs), f"{number} {name}", features)
    return features


def _collect(tree: Mapping[str, Any], place: str, features: dict[str, float]) -> None:
    for key, value in tree.items():
        name = f"{place} {key}"
        if isinstance(value, dict):
            _collect(value, name, features)
        elif isinstance(value, list | np.ndarray):
            _collect({str(k): item for k, item in enumerate(np.asarray(value).tolist())}, name, features)
        elif isinstance(value, bool | int | float | np.number):
            features[name] = float(value)
        else:
            features[f"{name} = {value}"] = 1.0


def metadata_classifier(cases: Sequence[Mapping[str, float]], classes: Sequence[str]) -> Rate:
    """How often the class is right by nearest neighbours in standardised metadata, each case left out once.

    Parameters
    ----------
    cases : sequence of mapping
        Features by name; a missing one is 0.
    classes : sequence of str

    Returns
    -------
    Rate
        Of no case where there are too few to have neighbours.
    """
    if len(cases) <= N_NEIGHBOURS:
        return rate(0, 0)
    names = sorted(set().union(*cases))
    table = np.array([[case.get(name, 0.0) for name in names] for case in cases])
    spread = table.std(axis=0)
    table = (table - table.mean(axis=0))[:, spread > 0] / spread[spread > 0]
    distance = np.linalg.norm(table[:, None] - table[None], axis=2)
    np.fill_diagonal(distance, np.inf)
    right = 0
    for row, truth in zip(distance, classes, strict=True):
        near = Counter(classes[k] for k in np.argsort(row, kind="stable")[:N_NEIGHBOURS])
        right += near.most_common(1)[0][0] == truth
    return rate(right, len(classes))
