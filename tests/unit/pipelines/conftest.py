"""Reports of sweeps, drawn once for all tests of these folders."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from synthetic_experiment import shaker_experiment, work_experiment

from pipelines.sweep.report import write_report
from pipelines.sweep.results import SweepExperiment

Drawn = tuple[SweepExperiment, Path]


@pytest.fixture(scope="session")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Drawn]:
    """Experiment and folder of a report by name; each is drawn when first asked for."""
    makers = {
        "two fills": lambda: shaker_experiment(
            extra=True, flags=("<b>look</b> at run 2",), run_prefix="<script>alert(1)</script> $x_{$"
        ),
        "one run": lambda: shaker_experiment((0.5,), (2.0,), surface_tension=None),
        "work": lambda: work_experiment(run_prefix="$x_{$ <i>level"),
    }
    done: dict[str, Drawn] = {}

    def get(name: str) -> Drawn:
        if name not in done:
            folder = tmp_path_factory.mktemp("report")
            experiment = makers[name]()
            write_report(experiment, folder)
            done[name] = experiment, folder
        return done[name]

    return get
