"""Recordings of the tank on the beam whose root moves at random: force by force, and in closed loop."""

from __future__ import annotations

import itertools
import json
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pipelines.report.progress import progress
from pipelines.structure.analysis import analyse_beam
from pipelines.structure.figures_twin import pairs_of
from pipelines.structure.results import BeamExperiment, BeamRun, BeamSettings
from pipelines.structure.twin_damping import fitted_damping
from pipelines.structure.twins import twins_of_runs
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import AnalysisError
from sloshlab.reduced_order_model.amplitude_weights import local_amplitude
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.storage import save_model
from sloshlab.reduced_order_model.tank_scaling import tank_facts
from sloshlab.reduced_order_model.validity_domain import ValidityDomain, motion_cycles
from studies.beyond_the_source.recordings import Recordings, part
from studies.small_motion.campaign import MODEL_RATE_HZ
from studies.small_motion.errors import Judged, Measured
from studies.small_motion.networks import N_DELAYS, SEEDS, Candidate, Predictor, trained

FloatArray = NDArray[np.float64]

LEVELS_G: Final = (0.1, 0.2, 0.4)
TRAINED_ON_G: Final = 0.2
"""Level whose first 60 s train the candidates with a random run, and whose last 30 s validate them."""
SOURCE: Final = Candidate("slow run, as the source")
GALILEAN: Final = Candidate("slow run, Galilean", galilean=True)
WITH_RANDOM: Final = Candidate("slow and random runs")
BOTH: Final = Candidate("Galilean, slow and random runs", galilean=True)
WEIGHTED: Final = Candidate("slow run, weighted", is_weighted=True)
ALL: Final = Candidate("Galilean, slow and random runs, weighted", galilean=True, is_weighted=True)
SCALED: Final = Candidate("slow and random runs, scaled by their amplitude", is_scaled=True)
IN_TWIN: Final = (SOURCE, WEIGHTED, GALILEAN, WITH_RANDOM, BOTH, ALL)
"""Models that a twin can carry."""
CANDIDATES: Final = (*IN_TWIN, SCALED)
ACCELERATION_CLASSES_G: Final = ((0.0, 0.5), (0.5, 1.0), (1.0, 2.0), (2.0, 9.0))


@dataclass(frozen=True)
class RecordedWorkshop:
    """Networks of the recordings, as `networks.Workshop` has those of computed runs.

    Attributes
    ----------
    folder : Path
        Where networks are kept.
    raw : Path
        raw_data/numerical_tank.
    """

    folder: Path
    raw: Path

    @cached_property
    def recordings(self) -> Recordings:
        """The recordings at the rate of the models."""
        return Recordings(self.raw, MODEL_RATE_HZ)

    @cached_property
    def random_runs(self) -> dict[float, LiquidSignals]:
        """Runs on the beam by level."""
        return {level_g: self.recordings.beam_random(level_g) for level_g in LEVELS_G}

    def training(self, candidate: Candidate) -> tuple[list[LiquidSignals], list[LiquidSignals]]:
        """Runs that train and validate a candidate."""
        training, validation = [self.recordings.vfa(480)], [self.recordings.vfa(240)]
        if candidate in (WITH_RANDOM, BOTH, ALL, SCALED):
            random = self.random_runs[TRAINED_ON_G]
            training, validation = [*training, part(random, 0.0, 60.0)], [*validation, part(random, 60.0, 90.0)]
        return training, validation

    def predictor(self, candidate: Candidate, seed: int) -> Predictor:
        """Return the network of a candidate, trained if it is not there."""
        training, validation = self.training(candidate)
        name = candidate.name.replace(",", "").replace(" ", "_")
        path = self.folder / f"recorded_{name}_{seed}.nc"
        return trained(candidate, training, validation, path, seed)

    def judged(self, candidate: Candidate) -> list[Judged]:
        """The unseen random runs with the networks of a candidate."""
        networks = [self.predictor(candidate, seed) for seed in SEEDS]
        return [Judged.of([run], networks) for level_g, run in self.random_runs.items() if level_g != TRAINED_ON_G]


