"""Which gusts an aircraft flies through: those of the source, at speeds relative to the flutter that is found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from sloshlab.aeroelastic.gust import USUAL_LENGTH_IN_SEMI_CHORDS
from sloshlab.errors import InputError

OTHER_LENGTH_M: Final = 10.0
"""25 chords of the source's aircraft, if the b of its gust length is the chord that it says to be."""


@dataclass(frozen=True)
class GustCase:
    """A gust that is the same everywhere.

    Attributes
    ----------
    name : str
    speed_m_per_s, amplitude_m_per_s, length_m : float
        U, w_ga and L_g.
    figures : str
        Of the source that show its counterpart; empty if there are none.
    is_main : bool
        Whether it has the usual length; figures and ensembles are of these.
    """

    name: str
    speed_m_per_s: float
    amplitude_m_per_s: float
    length_m: float
    figures: str = ""
    is_main: bool = True


@dataclass(frozen=True)
class PrintedGust:
    """A gust of the source.

    Attributes
    ----------
    label : str
    speed_m_per_s, amplitude_m_per_s : float
        On its own aircraft.
    relative_to : str
        Its flutter speed ``frozen`` or ``lateral``, whose ratio to the speed is kept; ``both``: the share of the
        way from one to the other is.
    figures : str
    """

    label: str
    speed_m_per_s: float
    amplitude_m_per_s: float
    relative_to: str
    figures: str


PRINTED_FLUTTER: Final = {1: {"frozen": 18.95, "lateral": 18.80}, 2: {"frozen": 20.86, "lateral": 21.71}}
"""Symmetric flutter of the source's aircraft [m/s] with one and with two tanks (Figs. 3.18, 3.23)."""
PRINTED_GUSTS: Final = {
    1: (
        PrintedGust("before", 18.0, 2.5, "frozen", "Figs. 3.19–3.21"),
        PrintedGust("after", 19.35, 0.3, "frozen", "Fig. 3.22"),
    ),
    2: (
        PrintedGust("before", 18.0, 3.0, "frozen", "Fig. 3.24"),
        PrintedGust("between", 21.1, 0.2, "both", "Fig. 3.25"),
        PrintedGust("after", 22.5, 0.2, "lateral", "Fig. 3.26"),
    ),
}
"""By number of tanks."""


def source_gusts(n_tanks: int, flutter_m_per_s: dict[str, float], semi_chord_m: float) -> tuple[GustCase, ...]:
    """Gusts of the source, as far from the flutter of this aircraft as they were from that of its own.

    Parameters
    ----------
    n_tanks : int
        1 or 2; others have the gusts of 1.
    flutter_m_per_s : dict of str to float
        First symmetric flutter, ``frozen`` and ``lateral``.
    semi_chord_m : float

    Raises
    ------
    InputError
        If no flutter was found, so that the speeds are not known.
    """
    number = n_tanks if n_tanks in PRINTED_GUSTS else 1
    printed = PRINTED_FLUTTER[number]
    cases = []
    for gust in PRINTED_GUSTS[number]:
        speed = _speed(gust, printed, flutter_m_per_s)
        lengths = {"": USUAL_LENGTH_IN_SEMI_CHORDS * semi_chord_m, ", 10 m": OTHER_LENGTH_M}
        for ending, length in lengths.items():
            name = f"{gust.label}, {gust.amplitude_m_per_s:g} m/s{ending}"
            is_main = not ending
            cases.append(
                GustCase(name, speed, gust.amplitude_m_per_s, length, gust.figures if is_main else "", is_main)
            )
    return tuple(cases)


def _speed(gust: PrintedGust, printed: dict[str, float], found: dict[str, float]) -> float:
    needed = ("frozen", "lateral") if gust.relative_to == "both" else (gust.relative_to,)
    missing = [name for name in needed if name not in found]
    if missing:
        raise InputError(
            "gusts of the source",
            got=f"no symmetric flutter of the model {missing[0]}",
            allowed="speeds relative to it",
            remedy="widen --from and --to, or give --gust-speed and --gust",
        )
    if gust.relative_to != "both":
        return gust.speed_m_per_s * found[gust.relative_to] / printed[gust.relative_to]
    share = (gust.speed_m_per_s - printed["frozen"]) / (printed["lateral"] - printed["frozen"])
    return found["frozen"] + share * (found["lateral"] - found["frozen"])
