"""Effects of the sensors: faults between the true motion or force and the recorded channel."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from scipy.signal import lfilter, zoom_fft

from sloshlab.missing_physics.candidate import (
    Effect,
    EffectParameter,
    Numbers,
    Surroundings,
    channels_of,
    in_run,
    joined_channels,
    multiples,
    register,
)
from sloshlab.missing_physics.effects import scales
from sloshlab.missing_physics.evidence import (
    CLOCK_DRIFT,
    FOLLOWS_OTHER_CHANNEL,
    MAINS_LINE,
    PROPORTIONAL_TO_INTEGRAL,
    PROPORTIONAL_TO_RATE,
    PROPORTIONAL_TO_READING,
    SATURATING,
    SINGLE_CHANNEL,
    TREND,
)
from sloshlab.missing_physics.extension import Extension, Reading, SensorFault
from sloshlab.missing_physics.prior import Range
from sloshlab.missing_physics.update_rates import first_update_s

FloatArray = NDArray[np.float64]
Others = Mapping[str, FloatArray]
_MAINS_HZ: Final = 0.2
"""By which the frequency of the mains may be off."""
_MOST_PAIRS: Final = 20
"""Of channel and source."""
_SPLINE_DEGREE: Final = 5
_SPLINE_MARGIN: Final = 32
"""Samples beyond which one does not show in a coefficient of the spline: 0.4306^32 = 2e-12 (its larger pole)."""
_LARGEST_LEAK: Final = 0.1
"""Of a channel's reading; more than that is another connection or gain."""
_LARGEST_LEAK_OF_ITS_KIND: Final = 0.2
"""The same for what another channel of the same quantity adds: both have the same cables and amplifiers."""


def _channels_and_devices(at: Surroundings) -> list[str]:
    """Every channel, and the force cells together: they share an amplifier and a clock."""
    cells = [name for name in at.channels if name.startswith("force_cell")]
    return [*at.channels, *([joined_channels(cells)] if len(cells) > 1 else [])]


def _compared_channels(at: Surroundings) -> list[str]:
    """Channels that are compared with the simulation: all but one that drives it alone."""
    alone = at.driving if len(at.driving) == 1 else ()
    return [name for name in at.channels if name not in alone]


def _sensor_effect(
    name: str,
    equation: str,
    parameters: tuple[EffectParameter, ...],
    starts: Callable[[Surroundings], Iterable[Numbers]] | Sequence[Numbers],
    reading: Callable[[Numbers], Reading],
    *,
    undone: Callable[[Numbers], Reading] | None,
    separated_by: str = "the channel beside a second sensor at the same place",
    places: Callable[[Surroundings], list[str]] | None = None,
    spoken_for_by: tuple[str, ...] = (),
    variant_of: str = "",
) -> Effect:
    def extension(numbers: Numbers, at: Surroundings, channel: str) -> Extension:
        del at
        read, back = reading(numbers), None if undone is None else undone(numbers)
        return Extension(
            faults=tuple(
                SensorFault(sensor, read, back, (f"sensor.{name}.{channel}", sensor, *sorted(numbers.items())))
                for sensor in channels_of(channel)
            )
        )

    return register(
        Effect(
            name,
            "sensor",
            equation,
            parameters,
            starts if callable(starts) else multiples(parameters, *starts),
            extension,
            separated_by,
            places=places or (_compared_channels if undone is None else lambda at: list(at.channels)),
            spoken_for_by=spoken_for_by,
            variant_of=variant_of,
        )
    )


def _scaled(factor: Callable[[Numbers], float]) -> Callable[[Numbers], Reading]:
    def of(numbers: Numbers) -> Reading:
        return lambda values, rate, others, recorded: values * factor(numbers)

    return of


# A gain of the only measured force is a mass: F = M ü.
GAIN = _sensor_effect(
    "sensor_gain",
    "y → (1 + ε) y",
    (EffectParameter("ratio", -0.9, 5.0, range=Range(1e-3, 0.9, may_be_negative=True)),),
    [{"ratio": ratio} for ratio in (0.05, -0.05)],
    _scaled(lambda numbers: 1 + numbers["ratio"]),
    undone=_scaled(lambda numbers: 1 / (1 + numbers["ratio"])),
    spoken_for_by=(SINGLE_CHANNEL, PROPORTIONAL_TO_READING),
    places=_channels_and_devices,
)


