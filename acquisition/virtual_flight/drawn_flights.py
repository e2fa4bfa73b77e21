"""Flights drawn by a seed: what is hidden in each, how strong, and its truth in the words of a challenge.

What is drawn holds in the case itself – its laboratory, its airspeeds, its gusts and pulses: a single effect shows
there beyond retuning and beyond the names that come near it; look-alikes cannot be told apart there, because their
tanks are slender: what a liquid weighs shows, what it turns with does not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from acquisition.virtual_flight.described_wing import DescribedWing, with_spanwise_tanks
from acquisition.virtual_flight.drawn_effects import LOOK_ALIKES, OUTSIDE, SINGLES, Draw, DrawnEffect
from acquisition.virtual_flight.flight_test import CARD, FlightPoint
from acquisition.virtual_flight.hidden_physics import HiddenFlight
from acquisition.virtual_flight.recorded_flight import Laboratory, drawn_laboratory
from acquisition.virtual_flight.shown_change import ShownChange
from sloshlab.errors import AnalysisError

Generator = np.random.Generator
_SHARES: Final = {"nothing": 15, "effects": 33, "look_alikes": 6, "outside": 6}
"""Of sixty flights; others in proportion."""
_WEAKEST, _STRONGEST = 5.0, 40.0
"""Of a hidden effect beyond what retuning takes, in noise floors of the channel that shows it most; the strength
of a case is drawn between them, its logarithm uniformly."""
_LOOK_ALIKE: Final = (3.0, 5.0)
"""The same of look-alikes: the stronger they are the more tells them apart."""
_NEAR: Final = 1.5
"""Ratio within which a drawn strength counts as reached."""
_SMALLEST, _LARGEST = 0.02, 5.0
"""Of the usual size of an effect: beyond it there is no such wing."""
_TOLD_APART: Final = 12.0
"""Log-likelihood ratio by which a single effect is told from others: more than any diagnosis asks."""
_ALIKE: Final = 3.0
"""The same of look-alikes, at most: twenty to one."""
_MOST_TRIES: Final = 6
_MOST_ATTEMPTS: Final = 20


@dataclass(frozen=True, eq=False)
class Flight:
    """One drawn case.

    Attributes
    ----------
    name : str
    wing : DescribedWing
    hidden : HiddenFlight
    laboratory : Laboratory
    card : tuple of FlightPoint
    truth : dict
        As `sloshlab trial commit` reads it.
    seed : list of int
        Of what is done and of its noise.
    """

    name: str
    wing: DescribedWing
    hidden: HiddenFlight
    laboratory: Laboratory
    card: tuple[FlightPoint, ...]
    truth: dict[str, Any]
    seed: list[int] = field(default_factory=list)


class FlightDrawing:
    """Draws flights of a wing.

    Parameters
    ----------
    wing : DescribedWing
    seed : int
    """

    def __init__(self, wing: DescribedWing, seed: int) -> None:
        self._wing, self._seed = wing, seed

    def flights(self, n: int, said: Callable[[str], None] = lambda name: None) -> list[Flight]:
        """Flights in a drawn order of classes.

        Parameters
        ----------
        n : int
        said : callable, optional
            Told the name of every flight that is drawn.
        """
        kinds = _in_proportion(n)
        np.random.default_rng([self._seed, 0]).shuffle(kinds)
        found, counts = [], dict.fromkeys(_SHARES, 0)
        orders = {
            "effects": _turns(SINGLES, np.random.default_rng([self._seed, 1])),
            "look_alikes": _turns(LOOK_ALIKES, np.random.default_rng([self._seed, 2])),
            "outside": _turns(OUTSIDE, np.random.default_rng([self._seed, 3])),
        }
        for number, kind in enumerate(kinds):
            draws = orders[kind](counts[kind]) if kind in orders else []
            counts[kind] += 1
            found.append(self._flight(number, kind, draws))
            said(found[-1].name)
        return found

    def _flight(self, number: int, kind: str, draws: Sequence[Draw]) -> Flight:
        """A flight with the first of some effects that can be drawn there as its class asks; or another one."""
        for attempt in range(_MOST_ATTEMPTS):
            own = [self._seed, number, attempt]
            flight = self._empty(f"case_{number + 1:03d}", kind, own)
            if not draws:
                return flight
            shown = ShownChange(flight.wing, flight.laboratory, flight.card, [*flight.seed, 0])
            least, most = _LOOK_ALIKE if kind == "look_alikes" else (_WEAKEST, _STRONGEST)
            wanted = np.random.default_rng([*own, 11]).uniform(np.log(least), np.log(most))
            # what is told apart where it is strong may be alike where it is weak
            for strength in np.unique(np.maximum(np.exp(wanted) * 0.8 ** np.arange(4), least))[::-1]:
                for draw in draws:
                    drawing = _OfOneCase(draw, flight.wing, [*own, 12])
                    drawn = self._with_effect(flight, drawing, shown, float(strength))
                    if drawn is not None:
                        return drawn
        raise AnalysisError(f"flight {number + 1}", got="no effect that shows as its class asks", allowed="one")

    def _empty(self, name: str, kind: str, own: list[int]) -> Flight:
        """A flight that hides nothing."""
        generator = np.random.default_rng([*own, 10])
        wing = with_spanwise_tanks(self._wing) if kind == "look_alikes" else self._wing
        laboratory = drawn_laboratory(wing, generator)
        speeds = {14.0: float(generator.uniform(13.0, 15.0)), 20.0: float(generator.uniform(18.5, 20.5)), 0.0: 0.0}
        card = tuple(replace(point, airspeed_m_per_s=speeds[point.airspeed_m_per_s]) for point in CARD)
        return Flight(name, wing, HiddenFlight(), laboratory, card, {"hidden": kind}, [*own, 20])

    @staticmethod
    def _with_effect(flight: Flight, drawing: _OfOneCase, shown: ShownChange, wanted: float) -> Flight | None:
        """The flight with an effect of a strength; None where it does not show so there, or not as such."""
        kind = flight.truth["hidden"]
        effect, strength = drawing.of_strength(shown, wanted)
        if not wanted / _NEAR <= strength <= max(wanted, _STRONGEST) * _NEAR:
            return None
        apart = [shown.told_apart(effect.hidden, other) for other in effect.nearest.values()]
        is_held = max(apart) <= _ALIKE if kind == "look_alikes" else min(apart, default=np.inf) >= _TOLD_APART
        if not is_held:
            return None
        stated: dict[str, Any] = {"block": effect.block, "strength": strength}
        if effect.name != "unknown":
            stated |= {"name": effect.name, "parameters": effect.parameters}
        truth = {"hidden": kind, "effects": [stated]}
        if kind == "look_alikes":
            truth["equals"] = [[other] for other in effect.nearest]
        return replace(flight, hidden=effect.hidden, truth=truth)


@dataclass(frozen=True, eq=False)
class _OfOneCase:
    """One effect of any size, from the same draws at each."""

    draw: Draw
    wing: DescribedWing
    seed: list[int]

    def at(self, size: float) -> DrawnEffect:
        """The effect of a size about one."""
        return self.draw(self.wing, np.random.default_rng(self.seed), size)

    def of_strength(self, shown: ShownChange, wanted: float) -> tuple[DrawnEffect, float]:
        """The effect whose strength comes nearest to a wanted one, by secants of logarithms."""
        known: list[tuple[float, float, DrawnEffect]] = []
        size = 1.0
        for _ in range(_MOST_TRIES):
            effect = self.at(size)
            strength = max(shown.strength(effect.hidden), 1e-9)
            known.append((size, strength, effect))
            if max(strength / wanted, wanted / strength) <= _NEAR:
                break
            below = max((each for each in known if each[1] < wanted), key=lambda each: each[1], default=None)
            above = min((each for each in known if each[1] >= wanted), key=lambda each: each[1], default=None)
            if below is not None and above is not None:
                share = np.log(wanted / below[1]) / np.log(above[1] / below[1])
                size = float(below[0] * (above[0] / below[0]) ** np.clip(share, 0.1, 0.9))
            else:
                size = float(np.clip(size * np.clip(wanted / strength, 0.1, 4.0), _SMALLEST, _LARGEST))
        _, strength, effect = min(known, key=lambda each: abs(np.log(each[1] / wanted)))
        return effect, strength


def _in_proportion(n: int) -> list[str]:
    exact = {kind: n * share / sum(_SHARES.values()) for kind, share in _SHARES.items()}
    counts = {kind: int(value) for kind, value in exact.items()}
    for kind in sorted(exact, key=lambda kind: counts[kind] - exact[kind])[: n - sum(counts.values())]:
        counts[kind] += 1
    return [kind for kind, count in counts.items() for _ in range(count)]


def _turns(draws: Sequence[Draw], generator: Generator) -> Callable[[int], list[Draw]]:
    """Every one in turn, in a drawn order, and those that follow it."""
    order = generator.permutation(len(draws))
    return lambda number: [draws[int(order[(number + k) % len(draws)])] for k in range(len(draws))]
