"""Numbers that describe what a retuned baseline leaves of a case: features of a classifier.

Every feature is a pure number by name; one that a case does not have (no structure, no such channel) is absent,
and a classifier takes it as zero.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.identification.case import level
from sloshlab.identification.observations import Observation
from sloshlab.missing_force.latent_force import LatentForce
from studies.rivals.baseline import RetunedBaseline, whitened_residuals
from studies.rivals.regressed_models import RegressedModel

FloatArray = NDArray[np.float64]
BANDS: Final = {
    "slow": (0.0, 0.35),
    "half": (0.35, 0.7),
    "first": (0.7, 1.4),
    "second": (1.4, 2.4),
    "third": (2.4, 3.6),
    "higher": (3.6, math.inf),
}
"""Of frequencies over that of the motion."""
MAINS_HZ: Final = (50.0, 60.0)
_PARTS: Final = 4
"""Of a run, over which a residual may grow or fall."""


def features_of(found: RetunedBaseline, models: Sequence[RegressedModel]) -> dict[str, float]:
    """All features of a case.

    Parameters
    ----------
    found : RetunedBaseline
    models : sequence of RegressedModel
        Of the same case.
    """
    features = {**_of_plan(found), **_of_numbers(found), **_of_channels(found), **_of_forces(found)}
    return {**features, **_of_models(models, found)}


def band_shares(series: FloatArray, rate_hz: float, frequency_hz: float) -> dict[str, float]:
    """Shares of the power of a series in bands about multiples of a frequency; empty of a series without power.

    Parameters
    ----------
    series : ndarray, shape (n,)
    rate_hz, frequency_hz : float

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(4000) / 400
    >>> shares = band_shares(np.sin(2 * np.pi * 15 * t), 400.0, 5.0)
    >>> round(shares["third"], 3), round(shares["first"], 3)
    (1.0, 0.0)
    """
    power = np.abs(np.fft.rfft((series - series.mean()) * np.hanning(series.size))) ** 2
    total = float(power.sum())
    if total <= 0 or frequency_hz <= 0:
        return {}
    ratio = np.fft.rfftfreq(series.size, 1 / rate_hz) / frequency_hz
    return {
        name: float(power[(ratio >= low) & (ratio < high)].sum() / total) for name, (low, high) in BANDS.items()
    }


def growth(parts: FloatArray) -> float:
    """Slope of the logarithm of sizes over their places from 0 to 1; 0 of one alone.

    Parameters
    ----------
    parts : ndarray, shape (n,)
        Above zero.

    Examples
    --------
    >>> import numpy as np
    >>> round(growth(np.exp(2.0 * np.linspace(0, 1, 5))), 6)
    2.0
    """
    if parts.size < 2:
        return 0.0
    return float(np.polyfit(np.linspace(0.0, 1.0, parts.size), np.log(np.maximum(parts, 1e-12)), 1)[0])


def phase_shares(force: FloatArray, motion: FloatArray) -> dict[str, float]:
    """Correlations of a force with displacement, velocity and acceleration, −1 … 1.

    Parameters
    ----------
    force : ndarray, shape (n,)
    motion : ndarray, shape (n, 3)
    """
    force = force - force.mean()
    size = float(np.linalg.norm(force))
    shares = {}
    for name, column in zip("xva", (motion - motion.mean(axis=0)).T, strict=True):
        scale = size * float(np.linalg.norm(column))
        shares[name] = float(force @ column) / scale if scale > 0 else 0.0
    return shares


def _of_plan(found: RetunedBaseline) -> dict[str, float]:
    runs = found.case.runs
    return {
        "is a beam": float(found.case.rig.structure is not None and found.case.rig.structure.kind == "beam")
        if found.case.rig is not None
        else 0.0,
        "has a structure": float(found.model.twin.structure is not None),
        "tank damps": float(bool(found.model.twin.terms)),
        "free runs": float(np.mean([run.is_free for run in runs])),
        "has one frequency": float(all(_spread(found, run.name) < 1.1 for run in runs)),
        "tests": float(len(found.case.tests())),
    }


def _of_numbers(found: RetunedBaseline) -> dict[str, float]:
    """How far retuning moved the baseline, in tolerances, and what it leaves."""
    shifts: dict[str, list[float]] = {}
    for parameter in found.model.parameters:
        if parameter.name.endswith(tuple(run.name for run in found.case.runs)):
            continue
        shift = (found.values.get(parameter.name, parameter.believed) - parameter.believed) / parameter.tolerance
        kind = next(
            (word for word in ("frequency", "damping", "mass", "gain", "shape") if word in parameter.name), "other"
        )
        shifts.setdefault(kind, []).append(shift)
    features = {f"shift of {kind}": max(values, key=abs) for kind, values in shifts.items()}
    return {
        **features,
        "shift of all": math.sqrt(sum(value**2 for values in shifts.values() for value in values)),
        "fitted error": math.log(max(found.retuned.fitted_rms, 0.1)),
        "held-out error": math.log(max(found.retuned.held_out_rms or found.retuned.fitted_rms, 0.1)),
    }


def _of_channels(found: RetunedBaseline) -> dict[str, float]:
    by_role: dict[str, list[dict[str, float]]] = {}
    per_run = zip(found.runs, whitened_residuals(found.runs, found.readings), strict=True)
    worst, quietest, size_of_worst = "", math.inf, -math.inf
    for observed, residuals in per_run:
        for observation, residual in zip(observed, residuals, strict=True):
            channel = _of_channel(found, observation, residual)
            by_role.setdefault(_role(observation.channel), []).append(channel)
            quietest = min(quietest, channel["size"])
            if channel["size"] > size_of_worst:
                worst, size_of_worst = observation.channel, channel["size"]
    features = {f"worst is {_role(worst)}": 1.0, "worst over quietest": size_of_worst - quietest}
    everything = [channel for several in by_role.values() for channel in several]
    for role, several in {**by_role, "any": [max(everything, key=lambda channel: channel["size"])]}.items():
        for name in several[0]:
            features[f"{name} of {role}"] = float(
                np.median([channel[name] for channel in several if name in channel])
            )
        features[f"dependence on level of {role}"] = _over_level(several)
        features[f"largest size of {role}"] = max(channel["size"] for channel in several)
    return features


def _of_channel(found: RetunedBaseline, observation: Observation, residual: FloatArray) -> dict[str, float]:
    run = observation.run
    missed = found.forces[run.name].missed[observation.channel]
    recorded = np.nan_to_num(np.asarray(run.recording[observation.channel].values, np.float64))
    rate = run.attributes.sampling_rate_hz
    blocks = np.sqrt(np.mean(residual**2, axis=1))
    shown = np.sqrt(np.mean(residual[observation.informative] ** 2)) if observation.informative.any() else 1.0
    scale = max(float(recorded.std()), 1e-300)
    ratio = max(float(missed.std()) / scale, 1e-6)
    parts = np.array([part.std() / scale for part in np.array_split(missed, _PARTS)])
    peaks = float(np.mean((missed - missed.mean()) ** 4)) / max(float(missed.var()) ** 2, 1e-300)
    left = found.forces[run.name].left.get(observation.channel)
    return {
        "size": math.log(max(float(shown), 0.1)),
        "ratio": math.log(ratio),
        "level": math.log(max(level(run), 1e-9)),
        "growth": growth(parts),
        "impulsiveness": math.log(max(peaks, 0.1)),
        "unsteadiness": float(blocks.std() / max(blocks.mean(), 1e-12)),
        "mean": float(missed.mean()) / scale,
        "mains": _mains_share(missed, rate),
        "alone": 0.0
        if left is None
        else math.log(max(float(left.std()) / max(float(missed.std()), 1e-300), 1e-3)),
        **_with_reading(missed, found.readings[run.name][observation.channel]),
        **{
            f"{name} band": share for name, share in band_shares(missed, rate, _frequency(found, run.name)).items()
        },
    }


def _with_reading(missed: FloatArray, reading: FloatArray) -> dict[str, float]:
    """Correlations of what a channel misses with its simulated reading, its rate, and its largest values."""
    n = min(missed.size, reading.size)
    y = reading[:n] - reading[:n].mean()
    peak = np.sign(y) * np.maximum(np.abs(y) - 0.7 * np.abs(y).max(initial=0.0), 0.0)
    columns = np.column_stack([y, np.gradient(y), peak])
    found = phase_shares(missed[:n], columns)
    return {"along reading": found["x"], "along its rate": found["v"], "at its peaks": found["a"]}


def _of_forces(found: RetunedBaseline) -> dict[str, float]:
    features: dict[str, float] = {}
    places = dict.fromkeys(force.place for of_run in found.forces.values() for force in of_run.forces)
    for place in places:
        forces = [force for of_run in found.forces.values() if (force := of_run.at(place)) is not None]
        several = [_of_force(force) for force in forces]
        for name in several[0]:
            features[f"{name} of force at {place}"] = float(
                np.median([one[name] for one in several if name in one])
            )
        features[f"dependence on level of force at {place}"] = _over_level(several)
    return features


def _of_force(force: LatentForce) -> dict[str, float]:
    rate = force.run.attributes.sampling_rate_hz
    motion = force.motion
    frequency = float(motion[:, 2].std() / max(motion[:, 1].std(), 1e-300)) / (2 * math.pi)
    inertia = max(float(motion[:, 2].std()), 1e-300)
    parts = np.array([part.std() / inertia for part in np.array_split(force.force_n, _PARTS)])
    own, *_ = np.linalg.lstsq(motion / np.maximum(motion.std(axis=0), 1e-300), force.force_n, rcond=1e-8)
    rest = force.force_n - motion / np.maximum(motion.std(axis=0), 1e-300) @ own
    return {
        "size": math.log(max(float(force.force_n.std()) / max(force.standard_error_n, 1e-300), 0.01)),
        "ratio": math.log(max(float(force.force_n.std()) / inertia, 1e-9)),
        "level": math.log(max(level(force.run), 1e-9)),
        "growth": growth(parts),
        "nonlinear share": float(rest.var() / max(float(force.force_n.var()), 1e-300)),
        "mean": float(force.force_n.mean()) / max(float(force.force_n.std()), 1e-300),
        **{f"along {name}": share for name, share in phase_shares(force.force_n, motion).items()},
        **{f"{name} band": share for name, share in band_shares(force.force_n, rate, frequency).items()},
    }


def _of_models(models: Sequence[RegressedModel], found: RetunedBaseline) -> dict[str, float]:
    """Share of the excess over noise that single terms, and the best sparse model of a place, explain."""
    features: dict[str, float] = {}
    before = max(found.retuned.fitted_rms**2, 1e-12)
    for model in models:
        places = {term.place for term in model.terms}
        if len(places) > 1 or (model.threshold is None and len(model.terms) > 1):
            continue
        term = model.terms[0].term if len(model.terms) == 1 else "sparse model"
        name = f"{term} explains at {places.pop()}"
        features[name] = max(features.get(name, 0.0), 1.0 - model.fitted / before)
    return features


def _over_level(several: Sequence[Mapping[str, float]]) -> float:
    """Slope of the logarithm of a ratio over that of the level; 0 where all runs have one level."""
    levels = np.array([one["level"] for one in several])
    if levels.size < 2 or np.ptp(levels) < 0.1:
        return 0.0
    return float(np.polyfit(levels, [one["ratio"] for one in several], 1)[0])


def _mains_share(series: FloatArray, rate_hz: float) -> float:
    """Share of the power of a series within 0.3 Hz of the lines of the mains."""
    power = np.abs(np.fft.rfft((series - series.mean()) * np.hanning(series.size))) ** 2
    frequency = np.fft.rfftfreq(series.size, 1 / rate_hz)
    near = np.min([np.abs(frequency - mains) for mains in MAINS_HZ], axis=0) < 0.3
    return float(power[near].sum() / max(float(power.sum()), 1e-300))


def _frequency(found: RetunedBaseline, run: str) -> float:
    """Of most of a run's motion [Hz]: RMS of acceleration over that of velocity."""
    motion = found.motions[run]
    return float(motion[:, 2].std() / max(float(motion[:, 1].std()), 1e-300)) / (2 * math.pi)


def _spread(found: RetunedBaseline, run: str) -> float:
    """x_rms a_rms / v_rms², one for a motion of one frequency."""
    x, v, a = found.motions[run].std(axis=0)
    return float(x * a / max(v**2, 1e-300))


def _role(channel: str) -> str:
    """What a channel reads, without its number."""
    return channel.rstrip("0123456789").rstrip("_")
