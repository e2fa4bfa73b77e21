"""Units at the border: UDUNITS text in, SI factors out, nothing guessed."""

from __future__ import annotations

import functools
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


def _article(noun: str) -> str:
    return "an" if noun[0] in "aeiou" else "a"
