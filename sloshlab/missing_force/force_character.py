"""Character of a latent force: energy, symmetry, state or memory, rate dependence, onset.

Every answer is a number with a 90 % interval by block bootstrap over stretches of the runs, and "cannot tell"
where the interval leaves it open. What errors of the block's own stiffness, damping and mass within their
tolerances explain is subtracted, or widens the interval.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.missing_force.force_levels import Windows, constant_part, onset, orders, windows, work_exponents
from sloshlab.missing_force.force_regression import (
    PARITIES,
    Scales,
    Stretch,
    memory_features,
    normal_sums,
    residual_sum_of_squares,
    ridge_regression,
    state_features,
    stretches,
    time_features,
)
from sloshlab.missing_force.latent_force import LatentForce
from sloshlab.missing_physics.evidence import (
    CANNOT_TELL,
    CONSERVATIVE,
    CONSTANT,
    DISSIPATIVE,
    ENERGY_INPUT,
    EVEN,
    HALF_ORDER,
    IMPULSIVE,
    MEMORY,
    NO_ONSET,
    ODD_IN_BOTH,
    ODD_IN_DISPLACEMENT,
    ODD_IN_VELOCITY,
    ONSET,
    RATE_DEPENDENT,
    RATE_INDEPENDENT,
    SECOND_ORDER,
    STATE_FUNCTION,
    THIRD_ORDER,
    TIME_VARYING,
    WORK_1,
    WORK_2,
    WORK_3,
)

FloatArray = NDArray[np.float64]
LEVEL: Final = 0.90
_N_DRAWS: Final = 120
_NORMAL_90: Final = 1.6449
"""Half width of a 90 % interval in standard deviations."""
_RESOLVED: Final = 0.25
"""Excess of the mean square over that of the noise, from which a force is there."""
_OF_STATE: Final = 0.6
"""Explained share from which a force is a function of the state."""
_IMPULSIVE_KURTOSIS: Final = 5.0
"""Kurtosis from which a force is impulsive; 1.5 for a sine."""
_SMALL_SHARE: Final = 0.08
"""Share of the variance below which a part is absent; it is present above twice of it."""


@dataclass(frozen=True)
class Answer:
    """What one test says.

    Attributes
    ----------
    question, finding : str
        The finding is `CANNOT_TELL` where the interval leaves it open.
    quantity, units : str
        Of the number.
    value, low, high : float
        With its 90 % interval; NaN where there is none.
    says : dict of str to bool
        Terms of `evidence.TERMS` that hold, and that do not; those that are absent are open.
    remark : str
        Why it cannot be told.
    """

    question: str
    finding: str
    quantity: str
    units: str
    value: float
    low: float
    high: float
    says: dict[str, bool]
    remark: str = ""


@dataclass(frozen=True, eq=False)
class ForceCharacter:
    """All answers on the force at one place.

    Attributes
    ----------
    place : str
    size_n, noise_n : float
        RMS of the force beyond the block's own parameters, and of its noise.
    answers : tuple of Answer
    windows : Windows
        Work, force and amplitude per window of some cycles.
    """

    place: str
    size_n: float
    noise_n: float
    answers: tuple[Answer, ...]
    windows: Windows

    @property
    def exceeds_noise(self) -> bool:
        """Whether the force stands out of its noise."""
        return self.size_n**2 > (1 + _RESOLVED) * self.noise_n**2

    @property
    def says(self) -> dict[str, bool]:
        """Terms that hold, and that do not."""
        return {term: holds for answer in self.answers for term, holds in answer.says.items()}


def force_character(
    forces: Sequence[LatentForce],
    own_tolerances: FloatArray,
    *,
    damping_shift: float = 0.0,
    seed: int = 0,
) -> ForceCharacter:
    """Ask all questions.

    Parameters
    ----------
    forces : sequence of LatentForce
        Of all runs, at one place, not empty.
    own_tolerances : ndarray, shape (3,)
        Standard deviations of the block's own stiffness, damping and mass, in N per m, m/s, m/s².
    damping_shift : float
        How much more damping the baseline has than is believed [N s/m]: retuning may have hidden the force there.
    seed : int
        Of the draws for intervals.
    """
    # A dissipative force is hidden first of all in a damping that was retuned too high; what was added there is
    # asked for with the force.
    shifted = [_with_damping(force, damping_shift) for force in forces]
    parts = stretches(shifted)
    noise = float(np.sqrt(np.mean([force.standard_error_n**2 for force in forces])))
    fit = _Regression(parts, own_tolerances, np.random.default_rng(seed))
    size = float(np.sqrt(np.mean(fit.beyond_own**2)))
    found = windows(parts, fit.beyond_spring_of_parts, float(own_tolerances[1]))
    if size**2 <= (1 + _RESOLVED) * noise**2:
        nothing = Answer(
            "is there a force", "none beyond noise", "RMS over noise", "1", size / max(noise, 1e-300),
            float("nan"), float("nan"), {}, "nothing can be asked of a force that does not stand out of its noise",
        )  # fmt: skip
        return ForceCharacter(forces[0].place, size, noise, (nothing,), found)
    generator = np.random.default_rng(seed + 1)
    answers = (
        _energy(found, own_tolerances[1], generator),
        *_symmetry(fit),
        *_history(fit, noise),
        *work_exponent_answers(found, generator),
        onset_answer(found, parts, own_tolerances, noise, generator),
        *_order_answers(shifted, fit, generator),
        _constant(fit, generator),
        _impulsiveness(fit, noise),
    )
    return ForceCharacter(forces[0].place, size, noise, answers, found)


def _with_damping(latent_force: LatentForce, shift: float) -> LatentForce:
    return replace(latent_force, force_n=latent_force.force_n - shift * latent_force.motion[:, 1])


class _Regression:
    """Regressions of the force on the block's own parameters, the state, memory and time, with a bootstrap."""

    def __init__(self, parts: Sequence[Stretch], own: FloatArray, generator: np.random.Generator) -> None:
        self.parts, self.generator = parts, generator
        scales = Scales.of(parts)
        rows, self.normal_sums = [], []
        parity = np.zeros(0, np.int64)
        for part in parts:
            state, parity = state_features(part, scales)
            columns = (part.own * own, state, memory_features(part, scales), time_features(part, scales))
            features = np.concatenate(columns, axis=1)
            rows.append(features)
            self.normal_sums.append(normal_sums(features, part.force_n))
        widths = np.cumsum([0, *[part.shape[1] for part in columns]])
        own_, state_, memory_, time_ = (np.arange(a, b) for a, b in pairwise(widths))
        state_ = state_[parity >= 0]
        self.parity = parity
        self.sets = {
            "own": own_,
            "state": np.concatenate([own_, state_]),
            "memory": np.concatenate([own_, state_, memory_]),
            "time": np.concatenate([own_, state_, time_]),
        }
        self.state_columns = state_
        spread = float(np.median([part.a.std() / max(part.v.std(), 1e-300) for part in parts]))
        duration = sum(float(part.time_s[-1] - part.time_s[0]) for part in parts)
        n = sum(part.force_n.size for part in parts)
        # Samples are far closer than independent readings, of which there are about as many as the motion has
        # radians.
        per_sample = np.sqrt(max(4.0, duration * spread) / n)
        self.prior = np.full(widths[-1], 3.0 / per_sample)
        self.prior[own_] = np.where(own > 0, 1.0 / (scales.force / per_sample), 1e-9)
        self.rows = rows
        # The block's own parameters first, within their tolerances: what they can follow is not missing.
        alone = ridge_regression(self.normal_sums, self.prior, own_)
        self.beyond_own_of_parts = [part.force_n - row @ alone for part, row in zip(parts, rows, strict=True)]
        self.beyond_own = np.concatenate(self.beyond_own_of_parts)
        # What the block's own damping can follow stays in the windows: it becomes the doubt of their work.
        spring = alone.copy()
        spring[own_[1]] = 0.0
        self.beyond_spring_of_parts = [part.force_n - row @ spring for part, row in zip(parts, rows, strict=True)]

    def draw(self) -> list[int]:
        """Stretches drawn with replacement."""
        return [int(i) for i in self.generator.integers(0, len(self.parts), len(self.parts))]

    def parity_shares(self, chosen: Sequence[int]) -> FloatArray:
        """Share of the variance of the state's part per parity, shape (4,)."""
        picked = [self.normal_sums[i] for i in chosen]
        numbers = ridge_regression(picked, self.prior, self.sets["state"])
        xx = np.sum([part.xx for part in picked], axis=0)
        powers = np.zeros(4)
        for which in range(4):
            part = np.zeros(numbers.size)
            columns = self.state_columns[self.parity == which]
            part[columns] = numbers[columns]
            powers[which] = float(part @ xx @ part)
        return np.asarray(powers / max(float(powers.sum()), 1e-300), np.float64)

    def explained_shares(self, noise_n: float, n_draws: int) -> dict[str, FloatArray]:
        """Cross-validated explained shares, every second stretch in turn; bootstrap draws after the first.

        Shape (1 + n_draws,) per set of features.
        """
        n = len(self.normal_sums)
        rest = {name: np.zeros(n) for name in self.sets}
        # Judged on stretches that were not fitted: memory and time have more features than the state and would
        # win on the same.
        for first in (0, 1):
            fitted, judged = self.normal_sums[1 - first :: 2], range(first, n, 2)
            for name, columns in self.sets.items():
                numbers = ridge_regression(fitted, self.prior, columns)
                rest[name][list(judged)] = [
                    residual_sum_of_squares([self.normal_sums[i]], numbers) for i in judged
                ]
        expected = noise_n**2 * np.array([part.n for part in self.normal_sums])
        draws = [np.arange(n), *[self.generator.integers(0, n, n) for _ in range(n_draws)]]
        found: dict[str, list[float]] = {name: [] for name in self.sets}
        for drawn in draws:
            own = float(rest["own"][drawn].sum())
            # A share of what can be explained, the noise left out.
            whole = max(own - float(expected[drawn].sum()), 0.1 * own, 1e-300)
            for name, values in rest.items():
                found[name].append((own - float(values[drawn].sum())) / whole)
        return {name: np.array(shares) for name, shares in found.items()}


