"""Numbers of a user's twin that retuning took as far as it may: tolerances too small, or missing physics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from sloshlab.identification.baseline_parameter import BaselineParameter

_NEAR: Final = 1e-3
"""Of a tolerance: a fit reaches a bound to rounding only."""
_MOST_NAMED: Final = 3


def at_their_bounds(parameters: Sequence[BaselineParameter], values: Mapping[str, float]) -> tuple[str, ...]:
    """One line on the parameters that ended at a bound; none where no one did.

    Parameters
    ----------
    parameters : sequence of BaselineParameter
        With their bounds in their own units.
    values : mapping
        Of the fitted model; a missing one is as believed.

    Returns
    -------
    tuple of str
        Empty or one.

    Examples
    --------
    >>> k = BaselineParameter("k", 300.0, 1.0, "N m-1")
    >>> at_their_bounds([k], {"k": 303.0})
    ()
    >>> at_their_bounds([k], {"k": 304.0})[0]
    'retuned as far as it may: k to 304 N m-1, believed 300 ± 1; widen a tolerance that is too small'
    """
    ends = []
    for parameter in parameters:
        value, (low, high) = values.get(parameter.name, parameter.believed), parameter.bounds
        if not low + _NEAR * parameter.tolerance < value < high - _NEAR * parameter.tolerance:
            units = "" if parameter.units == "1" else f" {parameter.units}"
            believed = f"believed {parameter.believed:.6g} ± {parameter.tolerance:.6g}"
            ends.append(f"{parameter.name} to {value:.6g}{units}, {believed}")
    if not ends:
        return ()
    more = f" and {len(ends) - _MOST_NAMED} more" if len(ends) > _MOST_NAMED else ""
    named = "; ".join(ends[:_MOST_NAMED])
    return (f"retuned as far as it may: {named}{more}; widen a tolerance that is too small",)
