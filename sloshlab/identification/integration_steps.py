"""How many integration steps lie between two samples of a recording: for modes, for forces with memory."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from sloshlab.errors import AnalysisError
from sloshlab.twin.terms import Term
from sloshlab.twin.twin import Twin

STEPS_PER_PERIOD: Final = 8.0
"""Of the highest mode within the band."""
_STEPS_PER_FIRST_PERIOD: Final = 60.0
"""Of the lowest mode: forces with memory need them."""
MOST_STEPS_OF_MEMORY: Final = 32
"""Per sample; a loop that yields within a 64th of the way between two samples is dry friction to a recording."""
_LARGEST_STEP_OF_MEMORY: Final = 2.0
"""Over the time in which it forgets at the largest speed, where a loop has yielded; RK4 is stable up to 2.78."""
_LEAST_STEPS_PER_S: Final = 500.0
"""Of a tank that follows its measured motion: forces with a running mean need some tens of steps per cycle.

At 64 Hz the memory of the liquid's damping was integrated in steps of a seventh of a cycle and diverged.
"""


def steps_per_sample(
    twin: Twin,
    sampling_rate_hz: float,
    per_period: float = STEPS_PER_PERIOD,
    speed_m_per_s: float = 0.0,
) -> int:
    """Integration steps that follow every mode within the band of a recording, and forces with memory.

    Parameters
    ----------
    twin : Twin
    sampling_rate_hz : float
    per_period : float, optional
        Of the highest mode.
    speed_m_per_s : float, optional
        The largest of the place where forces act, for memories that forget with the way.

    Raises
    ------
    AnalysisError
        If a memory forgets faster than steps can follow.
    """
    least = steps_of_memory(twin.terms, sampling_rate_hz, speed_m_per_s)
    if twin.structure is None:
        return max(least, math.ceil(_LEAST_STEPS_PER_S / sampling_rate_hz))
    frequencies = twin.structure.frequencies_hz
    needed = max(per_period * float(frequencies.max()), _STEPS_PER_FIRST_PERIOD * float(frequencies.min()))
    return max(least, min(1000, math.ceil(needed / sampling_rate_hz)))


def steps_of_memory(terms: Sequence[Term], sampling_rate_hz: float, speed_m_per_s: float) -> int:
    """Steps that follow memories which forget with the way; one where there are none.

    A power of two, so that twins that differ a little are simulated side by side.

    Parameters
    ----------
    terms : sequence of Term
    sampling_rate_hz : float
    speed_m_per_s : float
        The largest of their place.

    Raises
    ------
    AnalysisError
        If `MOST_STEPS_OF_MEMORY` would be too few: in steps that long a loop overshoots the force at which it
        yields, turns in every step, and is no loop any more.
    """
    needed = steps_needed(terms, sampling_rate_hz, speed_m_per_s)
    if needed > MOST_STEPS_OF_MEMORY:
        raise AnalysisError(
            "a force with memory",
            got=f"a need of {needed:.0f} steps between two samples to follow how it yields",
            allowed=f"at most {MOST_STEPS_OF_MEMORY}",
            remedy="describe it as dry friction, or sample faster",
        )
    return int(2 ** math.ceil(math.log2(needed)))


def steps_needed(terms: Sequence[Term], sampling_rate_hz: float, speed_m_per_s: float) -> float:
    """The same without an upper limit, and not a power of two.

    Parameters
    ----------
    terms : sequence of Term
    sampling_rate_hz : float
    speed_m_per_s : float
    """
    fastest = max((term.memory_rate(speed_m_per_s) for term in terms), default=0.0)
    return max(fastest / (_LARGEST_STEP_OF_MEMORY * sampling_rate_hz), 1.0)