def _quantiles(draws: Sequence[float] | FloatArray) -> tuple[float, float]:
    low, high = np.quantile(np.asarray(draws), (0.05, 0.95))
    return float(low), float(high)


def _energy(found: Windows, own_damping: float, generator: np.random.Generator) -> Answer:
    """Dissipated work over force times path, by RMS values: 1 dissipates all, −1 feeds all in."""
    scale = found.force_rms_n * found.velocity_m_per_s
    dissipated = -found.power_w
    doubt = own_damping * found.velocity_m_per_s**2
    keep = scale > 0
    if keep.sum() < 4:
        return _undecided("energy", "work over force times path", "1", "too few cycles")

    def share(index: NDArray[np.int64]) -> float:
        return float(dissipated[keep][index].sum() / scale[keep][index].sum())

    n = int(keep.sum())
    value = share(np.arange(n))
    low, high = _quantiles([share(generator.integers(0, n, n)) for _ in range(_N_DRAWS)])
    # The damping is off by the same in all windows: these doubts add up and do not average out.
    margin = _NORMAL_90 * float(doubt[keep].sum() / scale[keep].sum())
    low = max(value - float(np.hypot(value - low, margin)), -1.0)
    high = min(value + float(np.hypot(high - value, margin)), 1.0)
    if low > 0.03:
        finding, says = DISSIPATIVE, {DISSIPATIVE: True, ENERGY_INPUT: False, CONSERVATIVE: False}
    elif high < -0.03:
        finding, says = ENERGY_INPUT, {DISSIPATIVE: False, ENERGY_INPUT: True, CONSERVATIVE: False}
    elif low > -0.15 and high < 0.15:
        finding, says = CONSERVATIVE, {DISSIPATIVE: False, ENERGY_INPUT: False, CONSERVATIVE: True}
    else:
        return Answer(
            "energy", CANNOT_TELL, "work over force times path", "1", value, low, high, {},
            "its sign is within the interval, which holds what the block's own damping may be off",
        )  # fmt: skip
    return Answer("energy", finding, "work over force times path", "1", value, low, high, says)


