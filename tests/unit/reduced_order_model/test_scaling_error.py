"""The error bar of the scaling law: its numbers are those that are kept, its form is that of the equations."""

import hashlib
import json
import math
from pathlib import Path

import pytest

from sloshlab.reduced_order_model.scaling_error import (
    COMPUTED,
    SURFACE_TENSION,
    WALL_LAYERS,
    scaling_error,
)
from sloshlab.reduced_order_model.tank_scaling import TankScaling

KEPT = Path(__file__).resolve().parents[3] / "raw_data" / "tank_scaling"


def test_numbers_are_those_of_the_study() -> None:
    """Every constant is a number of the kept file, which is the one that its manifest names."""
    content = (KEPT / "law.json").read_bytes()
    manifest = json.loads((KEPT / "manifest.json").read_text())
    assert hashlib.sha256(content).hexdigest() == manifest["files"]["law.json"]["sha256"]
    law = json.loads(content)
    of_size = {entry["size"]: entry for entry in law["sizes"]}
    assert [factor for factor, *_ in COMPUTED] == pytest.approx([size**1.5 for size in of_size])
    for (_, work, beta), size in zip(COMPUTED, of_size, strict=True):
        assert work == pytest.approx(of_size[size]["work_rms"], abs=5e-4)
        assert beta == pytest.approx(of_size[size]["beta_rms"], abs=5e-4)
    assert pytest.approx(law["wall_layers"], abs=5e-4) == WALL_LAYERS
    assert pytest.approx(law["surface_tension"], abs=5e-4) == SURFACE_TENSION


def test_the_same_tank_has_no_error() -> None:
    error = scaling_error(1.0, 1.0)
    assert (error.work, error.beta, error.is_tested) == (0.0, 0.0, True)


def test_a_tank_four_times_as_high_by_hand() -> None:
    """Re × 8, Bo × 16: half of ln 2^1.5 … ln 5^1.5 or so computed, layers lose 1 − 8^(−1/2), tension 15/16."""
    of_two, of_five = COMPUTED[3][1], COMPUTED[4][1]
    error = TankScaling(2.0, 2.0, 64.0, 8.0, 16.0).error
    share = (math.log(8) - math.log(2**1.5)) / (math.log(5**1.5) - math.log(2**1.5))
    computed = of_two + share * (max(of_two, of_five) - of_two)
    layers = WALL_LAYERS * (1 - 8**-0.5)
    tension = SURFACE_TENSION * 15 / 16
    assert error.work == pytest.approx(math.sqrt(computed**2 + layers**2 + tension**2), rel=1e-12)
    assert error.is_tested


def test_a_liquid_that_is_not_told_is_the_same_one() -> None:
    told = TankScaling(2.0, 2.0, 64.0, 8.0, 16.0)
    assert TankScaling(2.0, 2.0, 64.0, math.nan, math.nan).error == told.error
    thinner = TankScaling(2.0, 2.0, 64.0, 100.0, 16.0)
    assert thinner.error.work != told.error.work


def test_beyond_what_was_computed_it_says_so() -> None:
    largest = max(factor for factor, *_ in COMPUTED)
    assert scaling_error(largest, 25.0**2).is_tested
    beyond = scaling_error(4 * largest, 25.0**2)
    assert not beyond.is_tested
    assert "beyond the sizes" in str(beyond)
    assert beyond.beta == scaling_error(largest, 25.0**2).beta
    # a smaller tank: layers and surface take more than in the training, without limit
    smallest = min(factor for factor, *_ in COMPUTED)
    assert scaling_error(smallest, 0.04**2).is_tested
    smaller = scaling_error(smallest / 4, 0.01)
    assert not smaller.is_tested
    assert smaller.work > 9 * WALL_LAYERS


def test_a_smaller_tank_errs_by_what_was_computed_of_smaller_ones() -> None:
    """A tenth as high: W̄ was 15 % less on average, more than any larger tank differs."""
    error = scaling_error(0.1**1.5, 1.0)
    layers = WALL_LAYERS * (0.1**-0.75 - 1)
    assert error.work == pytest.approx(math.hypot(COMPUTED[1][1], layers), rel=1e-12)
    assert error.work > scaling_error(10**1.5, 1.0).work


def test_errors_do_not_shrink_with_the_distance() -> None:
    factors = [1.0, 2.0, 3.0, 10.0, 50.0, 200.0]
    for way in (1, -1):
        betas = [scaling_error(factor**way, factor ** (way * 4 / 3)).beta for factor in factors]
        assert betas == sorted(betas)
