"""Which fits go on from one rung to the next."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from sloshlab.diagnosis.selection import successive_halving
from sloshlab.diagnosis.selection.successive_halving import _Running


def running(key: str, cost: float) -> _Running:
    effect = SimpleNamespace(known_as=key.rpartition(".")[2])
    candidates = (SimpleNamespace(effect=effect),)
    return _Running(cast(Any, SimpleNamespace(keys=frozenset([key]), candidates=candidates)), {}, None, cost)


def kept(costs: dict[str, float], n: int = 4) -> set[str]:
    better = successive_halving._better([running(name, cost) for name, cost in costs.items()], n, 1)
    return {key for each in better for key in each.proposal.keys}


def test_what_costs_many_times_as_much_is_hopeless() -> None:
    assert kept({"mass": 5e4, "spring": 1e4, "drag": 2e4, "stop": np.inf}) == {"spring", "drag"}


def test_what_inflated_noise_hides_nearly_all_of_is_not() -> None:
    """By a ratio of nearly nothing the equal of a fit that is a step ahead would be left out."""
    assert kept({"mass": 80.0, "spring": 0.8, "drag": 1e3}) == {"mass", "spring"}


def test_the_lowest_costs_go_on() -> None:
    assert kept({"mass": 3.0, "spring": 1.0, "drag": 2.0}, n=2) == {"spring", "drag"}


def test_places_of_one_name_leave_room_for_others() -> None:
    """Of three pulse trains that lead two go on, and so do the two others behind them."""
    costs = {"structure.pulses": 1.0, "tank.pulses": 1.1, "sensor.pulses": 1.2, "drag": 1.3, "play": 1.4}
    assert kept(costs) == {"structure.pulses", "tank.pulses", "drag", "play"}
