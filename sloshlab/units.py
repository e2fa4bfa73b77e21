"""Units at the border: UDUNITS text in, SI factors out, nothing guessed."""

from __future__ import annotations

import functools
import re
from dataclasses import dataclass
from typing import Annotated, Final

from sloshlab.errors import UnitsError
from sloshlab.registry import one_of

SI_UNITS: Final[dict[str, str]] = {
    "force": "N",
    "acceleration": "m s-2",
    "velocity": "m s-1",
    "displacement": "m",
    "voltage": "V",
}
"""Quantity of a channel → the units that it has inside the software."""

ChannelQuantity = Annotated[str, one_of(lambda: tuple(SI_UNITS))]

_LONGEST_UNITS = 64


@functools.lru_cache(maxsize=256)
def factor_to_si(units: str, quantity: str) -> float:
    """Factor that turns numbers in `units` into SI numbers of `quantity`.

    Parameters
    ----------
    units : str
        UDUNITS text, for example ``"kN"`` or ``"cm s-2"``.
    quantity : str
        One of the keys of `SI_UNITS`.

    Returns
    -------
    float
        Multiply by it; never an offset.

    Raises
    ------
    UnitsError
        If the units are unknown, belong to another quantity, or have an offset.

    Examples
    --------
    >>> factor_to_si("kN", "force")
    1000.0
    >>> factor_to_si("g", "force")
    Traceback (most recent call last):
    ...
    sloshlab.errors.UnitsError: units of a force: got 'g'; allowed: units convertible to N; remedy: \
in UDUNITS 'g' is the gram; a force in gram-force is 'gf', an acceleration in g is 'gravity'
    """
    if quantity not in SI_UNITS:
        raise UnitsError("quantity", got=repr(quantity), allowed=", ".join(SI_UNITS))
    si = SI_UNITS[quantity]
    if units == si:
        return 1.0
    # only where the units are not SI already
    import cf_units

    what = f"units of {_article(quantity)} {quantity}"
    remedy = f"state the units the channel really has, for example '{si}'"
    if units.strip() == "g":
        remedy = "in UDUNITS 'g' is the gram; a force in gram-force is 'gf', an acceleration in g is 'gravity'"
    if not units.strip() or len(units) > _LONGEST_UNITS or not units.isprintable():
        raise UnitsError(what, got=repr(units[:_LONGEST_UNITS]), allowed="UDUNITS text", remedy=remedy)
    try:
        source = cf_units.Unit(units)
        convertible = source.is_convertible(si) and not source.is_time_reference()
    except ValueError:
        convertible = False
    if not convertible:
        raise UnitsError(what, got=repr(units), allowed=f"units convertible to {si}", remedy=remedy)
    # with an offset no factor is right
    if source.convert(0.0, si) != 0.0:
        raise UnitsError(what, got=repr(units), allowed="units without an offset", remedy=remedy)
    return float(source.convert(1.0, si))


@dataclass(frozen=True)
class Dimension:
    """Powers of mass and length in the dimension of a number; that of time has no use here."""

    mass: int = 0
    length: int = 0

    def inverse(self) -> Dimension:
        """Of one over the number."""
        return Dimension(-self.mass, -self.length)


DIMENSIONLESS: Final = Dimension()


@functools.lru_cache(maxsize=256)
def dimension_of(units: str) -> Dimension:
    """Dimension of a number of some units; none of what UDUNITS does not know.

    Parameters
    ----------
    units : str
        UDUNITS text; ``"g"`` is that of an acceleration, as in the names of numbers.

    Examples
    --------
    >>> dimension_of("N s m-1"), dimension_of("N s²/m²")
    (Dimension(mass=1, length=0), Dimension(mass=1, length=-1))
    >>> dimension_of("rad/(N m)"), dimension_of("g"), dimension_of("1")
    (Dimension(mass=-1, length=-2), Dimension(mass=0, length=1), Dimension(mass=0, length=0))
    """
    import cf_units

    if len(units) > _LONGEST_UNITS:
        return DIMENSIONLESS
    try:
        base_units = str(cf_units.Unit("gravity" if units == "g" else units).definition)
    except ValueError:
        return DIMENSIONLESS
    powers = {unit: int(power or 1) for unit, power in re.findall(r"\b(kg|m)(-?\d+)?(?=\.|$)", base_units)}
    return Dimension(powers.get("kg", 0), powers.get("m", 0))


def _article(noun: str) -> str:
    return "an" if noun[0] in "aeiou" else "a"