def _symmetry(fit: _Regression) -> list[Answer]:
    everything = range(len(fit.parts))
    shares = fit.parity_shares(everything)
    draws = np.array([fit.parity_shares(fit.draw()) for _ in range(_N_DRAWS)])
    low, high = np.quantile(draws, (0.05, 0.95), axis=0)
    answers = []
    terms = (EVEN, ODD_IN_DISPLACEMENT, ODD_IN_VELOCITY, ODD_IN_BOTH)
    for which, (parity, term) in enumerate(zip(PARITIES, terms, strict=True)):
        largest = which == int(np.argmax(shares))
        # An even part and one odd in both hold beside whatever else there is, one odd in a single motion only as
        # the largest: that is what the terms say.
        says: dict[str, bool] = {}
        if high[which] < 2 * _SMALL_SHARE:
            says[term] = False
        elif low[which] > 2 * _SMALL_SHARE and (which in (0, 3) or largest):
            says[term] = True
        finding = term if says.get(term) else f"not {term}" if term in says else CANNOT_TELL
        answers.append(
            Answer(
                f"symmetry: {parity}",
                finding,
                "share of the variance",
                "1",
                float(shares[which]),
                min(float(low[which]), float(shares[which])),
                max(float(high[which]), float(shares[which])),
                says,
            )
        )
    return answers


