"""Forces that do not depend on the motion: pulses, and a machine that runs by itself, at structure or tank.

What repeats from run to run is size, period and frequency; instants and phases are numbers of every run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import ceil, isclose, log, log1p, pi
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sloshlab.missing_physics.candidate import (
    Effect,
    EffectParameter,
    MissingForces,
    Numbers,
    Surroundings,
    in_run,
    multiples,
    register,
)
from sloshlab.missing_physics.effects import scales
from sloshlab.missing_physics.effects.force_effect import has_structure
from sloshlab.missing_physics.evidence import IMPULSIVE, MEMORY, TIME_VARYING
from sloshlab.missing_physics.extension import Extension
from sloshlab.missing_physics.prior import Range
from sloshlab.twin.external_forces import HARMONIC_FORCE, PULSE_TRAIN
from sloshlab.twin.terms import Term

FloatArray = NDArray[np.float64]
_WIDTHS: Final = (0.1, 0.25, 0.5, 1.0, 2.0)
"""Of pulses that are sought in a missing force, in periods of the motion; wider ones are a slow force."""
_PLACES_PER_WIDTH: Final = 8
"""At which a pulse is sought: off by a sixteenth of its width, a raised cosine explains five per cent less."""
_MOST_LINES: Final = 3
"""Of a missing force, that are proposed."""


def _of_run(numbers: Numbers, name: str, run: str) -> float:
    """A number that every run has of its own, or all have alike."""
    return numbers.get(in_run(name, run), numbers.get(name, 0.0))


def _in_every_run(term: Callable[[Numbers, str, Surroundings], Term]) -> Callable[..., Extension]:
    def extension(numbers: Numbers, at: Surroundings, channel: str) -> Extension:
        del channel
        return Extension(run_terms={run: (term(numbers, run, at),) for run in at.runs})

    return extension


def _can_act(block: str) -> Callable[[Surroundings], bool]:
    """In runs that are known by their names, at a block that is there."""
    return lambda at: bool(at.runs) and (block == "tank" or has_structure(at))


# --- pulses ----------------------------------------------------------------------------------------------------


def _pulse_numbers(earliest_start: float) -> tuple[EffectParameter, ...]:
    """Of a train that begins at the earliest start [lengths of a run] or later."""
    return (
        EffectParameter("size_n", -1e7, 1e7, range=Range(1e-3, 10.0, scales.force, may_be_negative=True)),
        EffectParameter("period_s", 1e-3, 1e5, range=Range(0.02, 1.0, scales.duration), tolerance=scales.period),
        EffectParameter("width_s", 1e-4, 1e4, range=Range(0.03, 3.0, scales.period)),
        EffectParameter(
            "start_s",
            1e5 * earliest_start,
            1e5,
            range=Range(earliest_start, 1.0, scales.duration, is_log=False),
            each_run=True,
            tolerance=scales.period,
        ),
    )


_PULSES: Final = _pulse_numbers(0.0)
_ALTERNATING: Final = _pulse_numbers(-1.0)
"""May have begun before a run, so that its first pulse is a reversed one."""


def _pulses(block: str, *, alternates: bool) -> Callable[[Numbers, str, Surroundings], Term]:
    def term(numbers: Numbers, run: str, at: Surroundings) -> Term:
        del at
        return PULSE_TRAIN(
            place=block,
            size_n=numbers["size_n"],
            start_s=_of_run(numbers, "start_s", run),
            period_s=numbers["period_s"],
            # pulses that run into each other would end in a jump
            width_s=min(numbers["width_s"], numbers["period_s"]),
            alternates=float(alternates),
        )

    return term


def _pulses_in(*, alternate: bool) -> Callable[[Surroundings, MissingForces, Numbers], list[Numbers]]:
    """The train that explains most of a missing force, for pulses upward and downward; or the instants of one."""

    def proposed(at: Surroundings, missing: MissingForces, known: Numbers) -> list[Numbers]:
        best: dict[float, tuple[float, int, Numbers]] = {}
        widths_s = [known["width_s"]] if known else [share / at.frequency_hz for share in _WIDTHS]
        signs = [float(np.sign(known["size_n"]))] if known else [1.0, -1.0]
        for width_s in widths_s:
            n = max(4, round(width_s * at.sampling_rate_hz))
            shape = 0.5 * (1 - np.cos(2 * pi * np.arange(n) / n))
            longest = min((each.force_n.size for each in missing.values()), default=0)
            if longest <= 4 * n:
                continue
            # in standard deviations of its noise; eight places are within a width
            apart = max(1, n // _PLACES_PER_WIDTH)
            matched = {run: each.along(shape) for run, each in missing.items()}
            roots = np.sqrt([power for _, power in matched.values()])
            along = [
                np.ascontiguousarray(values[::apart] / root)
                for (values, _), root in zip(matched.values(), roots, strict=True)
            ]
            rate = at.sampling_rate_hz / apart
            periods = np.array([known["period_s"] * rate]) if known else _periods(n / apart, longest / apart)
            # (run, period, direction, column)
            places = np.stack([_best_places(values, periods, alternate) for values in along])
            explained = places[..., 0].sum(axis=0)
            # the size that fits the pulses of all runs, by least squares
            force, weight = np.tensordot(roots, places[..., 1], 1), np.tensordot(roots**2, places[..., 2], 1)
            for sign in signs:
                row = 0 if sign > 0 else 1
                k = int(np.argmax(explained[:, row]))
                score = float(explained[k, row])
                if score > best.get(sign, (0.0,))[0]:
                    first = zip(missing, places[:, k, row, 3].tolist(), strict=True)
                    starts = {in_run("start_s", run): place / rate for run, place in first}
                    size = float(sign * force[k, row] / weight[k, row])
                    train = {
                        "size_n": size,
                        "period_s": float(periods[k]) / rate,
                        "width_s": n / at.sampling_rate_hz,
                    }
                    began = sum(start < 0 for start in starts.values())
                    best[sign] = (score, began, {**train, **known, **starts})
        ranked = sorted(best.values(), key=lambda found: (-found[0], found[1]))
        if alternate and len(ranked) == 2 and isclose(ranked[0][0], ranked[1][0]) and ranked[0][1] != ranked[1][1]:
            # What alternates is as well its own reverse, begun a period earlier. Told by the first pulse that is
            # seen it holds in runs, too, in which that is late.
            ranked = [min(ranked, key=lambda found: found[1])]
        return [train for *_, train in ranked]

    return proposed


def _periods(width: float, longest: float) -> FloatArray:
    """Periods, so near to each other that the last pulse slips by half a width at most; all in one unit."""
    n = ceil(log(max(longest / (2.0 * width), 1.0)) / log1p(0.5 * width / longest)) + 1
    return np.asarray(2.0 * width * (1.0 + 0.5 * width / longest) ** np.arange(n), np.float64)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _best_places(values: FloatArray, periods: FloatArray, alternate: bool) -> FloatArray:
    """Where a train of each period explains most of a series, upward and downward, shape (n_periods, 2, 4).

    Columns: what it explains; the sum of the values at its pulses, positive along its direction; how many these
    are; when it begins, within the first two periods, or, where pulses alternate and every other one counts
    reversed, up to a period before the series. Periods and beginnings are in places of the series.
    """
    best = np.zeros((periods.size, 2, 4))
    for i, period in enumerate(periods):
        n_places = min(int(period), values.size)
        sums, sign = np.zeros(int(period)), 1.0
        n_pulses = int(values.size / period)
        for pulse in range(n_pulses + 1):
            # a period need not be a whole number of places, or later pulses would slip
            start = int(np.rint(pulse * period))
            along = values[start : start + sums.size]
            # two plain loops, in each of which one instruction does several places
            if sign > 0:
                for k in range(along.size):
                    sums[k] += along[k]
            else:
                for k in range(along.size):
                    sums[k] -= along[k]
            if alternate:
                sign = -sign
        # Trains that begin early enough have one pulse more before the end.
        n_longer = max(min(n_places, values.size - int(np.rint(n_pulses * period))), 0)
        # A train that explains nothing has its first pulse, too: its weight must not be zero.
        best[i, :, 2] = n_pulses + (n_longer > 0)
        _keep_extremes(best[i], sums, values, 0, n_longer, n_pulses + 1.0, period, alternate)
        _keep_extremes(best[i], sums, values, n_longer, n_places, float(n_pulses), period, alternate)
    return best


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _keep_extremes(
    best: FloatArray,
    sums: FloatArray,
    values: FloatArray,
    first: int,
    end: int,
    count: float,
    period: float,
    alternate: bool,
) -> None:
    """Better trains among those that begin from `first` to before `end`, all of so many pulses; into `best`.

    Of trains of one number of pulses the largest sum and the least one explain most.
    """
    if first >= end:
        return
    high = low = high_later = low_later = first
    largest = least = sums[first]
    largest_later = least_later = sums[first] - values[first]
    for k in range(first + 1, end):
        own, later = sums[k], sums[k] - values[k]
        if own > largest:
            largest, high = own, k
        if own < least:
            least, low = own, k
        if later > largest_later:
            largest_later, high_later = later, k
        if later < least_later:
            least_later, low_later = later, k
    reverse = -1.0 if alternate else 1.0
    for total, weight, begins in (
        (largest, count, float(high)),
        (least, count, float(low)),
        (-largest if alternate else 0.0, count, high - period),
        (-least if alternate else 0.0, count, low - period),
        (reverse * largest_later, count - 1.0, high_later + period),
        (reverse * least_later, count - 1.0, low_later + period),
    ):
        row = 0 if total > 0 else 1
        if weight > 0 and total**2 / weight > best[row, 0]:
            best[row, 0], best[row, 1], best[row, 2], best[row, 3] = total**2 / weight, abs(total), weight, begins


# --- a machine that runs by itself -----------------------------------------------------------------------------


_LINE: Final = (
    EffectParameter("size_n", 0.0, 1e7, range=Range(1e-4, 1.0, scales.force)),
    EffectParameter(
        "frequency_hz", 1e-2, 1e5, range=Range(0.05, 20.0, scales.frequency), tolerance=scales.cycle_in_a_run
    ),
    EffectParameter("phase", -1.0, 2.0, range=Range(0.0, 1.0, is_log=False), each_run=True),
)


def _line(block: str) -> Callable[[Numbers, str, Surroundings], Term]:
    def term(numbers: Numbers, run: str, at: Surroundings) -> Term:
        return HARMONIC_FORCE(
            place=block,
            frequency_hz=numbers["frequency_hz"],
            size_n=numbers["size_n"],
            phase=_of_run(numbers, "phase", run),
            reference_s=0.5 * at.longest_run_s,
        )

    return term


def _line_starts(at: Surroundings) -> Iterable[Numbers]:
    frequencies = at.missed_hz or (1.3 * at.frequency_hz,)
    return [
        {"size_n": 0.01 * at.force_n, "frequency_hz": frequency, "phase": phase}
        for frequency in frequencies
        for phase in (0.25, 0.75)
    ]


def _lines_in(at: Surroundings, missing: MissingForces, known: Numbers) -> list[Numbers]:
    """The strongest lines of the missing force of all runs, each with its phase in every run; or phases of one."""
    if not missing:
        return []
    forces = {run: each.force_n - each.force_n.mean() for run, each in missing.items()}
    frequencies = [known["frequency_hz"]] if known else _strongest_lines_hz(list(forces.values()), at)
    found: list[Numbers] = []
    for frequency in frequencies:
        amplitudes = {run: _amplitude(force, frequency, at) for run, force in forces.items()}
        phases = {
            # F sin 2π(f t + φ) is the real part of −i F e^(2πi(f t + φ))
            in_run("phase", run): float(np.angle(1j * value) / (2 * pi) % 1.0)
            for run, value in amplitudes.items()
        }
        size = float(np.mean([abs(value) for value in amplitudes.values()]))
        found.append({"size_n": size, "frequency_hz": frequency, **known, **phases})
    return found


def _strongest_lines_hz(forces: Sequence[FloatArray], at: Surroundings) -> list[float]:
    n = 4 * max(force.size for force in forces)
    spectrum = np.asarray(sum(np.abs(np.fft.rfft(force, n)) ** 2 for force in forces))
    inner = np.flatnonzero((spectrum[1:-1] > spectrum[:-2]) & (spectrum[1:-1] >= spectrum[2:])) + 1
    return [float(k) * at.sampling_rate_hz / n for k in inner[np.argsort(-spectrum[inner])][:_MOST_LINES]]


def _amplitude(force: FloatArray, frequency_hz: float, at: Surroundings) -> complex:
    """Complex amplitude of a line about the instant to which phases refer, in a force without its mean."""
    time = np.arange(force.size) / at.sampling_rate_hz - 0.5 * at.longest_run_s
    return complex(2.0 * np.mean(force * np.exp(-2j * pi * frequency_hz * time)))


_SEPARATED_BY: Final = "a run in which nothing is driven or released; a run when the machines around are off"


def _registered(block: str) -> tuple[Effect, Effect, Effect]:
    """Pulses, pulses of alternating sign, and a line, at one block."""
    train = multiples(
        _PULSES,
        *({"size_n": sign, "period_s": 0.25, "width_s": 0.5, "start_s": 0.1} for sign in (0.05, -0.05)),
    )
    pulses, alternating = (
        register(
            Effect(
                name,
                block,
                PULSE_TRAIN.equation + after,
                numbers,
                train,
                _in_every_run(_pulses(block, alternates=alternates)),
                _SEPARATED_BY,
                _can_act(block),
                spoken_for_by=(IMPULSIVE, MEMORY, TIME_VARYING),
                variant_of=variant_of,
                size=("size_n",),
                proposes=_pulses_in(alternate=alternates),
            )
        )
        for name, after, numbers, alternates, variant_of in (
            ("external_force", "", _PULSES, False, ""),
            ("alternating_pulses", ", up and down in turn", _ALTERNATING, True, "external_force"),
        )
    )
    line = Effect(
        "harmonic_force",
        block,
        HARMONIC_FORCE.equation,
        _LINE,
        _line_starts,
        _in_every_run(_line(block)),
        _SEPARATED_BY,
        _can_act(block),
        spoken_for_by=(MEMORY, TIME_VARYING),
        variant_of="external_force",
        size=("size_n",),
        proposes=_lines_in,
    )
    return pulses, alternating, register(line)


STRUCTURE = _registered("structure")
TANK = _registered("tank")
