"""What the network does not know, carried into ζ₁: every member of an ensemble in the tank of the structure.

Members are trained from their own starts on blocks of the runs drawn anew; what they disagree about is what the
recordings of the shaker do not tell. In the loop with the structure their differences become differences of ζ₁.
"""

from __future__ import annotations

import dataclasses
import itertools
import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from pipelines.report.numbers import text
from pipelines.structure.analysis import analyse_beam
from pipelines.structure.figures_twin import pairs_of
from pipelines.structure.results import BeamExperiment, BeamSettings, in_g
from pipelines.structure.twin_damping import decay_comparisons, fitted_damping
from pipelines.structure.twins import twins_of_runs
from pipelines.structure.uncertain_damping import NetworkUncertainty, UncertainDamping
from sloshlab.errors import AnalysisError
from sloshlab.modal.pooled_decays import DampingDeviation
from sloshlab.recording import read_attributes
from sloshlab.reduced_order_model.ensemble_storage import load_ensemble
from sloshlab.reduced_order_model.storage import save_model

_MEMBER: Final = "member_"


def network_uncertainty(
    ensemble: Path, runs: Sequence[Path], rig: Path, settings: BeamSettings
) -> NetworkUncertainty:
    """Simulate the sloshing recordings with every member, and read ζ₁ as of the recordings.

    Parameters
    ----------
    ensemble : Path
        Of `sloshlab train --ensemble`.
    runs : sequence of Path
        Recordings of the structure; frozen ones are passed over.
    rig : Path
    settings : BeamSettings

    Raises
    ------
    InputError
        If the file is no ensemble, or a member cannot stand in the tank.
    """
    found = load_ensemble(ensemble)
    sloshing = [run for run in runs if read_attributes(run).configuration == "sloshing"]
    with tempfile.TemporaryDirectory(prefix="sloshlab-members-") as place:
        folder, tables = Path(place), dict[str, str]()
        for number, member in enumerate(found.members, 1):
            name = f"{_MEMBER}{number}"
            # what the members share of their training is kept once, with the ensemble
            save_model(dataclasses.replace(member, facts={**found.facts, **member.facts}), folder / f"{name}.nc")
            tables[name] = f'tank_model = "rom"\nparameters = {{rom = {json.dumps(f"{name}.nc")}}}'
        made, ran_away = list[Path](), list[str]()
        for run, (name, table) in itertools.product(sloshing, tables.items()):
            try:
                made += twins_of_runs([run], rig, folder, {name: table}, with_known=False)
            # one network that means nothing in a motion is a finding about the ensemble, not the end of it
            except AnalysisError:
                ran_away.append(f"{name} in {run.stem}")
        experiment = analyse_beam([*made, *sloshing], rig, settings)
    dampings = (*of_decays(decay_comparisons(experiment)), *of_random(experiment))
    return NetworkUncertainty(ensemble.name, len(found.members), tuple(dampings), tuple(ran_away))


def of_decays(compared: Mapping[str, DampingDeviation]) -> list[UncertainDamping]:
    """At the amplitudes where the releases repeat well enough to say what a model should meet."""
    by_amplitude: dict[float, tuple[float, list[float]]] = {}
    for deviation in compared.values():
        for amplitude, measured, model, is_known in zip(
            deviation.amplitude_m_per_s2, deviation.measured, deviation.model, deviation.is_known, strict=True
        ):
            if is_known:
                by_amplitude.setdefault(float(amplitude), (float(measured), []))[1].append(float(model))
    return [
        UncertainDamping(f"decay at {text(float(in_g(np.array(amplitude))), 3)} g", measured, np.array(models))
        for amplitude, (measured, models) in sorted(by_amplitude.items(), reverse=True)
    ]


def of_random(experiment: BeamExperiment) -> list[UncertainDamping]:
    """ζ₁ of the members in every random run whose own ζ₁ is known."""
    found = []
    for measured, simulated in pairs_of(experiment, experiment.random_runs):
        known = fitted_damping(measured)
        members = [damping for run in simulated if (damping := fitted_damping(run)) is not None]
        if known is not None and members:
            found.append(UncertainDamping(f"random, {measured.level_text}", known, np.array(members)))
    return found