def closed_loop(workshop: RecordedWorkshop, candidates: Sequence[Candidate]) -> dict[str, Any]:
    """ζ₁ and error of the tank's acceleration with each network in the tank of the beam (Table 2.5, Fig. 2.40).

    Parameters
    ----------
    workshop : RecordedWorkshop
    candidates : sequence of Candidate
    """
    beam = workshop.raw / "beam"
    rig, runs = beam / "rig_beam.toml", [beam / f"random_{level_g:.1f}g.nc" for level_g in LEVELS_G]
    ran_away = list[str]()
    with tempfile.TemporaryDirectory(prefix="sloshlab-small-motion-") as place:
        folder = Path(place)
        tables = {"frozen": 'tank_model = "frozen"'} | _saved(workshop, candidates, folder)
        made = list[Path]()
        with progress("twins", len(runs) * len(tables)) as done:
            for run, (name, table) in itertools.product(runs, tables.items()):
                try:
                    made += twins_of_runs([run], rig, folder, {name: table}, with_known=False)
                except AnalysisError:
                    ran_away.append(f"{name} in {run.stem}")
                done(f"{run.stem}, {name}")
        experiment = analyse_beam([*made, *runs], rig, BeamSettings())
        names = {_short(candidates.index(each)): each.name for each in candidates} | {"frozen": "frozen"}
        return {"damping": _damping(experiment, names), "acceleration": _accelerations(experiment, names),
                "ran away": ran_away}  # fmt: skip


def _short(number: int) -> str:
    return f"candidate_{number}"


def _saved(workshop: RecordedWorkshop, candidates: Sequence[Candidate], folder: Path) -> dict[str, str]:
    """Networks with what a twin asks of them, and their tables [twin]."""
    tables = {}
    for (number, candidate), seed in itertools.product(enumerate(candidates), SEEDS):
        network = workshop.predictor(candidate, seed)
        assert isinstance(network, ReducedOrderModel)
        training, _ = workshop.training(candidate)
        domain = ValidityDomain.of([motion_cycles(each.velocity_m_per_s, MODEL_RATE_HZ) for each in training])
        facts = {**network.facts, **tank_facts(workshop.recordings.shaker_rig), "domain": domain.facts()}
        name = f"{_short(number)}_start_{seed}"
        save_model(replace(network, facts=facts), folder / f"{name}.nc")
        tables[name] = f'tank_model = "rom"\nparameters = {{rom = {json.dumps(f"{name}.nc")}}}'
    return tables


def _damping(experiment: BeamExperiment, names: Mapping[str, str]) -> dict[str, dict[str, list[float]]]:
    """ζ₁ in per cent by level: measured, and of every start of every candidate."""
    found: dict[str, dict[str, list[float]]] = {}
    for measured, simulated in pairs_of(experiment, experiment.random_runs):
        at_level: dict[str, list[float]] = {"measured": [_percent(fitted_damping(measured))]}
        for run in simulated:
            at_level.setdefault(_name(run, names), []).append(_percent(fitted_damping(run)))
        found[measured.name] = at_level
    return found


def _name(run: BeamRun, names: Mapping[str, str]) -> str:
    """Candidate of a simulated run."""
    return names[run.group.removeprefix("twin ").partition("_start")[0]]


def _percent(damping_ratio: float | None) -> float:
    return float("nan") if damping_ratio is None else round(100 * damping_ratio, 4)


def _accelerations(experiment: BeamExperiment, names: Mapping[str, str]) -> dict[str, dict[str, dict[str, Any]]]:
    """RMS error of the tank's acceleration over that of the recording, by local amplitude of the recording."""
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for measured, simulated in pairs_of(experiment, experiment.random_runs):
        own = measured.tank_acceleration / GRAVITY_M_PER_S2
        n_past = round(N_DELAYS / MODEL_RATE_HZ / float(np.median(np.diff(measured.time_s))))
        amplitude = local_amplitude(own, n_past)
        of_run: dict[str, dict[str, Any]] = {}
        for low, high in ACCELERATION_CLASSES_G:
            chosen = (amplitude >= low) & (amplitude < high)
            if chosen.sum() < 2 * n_past:
                continue
            by_name: dict[str, list[float]] = {}
            for run in simulated:
                n = min(own.size, run.tank_acceleration.size)
                use = chosen[:n]
                other = run.tank_acceleration[:n] / GRAVITY_M_PER_S2
                squared = np.mean((other - own[:n])[use] ** 2) / np.mean(own[:n][use] ** 2)
                by_name.setdefault(_name(run, names), []).append(round(float(squared**0.5), 4))
            of_run[f"{low:g}–{high:g}"] = by_name
        found[measured.name] = of_run
    return found


def mean_of(values: Sequence[float]) -> Measured:
    """Mean and its standard error over starts."""
    known = np.array([value for value in values if np.isfinite(value)])
    if not known.size:
        return Measured(float("nan"), float("nan"))
    error = known.std(ddof=1) / known.size**0.5 if known.size > 1 else float("nan")
    return Measured(float(known.mean()), float(error))
