"""Forces that no motion makes: blows that repeat, and a machine that runs by itself."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sealed_trial.hidden_physics.effect import Change, DrawnEffect, Scales
from sealed_trial.laboratory import kernel_layout as at

_MOST_RUNS: Final = 16
"""Of a plan."""


def outside_force(block: str, unit_n: float, scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Pulses of one sign or of either in turn, or a tone; in every run they are at another instant.

    Parameters
    ----------
    block : {"structure", "tank"}
    unit_n : float
        Largest force of the magnitude one.
    scales : Scales
    generator : numpy.random.Generator
    """
    sort = str(generator.choice(["pulses", "alternating pulses", "tone"]))
    place = {at.OUTSIDE_AT_TANK: 1.0 if block == "tank" else 0.0}
    shares = generator.random(_MOST_RUNS)
    if sort == "tone":
        rate = scales.rate_rad_per_s * generator.uniform(1.25, 1.7)
        phases = tuple({at.TONE_PHASE: 2 * math.pi * float(share)} for share in shares)

        def tone(m: float) -> Change:
            true = {"frequency_hz": rate / (2 * math.pi), "size_n": m * unit_n}
            return Change(true, {at.TONE_FORCE: m * unit_n, at.TONE_RATE: rate, **place}, of_runs=phases)

        return DrawnEffect("external_force", block, tone)
    cycle = 2 * math.pi / scales.rate_rad_per_s
    period, width = float(generator.uniform(0.4, 1.6)), cycle * float(generator.uniform(0.15, 0.5))
    sign = 1.0 if generator.random() < 0.5 else -1.0
    starts = tuple({at.PULSE_START: 0.3 + period * float(share)} for share in shares)

    def pulses(m: float) -> Change:
        true = {"size_n": 4 * sign * m * unit_n, "period_s": period, "width_s": width}
        kernel = {
            at.PULSE_FORCE: 4 * sign * m * unit_n,
            at.PULSE_PERIOD: period,
            at.PULSE_WIDTH: width,
            at.PULSE_ALTERNATES: float(sort != "pulses"),
            **place,
        }
        return Change(true, kernel, of_runs=starts)

    return DrawnEffect("external_force", block, pulses)
