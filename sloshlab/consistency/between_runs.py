"""Runs of one rig against each other and against the rig file.

The sensors of a campaign stay the same: gains and delays of an empty, a frozen and a sloshing run must agree, and
what the force cells carry at the quiet start of a sloshing run must be the dry mass and the liquid.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import xarray as xr

from sloshlab.conditioning.calibration import DryMass, w_bar_bias_of_delay
from sloshlab.consistency.effect import Inertia
from sloshlab.consistency.finding import SMALLEST_EFFECT, Finding, OpenPoint, contradiction
from sloshlab.consistency.force_response import ForceResponse
from sloshlab.consistency.like_sensors import NORMAL_GAIN_ERROR, delay_text
from sloshlab.consistency.series import SensorSeries
from sloshlab.rig import Rig

_SIGMA: Final = 5.0
NORMAL_MASS_ERROR: Final = 0.01
"""Of a mass that a laboratory believes (recording format: masses within ±1 % are normal)."""
QUIET_EFFECTIVE_MASS: Final = (0.80, 1.0)
"""Share of its mass with which a liquid below the onset of waves follows the tank.

All of it in theory; 0.83 … 0.87 at 0.25 g in the measured maps of the source (β = −0.13 … −0.17, App. E), and
their scatter.
"""
_LARGEST_W_BAR_AT_THE_END: Final = 1.0
"""Below 1 g, where a liquid takes little: at most 0.6 in the recordings of the numerical tank."""
_CHANGE_OF_EFFECTIVE_MASS: Final = 0.1
"""Share of the liquid by which its effective mass may change up to 1 g: half of the range above."""
_LARGEST_COMMON_DELAY_SAMPLES: Final = 0.02
_FEWEST_SIBLINGS: Final = 3


def sensor_findings(
    series: Sequence[tuple[SensorSeries, float]], of_still_run: Sequence[SensorSeries], inertia: Inertia
) -> list[Finding]:
    """Gains of like sensors against those of a run without liquid motion."""
    findings = []
    before = {(one.name, one.reference): one for one in of_still_run}
    for one, share in series:
        other = before.get((one.name, one.reference))
        if other is None:
            continue
        gain, its = one.mean_gain, other.mean_gain
        relative = gain.value / its.value - 1
        std = math.hypot(gain.std / gain.value, its.std / its.value)
        if abs(relative) > _SIGMA * std:
            what = f"their ratio is {100 * relative:+.3g} % from that of the still run"
            effect, channels = inertia.of_gain(share * relative), (one.name, one.reference)
            findings.append(contradiction("gain against the still runs", what, channels, effect=effect))
    return findings


def start_findings(
    response: ForceResponse | None, rig: Rig, dry: DryMass | None, inertia: Inertia, sample_s: float
) -> tuple[list[Finding], list[OpenPoint]]:
    """Mass, delay and linearity at the quiet start of a sloshing run.

    Returns
    -------
    findings : list of Finding
    not_checked : list of OpenPoint
    """
    if response is None:
        why = "the run does not begin at rest"
        return [], [OpenPoint("common gain, delay and linearity of the forces with the liquid at rest", why)]
    findings = [
        *_mass(response, rig, dry, inertia),
        *_delay(response, dry, inertia, sample_s),
        *_bend(response, inertia, is_still=False),
    ]
    return findings, _open_points(response, rig, dry, inertia)


def _open_points(response: ForceResponse, rig: Rig, dry: DryMass | None, inertia: Inertia) -> list[OpenPoint]:
    """What the quiet start leaves open, with its largest effect."""
    low, high = QUIET_EFFECTIVE_MASS
    scatter = 2 * _SIGMA * response.mass_std_kg / inertia.total_kg
    gain = (high - low) * rig.liquid_mass_kg / inertia.total_kg + scatter
    points = [
        OpenPoint(
            "a gain common to all force cells, or to all accelerometers",
            "how much of its mass a quiet liquid carries is not known better",
            *inertia.of_gain(gain),
        ),
        OpenPoint(
            "a delay between force and acceleration",
            "the quiet start is short",
            *inertia.of_delay(_SIGMA * response.delay_std_s),
        ),
    ]
    if dry is None:
        of_mass = gain + 2 * _belief()
        # W̄ and β are per mass of the liquid, of which the whole mass says as much as it is known itself
        of_filling = of_mass * inertia.total_kg / rig.liquid_mass_kg
        points.append(
            OpenPoint(
                "gains and masses against still runs", "no empty or frozen run is given", of_filling, of_filling
            )
        )
    return points


def _belief() -> float:
    """Relative uncertainty of the whole mass as the force cells read it, from beliefs alone."""
    # the gains of two cells and of two accelerometers: their means err by 1/√2, their ratio by 1
    return math.hypot(NORMAL_MASS_ERROR, NORMAL_GAIN_ERROR)


def _mass(response: ForceResponse, rig: Rig, dry: DryMass | None, inertia: Inertia) -> list[Finding]:
    gain = 1.0 if dry is None else dry.gain_ratio
    dry_kg = rig.tank.dry_mass_kg if dry is None else dry.mass_kg
    low, high = (gain * (dry_kg + share * rig.liquid_mass_kg) for share in QUIET_EFFECTIVE_MASS)
    of_reference = (
        _belief() * high if dry is None else (dry.mass_std_kg if math.isfinite(dry.mass_std_kg) else 0.0)
    )
    # a weighed liquid is believed, too: its share of the whole is what counts
    of_liquid = NORMAL_MASS_ERROR * rig.liquid_mass_kg if dry is not None and not dry.gain_is_identified else 0.0
    margin = of_reference + of_liquid + _SIGMA * response.mass_std_kg
    mass = response.mass_kg
    excess = max(mass - high, low - mass)
    if excess <= margin:
        return []
    relative = (mass - min(max(mass, low), high)) / mass
    effect = inertia.of_gain(relative)
    known = "the still runs" if dry is not None else "the rig file"
    what = (
        f"with the liquid at rest (until {response.stop_s:.3g} s) force over acceleration is {mass:.4g} ± "
        f"{response.mass_std_kg:.2g} kg, {low:.4g} … {high:.4g} kg by {known}: a gain, a mass or the filling is "
        "wrong"
    )
    return [contradiction("mass at the quiet start", what, effect=effect)]


def _delay(response: ForceResponse, dry: DryMass | None, inertia: Inertia, sample_s: float) -> list[Finding]:
    expected = 0.0 if dry is None else dry.delay_s
    delay = response.delay_s - expected
    if abs(delay) <= _SIGMA * response.delay_std_s + _LARGEST_COMMON_DELAY_SAMPLES * sample_s:
        return []
    effect = inertia.of_delay(delay)
    compared = "against the still runs" if dry is not None else "against the acceleration"
    what = (
        f"with the liquid at rest (until {response.stop_s:.3g} s) the force comes {delay_text(delay, sample_s)} "
        f"{compared}, ± {1e6 * response.delay_std_s:.2g} µs"
    )
    return [contradiction("delay at the quiet start", what, effect=effect)]


def _bend(response: ForceResponse, inertia: Inertia, *, is_still: bool) -> list[Finding]:
    # what a liquid at rest carries changes with the level by some of its mass, what is still does not
    of_liquid = 0.0 if is_still else _CHANGE_OF_EFFECTIVE_MASS * inertia.liquid_kg / inertia.total_kg
    if abs(response.bend) <= _SIGMA * response.bend_std + of_liquid:
        return []
    effect = inertia.of_gain(0.75 * response.bend)
    what = f"force is not in proportion to acceleration: {100 * response.bend:+.2g} % at the largest acceleration"
    return [contradiction("linearity", what, effect=effect)]


def stop_findings(response: ForceResponse | None, dry: DryMass | None, inertia: Inertia) -> list[Finding]:
    """Delay while the motion dies away at the end, against what the liquid may still take there."""
    if response is None or not math.isfinite(inertia.liquid_kg):
        return []
    delay = response.delay_s - (0.0 if dry is None else dry.delay_s)
    per_delay = math.pi * 2 * math.pi * inertia.highest_hz * inertia.total_kg / inertia.liquid_kg
    if per_delay * (abs(delay) - _SIGMA * response.delay_std_s) <= _LARGEST_W_BAR_AT_THE_END:
        return []
    what = (
        f"while the motion dies away at the end the force comes {1e3 * abs(delay):.3g} ms "
        f"{'late' if delay > 0 else 'early'}, ± {1e3 * response.delay_std_s:.2g} ms"
    )
    return [contradiction("delay at the end", what, effect=inertia.of_delay(delay))]


def still_findings(response: ForceResponse | None, inertia: Inertia) -> list[Finding]:
    """Linearity of force against acceleration in an empty or frozen run."""
    return [] if response is None else _bend(response, inertia, is_still=True)


def carried_mass_findings(response: ForceResponse | None, believed_kg: float, inertia: Inertia) -> list[Finding]:
    """Force over acceleration of a still run against the mass that the rig file states."""
    if response is None:
        return []
    relative = response.mass_kg / believed_kg - 1
    tolerance = math.hypot(NORMAL_MASS_ERROR, 2 * NORMAL_GAIN_ERROR) + _SIGMA * response.mass_std_kg / believed_kg
    if abs(relative) <= tolerance:
        return _bend(response, inertia, is_still=True)
    what = (
        f"force over acceleration is {response.mass_kg:.4g} ± {response.mass_std_kg:.2g} kg, the rig file states "
        f"{believed_kg:.4g} kg: a gain or the mass is wrong"
    )
    effect = inertia.of_gain(relative)
    return [contradiction("mass of the tank", what, effect=effect)]


def calibration_findings(dry: DryMass, rig: Rig, inertia: Inertia) -> list[Finding]:
    """What the still runs identify against what the laboratory believes."""
    findings = []
    # g amplifies an error of either run by the ratio of whole mass and liquid
    if dry.gain_is_identified and abs(dry.gain_ratio - 1) > 2 * NORMAL_GAIN_ERROR + 3 * dry.gain_ratio_std:
        what = (
            f"empty and frozen runs differ by {dry.gain_ratio:.4g} of the liquid's mass: a gain changed between "
            "them, the filling is not as stated, or forces and accelerations are calibrated differently"
        )
        findings.append(contradiction("gain of force over acceleration", what))
    relative = dry.mass_kg / rig.tank.dry_mass_kg - 1
    if abs(relative) > NORMAL_MASS_ERROR + 2 * NORMAL_GAIN_ERROR + 3 * dry.mass_std_kg / dry.mass_kg:
        effect = inertia.of_gain(relative)
        what = (
            f"the still runs give a dry mass of {dry.mass_kg:.4g} kg, the rig file {rig.tank.dry_mass_kg:.4g} kg"
        )
        findings.append(contradiction("dry mass", what, effect=effect))
    return findings + _common_delay(dry, rig, inertia)


def _common_delay(dry: DryMass, rig: Rig, inertia: Inertia) -> list[Finding]:
    bias = w_bar_bias_of_delay(dry, rig, frequency_hz=inertia.highest_hz)
    if abs(dry.delay_s) <= 3 * dry.delay_std_s or abs(bias) <= SMALLEST_EFFECT:
        return []
    what = (
        f"force lags acceleration by {1e6 * dry.delay_s:.0f} µs, which shifts W̄ at {inertia.highest_hz:.0f} Hz by "
        f"{bias:+.3f}; compensate it with delay_s in the channel map"
    )
    return [contradiction("delay of the still runs", what, effect=(abs(bias), math.nan))]


def sibling_findings(starts: Mapping[str, ForceResponse], rig: Rig, inertia: Inertia) -> dict[str, Finding]:
    """Quiet starts of several sloshing runs of one rig against their median, by run."""
    if len(starts) < _FEWEST_SIBLINGS:
        return {}
    masses = sorted(start.mass_kg for start in starts.values())
    middle = 0.5 * (masses[(len(masses) - 1) // 2] + masses[len(masses) // 2])
    findings = {}
    for run_id, start in starts.items():
        relative = start.mass_kg / middle - 1
        # the effective mass itself changes a little with the level of the start
        tolerance = _SIGMA * start.mass_std_kg / middle + 0.05 * rig.liquid_mass_kg / middle
        if abs(relative) > tolerance:
            effect = inertia.of_gain(relative)
            what = f"force over acceleration at the quiet start is {100 * relative:+.2g} % from that of other runs"
            findings[run_id] = contradiction("gain between runs", what, effect=effect)
    return findings


def still_reference(recordings: Sequence[xr.Dataset]) -> xr.Dataset | None:
    """The still run that sensors are compared with: frozen rather than empty, whose load is another."""
    by_configuration = {str(recording.attrs.get("configuration")): recording for recording in recordings}
    return by_configuration.get("frozen", by_configuration.get("empty"))