_RINGING_SAMPLES: Final = 4
"""Ringing of filters and of interpolation after a jump."""


def _delayed(numbers: Numbers) -> Reading:
    def reading(values: FloatArray, rate: float, others: Others, recorded: FloatArray) -> FloatArray:
        """Before and after the recording nothing is known (a released tank jumps): there it reads what was
        recorded.
        """
        del others
        samples = numbers["delay_s"] * rate
        moved, place = _shifted(values, samples), np.arange(values.size)
        unknown = abs(samples) + _RINGING_SAMPLES * min(abs(samples), 1.0)
        outside = np.clip(unknown - (place if samples > 0 else place[::-1]), 0.0, 1.0)
        return np.asarray(np.where(np.isfinite(recorded), moved + outside * (recorded - moved), moved))

    return reading


def _advanced(numbers: Numbers) -> Reading:
    def reading(values: FloatArray, rate: float, others: Others, recorded: FloatArray) -> FloatArray:
        del others, recorded
        return _shifted(values, -numbers["delay_s"] * rate)

    return reading


def _shifted(values: FloatArray, samples: float) -> FloatArray:
    """Values delayed by `samples`, by a linear phase; the series is reflected at its ends."""
    margin = min(values.size - 1, 64 + int(abs(samples)))
    # A Fourier transform takes the series for periodic, and the jump between its ends would ring into the run.
    padded = _reflected(values, margin)
    spectrum = np.fft.rfft(np.nan_to_num(padded))
    frequency = np.fft.rfftfreq(padded.size)
    moved = np.fft.irfft(spectrum * np.exp(-2j * np.pi * frequency * samples), padded.size)
    result = moved[margin : margin + values.size]
    return np.asarray(np.where(np.isfinite(values), result, np.nan))


def _reflected(values: FloatArray, margin: int) -> FloatArray:
    """With margins, reflected about the end points, so that value and slope go on."""
    return np.concatenate(
        [2 * values[0] - values[margin:0:-1], values, 2 * values[-1] - values[-2 : -margin - 2 : -1]]
    )


DELAY = _sensor_effect(
    "sensor_delay",
    "y(t) → y(t − τ)",
    (EffectParameter("delay_s", -0.05, 0.05, range=Range(2e-4, 0.25, scales.period, may_be_negative=True)),),
    [{"delay_s": share} for share in (0.02, -0.02)],
    _delayed,
    undone=_advanced,
    spoken_for_by=(SINGLE_CHANNEL, PROPORTIONAL_TO_RATE),
    places=_channels_and_devices,
)


def _high_passed(numbers: Numbers) -> Reading:
    def reading(values: FloatArray, rate: float, others: Others, recorded: FloatArray) -> FloatArray:
        """The charge at the first sample is free in every run, by least squares."""
        del others
        two = 2 * numbers["time_constant_s"] * rate
        # Bilinear transform: exact at zero frequency, and stable for every time constant.
        a, b = (two - 1) / (two + 1), two / (two + 1)
        passed = np.asarray(lfilter([b, -b], [1.0, -a], values))
        leaking = a ** np.arange(values.size)
        known = np.isfinite(recorded)
        size = float(leaking[known] @ leaking[known])
        charge = float((recorded - passed)[known] @ leaking[known]) / size if size > 0 else 0.0
        return np.asarray(passed + charge * leaking)

    return reading


def _high_pass_undone(numbers: Numbers) -> Reading:
    def reading(values: FloatArray, rate: float, others: Others, recorded: FloatArray) -> FloatArray:
        del others, recorded
        # By trapezoids: the inverse of the bilinear transform.
        whole = values + (np.nancumsum(values) - 0.5 * values) / (numbers["time_constant_s"] * rate)
        # The zero of a recorder becomes a ramp. The mean is no zero: where an acceleration ends elsewhere than it
        # began, all of the difference has leaked away.
        known = np.isfinite(whole)
        time = np.arange(whole.size) - np.arange(whole.size)[known].mean()
        slope = time[known] @ whole[known] / max(float(time[known] @ time[known]), 1.0)
        return np.asarray(whole - slope * time)

    return reading


HIGH_PASS = _sensor_effect(
    "sensor_high_pass",
    "τ ẏ + y = τ u̇",
    (EffectParameter("time_constant_s", 1e-3, 100.0, range=Range(5e-3, 20.0)),),
    [{"time_constant_s": value} for value in (2.0, 0.2, 0.03)],
    _high_passed,
    undone=_high_pass_undone,
    spoken_for_by=(SINGLE_CHANNEL, PROPORTIONAL_TO_INTEGRAL),
    places=_channels_and_devices,
)


