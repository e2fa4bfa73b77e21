"""The mismatch with the laboratory treated as a diagnosis: which change explains it, by runs that chose nothing.

A liquid, or a change of one, is chosen by what it says at two points at which the source tells W̄ (below 1 g and at
the measured maximum), and judged at a third (where the beam works). The rules are those of `sloshlab diagnose`:
named is what gains at the judging point and reaches it, look-alikes are what does as well within chance, and where
nothing reaches it the answer is unknown.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

from studies.tank_reference.comparison import SPREAD_OF_W_BAR, Liquid, laboratory_w_bar
from studies.tank_reference.points import BEAM_POINT, DrivenPoint

CHOOSING: Final = (DrivenPoint(0.5, 11.4), DrivenPoint(4.0, 11.4))
JUDGING: Final = (BEAM_POINT,)
CHANCE: Final = 2.0
"""Standard errors that a difference has to exceed."""

Answer = Literal["named", "indistinguishable", "unknown", "nothing_missing"]


@dataclass(frozen=True)
class Misfit:
    """Distance of a liquid from the laboratory.

    Attributes
    ----------
    value : float
        Mean of |W̄ − measured| over points; NaN where one was not computed.
    standard_error : float
        By chance.
    """

    value: float
    standard_error: float

    def __str__(self) -> str:
        """As tables have it.

        Examples
        --------
        >>> str(Misfit(0.91, 0.03)), str(Misfit(float("nan"), float("nan")))
        ('0.91 ± 0.03', '–')
        """
        if math.isnan(self.value):
            return "–"
        return f"{self.value:.2f}" + ("" if math.isnan(self.standard_error) else f" ± {self.standard_error:.2f}")


def misfit(liquid: Liquid, points: Sequence[DrivenPoint]) -> Misfit:
    """Mean distance of W̄ from the laboratory's.

    Parameters
    ----------
    liquid : mapping
    points : sequence of DrivenPoint
        At which the source tells W̄.
    """
    if any(point not in liquid for point in points):
        return Misfit(math.nan, math.nan)
    means = [liquid[point].w_bar for point in points]
    distances = [abs(mean.value - laboratory_w_bar(point)) for mean, point in zip(means, points, strict=True)]
    # an error that is not known is not zero: nothing is then beyond chance
    errors = [mean.standard_error for mean in means]
    return Misfit(sum(distances) / len(points), math.hypot(*errors) / len(points))


@dataclass(frozen=True)
class Verdict:
    """What may be said.

    Attributes
    ----------
    answer : str
        As of `sloshlab diagnose`.
    names : tuple of str
        Of what is named or cannot be told apart; of unknown what comes nearest.
    gain : float
        Of the best over the liquid as it is, at the points that chose nothing, in W̄.
    left : float
        What the best leaves there.
    """

    answer: Answer
    names: tuple[str, ...]
    gain: float
    left: float


def verdict(believed: Liquid, changed: Mapping[str, Liquid]) -> Verdict:
    """Judge the changes of a liquid.

    Parameters
    ----------
    believed : mapping
        The liquid as it is.
    changed : mapping
        Liquids with a change by its name; those that were not computed at all points are passed over.
    """
    before = misfit(believed, JUDGING)
    spread = SPREAD_OF_W_BAR * sum(laboratory_w_bar(point) for point in JUDGING) / len(JUDGING)
    known = {
        name: (misfit(liquid, CHOOSING), misfit(liquid, JUDGING))
        for name, liquid in changed.items()
        if not math.isnan(misfit(liquid, (*CHOOSING, *JUDGING)).value)
    }
    if before.value <= spread:
        return Verdict("nothing_missing", (), 0.0, before.value)
    if not known:
        return Verdict("unknown", (), 0.0, before.value)
    best = min(known, key=lambda name: known[name][0].value)
    chosen, judged = known[best]
    gain = before.value - judged.value
    alike = tuple(name for name, (choosing, _) in known.items() if not _worse(choosing, chosen))
    reaches = judged.value <= spread + CHANCE * judged.standard_error
    gains = gain > CHANCE * math.hypot(before.standard_error, judged.standard_error)
    if not (reaches and gains):
        return Verdict("unknown", alike, gain, judged.value)
    also = tuple(name for name in alike if not _worse(known[name][1], judged))
    return Verdict("named" if len(also) == 1 else "indistinguishable", also, gain, judged.value)


def _worse(one: Misfit, best: Misfit) -> bool:
    return one.value - best.value > CHANCE * math.hypot(one.standard_error, best.standard_error)


def misfit_table(liquids: Mapping[str, Liquid]) -> Iterator[str]:
    """Yield the lines of a Markdown table: how far liquids are from the laboratory.

    Parameters
    ----------
    liquids : mapping
        By their names.
    """
    yield "| liquid | misfit where it may choose | misfit where it is judged |"
    yield "|---|---|---|"
    for name, liquid in liquids.items():
        if math.isnan(misfit(liquid, CHOOSING).value) and math.isnan(misfit(liquid, JUDGING).value):
            continue
        yield f"| {name} | {misfit(liquid, CHOOSING)} | {misfit(liquid, JUDGING)} |"


def verdict_table(verdicts: Mapping[str, Verdict]) -> Iterator[str]:
    """Yield the lines of a Markdown table of answers.

    Parameters
    ----------
    verdicts : mapping
        By the names of the liquids that are doubted.
    """
    yield "| doubted | answer | named, equal, or nearest | gain where it is judged | left there |"
    yield "|---|---|---|---|---|"
    for name, found in verdicts.items():
        names = ", ".join(found.names) or "–"
        numbers = f"{found.gain:.2f} | {found.left:.2f}".replace("-", "−")
        yield f"| {name} | `{found.answer}` | {names} | {numbers} |"
