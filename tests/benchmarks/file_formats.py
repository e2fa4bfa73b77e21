"""Speed of reading every format: `python -m tests.benchmarks.file_formats` prints JSON.

The files are those of the tests of the importer (`tests/unit/acquisition/files/import_scenarios.py`), made longer:
two channels, and times where the format keeps them. Counted are bytes of decoded float64, so that a compressed
or a wordy file is not called fast or slow for its size. The limit is `numpy.fromfile` of the same numbers; the
peer is the library that somebody would call instead, up to arrays of the same two channels, without the process of
its own and without the checks that a file of a stranger gets here. All three are taken in turn.
"""

from __future__ import annotations

import json
import sys
import tempfile
import tomllib
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from tests.benchmarks.measurements import best_in_turn

N_SAMPLES: Final = {"can asc": 50_000, "can blf": 50_000, "can trc": 50_000}
"""Frames of a bus are Python objects; of the others:"""
N_SAMPLES_OF_OTHERS: Final = 500_000
SPEED_LABEL: Final = "reading {} [MB/s]"
LIMIT_LABEL: Final = "… {} over numpy.fromfile"
PEER_LABEL: Final = "… {} by the library alone, over ours"


def _peers() -> dict[str, Callable[[Path], object]]:
    import can
    import h5py
    import lvm_read
    import netCDF4
    import pandas
    import pyuff
    import scipy.io
    from asammdf import MDF
    from nptdms import TdmsFile

    def frames(path: Path) -> list[bytes]:
        return [bytes(frame.data) for frame in can.LogReader(path)]

    def sheets(**options: Any) -> Callable[[Path], object]:
        return lambda path: pandas.read_csv(path, **options)

    def measured(path: Path) -> list[object]:
        with MDF(path) as source:
            return [source.get(name).samples for name in ("F", "a")]

    def networked(path: Path) -> list[object]:
        with netCDF4.Dataset(path) as source:
            return [source[name][:] for name in ("t", "F", "a")]

    def of_hdf5(path: Path) -> list[object]:
        with h5py.File(path) as source:
            return [source["Force"][:], source["data/Acceleration"][:]]

    def waves(path: Path) -> list[object]:
        with TdmsFile.open(path) as source:
            return [source["rig"][name][:] for name in ("F", "a")]

    return {
        "csv": sheets(),
        "csv with decimal commas": sheets(sep=";", decimal=",", skiprows=[0, 2]),
        "text with rounded times": sheets(sep=" ", skiprows=1, header=None),
        "mat v5": scipy.io.loadmat,
        "mat v5 structure": scipy.io.loadmat,
        "mat v7.3": of_hdf5,
        "uff": lambda path: pyuff.UFF(str(path)).read_sets(),
        "uff binary": lambda path: pyuff.UFF(str(path)).read_sets(),
        "tdms": waves,
        "tdms counts": waves,
        "lvm": lambda path: lvm_read.read(str(path), read_from_pickle=False),
        "mf4": measured,
        "can asc": frames,
        "can blf": frames,
        "can trc": frames,
        "netcdf": networked,
    }


def format_figures() -> dict[str, float]:
    """Every scenario of the importer's tests: MB/s, over the limit, and the peer."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit" / "acquisition" / "files"))
    import import_scenarios

    from acquisition.files.channel_map import SourceSection
    from acquisition.files.formats import read_table

    figures: dict[str, float] = {}
    peers = _peers()
    for scenario in import_scenarios.SCENARIOS:
        n = N_SAMPLES.get(scenario.name, N_SAMPLES_OF_OTHERS)
        _lengthen(import_scenarios, n)
        with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            path, _ = scenario.write(Path(name))
            settings = SourceSection.model_validate(_settings(scenario.source, Path(name)))
            table = read_table(path, settings)
            columns = [column.values for column in table.columns if column.values.size >= n]
            assert len(columns) >= 2, scenario.name
            plain = Path(name, "plain.f8")
            np.concatenate(columns).tofile(plain)
            size_mb = plain.stat().st_size / 1e6
            best = best_in_turn(
                {
                    "ours": lambda p=path, s=settings: read_table(p, s),  # type: ignore[misc]
                    "limit": lambda p=plain: np.fromfile(p),  # type: ignore[misc]
                    "peer": lambda p=path, read=peers[scenario.name]: read(p),  # type: ignore[misc]
                },
                3,
            )
        figures[SPEED_LABEL.format(scenario.name)] = size_mb / best["ours"]
        figures[LIMIT_LABEL.format(scenario.name)] = best["limit"] / best["ours"]
        figures[PEER_LABEL.format(scenario.name)] = best["peer"] / best["ours"]
        print(f"{scenario.name} …", file=sys.stderr, flush=True)
    return figures


def _lengthen(scenarios: Any, n: int) -> None:
    """Make the signals of the scenarios n samples long; the files are written from them."""
    counts = (np.arange(n) * 37) % 101 - 50
    scenarios.N_SAMPLES, scenarios.COUNTS = n, counts
    scenarios.FORCE_KN, scenarios.ACCELERATION = counts * 0.25, counts[::-1] * 0.5
    scenarios.TIME_S = np.arange(n) / scenarios.RATE_HZ
    # its declared number of samples is a default, made when the module was read
    scenarios.lvm_text.__kwdefaults__["declared"] = n


def _settings(source: str, folder: Path) -> dict[str, Any]:
    settings = tomllib.loads(source)
    if "database" in settings:
        settings["database"] = str(folder / settings["database"])
    return settings


if __name__ == "__main__":
    print(json.dumps(format_figures(), indent=1, ensure_ascii=False))
