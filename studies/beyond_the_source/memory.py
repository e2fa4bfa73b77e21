"""A model with memory of the liquid's state against one without, on the first cycles of decays.

With memory the network is trained on the slow run, and its break-up on sudden starts, too. Which state the
network sees is chosen by the error of the work in the first cycles of sudden starts that lie between those of the
training. The decays of the beam choose nothing.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.reduced_order_model.agitation import Agitation
from sloshlab.reduced_order_model.break_up_fit import with_break_up
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.sweep.transient_cycles import cycle_works_j, upward_crossings_s
from studies.beyond_the_source.models import RATE_HZ, Workshop
from studies.beyond_the_source.recordings import REST_S, Recordings

FloatArray = NDArray[np.float64]

CANDIDATES: Final[Mapping[str, Agitation | None]] = {
    "no_state": None,
    "speed_0.3s": Agitation("speed", (0.3,)),
}
STARTS: Final = (0, 1)
FIRST_CYCLES: Final = 8
DECAYS_MM: Final = (14.6, 10.0, 6.5)


@dataclass(frozen=True)
class _Runs:
    """What models are trained on and stopped by; the sudden starts between the others choose."""

    slow: LiquidSignals
    slow_validation: LiquidSignals
    starts: list[LiquidSignals]
    between: list[LiquidSignals]


def memory_lines(recordings: Recordings, workshop: Workshop) -> list[str]:
    """Return the table as lines of text.

    Parameters
    ----------
    recordings : Recordings
    workshop : Workshop
    """
    runs = _Runs(
        recordings.vfa(480),
        recordings.vfa(240),
        recordings.sudden_starts(between=False),
        recordings.sudden_starts(between=True),
    )
    without = {
        "slow run only": [_without(workshop, runs, seed, with_starts=False) for seed in STARTS],
        "without memory": [_without(workshop, runs, seed, with_starts=True) for seed in STARTS],
    }
    candidates = {name: _with_memory(workshop, runs, name, 0) for name in CANDIDATES}
    lines = ["rms error of the work of the first cycles of sudden starts between those of the training:"]
    for name, model in {**{name: models[0] for name, models in without.items()}, **candidates}.items():
        lines.append(_choice_line(name, model, runs))
    chosen = min(candidates, key=lambda name: work_error(candidates[name], runs.between))
    lines.append(f"chosen: {chosen} and break-up; {candidates[chosen].break_up}")
    models = {**without, "with memory": [_with_memory(workshop, runs, chosen, seed) for seed in STARTS]}
    for deflection_mm in filter(recordings.has_decays, DECAYS_MM):
        lines += decay_lines(f"decay from {deflection_mm} mm", recordings.decays(deflection_mm), models)
    return lines


def _without(workshop: Workshop, runs: _Runs, seed: int, *, with_starts: bool) -> ReducedOrderModel:
    if not with_starts:
        return workshop.model("slow_no_state", [runs.slow], [runs.slow_validation], seed=seed)
    training, validation = [runs.slow, *runs.starts], [runs.slow_validation, *runs.between]
    return workshop.model("starts_no_state", training, validation, seed=seed)


def _with_memory(workshop: Workshop, runs: _Runs, name: str, seed: int) -> ReducedOrderModel:
    """A model of the slow run, whose break-up is that of the sudden starts."""
    steady = workshop.model(
        f"slow_{name}", [runs.slow], [runs.slow_validation], agitation=CANDIDATES[name], seed=seed
    )
    return with_break_up(steady, [start.run() for start in (runs.slow, *runs.starts)])


def _choice_line(name: str, model: ReducedOrderModel, runs: _Runs) -> str:
    error = 100 * work_error(model, runs.between)
    force = np.nanstd(runs.slow_validation.dynamic_force_n - model.simulate(runs.slow_validation.velocity_m_per_s))
    return f"  {name:20s} {error:6.1f} %   error of the force of the slow run {force:.3f} N"


def work_error(model: ReducedOrderModel, runs: Sequence[LiquidSignals]) -> float:
    """Return the RMS of predicted less measured work of the first cycles over the RMS of the measured."""
    pairs = [_works(run, model) for run in runs]
    measured, predicted = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    return float(np.sqrt(np.mean((predicted - measured) ** 2) / np.mean(measured**2)))


def decay_lines(
    title: str, runs: Sequence[LiquidSignals], models: Mapping[str, Sequence[ReducedOrderModel]]
) -> list[str]:
    """Return work per cycle, measured and of each kind of model, with the scatter of repeats and of starts."""
    measured = np.array([measured_works(run) for run in runs])
    peaks = np.mean([_peak_accelerations_g(run) for run in runs], axis=0)
    lines = [f"{title}: work per cycle in mJ, mean ± standard deviation of repeats and starts"]
    lines.append(f"  {'peak of cycle, g':18s}" + "".join(f"{peak:13.1f}" for peak in peaks))
    lines.append(f"  {'recorded':18s}" + _row(measured))
    for name, kind in models.items():
        found = np.array([[_works(run, model)[1] for run in runs] for model in kind])
        lines.append(f"  {name:18s}" + _row(found.reshape(-1, FIRST_CYCLES)))
        by_start = [
            [100 * _relative(found[start, :, :n], measured[:, :n]) for start in range(len(kind))]
            for n in (2, FIRST_CYCLES)
        ]
        first, whole = (f"{np.mean(errors):.1f} ± {np.std(errors, ddof=1):.1f} %" for errors in by_start)
        lines.append(f"  {'':18s}  rms error of cycles 1–2: {first}; 1–{FIRST_CYCLES}: {whole}")
    repeats = measured - measured.mean(axis=0)
    scatter = np.sqrt(np.mean(repeats[:, :2] ** 2) * 1.5 / np.mean(measured[:, :2] ** 2))
    lines.append(f"  {'repeats scatter by':18s}  {100 * scatter:.1f} % in cycles 1–2")
    return lines


def measured_works(run: LiquidSignals) -> FloatArray:
    """Return the recorded work of the first cycles [J]."""
    return cycle_works_j(run.velocity_m_per_s, run.dynamic_force_n, RATE_HZ, REST_S)[:FIRST_CYCLES]


def _works(run: LiquidSignals, model: ReducedOrderModel) -> tuple[FloatArray, FloatArray]:
    force = model.simulate(run.velocity_m_per_s)
    predicted = cycle_works_j(run.velocity_m_per_s, force, RATE_HZ, REST_S)[:FIRST_CYCLES]
    return measured_works(run), predicted


def _peak_accelerations_g(run: LiquidSignals) -> FloatArray:
    """Amplitude of the velocity times 2πf, which higher modes of the beam do not disturb."""
    ends = upward_crossings_s(run.velocity_m_per_s, RATE_HZ, REST_S)[: FIRST_CYCLES + 1]
    places = np.round(ends * RATE_HZ).astype(int)
    sizes = [np.abs(run.velocity_m_per_s[first:last]).max() for first, last in itertools.pairwise(places)]
    return np.asarray(np.array(sizes) * 2 * np.pi / np.diff(ends) / 9.81)


def _relative(predicted: FloatArray, measured: FloatArray) -> float:
    return float(np.sqrt(np.mean((predicted - measured) ** 2) / np.mean(measured**2)))


def _row(works_j: FloatArray) -> str:
    means, scatter = 1e3 * works_j.mean(axis=0), 1e3 * works_j.std(axis=0, ddof=1)
    return "".join(f"{mean:7.1f} ±{std:4.1f}" for mean, std in zip(means, scatter, strict=True))
