"""All networks by name, for saved models and command lines."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from sloshlab.errors import InputError
from sloshlab.reduced_order_model.networks.multilayer import Multilayer
from sloshlab.reduced_order_model.networks.network import Network
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis, RadialBasis

NETWORKS: Final = (NormalisedRadialBasis.kind, RadialBasis.kind, Multilayer.kind)
LARGEST_PARAMETERS: Final = 12_000
"""The matrix of the least-squares problem has this many rows: 1.2 GB."""


def network_of(kind: str, settings: Mapping[str, Any]) -> Network:
    """Make a network from its name and settings.

    Parameters
    ----------
    kind : str
        One of `NETWORKS`.
    settings : mapping
        As `Network.settings` gives them.

    Raises
    ------
    InputError
        If there is no such network, or it is too large.

    Examples
    --------
    >>> network_of("normalised_rbf", {"n_inputs": 70, "n_neurons": 35}).n_parameters
    2485
    """
    if kind not in NETWORKS:
        raise InputError("network", got=repr(kind), allowed=", ".join(NETWORKS))
    n_inputs = _positive_integer("inputs", settings.get("n_inputs"))
    network: Network
    if kind == Multilayer.kind:
        layers = tuple(_positive_integer("neurons", size) for size in str(settings.get("layers", "")).split())
        network = Multilayer(n_inputs, layers, str(settings.get("activation", "tanh")))
    else:
        n_neurons = _positive_integer("neurons", settings.get("n_neurons"))
        network = (NormalisedRadialBasis if kind == NormalisedRadialBasis.kind else RadialBasis)(
            n_inputs, n_neurons
        )
    if network.n_parameters > LARGEST_PARAMETERS:
        raise InputError(
            f"network {kind}",
            got=f"{network.n_parameters} parameters",
            allowed=f"at most {LARGEST_PARAMETERS}",
            remedy="take fewer delays or neurons",
        )
    return network


def _positive_integer(what: str, value: object) -> int:
    try:
        number = int(str(value))
    except ValueError:
        number = 0
    if not 1 <= number <= LARGEST_PARAMETERS:
        raise InputError(f"network: {what}", got=repr(value), allowed=f"a whole number 1 … {LARGEST_PARAMETERS}")
    return number
