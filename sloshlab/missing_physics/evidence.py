"""Terms of tests on a latent force or a sensor, and the evidence that they are for and against an effect.

An effect lists the terms that hold where it is what is missing (`Effect.spoken_for_by`). A test says that a term
holds, that it does not, or nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

CANNOT_TELL: Final = "cannot tell"

DISSIPATIVE, ENERGY_INPUT, CONSERVATIVE = "takes energy", "gives energy", "does no work"
ODD_IN_DISPLACEMENT, ODD_IN_VELOCITY = "odd in displacement", "odd in velocity"
EVEN, ODD_IN_BOTH = "even", "odd in both"
STATE_FUNCTION, MEMORY, TIME_VARYING = "function of the state", "memory", "changes along the run"
RATE_INDEPENDENT, RATE_DEPENDENT = "rate-independent", "grows with rate"
WORK_1, WORK_2, WORK_3 = "work ∝ amplitude", "work ∝ amplitude²", "work ∝ amplitude³"
ONSET, NO_ONSET = "onset", "no onset"
CONSTANT = "constant part"
HALF_ORDER, SECOND_ORDER, THIRD_ORDER = "half order", "second order", "third order"
IMPULSIVE = "impulsive"
FORCE_TERMS: Final = {
    DISSIPATIVE: "the force takes energy out of the motion",
    ENERGY_INPUT: "the force gives energy to the motion",
    CONSERVATIVE: "the force does no work over a cycle",
    ODD_IN_DISPLACEMENT: (
        "its largest part is odd in the displacement (acceleration of a tank) and even in the velocity"
    ),
    ODD_IN_VELOCITY: "its largest part is odd in the velocity and even in the displacement",
    EVEN: "a part is even in both",
    ODD_IN_BOTH: "a part is odd in both",
    STATE_FUNCTION: "it is a function of the present motion",
    MEMORY: "it depends on the history of the motion",
    TIME_VARYING: "it changes along a run",
    RATE_INDEPENDENT: "its work per cycle does not depend on the frequency",
    RATE_DEPENDENT: "its work per cycle grows with the frequency",
    WORK_1: "its work per cycle grows as the amplitude",
    WORK_2: "its work per cycle grows as the square of the amplitude",
    WORK_3: "its work per cycle grows as the cube of the amplitude",
    ONSET: "below some level it is nothing",
    NO_ONSET: "it is there at the smallest level",
    CONSTANT: "it has a part that never changes",
    HALF_ORDER: "it has a part at half the frequency of the motion",
    SECOND_ORDER: "it has a part at twice the frequency of the motion",
    THIRD_ORDER: "it has a part at three times the frequency of the motion",
    IMPULSIVE: "it comes in blows",
}

PROPORTIONAL_TO_READING, PROPORTIONAL_TO_RATE, PROPORTIONAL_TO_INTEGRAL, TREND = (
    "proportional to the reading",
    "follows its rate",
    "follows its integral",
    "slow trend",
)
MAINS_LINE, CLOCK_DRIFT, SATURATING, FOLLOWS_OTHER_CHANNEL = (
    "a line of the mains",
    "rate growing along the run",
    "at the largest readings",
    "another channel",
)
SINGLE_CHANNEL = "one channel alone"
SENSOR_TERMS: Final = {
    SINGLE_CHANNEL: "one channel contradicts the others, which agree",
    PROPORTIONAL_TO_READING: "what it reads wrong is proportional to what it reads",
    PROPORTIONAL_TO_RATE: "what it reads wrong follows the rate of what it reads",
    PROPORTIONAL_TO_INTEGRAL: "what it reads wrong follows the integral of what it reads",
    TREND: "what it reads wrong is a trend along the run",
    MAINS_LINE: "what it reads wrong is a line at 50 or 60 Hz",
    CLOCK_DRIFT: "what it reads wrong follows its rate, ever more along the run",
    SATURATING: "it reads wrong where it reads most",
    FOLLOWS_OTHER_CHANNEL: "what it reads wrong is what another channel reads",
}
TERMS: Final = {**FORCE_TERMS, **SENSOR_TERMS}


@dataclass(frozen=True)
class Evidence:
    """What tests say of an effect.

    Attributes
    ----------
    speaks_for, speaks_against, still_open : tuple of str
        Terms of the effect that hold, that do not, and that no test could tell.
    """

    speaks_for: tuple[str, ...]
    speaks_against: tuple[str, ...]
    still_open: tuple[str, ...]


def evidence(terms: tuple[str, ...], says: Mapping[str, bool]) -> Evidence:
    """Sort the terms of an effect by what tests say.

    Parameters
    ----------
    terms : tuple of str
    says : mapping of term to bool

    Examples
    --------
    >>> evidence((DISSIPATIVE, WORK_1, ONSET), {DISSIPATIVE: True, WORK_1: False})
    Evidence(speaks_for=('takes energy',), speaks_against=('work ∝ amplitude',), still_open=('onset',))
    """
    # Tests know of no candidate: an effect says beforehand what holds of it, and fits decide. A term that no
    # test could tell is neither for nor against.
    return Evidence(
        tuple(term for term in terms if says.get(term) is True),
        tuple(term for term in terms if says.get(term) is False),
        tuple(term for term in terms if term not in says),
    )
