"""What maps of liquid and gas say of the source's facts, from points whose W̄ is given."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from studies.measured_facts.table import facts as measured_facts
from studies.two_phase_verification import box_facts, box_shaken, shaken
from studies.two_phase_verification.shaken import Shaking

GRAVITY, HEIGHT_M, VOLUME_M3 = 9.81, 0.0272, 0.1172 * 0.0272 * 0.078


def kept_with(cases: Any, w_bar: Any, beta: float = -0.2) -> dict[str, dict[str, float]]:
    return {case.name: {"w_bar": w_bar(case), "beta": beta} for case in cases}


def omega_bar(case: Shaking) -> float:
    return 2 * math.pi * case.frequency_hz * math.sqrt(HEIGHT_M / GRAVITY)


def test_windows_have_the_work_of_their_runs() -> None:
    cases = [Shaking(2.0, 11.4, 24, 12, filling_level=fill) for fill in (0.25, 0.5)]
    windows = box_facts.windows_of(kept_with(cases[:1], lambda case: 0.8), cases)
    assert windows.sizes == {"window": 1}
    assert windows.omega_bar.item() == pytest.approx(omega_bar(cases[0]))
    assert windows.amplitude_m.item() == pytest.approx(2.0 * GRAVITY / (2 * math.pi * 11.4) ** 2)
    speed = 2.0 * GRAVITY / (2 * math.pi * 11.4)
    assert windows.work_j.item() == pytest.approx(0.8 * 998.2 * 0.25 * VOLUME_M3 * speed**2, rel=1e-6)


def test_a_liquid_as_the_laboratory_has_it_meets_the_facts_of_its_map() -> None:
    """W̄ with one maximum of 1.65 at ω̄ = 3.78 and 4 g, and nothing below 1 g."""

    def w_bar(case: Shaking) -> float:
        away = math.log2(case.acceleration_g / 4.0) ** 2 + (2 * math.log2(omega_bar(case) / 3.78)) ** 2
        return 1.65 * math.exp(-0.2 * away) if case.acceleration_g >= 1.5 else 0.1 * case.acceleration_g

    map_cases = (*box_shaken.POINTS["campaign"], *box_shaken.POINTS["weakest"])
    fills = box_shaken.POINTS["fills"]

    def of_fill(case: Shaking) -> float:
        # the most work, W̄ times the mass, half filled but at 17 Hz
        half_is_largest = case.frequency_hz < 17.0
        return 1.0 if (case.filling_level == 0.5) == half_is_largest else 0.1

    kept = kept_with(map_cases, w_bar, -0.15) | kept_with(fills, of_fill)
    found = "\n".join(box_facts.lines({"such": box_facts.results_of(kept, map_cases, fills)}))
    facts = {fact.name: fact for fact in measured_facts(box_facts.results_of(kept, map_cases, fills))}
    of_a_map = ("quiet", "falls", "largest", "place", "effective_mass", "weakest")
    of_fills = [name for name in facts if name.startswith("work_")]
    assert all(facts[name].agrees for name in (*of_a_map, *of_fills))
    assert len(of_fills) == 6
    assert "| met |  | " in found


def test_the_plane_and_the_box_are_told_from_what_is_kept() -> None:
    columns = box_facts.columns()
    assert list(columns) == ["plane, h/16", "three dimensions, h/12"]
    plane, box = (results.at(0.5) for results in columns.values())
    assert plane.sizes["window"] == len(shaken.CAMPAIGN)
    at = np.flatnonzero((box.acceleration_g == 4.0) & (box.frequency_hz == 12.5))
    assert box.w_bar[at].item() == pytest.approx(1.40, abs=0.01)