def _history(fit: _Regression, noise_n: float) -> list[Answer]:
    shares = fit.explained_shares(noise_n, _N_DRAWS)
    state, memory, time = shares["state"], shares["memory"], shares["time"]
    answers = [
        _added_share("history", "more by its history", memory - state, MEMORY),
        _added_share("along the run", "more by time", time - state, TIME_VARYING),
    ]
    value, (low, high) = float(state[0]), _quantiles(state)
    says: dict[str, bool] = {}
    if (
        any(answer.says.get(term) for answer, term in zip(answers, (MEMORY, TIME_VARYING), strict=True))
        or high < 0.4
    ):
        says[STATE_FUNCTION] = False
    elif low > _OF_STATE:
        says[STATE_FUNCTION] = True
    finding = STATE_FUNCTION if says.get(STATE_FUNCTION) else f"not: {STATE_FUNCTION}" if says else CANNOT_TELL
    quantity = "share of the variance by the present motion"
    return [Answer("state", finding, quantity, "1", value, low, high, says), *answers]


def _added_share(question: str, quantity: str, draws: FloatArray, term: str) -> Answer:
    value = float(draws[0])
    low, high = _quantiles(draws)
    # A term holds, or does not, only by the whole interval; between them it is open and no evidence.
    says = {term: True} if low > _SMALL_SHARE else {term: False} if high < _SMALL_SHARE else {}
    finding = term if says.get(term) else f"not: {term}" if term in says else CANNOT_TELL
    return Answer(question, finding, f"share of the variance, {quantity}", "1", value, low, high, says)


def _undecided(question: str, quantity: str, units: str, why: str) -> Answer:
    nan = float("nan")
    return Answer(question, CANNOT_TELL, quantity, units, nan, nan, nan, {}, why)


def work_exponent_answers(found: Windows, generator: np.random.Generator) -> list[Answer]:
    """How the work per cycle grows with amplitude and frequency."""
    result = work_exponents(found, generator)
    answers = []
    for name, estimate in (("amplitude", result.amplitude), ("frequency", result.frequency)):
        question = "work over amplitude" if name == "amplitude" else "work over frequency"
        if estimate is None:
            answers.append(_undecided(question, f"exponent of the {name}", "1", result.why[name]))
            continue
        value, low, high = estimate
        says: dict[str, bool] = {}
        if name == "amplitude":
            for term, exponent in ((WORK_1, 1.0), (WORK_2, 2.0), (WORK_3, 3.0)):
                if not low - 0.15 < exponent < high + 0.15:
                    says[term] = False
                elif high - low < 0.9:
                    says[term] = True
            # Where two exponents are possible none of them holds; those that are excluded stay so.
            if sum(says.values()) > 1:
                says = {term: holds for term, holds in says.items() if not holds}
        elif low > 0.35:
            says = {RATE_DEPENDENT: True, RATE_INDEPENDENT: False}
        elif high < 0.5 and low > -0.5:
            says = {RATE_DEPENDENT: False, RATE_INDEPENDENT: True}
        held = [term for term, holds in says.items() if holds]
        answers.append(
            Answer(
                question, held[0] if held else CANNOT_TELL, f"exponent of the {name}", "1", value, low, high, says
            )
        )
    return answers


