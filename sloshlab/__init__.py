"""Physics and mathematics of shaken, partly filled tanks, and the names that a Python program uses.

``import sloshlab as sl`` offers what `__all__` lists. Each name is imported when it is first asked for, so that
``import sloshlab`` alone loads none of the numerical stack. What has its place above this package, in
``pipelines``, is named here and imported by nothing in here. Types stand in ``__init__.pyi``.
"""

from __future__ import annotations

import importlib as _importlib
from typing import Any as _Any

from sloshlab._version import __version__
from sloshlab.compiled_cache import keep_compiled_loops as _keep_compiled_loops

_keep_compiled_loops()

_PLACES = {
    "BeamAnalysis": "pipelines.interface.beam",
    "CaseVerdict": "pipelines.interface.diagnosis",
    "InputError": "sloshlab.errors",
    "LiquidModel": "pipelines.interface.training",
    "Rig": "sloshlab.rig",
    "SloshlabError": "sloshlab.errors",
    "SweepAnalysis": "pipelines.interface.sweep",
    "TwinSimulation": "pipelines.interface.simulation",
    "analyse_beam": "pipelines.interface.beam",
    "analyse_sweep": "pipelines.interface.sweep",
    "diagnose": "pipelines.interface.diagnosis",
    "open_campaign": "pipelines.interface.recordings",
    "open_recording": "pipelines.interface.recordings",
    "simulate": "pipelines.interface.simulation",
    "train": "pipelines.interface.training",
    "virtual_run": "pipelines.interface.virtual",
    "write_recording": "sloshlab.recording",
}
"""Modules of the names that a program uses."""

__all__ = ["__version__", *_PLACES]


def __getattr__(name: str) -> _Any:
    if name not in _PLACES:
        raise AttributeError(f"module 'sloshlab' has no attribute {name!r}")
    found = getattr(_importlib.import_module(_PLACES[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
