"""The whole diagnosis, search and decision, on decays that scipy made."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import MASS_KG, decays, rig

from sloshlab.diagnosis.findings import findings_of
from sloshlab.diagnosis.verdict import Verdict, verdict_of
from sloshlab.identification.case import Case, CaseRun

LEVELS_M = (0.006, 0.010, 0.018)


def verdict(folder: Path, runs: Sequence[CaseRun]) -> Verdict:
    return verdict_of(findings_of(Case("case", folder, rig(folder), tuple(runs))))


@pytest.mark.slow
def test_nothing_is_missing_where_nothing_is(tmp_path: Path) -> None:
    found = verdict(tmp_path, decays(LEVELS_M, seed=3))
    assert found.kind == "nothing_missing"
    assert found.probabilities["none"] > 0.9


def test_friction_is_named_with_its_size(tmp_path: Path) -> None:
    found = verdict(tmp_path, decays(LEVELS_M, seed=5, friction_n=(0.2, 0.2)))
    assert (found.kind, found.alternatives) == ("named", [("coulomb_friction",)])
    its = found.intervals["structure.coulomb_friction", "force_n"]
    assert its.estimate == pytest.approx(0.2, rel=0.02)
    assert its.low < 0.2 < its.high


@pytest.mark.slow
def test_a_damper_that_closes_with_the_displacement_has_no_name_and_is_placed(tmp_path: Path) -> None:
    # c x² v: dissipates, and is no function of the velocity alone.
    found = verdict(tmp_path, decays(LEVELS_M, seed=7, force=lambda t, x, v: -3e4 * x**2 * v))
    assert found.kind == "unknown"
    assert found.block in ("structure", "")
    assert np.isclose(sum(found.probabilities.values()), 1.0)


@pytest.mark.slow
def test_a_mass_and_a_spring_are_equals_and_a_known_mass_tells_them_apart(tmp_path: Path) -> None:
    # √(k/(1.2 m)) is √((1 − 0.2/1.2) k/m): one decay after the other is the same, until both have a known mass.
    # The frequency is off by 8.7 %; what is within four tolerances is a number of the baseline.
    found = verdict(tmp_path, decays(LEVELS_M, seed=9, mass_kg=1.2 * MASS_KG))
    assert found.kind == "indistinguishable"
    assert {("mass_error",), ("stiffness_change",)} <= set(found.alternatives)
    assert "known mass" in found.separating_experiment