def _clipped(numbers: Numbers) -> Reading:
    def reading(values: FloatArray, rate: float, others: Others, recorded: FloatArray) -> FloatArray:
        del rate, others, recorded
        return np.asarray(np.clip(values, -numbers["limit"], numbers["limit"]))

    return reading


# At the largest reading nothing clips and nothing changes, so that starts lie below it, too.
CLIPPING = _sensor_effect(
    "sensor_clipping",
    "y → min(max(y, −limit), limit), limit in the unit of the channel",
    (EffectParameter("limit", 1e-9, 1e9, range=Range(0.05, 1.0, scales.peak)),),
    [{"limit": share} for share in (1.0, 0.97, 0.8)],
    _clipped,
    undone=None,
    spoken_for_by=(SINGLE_CHANNEL, SATURATING),
)


def _drifted(numbers: Numbers) -> Reading:
    def reading(values: FloatArray, rate: float, others: Others, recorded: FloatArray) -> FloatArray:
        del others, recorded
        # From zero at the first sample, as the equation says: a drift about its mean would be a shifted offset
        # as well.
        time = np.arange(values.size) / rate
        return np.asarray(values + numbers["rate"] * time)

    return reading


_RATE: Final = EffectParameter("rate", -1e6, 1e6, range=Range(3e-3, 30.0, scales.drift, may_be_negative=True))
_RATES: Final = ({"rate": 0.3}, {"rate": -0.3})
_DRIFT: Final = "y → y + rate · t, in the unit of the channel per second"

DRIFT = _sensor_effect(
    "sensor_drift", _DRIFT, (_RATE,), _RATES, _drifted, undone=None, spoken_for_by=(SINGLE_CHANNEL, TREND)
)


def _drifted_in_runs(numbers: Numbers, at: Surroundings, channel: str) -> Extension:
    rates = {run: numbers.get(in_run("rate", run), 0.0) for run in at.runs}
    return Extension(
        faults=tuple(
            SensorFault(channel, _drifted({"rate": rate}), None, (f"sensor.drift_of_runs.{channel}", rate), run)
            for run, rate in rates.items()
        )
    )


# A sensor that drifts with its temperature does so differently in every run.
DRIFT_OF_RUNS = register(
    Effect(
        "drift_of_runs",
        "sensor",
        f"{_DRIFT}, of a rate of its own in every run",
        (replace(_RATE, each_run=True),),
        multiples((_RATE,), *_RATES),
        _drifted_in_runs,
        places=_compared_channels,
        needs=lambda at: bool(at.runs),
        spoken_for_by=DRIFT.spoken_for_by,
        separated_by=DRIFT.separated_by,
        variant_of=DRIFT.name,
        reduces_to=(DRIFT.name,),
    )
)


def _with_hum(line_hz: float, sign: float) -> Callable[[Numbers], Reading]:
    def of(numbers: Numbers) -> Reading:
        def reading(values: FloatArray, rate: float, others: Others, recorded: FloatArray) -> FloatArray:
            """Its phase and the mains' frequency are free in every run: those of the residual."""
            del others
            # Phase and frequency of the mains differ from run to run; free numbers for each run would be far
            # more than the amplitude.
            left = recorded - values if sign > 0 else recorded
            return np.asarray(values + sign * numbers["amplitude"] * _line(np.nan_to_num(left), rate, line_hz))

        return reading

    return of


def _line(values: FloatArray, rate: float, line_hz: float) -> FloatArray:
    """Unit cosine of the strongest line within ±0.2 Hz of a frequency."""
    within = np.array([line_hz - _MAINS_HZ, line_hz + _MAINS_HZ])
    n = max(9, int(8 * _MAINS_HZ * values.size / rate)) if within[1] < 0.5 * rate else 0
    if not n:
        return np.zeros(values.size)
    power = np.abs(zoom_fft(values, within, n, fs=rate, endpoint=True))
    # A parabola through the peak: the grid of the zoomed transform is coarser than the frequency must be known.
    k = min(max(int(np.argmax(power)), 1), n - 2)
    before, at, after = power[k - 1 : k + 2]
    curvature = before - 2 * at + after
    shift = 0.5 * (before - after) / curvature if curvature < 0 else 0.0
    frequency = within[0] + (k + min(max(shift, -1.0), 1.0)) * (within[1] - within[0]) / (n - 1)
    line = np.exp(2j * np.pi * frequency * np.arange(values.size) / rate)
    amplitude = complex(np.mean(values * line.conj()))
    return np.asarray((line * amplitude).real / max(abs(amplitude), 1e-300))


