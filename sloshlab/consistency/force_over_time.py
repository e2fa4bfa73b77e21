"""Force against acceleration over a run: what changes as no liquid does."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sloshlab.consistency.bounds import LARGEST_W_BAR
from sloshlab.consistency.effect import Inertia
from sloshlab.consistency.finding import Finding, contradiction
from sloshlab.consistency.like_sensors import N_EACH_SIDE, SIGMA
from sloshlab.consistency.series import SensorSeries
from sloshlab.consistency.step_test import largest_step, step_sigma_near

_LARGEST_PHYSICAL_STEP_OF_W_BAR: Final = 1.0
"""What the liquid itself does within some seconds of a sweep; the largest measured W̄ is 1.65 (Table 1.2)."""
_FEWEST_BLOCKS: Final = 3
_SHARE_OF_BLOCKS: Final = 0.02
"""A block of a second may be out of phase by a start or a stop."""
_SHARP: Final = 4
"""Seconds on each side of a step of the gain: a liquid takes longer to change."""
_NO_STEP_SIGMA: Final = 4.0


def findings_over_time(series: SensorSeries, inertia: Inertia) -> list[Finding]:
    """Steps and impossible phases of the force against the acceleration.

    Parameters
    ----------
    series : SensorSeries
        Of the total force against the mean acceleration, in a run with a moving liquid.
    inertia : Inertia
        With known masses.
    """
    return [*_lost_samples(series, inertia), *_impossible_phase(series, inertia), *_gain_step(series, inertia)]


def _lost_samples(series: SensorSeries, inertia: Inertia) -> list[Finding]:
    """A step of the delay between force and acceleration that no liquid makes."""
    step = largest_step(series.delay_s, N_EACH_SIDE)
    if step is None or step.sigma < SIGMA:
        return []
    omega = float(series.omega_rad_per_s[step.index])
    w_bar = math.pi * omega * abs(step.size) * inertia.total_kg / inertia.liquid_kg
    if w_bar < _LARGEST_PHYSICAL_STEP_OF_W_BAR:
        return []
    what = (
        f"the force comes {1e3 * abs(step.size):.3g} ms {'later' if step.size > 0 else 'earlier'} against the "
        "acceleration from here on: samples lost or doubled"
    )
    worst, beta = inertia.of_delay(step.size)
    return [
        contradiction("lost samples", what, effect=(worst, beta), time_s=series.from_index(step.index)),
    ]


def _impossible_phase(series: SensorSeries, inertia: Inertia) -> list[Finding]:
    """Blocks in which force and acceleration are further out of phase than any liquid can bring them."""
    dry_kg = inertia.total_kg - inertia.liquid_kg
    # W̄ is bounded, and the dry mass is always in phase: tan φ = W̄ m_l/(π M)
    largest = math.atan2(LARGEST_W_BAR * inertia.liquid_kg, math.pi * dry_kg)
    phase = series.delay_s * series.omega_rad_per_s
    beyond = np.abs(phase) > largest
    if beyond.sum() < max(_FEWEST_BLOCKS, _SHARE_OF_BLOCKS * phase.size):
        return []
    at = np.flatnonzero(beyond)
    found = float(np.abs(phase).max())
    what = f"force and acceleration are up to {found:.2g} rad out of phase, a liquid gives at most {largest:.2g}"
    return [contradiction("phase", what, time_s=(float(series.time_s[at[0]]), float(series.time_s[at[-1]])))]


def _gain_step(series: SensorSeries, inertia: Inertia) -> list[Finding]:
    """A step in force over acceleration that stands alone and leaves their delay as it was.

    Where waves come and go the liquid steps, too, but more than once, and mostly with a change of the delay.
    """
    step = largest_step(series.gain, _SHARP)
    if step is None or step.sigma < SIGMA or abs(step.size) < 2 * step.next_size:
        return []
    if step_sigma_near(series.delay_s, _SHARP, step.index) > _NO_STEP_SIGMA:
        return []
    relative = step.size / series.mean_gain.value
    what = f"force over acceleration steps by {100 * relative:+.3g} % while their delay stays"
    effect = inertia.of_gain(relative)
    return [contradiction("gain over time", what, effect=effect, time_s=series.from_index(step.index))]
