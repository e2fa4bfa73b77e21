"""What retuning hides, on recordings that SciPy made, against what moving a number back saves by its prior."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import MASS_KG, STIFFNESS, decays, rig
from scipy.stats import t

from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.diagnosis.selection.hidden_effects import HiddenEffect, hidden_effects
from sloshlab.diagnosis.surroundings import surroundings_of
from sloshlab.identification.case import Case, CaseRun
from sloshlab.identification.free_run_fit import fitted_baseline
from sloshlab.identification.noise_floor import weighted_observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import candidates

assert effects.__all__
FORCE_N = 0.3
FREQUENCY = "frequency of mode 1"
MASS, SPRING = "structure.mass_error", "structure.stiffness_change"


def hidden(folder: Path, recorded: Sequence[CaseRun]) -> dict[str, HiddenEffect]:
    case = Case("case", folder, rig(folder), tuple(recorded))
    model = RigModel(rig(folder), folder, case.runs)
    runs = FittedRuns(model, list(weighted_observations(case, model).values()), case.names_by_test())
    retuned, _ = fitted_baseline(runs.problem())
    at = surroundings_of(runs.problem(), retuned, case.rig)
    pool = [candidate for candidate in candidates(at) if candidate.effect.block in ("structure", "tank")]
    return {each.candidate.key: each for each in hidden_effects(runs, retuned, pool)}


def test_what_a_frequency_has_taken(tmp_path: Path) -> None:
    # 5 % more mass: a frequency that is 1.2 tolerances lower
    deviation = (1 - 1 / np.sqrt(1.05)) / 0.02
    prior = t(8, scale=1 / np.sqrt(3))
    saved = prior.logpdf(0.0) - prior.logpdf(deviation)
    found = hidden(tmp_path, decays(mass_kg=1.05 * MASS_KG))
    # of a tank whose force is not recorded nothing tells what is fixed to it
    assert set(list(found)[:4]) == {MASS, SPRING, "tank.mass_error", "tank.effective_mass"}
    for key, size, expected in (
        (MASS, "mass_kg", 0.05 * MASS_KG),
        (SPRING, "stiffness_n_per_m", (1 / 1.05 - 1) * STIFFNESS),
    ):
        assert found[key].gain == pytest.approx(saved, rel=0.05)
        assert found[key].values[f"{key}.{size}"] == pytest.approx(expected, rel=0.1)
        assert found[key].values[FREQUENCY] == pytest.approx(1.0, abs=0.002)
    # a cube is no spring
    assert found["structure.cubic_stiffness"].gain < 0.5 * saved


def test_nothing_is_hidden_where_the_baseline_is_right(tmp_path: Path) -> None:
    assert max(each.gain for each in hidden(tmp_path, decays()).values()) < 0.3


def pulses(start_s: float) -> Callable[[float, float, float], float]:
    def force(t: float, x: float, v: float) -> float:
        within = (t - start_s) % 0.5
        inside = t >= start_s and within < 0.06
        return FORCE_N * 0.5 * (1 - np.cos(2 * np.pi * within / 0.06)) if inside else 0.0

    return force


@pytest.mark.slow
def test_what_the_scatter_of_repeats_has_taken(tmp_path: Path) -> None:
    """Pulses at other instants in each repeat make all of the noise, and are less than it."""
    starts = (0.21, 0.37, 0.44, 0.08)
    recorded = [
        replace(decays((0.01,), 4.0, seed=20 + i, force=pulses(start))[0], name=f"run_{i}")
        for i, start in enumerate(starts)
    ]
    found = hidden(tmp_path, recorded)
    [pulsed] = [each for key, each in found.items() if key == "structure.external_force"]
    assert pulsed is next(iter(found.values()))
    key = pulsed.candidate.key
    assert pulsed.values[f"{key}.size_n"] == pytest.approx(FORCE_N, rel=0.3)
    for i, start in enumerate(starts):
        off = (pulsed.values[f"{key}.start_s in run_{i}"] - start + 0.25) % 0.5 - 0.25
        assert abs(off) < 0.06
