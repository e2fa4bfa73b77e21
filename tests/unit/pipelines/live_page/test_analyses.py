"""What the page computes of the last seconds: against closed forms."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.recorder.journal_format import described_source
from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block
from acquisition.sources.interface import SourceInfo
from pipelines.live_page.analyses import Analyst, since_the_last_loss
from pipelines.live_page.last_cycles import roles_of
from pipelines.live_page.page_state import PageState
from pipelines.live_page.spectra import spectrum, thinned

RATE_HZ = 2000.0
FREQUENCY_HZ = 7.3
LEVEL_M_PER_S2 = 12.0
DASHPOT_KG_PER_S = 3.1
DRY_KG, LIQUID_KG = 0.6, 1000.0 * 0.5 * 0.03 * 0.1 * 0.1
RIG = """
[tank]
height_m = 0.03
length_m = 0.1
width_m = 0.1
dry_mass_kg = 0.6
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
"""
FORCES = (
    Channel("force_cell_1", "force", "kN", 24, 1e-6),
    Channel("force_cell_2", "force", "N", 24, 1e-4),
)
ROOF = Channel("acceleration_roof_1", "acceleration", "gravity", 24, 1e-6)


def dashpot_counts(n_samples: int) -> np.ndarray:
    """A tank whose liquid is a frozen mass and a dashpot: F = (M_dry + m_l) ü + c u̇, static weight beside."""
    phase = 2 * np.pi * FREQUENCY_HZ * np.arange(n_samples) / RATE_HZ
    acceleration = LEVEL_M_PER_S2 * np.cos(phase)
    velocity = LEVEL_M_PER_S2 / (2 * np.pi * FREQUENCY_HZ) * np.sin(phase)
    force = (DRY_KG + LIQUID_KG) * acceleration + DASHPOT_KG_PER_S * velocity
    columns = [0.3 * force / 1e3 / 1e-6, (0.7 * force + 4.0) / 1e-4, acceleration / 9.80665 / 1e-6]
    return np.round(np.column_stack(columns)).astype(np.int32)


def state_of(channels: tuple[Channel, ...], counts: np.ndarray, folder: Path, **attributes: str) -> PageState:
    (folder / "rig.toml").write_text(RIG, encoding="utf-8")
    info = SourceInfo("daq", "fake:daq", RATE_HZ, channels, (tuple(range(len(channels))),))
    state = PageState()
    begin: dict[str, Any] = {
        "about": "begin", "sources": [described_source(info)], "attributes": attributes,
        "folder": str(folder), "rig": str(folder / "rig.toml"),
    }  # fmt: skip
    state.take(json.loads(json.dumps(begin)))
    for counter in range(0, len(counts), 1000):
        part = counts[counter : counter + 1000]
        state.take((0, Block(0, 1, counter, part, None, counter * 500_000, 0)))
    return state


def work_of(state: PageState) -> dict[str, Any]:
    Analyst(state).update()
    return state.analyses["work"]


def test_the_work_of_a_dashpot_is_the_closed_form(tmp_path: Path) -> None:
    """W = π c Ω u₀² and W̄ = W/(m_l Ω² u₀²) = π c/(m_l Ω)."""
    work = work_of(state_of((*FORCES, ROOF), dashpot_counts(20_000), tmp_path))
    omega = 2 * math.pi * FREQUENCY_HZ
    [point] = work["trend"]
    assert point["y"] == pytest.approx(math.pi * DASHPOT_KG_PER_S / (LIQUID_KG * omega), rel=1e-4)
    amplitude_m = LEVEL_M_PER_S2 / omega**2
    work_mj = 1e3 * math.pi * DASHPOT_KG_PER_S * omega * amplitude_m**2
    assert f"W = {work_mj:.4g} mJ" in work["headline"]
    assert "7.3 Hz" in work["note"]
    # the loop: F_S = M_dry ü − F = −(m_l ü + c u̇), whose ends and area are known
    loop = np.array(work["loop"]["cycles"][-1])
    assert np.abs(loop[:, 0]).max() == pytest.approx(1e3 * amplitude_m, rel=0.01)
    assert np.abs(loop[:, 1]).max() == pytest.approx(
        math.hypot(LIQUID_KG * LEVEL_M_PER_S2, DASHPOT_KG_PER_S * omega * amplitude_m), rel=0.01
    )
    # the force of the liquid on the tank takes energy out: ∮ F_S du = −W
    area_mj = float(np.sum(0.5 * (loop[1:, 1] + loop[:-1, 1]) * np.diff(loop[:, 0])))
    assert area_mj == pytest.approx(-work_mj, rel=0.02)


@pytest.mark.parametrize(
    ("channels", "attributes", "reason"),
    [
        ((Channel("voltage_pattern_1", "voltage", "V"),), {}, "no force channel"),
        ((ROOF,), {}, "no force channel"),
        (FORCES, {}, "no acceleration channel of the tank"),
        ((*FORCES, ROOF), {"configuration": "empty"}, "empty"),
    ],
)
def test_what_cannot_be_computed_is_said(
    channels: tuple[Channel, ...], attributes: dict[str, str], reason: str, tmp_path: Path
) -> None:
    state = state_of(channels, np.zeros((4000, len(channels)), np.int32), tmp_path, **attributes)
    work = work_of(state)
    assert work["headline"] == ""
    assert work["note"].startswith("not computed: ")
    assert reason in work["note"]


def test_a_tank_at_rest_has_no_work(tmp_path: Path) -> None:
    work = work_of(state_of((*FORCES, ROOF), np.zeros((20_000, 3), np.int32), tmp_path))
    assert work["note"].startswith("not computed: ")


def test_lost_samples_are_said_and_not_filled(tmp_path: Path) -> None:
    channel = Channel("voltage_a", "voltage", "V", missing_count=7)
    counts = np.ones((10_000, 1), np.int32)
    counts[9000] = 7
    state = state_of((channel,), counts, tmp_path)
    Analyst(state).update()
    assert "lost" in state.analyses["spectra"]["0:0"]["note"]


def test_work_begins_anew_behind_a_gap(tmp_path: Path) -> None:
    """Ten seconds lost in the middle, which no cycle may span; the closed form again from what came since."""
    state = state_of((*FORCES, ROOF), dashpot_counts(20_000)[:8000], tmp_path)
    for counter in range(28_000, 38_000, 1000):
        part = dashpot_counts(38_000)[counter : counter + 1000]
        state.take((0, Block(0, 1, counter, part, None, counter * 500_000, 0)))
    [point] = work_of(state)["trend"]
    omega = 2 * math.pi * FREQUENCY_HZ
    assert point["y"] == pytest.approx(math.pi * DASHPOT_KG_PER_S / (LIQUID_KG * omega), rel=1e-4)
    assert 14.0 < point["x"] < 19.0
    place, values = since_the_last_loss(100, np.array([[1.0, 2.0], [np.nan, 2.0], [1.0, 3.0]]))
    assert (place, values.tolist()) == (102, [[1.0, 3.0]])


def test_roles_follow_the_names_of_the_format() -> None:
    roles = roles_of([ROOF, *FORCES, Channel("acceleration_control", "acceleration", "m s-2")])
    assert (roles.forces, roles.accelerations) == ((1, 2), (0,))


def test_a_spectrum_holds_the_power_of_a_sine_and_of_noise() -> None:
    """One-sided: the density of a sine integrates to A²/2; white noise of variance σ² has 2σ²/rate everywhere."""
    time_s = np.arange(8000) / RATE_HZ
    sine = spectrum(3.0 * np.sin(2 * np.pi * 100 * time_s) + 50.0, RATE_HZ, "N")
    frequency, density = np.array(sine["frequency_hz"]), np.array(sine["density"])
    assert frequency[density.argmax()] == 100
    assert sine["units"] == "N²/Hz"
    # lines of 0.5 Hz around the largest; Hann has an equivalent noise bandwidth of 1.5 lines
    assert density.max() * 1.5 * 0.5 == pytest.approx(9.0 / 2, rel=1e-3)
    noise = spectrum(np.random.default_rng(1).normal(scale=2.0, size=200_000), RATE_HZ, "N")
    mean = np.mean([d for f, d in zip(noise["frequency_hz"], noise["density"], strict=True) if f < 0.5])
    assert mean == pytest.approx(2 * 4.0 / RATE_HZ, rel=0.6)
    assert "too few" in spectrum(np.zeros(10), RATE_HZ, "N")["note"]


def test_no_line_is_left_out_of_a_thinned_spectrum() -> None:
    frequency = np.arange(1, 50_001) * 0.5
    density = np.ones(50_000)
    density[[3, 4321, 49_999]] = 5.0, 7.0, 9.0
    few_frequencies, few = thinned(frequency, density)
    assert few.size <= 300
    assert [few_frequencies[few == value].tolist() for value in (5.0, 7.0, 9.0)] == [[2.0], [2161.0], [25_000.0]]
