"""Words and units in the names of effects and of their numbers."""

from __future__ import annotations

from typing import Final

_UNITS: Final = (
    ("_n_s2_per_m2", "N s²/m²"),
    ("_n_s_per_m", "N s/m"),
    ("_n_per_m3", "N/m³"),
    ("_n_per_m2", "N/m²"),
    ("_n_per_m", "N/m"),
    ("_rad_per_n_m", "rad/(N m)"),
    ("_rad_per_s", "rad/s"),
    ("_m_per_s", "m/s"),
    ("_kg_per_s", "kg/s"),
    ("_per_m", "1/m"),
    ("_rad", "rad"),
    ("_hz", "Hz"),
    ("_kg", "kg"),
    ("_n", "N"),
    ("_g", "g"),
    ("_s", "s"),
    ("_m", "m"),
)
_OF_A_CHANNEL: Final = ("amplitude", "limit", "rate")
"""Numbers of sensor effects in the unit of their channel."""
_PEOPLE: Final = frozenset({"coulomb", "faraday", "stribeck"})
"""After whom effects are called."""


def in_words(name: str) -> str:
    """A name, or names joined, as a sentence has it.

    Examples
    --------
    >>> in_words("coulomb_friction + sensor_delay")
    'Coulomb friction + sensor delay'
    """
    return " ".join(word.capitalize() if word in _PEOPLE else word for word in name.replace("_", " ").split(" "))


def is_calibrated(parameter: str) -> bool:
    """Whether a number is known no better than the gains of channels: it is no time, no frequency and no ratio.

    Examples
    --------
    >>> [is_calibrated(name) for name in ("gap_m", "rate in run_1", "delay_s", "frequency_hz", "ratio")]
    [True, True, False, False, False]
    """
    return parameter.partition(" in ")[0] in _OF_A_CHANNEL or named_and_units(parameter)[1] not in ("", "s", "Hz")


def named_and_units(parameter: str) -> tuple[str, str]:
    """Words and units of a parameter's name.

    Examples
    --------
    >>> named_and_units("stribeck_velocity_m_per_s"), named_and_units("ratio")
    (('Stribeck velocity', 'm/s'), ('ratio', ''))
    >>> named_and_units("start_s in run_02")
    ('start in run_02', 's')
    """
    parameter, of, run = parameter.partition(" in ")
    # Longer endings come first in the list, as `_m` is the end of `_n_per_m`, too.
    for ending, units in _UNITS:
        if parameter.endswith(ending):
            return in_words(parameter.removesuffix(ending)) + of + run, units
    return in_words(parameter) + of + run, ""
