"""The scripts of the gallery run as they stand, draw, and state what a closed form or the truth says."""

from __future__ import annotations

import re
import runpy
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import pyplot as plt

from sealed_trial.demonstrations import DOMAIN
from sealed_trial.sealing.sealed_case import key_of, opened_truth, read_published

Names = dict[str, Any]
GALLERY = Path(__file__).resolve().parents[2] / "docs" / "gallery"
SCRIPTS = sorted(GALLERY.glob("[0-9]*.py"))


@pytest.fixture
def run_script(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], Names]]:
    """Runs a script of the gallery, in its folder; its names."""
    monkeypatch.chdir(GALLERY)
    # a screen would be a warning that there is none
    monkeypatch.setattr(plt, "show", lambda: None)
    with plt.rc_context({"backend": "agg"}):
        yield lambda name: runpy.run_path(f"{name}.py")


def test_there_are_at_least_ten_with_a_title_and_a_text_each() -> None:
    assert len(SCRIPTS) >= 10
    for script in SCRIPTS:
        assert re.match(r"(?:\"\"\"|''')\n# .{10,60}\n\n.{40}", script.read_text(encoding="utf-8"), re.DOTALL), (
            script
        )


def test_every_script_has_a_test_of_its_own() -> None:
    own = Path(__file__).read_text(encoding="utf-8")
    assert [script.stem for script in SCRIPTS if f'run_script("{script.stem}")' not in own] == []


@pytest.mark.slow
def test_the_hidden_friction_is_named_and_its_size_is_in_the_interval(run_script: Callable[[str], Names]) -> None:
    names = run_script("01_hidden_friction")
    assert names["hidden"]["name"] == names["found"]["name"] == "coulomb_friction"
    assert names["number"]["low"] <= names["hidden"]["parameters"]["force_n"] <= names["number"]["high"]
    fit = names["verdict"].fit
    assert fit["heldout_after"] < 1.5 < 0.3 * fit["heldout_retuned"]


@pytest.mark.slow
def test_where_nothing_is_hidden_nothing_is_claimed(run_script: Callable[[str], Names]) -> None:
    verdict = run_script("02_nothing_hidden")["verdict"]
    assert verdict.kind == "nothing_missing"
    assert verdict.effects == []
    assert verdict.fit["heldout_after"] == pytest.approx(2.5, abs=0.1)
    assert verdict.fit["heldout_before"] == pytest.approx(3.4, abs=0.1)
    assert verdict.probabilities["none"] > 0.9
    case = GALLERY.parents[1] / "raw_data" / "cases" / "nothing-hidden"
    assert opened_truth(case, read_published(case), key_of(DOMAIN, "nothing-hidden", 1))["effects"] == []
    assert sum(verdict.probabilities.values()) == pytest.approx(1.0)


@pytest.mark.slow
def test_the_map_is_that_of_the_law(run_script: Callable[[str], Names]) -> None:
    names = run_script("03_sweep_to_map")
    assert names["map_error"] < 0.03
    # 1.65 at ω̄ = 3.78 is the largest W̄ of the law
    assert float(names["strongest"]["w_bar"]) == pytest.approx(1.65, rel=0.06)
    assert float(names["strongest"]["omega_bar"]) == pytest.approx(3.78, rel=0.1)


@pytest.mark.slow
def test_beta_is_that_of_a_mass_on_a_spring_and_changes_its_sign_there(run_script: Callable[[str], Names]) -> None:
    """The apparent mass m k/(k − mω²) with the damper c in parallel, in other letters than the script has it."""
    names = run_script("04_beta_and_its_sign")
    frequency = names["windows"]["frequency_hz"].values
    s, natural = 2j * np.pi * frequency, 2 * np.pi * 9.0
    pull = natural**2 + 2 * 0.10 * natural * s
    beta = (pull / (s**2 + pull)).real - 1
    # the sweep is slow, but not infinitely slow, where β turns from +2 to −3 within a hertz
    np.testing.assert_allclose(names["windows"]["beta"], beta, atol=0.005)
    assert ((beta > 0) == (frequency < 9.0)).all()
    means = names["means"]
    assert means["fill_0.50_sweep_6.00g", 10] > 0.05
    assert means["fill_0.50_sweep_6.00g", 16] < -0.2
    assert means["fill_0.50_sweep_3.00g", 10] < -0.1


@pytest.mark.slow
def test_three_readings_of_the_decay_of_a_linear_beam_agree(run_script: Callable[[str], Names]) -> None:
    names = run_script("05_damping_three_ways")
    readings = names["frozen"]
    assert len(readings) == 3
    # the rig file believes 0.32 %, and believes damping to be known within 20 %
    np.testing.assert_allclose(list(readings.values()), 0.32, rtol=0.2)
    assert np.ptp(list(readings.values())) < 0.03 * np.mean(list(readings.values()))


def test_the_ball_holds_where_it_was_tuned(run_script: Callable[[str], Names]) -> None:
    names = run_script("06_bouncing_ball")
    assert names["area"] == pytest.approx(names["work"], rel=1e-3)
    assert names["errors"][4.0] < 0.15
    assert min(names["errors"][2.5], names["errors"][5.5]) > 0.3


