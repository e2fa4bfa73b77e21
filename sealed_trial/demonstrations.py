"""Cases for a demonstration: what is hidden is chosen by its name, everything else is drawn from a seed."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sealed_trial.case_drawing import CaseDrawing, DrawnCase
from sealed_trial.composition import SINGLES
from sealed_trial.laboratory.test_plan import SHORT_DECAYS

DOMAIN: Final = b"sloshlab demonstration"
"""Another than those of trials: a demonstration shares no random number with them."""
_NOISE: Final = 4
_MOST_RIGS: Final = 16
"""Four of ten have neither friction nor a moving liquid in their simulation; of 16 none has in 1 of 5000 cases."""


@dataclass(frozen=True)
class Demonstration:
    """What a demonstration hides, and what its laboratory measures.

    Attributes
    ----------
    title : str
        What is hidden, in words for somebody who comes for the first time.
    measured : str
        What the laboratory does.
    kind : str
        Class of the case, as in a trial.
    effects : tuple of (str, str)
        Block and name of what is hidden.
    plan : str
        One of the plans of a trial.
    seed : int
        Of the case in `raw_data/cases`.
    """

    title: str
    measured: str
    kind: str
    effects: tuple[tuple[str, str], ...]
    plan: str
    seed: int = 1


_DECAYS: Final = "lets a partly filled tank go on its guide and springs, four times from three heights"
_FRICTION: Final = ("structure", "coulomb_friction")
_LATE: Final = ("sensor", "sensor_delay")

DEMONSTRATIONS: Final[dict[str, Demonstration]] = {
    "friction": Demonstration("dry friction in the guide", _DECAYS, "single", (_FRICTION,), SHORT_DECAYS),
    "moving-liquid": Demonstration(
        "a liquid that moves, where the simulation has it frozen",
        _DECAYS,
        "single",
        (("tank", "liquid_sloshing"),),
        SHORT_DECAYS,
    ),
    "late-sensor": Demonstration(
        "a sensor that comes later than the others", _DECAYS, "single", (_LATE,), SHORT_DECAYS
    ),
    "two-at-once": Demonstration(
        "dry friction in the guide and a late sensor at once",
        _DECAYS,
        "pair",
        (_FRICTION, _LATE),
        SHORT_DECAYS,
        seed=6,
    ),
    "nothing-hidden": Demonstration("nothing, which has to be said, too", _DECAYS, "nothing", (), SHORT_DECAYS),
}


def demonstration_entropy(name: str, seed: int) -> list[int]:
    """Words that all random numbers of a demonstration come from.

    Parameters
    ----------
    name : str
        One of `DEMONSTRATIONS`.
    seed : int
    """
    digest = hashlib.sha256(DOMAIN + b"\0" + name.encode() + b"\0" + str(seed).encode()).digest()
    return [int.from_bytes(digest[k : k + 4], "big") for k in range(0, 32, 4)]


def noise_generator(words: Sequence[int]) -> np.random.Generator:
    """Of the noise of all sensors of a demonstration."""
    return np.random.default_rng([*words, _NOISE])


def drawn_demonstration(name: str, seed: int) -> DrawnCase:
    """Draw a rig, its motions and the size of what is hidden.

    Parameters
    ----------
    name : str
        One of `DEMONSTRATIONS`.
    seed : int

    Raises
    ------
    ArithmeticError
        If no draw gives a motion that can be measured.
    """
    chosen = DEMONSTRATIONS[name]
    # beside a liquid that is believed to be frozen: the scatter of a chaotic one multiplies the time of a search
    vocabulary = [
        replace(effect, tank_model="frozen") for effect in SINGLES if (effect.block, effect.name) in chosen.effects
    ]
    words = demonstration_entropy(name, seed)
    drawing = CaseDrawing(words, plans=(chosen.plan,), effects=vocabulary, n_rigs=_MOST_RIGS)
    return drawing.case(0, name, chosen.kind)
