"""Whether runs that call themselves repeats of one test are of one rig.

What a rig repeats is its natural frequency, its damping, and its gain from drive to response; where a run starts,
its zero and its noise it need not. Decays are compared at common amplitudes, since stiffness and loss may depend
on them; driven
runs by their largest mode, or by the factor between their transfer functions where they show none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student_t

from sloshlab.configurations import SLOSHING
from sloshlab.errors import AnalysisError
from sloshlab.identification.case import Case, CaseRun
from sloshlab.identification.diagnosed_model import DiagnosedModel
from sloshlab.modal.driven_mode import (
    LARGEST_STRETCH,
    N_BLOCKS,
    Transfer,
    driven_mode,
    resonance_hz,
    transfer_of,
)
from sloshlab.modal.instantaneous_damping import InstantaneousDamping, Trust
from sloshlab.modal.local_sine_fit import local_sine_fit

FloatArray = NDArray[np.float64]
_FALSE_ALARM: Final = 1e-5
"""Probability of a difference as significant as what is refused, in repeats of one rig: with ten comparisons
a case that is one false alarm in ten thousand cases."""
_LEAST_DIFFERENCES: Final = {"frequency": 0.01, "damping": 0.4, "gain": 0.04}
"""Relative differences that are worth a refusal, twice what one rig may change by from run to run: half a per cent
of a frequency, as aluminium that is 20 K warmer, a fifth of a damping ratio, and a per cent of each of two sensors
(the tolerances of a rig description)."""
_MANY_ERRORS: Final = 100.0
"""Beyond it a number of standard errors says no more."""
_SHARE_OF_LIQUID: Final = 0.25
"""Of the mass of a moving liquid, that may take part in one repeat and not in the next: chaos. Means of many
cycles miss up to 0.17 of it (β, ``docs/virtual_laboratory.md``), single decays half as much again."""
_FEWEST_SAMPLES: Final = 64
"""Without a gap: fewer hold no eight cycles of eight samples."""
_LEAST_SAMPLES_PER_CYCLE: Final = 8.0
"""Of a decay that is read cycle by cycle, as `sloshlab.modal.release` needs them."""


@dataclass(frozen=True)
class RepeatDifference:
    """Something that two runs of one test do not repeat.

    Attributes
    ----------
    runs : tuple of str
        Names of the two.
    what : str
        ``frequency``, ``damping`` or ``gain``.
    values : tuple of float
        Of the two runs: hertz, damping ratio, or gain relative to the first.
    n_errors : float
        Their difference in standard errors.
    """

    runs: tuple[str, str]
    what: str
    values: tuple[float, float]
    n_errors: float

    @property
    def statement(self) -> str:
        """One line with numbers.

        Examples
        --------
        >>> RepeatDifference(("a", "b"), "frequency", (6.42, 6.61), 9.2).statement
        'runs a and b call themselves repeats: their frequencies are 6.42 and 6.61 Hz, 9 standard errors apart'
        """
        first, other = self.values
        errors = f"{self.n_errors:.0f}" if self.n_errors < _MANY_ERRORS else f"more than {_MANY_ERRORS:.0f}"
        said = {
            "frequency": f"their frequencies are {first:.4g} and {other:.4g} Hz",
            "damping": f"their damping ratios are {100 * first:.3g} and {100 * other:.3g} %",
            "gain": f"the same drive moves the second {other:.3g} times as much as the first",
        }[self.what]
        a, b = self.runs
        return f"runs {a} and {b} call themselves repeats: {said}, {errors} standard errors apart"


@dataclass(frozen=True)
class _Estimate:
    """A relative difference of two runs in one channel, its standard error, and the least that matters."""

    what: str
    values: tuple[float, float]
    relative: float
    std: float
    n_free: float
    least: float = 0.0

    @property
    def is_told(self) -> bool:
        """Whether a difference worth a refusal would have been seen."""
        return self._n_needed * self.std < self.least

    @property
    def differs(self) -> bool:
        """Beyond what one rig repeats, and beyond its error."""
        return abs(self.relative) > max(self.least, self._n_needed * self.std)

    @property
    def _n_needed(self) -> float:
        return float(student_t.isf(0.5 * _FALSE_ALARM, self.n_free))


def require_repeats(case: Case, model: DiagnosedModel) -> None:
    """Refuse runs that call themselves repeats of one test and are of different rigs.

    Parameters
    ----------
    case : Case
    model : DiagnosedModel

    Raises
    ------
    AnalysisError
        The largest difference, in one line.
    """
    found = repeat_differences(case, model)
    if found:
        worst = max(found, key=lambda difference: difference.n_errors)
        raise AnalysisError(
            worst.statement,
            allowed="repeats of one rig",
            remedy="make a case of each, or correct the attribute `test`",
        )


def repeat_differences(case: Case, model: DiagnosedModel) -> list[RepeatDifference]:
    """What runs of one test do not repeat.

    Parameters
    ----------
    case : Case
    model : DiagnosedModel
        Says which channels drive and which are compared.

    Returns
    -------
    list of RepeatDifference
        Empty where all repeats are of one rig, or too short or noisy to tell.

    Notes
    -----
    A difference counts where *every* channel that could tell it shows it, in the same direction: a sensor that has
    become another one is a fault of that sensor, and no other rig.
    """
    differences = []
    for first, other in _claimed_pairs(case):
        least = _least_differences(first, case, model)
        estimates = [
            replace(estimate, least=least[estimate.what])
            for estimate in _estimates(first, other, model)
            if estimate.what in least
        ]
        for what in least:
            told = [estimate for estimate in estimates if estimate.what == what and estimate.is_told]
            if told and all(estimate.differs for estimate in told) and _agree(told):
                lowest = min(told, key=lambda estimate: abs(estimate.relative) / estimate.std)
                n_errors = abs(lowest.relative) / lowest.std
                differences.append(RepeatDifference((first.name, other.name), what, lowest.values, n_errors))
    return differences


def _least_differences(run: CaseRun, case: Case, model: DiagnosedModel) -> dict[str, float]:
    """Relative differences that matter; the mass and the damping of a moving liquid scatter."""
    if run.attributes.configuration != SLOSHING:
        return dict(_LEAST_DIFFERENCES)
    moving = 0.0 if case.rig is None else _SHARE_OF_LIQUID * case.rig.liquid_mass_kg / model.moving_mass_kg
    # A frequency goes with the root of the mass.
    scatter = {"frequency": 0.5 * moving, "gain": moving}
    return {what: max(_LEAST_DIFFERENCES[what], size) for what, size in scatter.items()}


def _agree(estimates: Sequence[_Estimate]) -> bool:
    return len({np.sign(estimate.relative) for estimate in estimates}) == 1


def _claimed_pairs(case: Case) -> Iterator[tuple[CaseRun, CaseRun]]:
    """The first run of each test with each other one that calls itself its repeat, whatever it recorded."""
    groups: list[list[CaseRun]] = []
    for run in case.runs:
        group = next((group for group in groups if _is_claimed(case, group[0], run)), None)
        if group is None:
            groups.append([run])
        else:
            yield group[0], run
            group.append(run)


def _is_claimed(case: Case, first: CaseRun, other: CaseRun) -> bool:
    together = any({first.name, other.name} <= set(names) for names in case.names_by_test())
    return together or (first.attributes.repeat != other.attributes.repeat and _claim(first) == _claim(other))


def _claim(run: CaseRun) -> dict[str, str]:
    """Repeats of one test share every attribute but these."""
    own = ("run_id", "start_time_utc", "repeat", "seed")
    return {str(name): str(value) for name, value in run.recording.attrs.items() if name not in own}


def _estimates(first: CaseRun, other: CaseRun, model: DiagnosedModel) -> Iterator[_Estimate]:
    rate = first.attributes.sampling_rate_hz
    if other.attributes.sampling_rate_hz != rate:
        return
    driving = [name for name in model.driving(first) if name in first.recording and name in other.recording]
    is_free = first.is_free or not driving
    for name in model.compared(first):
        if name in driving or name not in other.recording:
            continue
        names = [name] if is_free else [driving[0], name]
        known = _known_together(first, other, names)
        if known is None:
            continue
        pair = _decay_estimates if is_free else _driven_estimates
        yield from pair(*known, rate)


def _known_together(first: CaseRun, other: CaseRun, names: Sequence[str]) -> tuple[FloatArray, FloatArray] | None:
    """The longest stretch without lost samples in both runs, (n_names, n) each."""
    n = min(first.recording.sizes["time"], other.recording.sizes["time"])
    series = [
        np.stack([np.asarray(run.recording[name].values[:n], np.float64) for name in names])
        for run in (first, other)
    ]
    known = np.concatenate([[False], np.isfinite(np.concatenate(series)).all(axis=0), [False]])
    edges = np.flatnonzero(np.diff(known.astype(int)))
    if not edges.size:
        return None
    begin, end = max(zip(edges[::2], edges[1::2], strict=True), key=lambda edge: edge[1] - edge[0])
    if end - begin < _FEWEST_SAMPLES:
        return None
    a, b = (part[:, begin:end] - part[:, begin:end].mean(axis=1, keepdims=True) for part in series)
    return (a, b) if a.std(axis=1).all() and b.std(axis=1).all() else None


def _decay_estimates(a: FloatArray, b: FloatArray, rate_hz: float) -> Iterator[_Estimate]:
    decays = _decays(a[0], b[0], rate_hz)
    if decays is None:
        return
    first, other = decays
    for what, of, std in (
        ("frequency", "frequency_hz", "frequency_hz_std"),
        ("damping", "damping_ratio", "damping_ratio_std"),
    ):
        pairs = _at_common_amplitudes(first, other, of, std)
        if pairs is None:
            continue
        mine, its, variance = pairs
        weight = 1.0 / variance
        means = tuple(float(np.sum(weight * values) / weight.sum()) for values in (mine, its))
        difference = means[1] - means[0]
        n_free = mine.size - 1
        # What scatters between the stretches of one run more than its noise says is no difference of two rigs.
        excess = float(np.sum(weight * (its - mine - difference) ** 2)) / n_free
        size = 0.5 * (means[0] + means[1])
        # Noise has damping ratios of either sign.
        if min(means) > 0:
            error = float(np.sqrt(max(1.0, excess) / weight.sum()))
            yield _Estimate(what, (means[0], means[1]), difference / size, error / size, n_free)


def _decays(a: FloatArray, b: FloatArray, rate_hz: float) -> tuple[InstantaneousDamping, ...] | None:
    """Both read stretch by stretch, about the line that is largest in both together."""
    power = [np.abs(np.fft.rfft(values * np.hanning(values.size))) ** 2 for values in (a, b)]
    lines = np.fft.rfftfreq(a.size, 1.0 / rate_hz)
    if lines.size < 4:
        return None
    joint = lines[2:][int(np.argmax((power[0] * power[1])[2:]))]
    if joint * _LEAST_SAMPLES_PER_CYCLE > rate_hz:
        return None
    near = np.flatnonzero(np.abs(lines - joint) <= LARGEST_STRETCH * joint)
    found = []
    for values, spectrum in zip((a, b), power, strict=True):
        own = float(lines[near][int(np.argmax(spectrum[near]))])
        try:
            decay = local_sine_fit(values, rate_hz, frequency_hz=own)[0]
        except AnalysisError:
            return None
        near_it = np.abs(decay.frequency_hz / joint - 1) <= 2 * LARGEST_STRETCH
        found.append(replace(decay, trust=np.where(near_it, decay.trust, str(Trust.NOISE))))
    return tuple(found)


def _at_common_amplitudes(
    first: InstantaneousDamping, other: InstantaneousDamping, of: str, std: str
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Values of both at amplitudes of the first, and the variance of their differences; three at least."""
    # The second is read between its stretches, over falling amplitudes only.
    kept, last = [], np.inf
    for i in np.flatnonzero(other.used):
        if other.acceleration_amplitude_m_per_s2[i] < last:
            kept.append(i)
            last = other.acceleration_amplitude_m_per_s2[i]
    mine = first.used
    if len(kept) < 3 or mine.sum() < 3:
        return None
    amplitudes = np.log(other.acceleration_amplitude_m_per_s2[kept])[::-1]
    at = np.log(first.acceleration_amplitude_m_per_s2[mine])
    values, errors = (np.interp(at, amplitudes, getattr(other, name)[kept][::-1]) for name in (of, std))
    common = (at >= amplitudes[0]) & (at <= amplitudes[-1])
    if common.sum() < 3:
        return None
    variance = getattr(first, std)[mine] ** 2 + errors**2
    floor = (1e-6 * np.abs(getattr(first, of)[mine])) ** 2 + 1e-300
    return getattr(first, of)[mine][common], values[common], np.maximum(variance, floor)[common]