HUM = [
    _sensor_effect(
        name,
        f"y → y + A cos(2π f t + φ), f about {line:g} Hz, A in the unit of the channel",
        (EffectParameter("amplitude", 0.0, 1e9, range=Range(1e-3, 1.0, scales.reading)),),
        [{"amplitude": 0.02}],
        _with_hum(line, 1.0),
        undone=_with_hum(line, -1.0),
        separated_by="the channel with nothing moving",
        spoken_for_by=(SINGLE_CHANNEL, MAINS_LINE),
        variant_of=variant_of,
    )
    for name, line, variant_of in (("mains_hum", 50.0, ""), ("mains_hum_60", 60.0, "mains_hum"))
]


def _with_clock_skew(sign: float) -> Callable[[Numbers], Reading]:
    def of(numbers: Numbers) -> Reading:
        def reading(values: FloatArray, rate: float, others: Others, recorded: FloatArray) -> FloatArray:
            del rate, others, recorded
            return _interpolated(values, np.arange(values.size, dtype=np.float64) * (1 + sign * numbers["ratio"]))

        return reading

    return of


def _interpolated(values: FloatArray, places: FloatArray) -> FloatArray:
    """Spline interpolation; linear interpolation would lose a ninth of a sine of six samples per cycle.

    Beyond the ends the last value stays; what is next to a lost sample is lost.
    """
    samples, known = np.arange(values.size), np.isfinite(values)
    if values.size <= _SPLINE_DEGREE or not known.any():
        return np.asarray(np.interp(places, samples, values))
    all_known = bool(known.all())
    # A spline through a lost sample would be lost throughout.
    whole = values if all_known else np.interp(samples, samples[known], values[known])
    # On equal distances the coefficients of the spline are a filter, which begins and ends in the margins.
    margin = min(values.size - 1, _SPLINE_MARGIN)
    within = np.clip(places, 0, values.size - 1) + margin
    found = map_coordinates(_reflected(whole, margin), [within], order=_SPLINE_DEGREE, mode="mirror")
    return np.asarray(found if all_known else np.where(np.interp(places, samples, known) == 1.0, found, np.nan))


CLOCK = _sensor_effect(
    "clock_skew",
    "y(t) → y((1 + ε) t)",
    (EffectParameter("ratio", -0.05, 0.05, range=Range(1e-3, 1.0, scales.clock, may_be_negative=True)),),
    [{"ratio": share} for share in (0.02, -0.02)],
    _with_clock_skew(1.0),
    undone=_with_clock_skew(-1.0),
    spoken_for_by=(SINGLE_CHANNEL, CLOCK_DRIFT),
    places=_channels_and_devices,
)


_NEAR_SAMPLES: Final = 0.1
"""To which the instants of updates are known; with noise of 2 % of the reading they were off by 0.03 at most."""


def _held(numbers: Numbers) -> Reading:
    def reading(values: FloatArray, rate: float, others: Others, recorded: FloatArray) -> FloatArray:
        """The instants of the updates are those of the recording in every run, found to a part of a sample.

        Which samples show an update is read from the recording, so that numbers of a fit never move a step of the
        reading to another sample; half a sample, which no step shows, is found by least squares.
        """
        del others
        held_hz = numbers["update_rate_hz"]
        samples = rate / held_hz
        first = first_update_s(recorded, rate, held_hz) * rate
        place = np.arange(values.size, dtype=np.float64)
        last = np.floor((place - first) / samples)
        updates = first + samples * last
        shown, slope = (_interpolated(series, updates) for series in (values, np.gradient(values)))
        known = np.isfinite(shown + slope + recorded) & (updates >= 0)
        size = float(slope[known] @ slope[known])
        late = float((recorded - shown)[known] @ slope[known]) / size if size > 0 else 0.0
        late = min(max(late, -0.5), 0.5)
        shown = _interpolated(values, updates + late)
        # an update so near to a sample may be shown by it or not
        since, until = place - updates, updates + samples - place
        beside = updates + samples * (1.0 * (until < _NEAR_SAMPLES) - 1.0 * (since < _NEAR_SAMPLES))
        other = _interpolated(values, beside + late)
        shown = np.where(np.abs(recorded - other) < np.abs(recorded - shown), other, shown)
        # before the first update it holds what was there before the run
        return np.asarray(np.where((updates < 0) & np.isfinite(recorded), recorded, shown))

    return reading


