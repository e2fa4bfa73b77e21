"""The result in words and numbers, for the top of the report."""

from __future__ import annotations

import numpy as np

from pipelines.report.numbers import interval, text
from pipelines.structure.results import BeamExperiment, in_g


def sentences(experiment: BeamExperiment) -> tuple[str, ...]:
    """What a reader should take away; one sentence per result."""
    n_free, n_random = len(experiment.free_runs), len(experiment.random_runs)
    what = "beam" if experiment.kind == "beam" else "guided tank"
    first = f"{len(experiment.runs)} runs of one {what}: {n_free} free "
    first += f"decay{'s' if n_free != 1 else ''} and {n_random} in random motion."
    lines = (_frozen(experiment), _sloshing(experiment), _ratio(experiment), _random(experiment))
    return (first, *(line for line in lines if line))


def _frozen(experiment: BeamExperiment) -> str:
    found = experiment.frozen_modes.get(0)
    if found is None:
        return ""
    return (
        f"With the liquid frozen the first mode has {found.frequency_hz:.2f} Hz and ζ = "
        f"{text(100 * found.damping_ratio)} % "
        f"(the rig states {experiment.modes.frequency_hz[0]:.4g} Hz)."
    )


def _sloshing(experiment: BeamExperiment) -> str:
    pooled = experiment.pooled.get(("sloshing", "local sine fit"))
    if pooled is None:
        return ""
    at = int(np.argmax(pooled.damping_ratio))
    amplitude = in_g(pooled.acceleration_amplitude_m_per_s2)
    return (
        f"With the liquid free ζ₁ depends on the amplitude: it lies in {interval(100 * pooled.damping_ratio)} % "
        "between "
        f"{interval(amplitude, 2)} g and is largest near {text(amplitude[at], 2)} g (mean over "
        f"{int(pooled.n_repeats.max())} release{'s' if pooled.n_repeats.max() > 1 else ''}, local sine fit)."
    )


def _ratio(experiment: BeamExperiment) -> str:
    frozen = experiment.pooled.get(("frozen", "local sine fit"))
    sloshing = experiment.pooled.get(("sloshing", "local sine fit"))
    if frozen is None or sloshing is None:
        return ""
    log_frozen, log_sloshing = (np.log(pooled.acceleration_amplitude_m_per_s2) for pooled in (frozen, sloshing))
    common = (log_sloshing >= log_frozen.min()) & (log_sloshing <= log_frozen.max())
    if not common.any():
        return ""
    ratio = sloshing.damping_ratio[common] / np.interp(log_sloshing[common], log_frozen, frozen.damping_ratio)
    return f"At equal amplitude the liquid multiplies the damping by {interval(ratio, 2)}."


def _random(experiment: BeamExperiment) -> str:
    parts = []
    for run in experiment.random_runs:
        fit = run.random.density_fit if run.random is not None else None
        if fit is not None and not run.is_simulated:
            parts.append(f"{text(100 * fit.damping_ratio)} % ({run.label})")
    return f"In random motion ζ₁ is {', '.join(parts)}, from the tank's density alone." if parts else ""
