"""Conditions that start a recording: what a person writes, and the sample at which it is met.

``CHANNEL>LEVEL`` and ``CHANNEL<LEVEL`` are crossings of a level, ``slope(CHANNEL,SECONDS)>VALUE`` crossings of a
slope, both in the units of the channel; ``mark`` is a mark that a person sets.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.samples.channel import Channel
from sloshlab.errors import InputError

MARK: Final = "mark"
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_LEVEL = re.compile(
    rf"(?:(?P<name>\w+)|slope\((?P<sloped>\w+)(?:,(?P<over>{_NUMBER}))?\))"
    rf"(?P<sign>[<>])(?P<level>{_NUMBER})(?:,(?P<hysteresis>{_NUMBER}))?"
)
_ALLOWED: Final = "CHANNEL>LEVEL, CHANNEL<LEVEL, slope(CHANNEL,SECONDS)>VALUE, each with ,HYSTERESIS; or mark"

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Condition:
    """What starts a recording.

    Attributes
    ----------
    text : str
        As it was written.
    channel : str
        Name of the channel; empty for a mark.
    is_rising : bool
        Whether the level is crossed upwards.
    level, hysteresis : float
        In units of the channel, or per second for a slope. The value must have been at or beyond `level` less
        `hysteresis` (plus, where it falls) before.
    over_s : float or None
        Time over which a slope is taken [s]; 0 is one sample, None no slope but the value itself.
    """

    text: str
    channel: str = ""
    is_rising: bool = True
    level: float = math.nan
    hysteresis: float = 0.0
    over_s: float | None = None


def parsed_condition(text: str) -> Condition:
    """The condition that a text states.

    Raises
    ------
    InputError
        If it states none.

    Examples
    --------
    >>> parsed_condition("force_cell_1 > 2.5, 0.5").hysteresis, parsed_condition("slope(force_cell_1)<-3").over_s
    (0.5, 0.0)
    """
    plain = "".join(text.split())
    if plain == MARK:
        return Condition(MARK)
    found = _LEVEL.fullmatch(plain)
    if found is None:
        raise InputError("--trigger", got=repr(text)[:80], allowed=_ALLOWED)
    level, hysteresis = float(found["level"]), float(found["hysteresis"] or 0.0)
    over_s = None if found["name"] else float(found["over"] or 0.0)
    if hysteresis < 0 or not math.isfinite(level) or not math.isfinite(hysteresis) or not 0 <= (over_s or 0) <= 10:
        raise InputError(
            "--trigger", got=repr(text)[:80], allowed="a finite level, a hysteresis ≥ 0, a slope over 0 … 10 s"
        )
    name = found["name"] or found["sloped"]
    return Condition(plain, name, found["sign"] == ">", level, hysteresis, over_s)


class CrossingDetector:
    """Finds the sample at which a channel meets a condition.

    A crossing needs a value on this side before: a signal that is beyond the level from its begin starts nothing.
    Samples without a reading are passed over; a slope is never taken across a gap.

    Parameters
    ----------
    condition : Condition
        Of a level or slope.
    channel : Channel
    sampling_rate_hz : float
    """

    def __init__(self, condition: Condition, channel: Channel, sampling_rate_hz: float) -> None:
        self._condition, self._channel = condition, channel
        self._n_apart = 0
        if condition.over_s is not None:
            self._n_apart = max(1, round(condition.over_s * sampling_rate_hz))
        self._rate_hz = sampling_rate_hz
        self._next: tuple[int, int] | None = None
        self._before: FloatArray = np.empty(0)
        self._is_armed = False

    def first(self, stream: int, counter: int, counts: NDArray[np.int32]) -> int | None:
        """Counter of the first of consecutive samples that meets the condition; None if none does.

        Samples older than what was seen already, as after a late frame, are not looked at.
        """
        seen = self._next
        if seen is not None and seen[0] == stream and counter < seen[1]:
            return None
        if seen is None or seen[0] != stream:
            self._is_armed = False
        if seen != (stream, counter):
            self._before = np.empty(0)
        self._next = stream, counter + len(counts)
        at = self._crossing(self._watched(self._values(counts)))
        return None if at is None else counter + at

    def _values(self, counts: NDArray[np.int32]) -> FloatArray:
        scaled = counts * self._channel.scale_factor + self._channel.add_offset
        values: FloatArray = np.asarray(scaled, dtype=np.float64)
        if self._channel.missing_count is not None:
            values[counts == self._channel.missing_count] = np.nan
        return values

    def _watched(self, values: FloatArray) -> FloatArray:
        """The value itself or its slope, NaN where there is none."""
        if not self._n_apart:
            return values
        together = np.concatenate([self._before, values])
        self._before = np.asarray(together[-self._n_apart :], dtype=np.float64)
        slope = np.full(len(values), np.nan)
        found = (together[self._n_apart :] - together[: -self._n_apart]) * (self._rate_hz / self._n_apart)
        if found.size:
            slope[len(values) - found.size :] = found
        return slope

    def _crossing(self, watched: FloatArray) -> int | None:
        """First place beyond the level after one on this side of it."""
        condition, sign = self._condition, 1.0 if self._condition.is_rising else -1.0
        above = sign * watched > sign * condition.level
        # nothing is compared with what is not there: NaN is neither
        below = sign * watched <= sign * condition.level - condition.hysteresis
        if not self._is_armed:
            if not below.any():
                return None
            self._is_armed = True
            above[: int(below.argmax())] = False
        return int(above.argmax()) if above.any() else None