def _held_channels(at: Surroundings) -> list[str]:
    return [name for name in _compared_channels(at) if name in at.update_rates_hz]


def _update_rates(at: Surroundings) -> list[Numbers]:
    """Those that the recording shows; no other place would be met by a descent."""
    rates = at.update_rates_hz.get(at.channel) or (0.125 * at.sampling_rate_hz,)
    return [{"update_rate_hz": rate} for rate in rates]


# Images of a line of frequency f at f_u ± f, its size times sinc(f/f_u), and half an update late on average.
HOLD = _sensor_effect(
    "sample_and_hold",
    "y(t) → y(t_k) for t_k ≤ t < t_k + 1/f_u: a reading held between updates",
    (
        EffectParameter(
            "update_rate_hz",
            1e-2,
            1e6,
            range=Range(0.01, 1.0, scales.sampling_rate),
            # after a slip of one update over the longest run every step is at another sample
            tolerance=scales.cycle_in_a_run,
        ),
    ),
    _update_rates,
    _held,
    undone=None,
    places=_held_channels,
    spoken_for_by=(SINGLE_CHANNEL,),
)


def _pairs(at: Surroundings) -> list[str]:
    """Channel and source, of the same quantity first; a leak between coherent channels is a gain and not offered.

    On a shaker all channels of one quantity read one motion or one force and are coherent.
    """
    is_shaker = at.twin.structure is None
    pairs = [
        (to, source)
        for to in at.channels
        for source in at.channels
        if source != to
        if to.endswith("_root")
        or not at.has_one_frequency
        or (source.endswith("_root") and to in at.incoherent_with_base)
        if not (is_shaker and _read_same_quantity(to, source))
    ]
    # Leaks within one quantity share cables and amplifiers; they come first where the list is cut.
    pairs.sort(key=lambda pair: not _read_same_quantity(*pair))
    return [f"{to}<{source}" for to, source in pairs[:_MOST_PAIRS]]


def _read_same_quantity(first: str, other: str) -> bool:
    """Whether two channels read the same quantity."""
    return first.partition("_")[0] == other.partition("_")[0]


def _cross_talk(numbers: Numbers, at: Surroundings, channel: str) -> Extension:
    del at
    to, _, source = channel.partition("<")

    def leaked(sign: float) -> Reading:
        def reading(values: FloatArray, rate: float, others: Others, recorded: FloatArray) -> FloatArray:
            del rate, recorded
            if source not in others:
                return values
            return np.asarray(values + sign * numbers["ratio"] * np.nan_to_num(others[source]))

        return reading

    key = (f"sensor.cross_talk.{channel}", numbers["ratio"])
    return Extension(faults=(SensorFault(to, leaked(1.0), leaked(-1.0), key, reads_others=True),))


def _largest_leaks(at: Surroundings) -> Mapping[str, tuple[float, float]]:
    to, _, source = at.channel.partition("<")
    most = _LARGEST_LEAK * scales.leak(at)
    if to.partition("_")[0] == source.partition("_")[0]:
        # A tenth for all was the bound before a base was found to add 14 % to the reading of a tank.
        is_base = to.endswith("_root")  # one that rests reads nothing else
        most = max(most, _LARGEST_LEAK) if is_base else _LARGEST_LEAK_OF_ITS_KIND * scales.leak(at)
    return {"ratio": (-most, most)}


_LEAK: Final = (
    EffectParameter(
        "ratio",
        -1e6,
        1e6,
        range=Range(1e-3, _LARGEST_LEAK_OF_ITS_KIND, scales.leak, may_be_negative=True),
    ),
)
CROSS_TALK = register(
    Effect(
        "cross_talk",
        "sensor",
        "y₁ → y₁ + r y₂, r in the unit of the one channel over that of the other",
        _LEAK,
        multiples(_LEAK, *({"ratio": share} for share in (0.03, -0.03))),
        _cross_talk,
        "the second channel disconnected",
        places=_pairs,
        limits=_largest_leaks,
        spoken_for_by=(SINGLE_CHANNEL, FOLLOWS_OTHER_CHANNEL),
    )
)
