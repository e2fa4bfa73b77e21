"""ζ₁ of an ensemble: intervals that hold one network more, and values that are gathered by motion."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.structure import network_uncertainty as module
from pipelines.structure.network_uncertainty import of_decays, of_random
from pipelines.structure.results import BeamSettings
from pipelines.structure.uncertain_damping import NetworkUncertainty, UncertainDamping, uncertainty_table
from sloshlab.errors import AnalysisError
from sloshlab.modal.pooled_decays import DampingDeviation
from sloshlab.reduced_order_model.ensemble import PROBABILITIES, Ensemble, ResidualSpread
from sloshlab.reduced_order_model.ensemble_storage import save_ensemble
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis
from sloshlab.reduced_order_model.regressors import Delays


def test_half_width_is_students_for_one_network_more() -> None:
    """Five values 1 … 5: s = √2.5, t(0.95, 4) = 2.1318 (tables), √(1 + 1/5)."""
    damping = UncertainDamping("", 5.0, np.arange(1.0, 6.0))
    assert damping.mean == 3.0
    assert damping.half_width == pytest.approx(2.1318 * np.sqrt(2.5) * np.sqrt(1.2), rel=1e-4)
    assert damping.holds_measured
    assert not UncertainDamping("", 7.0, damping.members).holds_measured


def test_interval_holds_one_network_more_in_nine_of_ten_cases() -> None:
    draws = np.random.default_rng(3).normal(0.03, 0.002, (2000, 6))
    held = [UncertainDamping("", row[0], row[1:]).holds_measured for row in draws]
    assert np.mean(held) == pytest.approx(0.90, abs=0.02)


def test_one_member_has_no_interval() -> None:
    alone = UncertainDamping("decay at 2 g", 0.03, np.array([0.03]))
    assert np.isnan(alone.half_width)
    assert not alone.holds_measured
    assert uncertainty_table(NetworkUncertainty("e.nc", 1, (alone,))).rows[0][3:6] == ("–", "1", "–")


def deviation(model: list[float], known: list[bool]) -> DampingDeviation:
    amplitude = 9.81 * np.array([4.0, 2.0, 1.0])
    return DampingDeviation(amplitude, np.array([0.03, 0.02, 0.01]), np.array(model), np.array(known))


def test_decays_are_gathered_by_amplitude_where_releases_repeat() -> None:
    one = deviation([0.031, 0.021, 0.5], [True, True, False])
    two = deviation([0.033, 0.023, 0.5], [True, True, False])
    found = of_decays({"twin member_1: ROM": one, "twin member_2: ROM": two})
    assert [each.motion for each in found] == ["decay at 4.00 g", "decay at 2.00 g"]
    assert [each.measured for each in found] == [0.03, 0.02]
    assert found[0].members.tolist() == [0.031, 0.033]


def test_random_runs_are_gathered_by_what_drove_them() -> None:
    def run(name: str, damping: float | None, source: str = "") -> Any:
        fit = None if damping is None else SimpleNamespace(damping_ratio=damping)
        return SimpleNamespace(
            name=name, random=SimpleNamespace(density_fit=fit), is_simulated=bool(source), simulated_from=source,
            level_text="0.2 g RMS",
        )  # fmt: skip

    measured = run("random", 0.022)
    runs = (measured, run("a", 0.021, "random"), run("b", 0.025, "random"), run("c", None, "random"))
    experiment: Any = SimpleNamespace(random_runs=runs, measured_of=lambda simulated: measured)
    (found,) = of_random(experiment)
    assert found.motion == "random, 0.2 g RMS"
    assert (found.measured, found.members.tolist()) == (0.022, [0.021, 0.025])


def test_a_network_that_ran_away_is_named_in_the_table() -> None:
    damping = UncertainDamping("random, 0.2 g RMS", 0.022, np.array([0.021, 0.023]))
    table = uncertainty_table(NetworkUncertainty("e.nc", 3, (damping,), ("member_2 in random_0.2g",)))
    assert table.caption.endswith("Ran away and left out: member_2 in random_0.2g.")
    assert table.rows[0][4] == "2"


def test_one_member_that_runs_away_does_not_end_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[str] = []

    def simulated(runs: Any, rig: Any, folder: Any, tables: dict[str, str], *, with_known: bool) -> list[Path]:
        (name,) = tables
        if name == "member_2":
            raise AnalysisError("twin", got="the output of the model runs away")
        made.append(name)
        return []

    members = tuple(small_model(seed) for seed in (1, 2, 3))
    ensemble = Ensemble(members, ResidualSpread(0.1, 0.1, (1.0,) * len(PROBABILITIES)))
    save_ensemble(ensemble, tmp_path / "e.nc")
    run: Any = SimpleNamespace(configuration="sloshing")
    monkeypatch.setattr(module, "read_attributes", lambda path: run)
    monkeypatch.setattr(module, "twins_of_runs", simulated)
    monkeypatch.setattr(module, "analyse_beam", lambda *given: None)
    monkeypatch.setattr(module, "decay_comparisons", lambda experiment: {})
    monkeypatch.setattr(module, "of_random", lambda experiment: [])
    found = module.network_uncertainty(tmp_path / "e.nc", [Path("decay.nc")], Path("rig.toml"), BeamSettings())
    assert made == ["member_1", "member_3"]
    assert found.ran_away == ("member_2 in decay",)


def small_model(seed: int) -> ReducedOrderModel:
    theta = np.random.default_rng(seed).normal(size=6)
    return ReducedOrderModel(NormalisedRadialBasis(2, 2), theta, Delays.tapped(2), Scaling(), 128.0)
