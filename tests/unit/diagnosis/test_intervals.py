"""Intervals of the numbers of a verdict, against widths in closed form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from hand_made_findings import (
    BASELINE,
    FRICTION,
    NOISE,
    findings,
    judged,
    left,
)
from scipy.stats import norm

from sloshlab.diagnosis.verdict import verdict_facts, verdict_of


def interval_of(values: Mapping[str, float], rms: float = NOISE) -> dict[str, float]:
    """What is told of the only number of an effect; its standard error is 0.01 at the noise floor."""
    found = findings(BASELINE, [left(0.0, 0.0, values, rms=rms)])
    [told] = verdict_facts(found, verdict_of(found))["effects"]
    [number] = told["parameters"].values()
    return dict(number)


@pytest.mark.parametrize(("rms", "widened"), [(0.9, 1.0), (2.0, 2.0)])
def test_intervals_are_as_wide_as_errors_were_and_wider_where_the_fit_leaves_more(
    rms: float, widened: float
) -> None:
    """Two standard errors, twice that at two noise floors, at 90 %, beside one per cent of the size."""
    force = interval_of(FRICTION, rms)
    width = np.hypot(2.0 * 0.01 * widened, 0.0037) * norm.ppf(0.95)
    assert (force["estimate"], force["level"]) == (0.37, 0.9)
    assert force["high"] - 0.37 == pytest.approx(width, rel=1e-4)
    assert 0.37 - force["low"] == pytest.approx(width, rel=1e-4)


def test_an_interval_is_as_wide_as_fits_about_other_baselines_end_elsewhere() -> None:
    spread = replace(left(0.0, 0.0, FRICTION), spread={"structure.coulomb_friction.force_n": 0.04})
    facts = verdict_facts(findings(BASELINE, [spread]), judged(BASELINE, [spread]))
    [force] = [one["parameters"]["force_n"] for one in facts["effects"]]
    width = np.linalg.norm([0.02, 0.0037, 0.04]) * norm.ppf(0.95)
    assert force["high"] - 0.37 == pytest.approx(width, rel=1e-4)


@pytest.mark.parametrize(
    "number", ["sensor.mains_hum_60.acceleration_tip.amplitude", "structure.coulomb_friction.force_n"]
)
def test_a_size_is_known_no_better_than_gains_and_masses(number: str) -> None:
    """One per cent of 4 m/s², or of 4 N, beside two standard errors."""
    size = interval_of({number: 4.0})
    width = norm.ppf(0.95) * np.hypot(0.02, 0.04)
    assert size["high"] - 4.0 == pytest.approx(width, rel=1e-4)
    assert 4.0 - size["low"] == pytest.approx(width, rel=1e-4)


def test_a_loss_per_second_is_a_size() -> None:
    loss = interval_of({"tank.liquid_loss.rate_kg_per_s": 0.5})
    assert loss["high"] - 0.5 == pytest.approx(norm.ppf(0.95) * np.hypot(0.02, 0.005), rel=1e-4)


@pytest.mark.parametrize(
    ("number", "gains"),
    [
        ("structure.stiffness_change.stiffness_n_per_m", np.sqrt(2)),
        ("tank.viscous_damping.damping_n_s_per_m", np.sqrt(2)),
        ("structure.quadratic_stiffness.stiffness_n_per_m2", np.sqrt(5)),
        ("structure.quadratic_drag.drag_n_s2_per_m2", np.sqrt(5)),
        ("structure.cubic_stiffness.stiffness_n_per_m3", np.sqrt(10)),
    ],
)
def test_the_gain_of_a_displacement_counts_with_its_power(number: str, gains: float) -> None:
    size = interval_of({number: 4.0})
    assert size["high"] - 4.0 == pytest.approx(norm.ppf(0.95) * np.hypot(0.02, 0.04 * gains), rel=1e-4)


def test_a_time_does_not_depend_on_gains() -> None:
    leak = interval_of({"sensor.sensor_high_pass.acceleration_tip.time_constant_s": 4.0})
    assert leak["high"] - 4.0 == pytest.approx(0.02 * norm.ppf(0.95), rel=1e-4)