def onset_answer(
    found: Windows, parts: Sequence[Stretch], own: FloatArray, noise_n: float, generator: np.random.Generator
) -> Answer:
    """The level below which the block's own parameters describe the force."""
    result = onset(parts, own, noise_n, generator)
    quantity = "acceleration below which it is nothing"
    if result is None:
        levels = f"{found.level_g.min():.2g} to {found.level_g.max():.2g} g"
        return _undecided("onset", quantity, "g", f"levels reach from {levels} only")
    value, low, high, at_lowest = result
    if at_lowest:
        return Answer("onset", NO_ONSET, quantity, "g", value, low, high, {ONSET: False, NO_ONSET: True})
    if high > found.level_g.max():
        return Answer("onset", CANNOT_TELL, quantity, "g", value, low, high, {}, "seen at the largest level alone")
    return Answer("onset", ONSET, quantity, "g", value, low, high, {ONSET: True, NO_ONSET: False})


def _order_answers(
    forces: Sequence[LatentForce], fit: _Regression, generator: np.random.Generator
) -> list[Answer]:
    answers = []
    result = orders(forces, fit.beyond_own_of_parts, generator)
    for term, order in ((HALF_ORDER, 0.5), (SECOND_ORDER, 2.0), (THIRD_ORDER, 3.0)):
        quantity = f"share of the variance at order {order:g}"
        if result is None:
            answers.append(_undecided(f"order {order:g}", quantity, "1", "the motion has no single frequency"))
            continue
        value, low, high = result[order]
        says = {term: True} if low > _SMALL_SHARE else {term: False} if high < _SMALL_SHARE else {}
        finding = term if says.get(term) else f"no {term}" if term in says else CANNOT_TELL
        answers.append(Answer(f"order {order:g}", finding, quantity, "1", value, low, high, says))
    return answers


def _constant(fit: _Regression, generator: np.random.Generator) -> Answer:
    value, low, high, rms = constant_part(fit.beyond_own_of_parts, generator)
    says: dict[str, bool] = {}
    if low > 0.1 * rms or high < -0.1 * rms:
        says[CONSTANT] = True
    elif max(abs(low), abs(high)) < 0.2 * rms:
        says[CONSTANT] = False
    finding = CONSTANT if says.get(CONSTANT) else "no constant part" if says else CANNOT_TELL
    return Answer("mean", finding, "mean force", "N", value, low, high, says)


def _impulsiveness(fit: _Regression, noise_n: float) -> Answer:
    """Kurtosis within some cycles: 1.5 for a sine, large for rare impulses."""
    found = []
    for force in fit.beyond_own_of_parts:
        size = float(np.sqrt(np.mean(force**2)))
        if size > 2 * noise_n and force.size > 8:
            found.append((_kurtosis(force), size))
    if len(found) < 4:
        return _undecided("blows", "kurtosis within some cycles", "1", "too few cycles stand out of the noise")
    table = np.array(found)

    def mean(rows: NDArray[np.int64]) -> float:
        return float(np.average(table[rows, 0], weights=table[rows, 1]))

    n = len(found)
    value = mean(np.arange(n))
    low, high = _quantiles([mean(fit.generator.integers(0, n, n)) for _ in range(_N_DRAWS)])
    says = (
        {IMPULSIVE: True}
        if low > _IMPULSIVE_KURTOSIS
        else {IMPULSIVE: False}
        if high < _IMPULSIVE_KURTOSIS
        else {}
    )
    finding = IMPULSIVE if says.get(IMPULSIVE) else f"not {IMPULSIVE}" if says else CANNOT_TELL
    return Answer("blows", finding, "kurtosis within some cycles", "1", value, low, high, says)


def _kurtosis(series: FloatArray) -> float:
    centred = series - series.mean()
    return float(np.mean(centred**4) / max(float(np.mean(centred**2)) ** 2, 1e-300))
