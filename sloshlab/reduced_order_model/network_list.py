"""All networks by name, for saved models and command lines."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from sloshlab.errors import InputError
from sloshlab.reduced_order_model.networks.multilayer import Multilayer
from sloshlab.reduced_order_model.networks.network import LARGEST_PARAMETERS, Network
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis, RadialBasis
from sloshlab.registry import Registry

NETWORKS: Final[Registry[type[Network]]] = Registry("network")
for _network in (NormalisedRadialBasis, RadialBasis, Multilayer):
    NETWORKS.add(_network.kind, _network)


def network_of(kind: str, settings: Mapping[str, Any]) -> Network:
    """Make a network from its name and settings.

    Parameters
    ----------
    kind : str
        A name of `NETWORKS`.
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
    network = NETWORKS[kind].of_settings(settings)
    # before a matrix of that many rows is asked for; a saved model may name any size
    if network.n_parameters > LARGEST_PARAMETERS:
        raise InputError(
            f"network {kind}",
            got=f"{network.n_parameters} parameters",
            allowed=f"at most {LARGEST_PARAMETERS}",
            remedy="take fewer delays or neurons",
        )
    return network