def _driven_estimates(a: FloatArray, b: FloatArray, rate_hz: float) -> Iterator[_Estimate]:
    """Of the largest mode where both show one, otherwise the gain from drive to response."""
    first, other = transfer_of(a, rate_hz), transfer_of(b, rate_hz)
    largest = resonance_hz(first, other)
    modes = [driven_mode(pair[0], pair[1], rate_hz, near_hz=largest) for pair in (a, b)] if largest else [None]
    if all(modes):
        mine, its = (mode for mode in modes if mode)
        # Block by block, since what one mode does not explain is the same in both where they share their drive.
        errors = np.sqrt(((its.influence - mine.influence) ** 2).sum(axis=0) * N_BLOCKS / (N_BLOCKS - 2))
        for what, values, error in (
            ("frequency", (mine.frequency_hz, its.frequency_hz), errors[0]),
            ("damping", (mine.damping_ratio, its.damping_ratio), errors[1]),
        ):
            relative = 2 * (values[1] - values[0]) / (values[1] + values[0])
            yield _Estimate(what, values, relative, max(float(error), 1e-9), N_BLOCKS - 2)
    elif not any(modes):
        yield from _gain_estimates(first, other)


def _gain_estimates(first: Transfer, other: Transfer) -> Iterator[_Estimate]:
    """Factor of the second over the first, by weighted least squares over driven lines."""
    driven = np.flatnonzero(first.is_driven & other.is_driven & (first.frequency_hz > 0))
    if driven.size < 3:
        return
    weight = 1.0 / (first.variance + other.variance)[driven]
    mine, its = first.value[driven], other.value[driven]
    power = float(np.sum(weight * np.abs(mine) ** 2))
    factor = float(np.sum(weight * (mine.conj() * its).real)) / power
    # A Hann window spreads each line over one and a half.
    n_free = max(2 * driven.size / 1.5 - 1, 1.0)
    excess = float(np.sum(weight * np.abs(its - factor * mine) ** 2)) / driven.size
    yield _Estimate("gain", (1.0, factor), factor - 1.0, float(np.sqrt(0.75 * max(1.0, excess) / power)), n_free)
