"""Speed of flutter: forces of the doublet lattice, computed and kept, and root loci of a flying wing."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from sloshlab.aeroelastic.generalised_force_cache import cached_generalised_forces
from sloshlab.aeroelastic.generalised_forces import GeneralisedForces, usual_reduced_frequencies
from sloshlab.aeroelastic.rational_roger import roger_fit
from sloshlab.aeroelastic.root_locus import root_locus
from sloshlab.aircraft.flight_stability import LIQUIDS, flight_system
from sloshlab.aircraft.lifting_surfaces import lifting_surfaces
from sloshlab.aircraft.model import load_model

MODEL = Path(__file__).resolve().parents[2] / "raw_data" / "aircraft" / "maewing1" / "case_1.toml"
FORCES_LABEL = "flutter: forces of 450 boxes at 15 frequencies [s]"
KEPT_LABEL = "… read from the cache [s]"
LOCUS_LABEL = "flutter: root locus of 60 speeds, {} liquid [s]"


def flutter_figures() -> dict[str, float]:
    """Measure; nothing where PanelAero is not installed."""
    if find_spec("panelaero") is None:
        return {}
    model = load_model(MODEL)
    surfaces = lifting_surfaces(model.structure, 450)
    k = usual_reduced_frequencies(1.3, 15)

    def forces(folder: Path) -> GeneralisedForces:
        return cached_generalised_forces(
            folder, surfaces.boxes, surfaces.motion, k, semi_chord_m=surfaces.semi_chord_m, mach=0.0
        )[0]

    with tempfile.TemporaryDirectory() as name:
        figures = {
            FORCES_LABEL: _timed(lambda: forces(Path(name))),
            KEPT_LABEL: _timed(lambda: forces(Path(name))),
        }
        table = forces(Path(name))
    air = roger_fit(k, table.motion, semi_chord_m=surfaces.semi_chord_m)
    speeds = np.linspace(13.0, 45.0, 60)
    for liquids in LIQUIDS:
        system = flight_system(model, air, liquids, density_kg_per_m3=model.density_kg_per_m3)
        locus = partial(root_locus, system.matrix_at, speeds, system.names, rigid=system.rigid)
        figures[LOCUS_LABEL.format(liquids)] = _timed(locus)
    return figures


def _timed(work: Callable[[], object]) -> float:
    began = time.process_time()
    work()
    return time.process_time() - began
