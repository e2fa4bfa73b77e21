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

from sloshlab.diagnosis.free_run_problem import FreeRunFit
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
    """1.25 standard errors, twice that at two noise floors, at 90 %, beside one per cent of the size."""
    force = interval_of(FRICTION, rms)
    width = np.hypot(0.0125 * widened, 0.0037) * norm.ppf(0.95)
    assert (force["estimate"], force["level"]) == (0.37, 0.9)
    assert force["high"] - 0.37 == pytest.approx(width, rel=1e-4)
    assert 0.37 - force["low"] == pytest.approx(width, rel=1e-4)


def test_an_interval_is_as_wide_as_fits_about_other_baselines_end_elsewhere() -> None:
    spread = replace(left(0.0, 0.0, FRICTION), spread={"structure.coulomb_friction.force_n": 0.04})
    facts = verdict_facts(findings(BASELINE, [spread]), judged(BASELINE, [spread]))
    [force] = [effect["parameters"]["force_n"] for effect in facts["effects"]]
    width = np.hypot(0.0125, 0.04) * norm.ppf(0.95)
    assert force["high"] - 0.37 == pytest.approx(width, rel=1e-4)


@pytest.mark.parametrize(("disagree", "counts"), [(0.05, 0.05), (0.01, 0.0125)])
def test_an_interval_is_as_wide_as_runs_disagree(disagree: float, counts: float) -> None:
    """Instead of what noise alone would give, where it is more."""
    scatter = replace(left(0.0, 0.0, FRICTION), scatter={"structure.coulomb_friction.force_n": disagree})
    facts = verdict_facts(findings(BASELINE, [scatter]), judged(BASELINE, [scatter]))
    [force] = [effect["parameters"]["force_n"] for effect in facts["effects"]]
    width = np.hypot(counts, 0.0037) * norm.ppf(0.95)
    assert force["high"] - 0.37 == pytest.approx(width, rel=1e-4)


def beside_a_gain(n: float) -> FreeRunFit:
    """An effect of size 0.37 that reads as a gain does, known to 1 from elsewhere, from n values of unit noise."""
    fit = left(0.0, 0.0, FRICTION).fit
    covariance = np.linalg.inv([[n + 1.0, n], [n, n]])
    return replace(fit, covariance=covariance, names=("gain", *fit.names), scales=np.array([0.01, 0.01]))


@pytest.mark.parametrize("n", [0.5, 4.0, 1e4])
def test_standard_errors_by_noise_and_by_the_prior_are_separate(n: float) -> None:
    """The mean of the values knows the sum to 1/√n; the effect is it less the gain, which is known to 1."""
    fit = beside_a_gain(n)
    assert fit.standard_errors(fit.names[1]) == pytest.approx((0.01 / np.sqrt(n), 0.01))
    assert fit.standard_error(fit.names[1]) == pytest.approx(0.01 * np.sqrt(1 + 1 / n))


@pytest.mark.parametrize(("elsewhere", "of_belief"), [(0.003, 0.01), (0.04, 0.04)])
def test_what_is_not_known_of_the_baseline_counts_once(elsewhere: float, of_belief: float) -> None:
    """As fits end elsewhere, as a belief is sure, or as a gain of one per cent does (0.0037)."""
    explanation = replace(
        left(0.0, 0.0, FRICTION), fit=beside_a_gain(4.0), spread={"structure.coulomb_friction.force_n": elsewhere}
    )
    facts = verdict_facts(findings(BASELINE, [explanation]), judged(BASELINE, [explanation]))
    [force] = [part["parameters"]["force_n"] for part in facts["effects"]]
    width = np.hypot(1.25 * 0.005, of_belief) * norm.ppf(0.95)
    assert force["high"] - 0.37 == pytest.approx(width, rel=1e-4)


@pytest.mark.parametrize(
    "number", ["sensor.mains_hum_60.acceleration_tip.amplitude", "structure.coulomb_friction.force_n"]
)
def test_a_size_is_known_no_better_than_gains_and_masses(number: str) -> None:
    """One per cent of 4 m/s², or of 4 N, beside what noise does."""
    size = interval_of({number: 4.0})
    width = norm.ppf(0.95) * np.hypot(0.0125, 0.04)
    assert size["high"] - 4.0 == pytest.approx(width, rel=1e-4)
    assert 4.0 - size["low"] == pytest.approx(width, rel=1e-4)


def test_a_loss_per_second_is_a_size() -> None:
    loss = interval_of({"tank.liquid_loss.rate_kg_per_s": 0.5})
    assert loss["high"] - 0.5 == pytest.approx(norm.ppf(0.95) * np.hypot(0.0125, 0.005), rel=1e-4)


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
    assert size["high"] - 4.0 == pytest.approx(norm.ppf(0.95) * np.hypot(0.0125, 0.04 * gains), rel=1e-4)


def test_a_leak_has_the_gains_of_two_sensors_in_it_and_a_gain_has_none() -> None:
    leak = interval_of({"sensor.cross_talk.acceleration_tip<acceleration_root.ratio": 1.0})
    assert leak["high"] - 1.0 == pytest.approx(norm.ppf(0.95) * np.hypot(0.0125, 0.01 * np.sqrt(2)), rel=1e-4)
    gain = interval_of({"sensor.sensor_gain.acceleration_tip.ratio": 4.0})
    assert gain["high"] - 4.0 == pytest.approx(norm.ppf(0.95) * 0.0125, rel=1e-4)


def test_a_time_does_not_depend_on_gains() -> None:
    leak = interval_of({"sensor.sensor_high_pass.acceleration_tip.time_constant_s": 4.0})
    assert leak["high"] - 4.0 == pytest.approx(0.0125 * norm.ppf(0.95), rel=1e-4)
