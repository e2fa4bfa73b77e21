"""Gusts of a wing: one gust for both liquids, whatever its tanks feel."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.aircraft.response_file import RecordedResponse
from pipelines.wing import gust_stages
from pipelines.wing.results import SLOSHING, WingSettings


@pytest.mark.parametrize(("g_per_m_per_s", "tries"), [(1.0, 1), (2.9, 1), (3.2, 2), (50.0, 6)])
def test_both_liquids_fly_through_one_gust(
    monkeypatch: pytest.MonkeyPatch, g_per_m_per_s: float, tries: int
) -> None:
    """Frozen liquids would bear 2 m/s at 6 g; sloshing ones feel so many g for each m/s, at last too many."""
    flown: list[tuple[bool, float]] = []

    def simulated(flight: Any, forces: Any = None, *, gust: Any, **settings: float) -> Any:
        amplitude = float(gust(np.linspace(0.0, 1.0, 100_001)).max())
        flown.append((bool(forces), amplitude))
        felt = (g_per_m_per_s if forces else 3.0) * 9.80665 * amplitude
        return SimpleNamespace(tank_acceleration_m_per_s2=np.array([[felt]]), ending="")

    monkeypatch.setattr(gust_stages, "simulate_flight", simulated)
    monkeypatch.setattr(gust_stages, "flight_at", lambda *of: None)
    monkeypatch.setattr(gust_stages, "readings_of", lambda case, after_s: {})
    state: Any = SimpleNamespace(model=None, air=None)
    tanks: Any = SimpleNamespace(
        flown=lambda name, flight, gust, **settings: RecordedResponse(
            name, simulated(flight, {"1": None}, gust=gust, **settings)
        )
    )
    settings = WingSettings(gust_length_m=45.0)
    found = gust_stages.gust_case(state, tanks, settings, (321.0, 2.5), lambda note: None)

    sloshing = [amplitude for sloshes, amplitude in flown if sloshes]
    assert len(sloshing) == tries
    sloshes, last = flown[-1]
    assert not sloshes
    assert last == pytest.approx(sloshing[-1])
    assert found.case.amplitude_m_per_s == pytest.approx(sloshing[-1])
    # (3.38) peaks at w_ga; a tenth less at every try
    assert sloshing[-1] == pytest.approx(2.0 * 0.9 ** (tries - 1), rel=1e-3)
    assert SLOSHING in {run.model for run in found.case.runs}