@pytest.mark.slow
def test_the_network_stays_below_its_ceiling_and_beats_a_repeat(run_script: Callable[[str], Names]) -> None:
    fits = run_script("07_network_and_its_ceiling")["fits"]
    assert fits["a repeat in its place"] < fits["this model"] < fits["the ceiling"] < 100.0
    # the error of the ceiling is 1/√2 of that of a repeat
    assert 100 - fits["the ceiling"] == pytest.approx((100 - fits["a repeat in its place"]) / np.sqrt(2), rel=0.01)


def test_the_twin_swings_with_the_frequency_of_its_springs_and_lacks_the_liquid(
    run_script: Callable[[str], Names],
) -> None:
    names = run_script("08_twin_against_recording")
    mass_kg = 2.061 + 1000.0 * 0.5 * 0.060 * 0.100 * 0.060
    assert names["found_hz"] == pytest.approx((3808.8 / mass_kg) ** 0.5 / (2 * np.pi), rel=5e-4)
    assert names["shares"]["sloshing"] < 0.2
    assert names["shares"]["frozen"] == pytest.approx(1.0, abs=0.4)


def test_fewer_runs_decide_less(run_script: Callable[[str], Names], capsys: Any) -> None:
    names = run_script("09_what_runs_can_decide")
    possible = [set(names["checked"][n_runs]["possible"]) for n_runs in (4, 2, 1)]
    assert possible[0] >= possible[1] > possible[2]
    # a run that nothing is fitted to, and a repeat, need more than one
    assert any("missing" in question for question in possible[1] - possible[2])
    assert any("once more" in line for line in names["checked"][1]["lacking"])
    assert "/" not in capsys.readouterr().out.partition("\n")[0]


@pytest.mark.slow
def test_the_hardening_of_an_own_twin_is_found(run_script: Callable[[str], Names]) -> None:
    verdict = run_script("10_own_twin")["verdict"]
    assert verdict.kind == "named"
    [effect] = verdict.effects
    assert effect["name"] == "cubic_stiffness"
    assert effect["parameters"]["stiffness_n_per_m3"]["estimate"] == pytest.approx(4.0e6, rel=0.02)


@pytest.mark.slow
def test_what_was_played_is_what_was_recorded(run_script: Callable[[str], Names]) -> None:
    names = run_script("11_live_recording")
    assert names["exit_codes"] == {"good": 0, "bad": 3}
    assert names["recordings"]["good"].sizes["time"] == names["original"].sizes["time"]
    assert not (names["recordings"]["good"]["quality"].values & 1).any()
    assert 100 < names["lost"].sum() < 3000
    for name in ("force_cell_1", "force_cell_2", "acceleration_roof_1"):
        played = names["original"][name].values
        np.testing.assert_array_equal(names["recordings"]["good"][name].values, played)
        kept = ~names["lost"]
        np.testing.assert_array_equal(names["recordings"]["bad"][name].values[kept], played[kept])


def test_the_work_of_a_damper_is_that_of_the_closed_form(run_script: Callable[[str], Names]) -> None:
    """W = πcΩu₀² with u₀ = a₀/Ω², so that W = πc a₀²/Ω³."""
    windows = run_script("12_any_structure")["windows"]
    omega = 2 * np.pi * windows["frequency_hz"]
    np.testing.assert_allclose(windows["work_j"], np.pi * 900.0 * (0.2 * 9.81) ** 2 / omega**3, rtol=2e-3)


@pytest.mark.slow
@pytest.mark.skipif(find_spec("panelaero") is None, reason="PanelAero is not installed: extra aircraft")
def test_a_tank_under_a_flying_wing_changes_its_flutter(run_script: Callable[[str], Names]) -> None:
    """An independent script found 32.02 m/s, 31.60 m/s and +0.9 % in frequency."""
    names = run_script("13_tank_under_a_flying_wing")
    assert names["flutter"]["frozen"].speed_m_per_s == pytest.approx(32.02, rel=0.025)
    assert names["speed"] == pytest.approx(31.60 / 32.02 - 1, abs=0.002)
    assert names["frequency"] == pytest.approx(0.009, abs=0.002)


@pytest.mark.slow
def test_a_model_of_the_shaker_holds_an_aircraft_in_a_limit_cycle(run_script: Callable[[str], Names]) -> None:
    """Frozen it grows as the root says; free it decays, swings on, or grows faster than the liquid can take."""
    names = run_script("14_from_shaker_to_flutter")
    assert names["factors"].time == pytest.approx((0.13 / 0.0272) ** 0.5)
    # 1.3689 kg against 0.12432 kg
    assert names["factors"].force == pytest.approx(0.18 * 0.18 * 0.065 * 650 / (0.1172 * 0.0136 * 0.078 * 1000))

    def peak_g(response: Any, start_s: float, end_s: float) -> float:
        within = (response.time_s > start_s) & (response.time_s < end_s)
        return float(np.abs(response.tank_acceleration_m_per_s2[within, 0]).max()) / 9.81

    system, speed = names["system"], 1.01 * names["flutter"].speed_m_per_s
    growth = np.linalg.eigvals(system.matrix_at(speed)).real.max()
    frozen = names["frozen"]
    assert np.log(peak_g(frozen, 18, 20) / peak_g(frozen, 13, 15)) == pytest.approx(5 * growth, rel=0.05)
    near, cycle, far = names["free"].values()
    assert peak_g(near, 18, 20) < 0.1 * peak_g(near, 2, 4)
    assert peak_g(cycle, 17, 20) == pytest.approx(peak_g(cycle, 14, 17), rel=0.01)
    assert 0.8 < peak_g(cycle, 17, 20) < 2
    assert "diverges" in far.ending
