"""Reports of sweeps, drawn once for all tests of these folders."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import pytest
from quick_figures import figures_not_drawn, figures_not_laid_out
from synthetic_experiment import shaker_experiment, work_experiment

from pipelines.sweep.report import write_report
from pipelines.sweep.results import SweepExperiment

Drawn = tuple[SweepExperiment, Path]
_QUICKLY: dict[str, Callable[[], AbstractContextManager[None]]] = {
    # one is laid out as readers see it, and of another only the words are read
    "one run": contextlib.nullcontext,
    "hostile names": figures_not_drawn,
}


@pytest.fixture(scope="session")
def makers() -> dict[str, Callable[[], SweepExperiment]]:
    """What makes each experiment."""
    hostile: dict[str, Any] = {
        "extra": True, "flags": ("<b>look</b> at run 2",), "run_prefix": "<script>alert(1)</script> $x_{$"
    }  # fmt: skip
    return {
        "two fills": lambda: shaker_experiment(**hostile),
        "hostile names": lambda: shaker_experiment((0.5,), **hostile),
        "one run": lambda: shaker_experiment((0.5,), (2.0,), surface_tension=None),
        "work": lambda: work_experiment(run_prefix="$x_{$ <i>level"),
    }


@pytest.fixture(scope="session")
def drawn(
    makers: dict[str, Callable[[], SweepExperiment]], tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], Drawn]:
    """Experiment and folder of a report by name; each is drawn when first asked for."""
    done: dict[str, Drawn] = {}

    def get(name: str) -> Drawn:
        if name not in done:
            folder = tmp_path_factory.mktemp("report")
            experiment = makers[name]()
            with _QUICKLY.get(name, figures_not_laid_out)():
                write_report(experiment, folder)
            done[name] = experiment, folder
        return done[name]

    return get
