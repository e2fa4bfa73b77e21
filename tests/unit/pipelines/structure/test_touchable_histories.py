"""Channels of runs of a structure, and twins beside the run that drove them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.report.interactive.contents import Line
from pipelines.report.interactive.spectra import power_densities
from pipelines.structure.touchable_histories import histories_of

RATE_HZ, MASS_KG = 512.0, 2.0


def run(name: str, *, group: str = "frozen", simulated_from: str = "", n: int = 2048, size: float = 9.81) -> Any:
    time = np.arange(n) / RATE_HZ
    acceleration = size * np.sin(2 * np.pi * 8.0 * time)
    return SimpleNamespace(
        name=name,
        group=group,
        path=SimpleNamespace(name=f"{name}.nc"),
        is_simulated=bool(simulated_from),
        simulated_from=simulated_from,
        attributes=SimpleNamespace(sampling_rate_hz=RATE_HZ),
        time_s=time,
        response=SimpleNamespace(acceleration_m_per_s2=acceleration[None]),
        tank_acceleration=acceleration,
        root_acceleration=None,
        interface_force=1.5 * acceleration,
        first_decay=SimpleNamespace(release=SimpleNamespace(release_s=0.25, frequency_hz=8.0)),
    )


def experiment() -> Any:
    return SimpleNamespace(modes=SimpleNamespace(names=("mode 1",)), total_mass_kg=MASS_KG)


def test_a_twin_stands_beside_the_run_that_drove_it_and_no_other() -> None:
    runs = [run("a"), run("b"), run("b_twin", group="rom", simulated_from="b.nc", size=4.905)]
    shown = histories_of(experiment(), runs, "Free decays")
    assert [each.name for each in shown.runs] == ["a", "b"]
    assert [len(each.channels[0].lines) for each in shown.runs] == [1, 2]
    channels = {channel.name: channel for channel in shown.runs[1].channels}
    recorded, twin = channels["mode: mode 1"].lines
    # a sine of 9.81 m/s² is 1 g
    assert recorded.values.max() == pytest.approx(1.0, rel=1e-3)
    assert twin.values.max() == pytest.approx(0.5, rel=1e-3)
    assert twin.label == "rom"
    assert channels["mode: mode 1"].difference_to == "recorded"
    # Δf = M ü − F = (2 − 1.5) ü
    np.testing.assert_allclose(channels["Δf of the liquid"].lines[0].values, 0.5 * runs[1].tank_acceleration)
    # 14 cycles of 8 Hz from the release
    assert channels["tank"].view_s == (0.0, 0.25 + 14 / 8.0)


def test_a_twin_that_is_sampled_differently_is_not_drawn_over_the_run() -> None:
    runs = [run("a"), run("a_twin", group="rom", simulated_from="a.nc", n=1024)]
    assert len(histories_of(experiment(), runs, "x").runs[0].channels[0].lines) == 1


def test_twins_alone_are_shown_where_nothing_was_recorded() -> None:
    shown = histories_of(experiment(), [run("a_twin", group="rom", simulated_from="a.nc")], "x")
    assert shown.runs[0].channels[0].lines[0].label == "rom"
    assert shown.runs[0].channels[0].difference_to == ""


def test_the_area_under_a_density_is_the_mean_square() -> None:
    time = np.arange(8192) / RATE_HZ
    values = 3.0 * np.sin(2 * np.pi * 20.0 * time)
    frequency_hz, (density,) = power_densities([Line("recorded", "recorded", values)], RATE_HZ)
    assert frequency_hz[density.values.argmax()] == pytest.approx(20.0, abs=0.3)
    assert density.values.sum() * np.diff(frequency_hz)[0] == pytest.approx(4.5, rel=1e-2)


@pytest.mark.parametrize("values", [np.full(100, np.nan), np.zeros(1), np.zeros(0)])
def test_lines_without_values_have_no_density(values: np.ndarray) -> None:
    frequency_hz, densities = power_densities([Line("recorded", "recorded", values)], RATE_HZ)
    assert frequency_hz.size == 0
    assert densities == ()
