"""What a simulation says of its data-driven tank model: its size and scaling, and where it left what it knows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final

from sloshlab.reduced_order_model.departures import Departure
from sloshlab.twin.reduced_order_model_domain import without_domain
from sloshlab.twin.reduced_order_model_force import NAME, description_of
from sloshlab.twin.simulation import Simulation

OUTSIDE: Final = "simulated_outside_domain"
"""Global attribute of a simulated recording."""
_SEPARATOR: Final = " | "


def departure_attributes(left: Sequence[Departure]) -> dict[str, str]:
    """Return the attribute that keeps with a recording where its tank model was outside its domain of validity.

    Parameters
    ----------
    left : sequence of Departure
    """
    return {OUTSIDE: _SEPARATOR.join(str(departure) for departure in left)} if left else {}


def departures_of(attributes: Mapping[str, Any]) -> list[str]:
    """Return what `departure_attributes` kept.

    Examples
    --------
    >>> departures_of({"simulated_outside_domain": "too strong | too weak"}), departures_of({})
    (['too strong', 'too weak'], [])
    """
    kept = str(attributes.get(OUTSIDE, ""))
    return kept.split(_SEPARATOR) if kept else []


def with_tank_model(summary: dict[str, Any], simulation: Simulation, left: Sequence[Departure]) -> dict[str, Any]:
    """Return the summary of a simulation with what there is to say of its tank model.

    Parameters
    ----------
    summary : dict
        With ``lines`` and ``flags``.
    simulation : Simulation
    left : sequence of Departure
        Of this simulation; each is a flag.
    """
    terms = [term for term in simulation.twin.terms if term.name == NAME]
    if not terms:
        return summary
    flags = [*summary["flags"], *(str(departure) for departure in left)]
    if without_domain(simulation):
        flags.append("the tank model does not tell where it was trained; whether it is valid here is not known")
    lines = [*summary["lines"], *(line for term in terms for line in description_of(term))]
    return {**summary, "lines": lines, "flags": flags, "outside_domain": [asdict(departure) for departure in left]}
