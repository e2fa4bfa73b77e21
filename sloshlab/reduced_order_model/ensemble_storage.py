"""An ensemble on disk: one netCDF file (classic format) with what its members share once. Never pickle.

The same ensemble gives the same bytes.
"""

from __future__ import annotations

import json
import os
from typing import Any, Final

import numpy as np
from scipy.io import netcdf_file

from sloshlab.atomic_file import replaced
from sloshlab.reduced_order_model.agitation import Agitation
from sloshlab.reduced_order_model.ensemble import Ensemble, ResidualSpread
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.network_list import network_of
from sloshlab.reduced_order_model.regressors import Delays
from sloshlab.reduced_order_model.storage import SCALING, read_classic

FORMAT: Final = 1


def save_ensemble(ensemble: Ensemble, path: str | os.PathLike[str]) -> None:
    """Write an ensemble, completely or not at all.

    Parameters
    ----------
    ensemble : Ensemble
    path : path-like
    """
    first, members = ensemble.members[0], ensemble.members
    with replaced(path) as temporary, netcdf_file(temporary, "w", version=2, mmap=False) as file:
        file.sloshlab_ensemble = FORMAT
        file.network = first.network.kind
        file.network_settings = json.dumps(first.network.settings(), sort_keys=True)
        file.facts = json.dumps(
            {"ensemble": ensemble.facts, "members": [member.facts for member in members]}, sort_keys=True
        )
        file.agitation = json.dumps(
            [member.agitation and member.agitation.facts() for member in members], sort_keys=True
        )
        for name, dimensions, values, kind in (
            ("theta", ("member", "parameter"), np.stack([member.theta for member in members]), "f8"),
            ("scaling", ("member", "scaling_value"), np.array([_scaling(member) for member in members]), "f8"),
            ("sampling_rate_hz", ("one",), np.array([first.sampling_rate_hz]), "f8"),
            ("input_delays", ("input_delay",), np.array(first.delays.inputs), "i4"),
            ("output_delays", ("output_delay",), np.array(first.delays.outputs), "i4"),
            ("residual", ("residual_value",), _residual(ensemble.residual), "f8"),
        ):
            if values.size:
                for dimension, size in zip(dimensions, values.shape, strict=True):
                    if dimension not in file.dimensions:
                        file.createDimension(dimension, size)
                file.createVariable(name, kind, dimensions)[:] = values


def load_ensemble(path: str | os.PathLike[str]) -> Ensemble:
    """Read an ensemble that `save_ensemble` wrote.

    Raises
    ------
    InputError
        If the file is missing, too large, damaged, or no ensemble.
    """
    return read_classic(path, "ensemble", _ensemble)


def _scaling(model: ReducedOrderModel) -> list[float]:
    return [getattr(model.scaling, name) for name in SCALING]


def _residual(residual: ResidualSpread) -> np.ndarray[Any, Any]:
    return np.array([residual.constant, residual.slope, *residual.reach])


def _ensemble(source: Any) -> Ensemble:
    if source.sloshlab_ensemble != FORMAT:
        raise ValueError(f"format {source.sloshlab_ensemble}")
    variables = {name: np.array(variable.data) for name, variable in source.variables.items()}
    settings, facts, memories = (
        json.loads(text) for text in (source.network_settings, source.facts, source.agitation)
    )
    network = network_of(source.network.decode(), settings)
    inputs, outputs = (
        tuple(int(d) for d in variables.get(name, ())) for name in ("input_delays", "output_delays")
    )
    members = []
    for theta, scaling, memory, told in zip(
        variables["theta"], variables["scaling"], memories, facts["members"], strict=True
    ):
        agitation = None if memory is None else Agitation.from_facts(memory)
        delays = Delays(inputs, outputs, 0 if agitation is None else agitation.n_states)
        members.append(
            ReducedOrderModel(
                network,
                theta.astype(np.float64),
                delays,
                Scaling(*(float(value) for value in scaling)),
                float(variables["sampling_rate_hz"][0]),
                dict(told),
                agitation,
            )
        )
    constant, slope, *reach = (float(value) for value in variables["residual"])
    return Ensemble(tuple(members), ResidualSpread(constant, slope, tuple(reach)), dict(facts["ensemble"]))
