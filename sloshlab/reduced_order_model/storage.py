"""A model on disk: one netCDF file (classic format), readable without the code that trained it. Never pickle.

The same model gives the same bytes. Numbers are variables: attributes of this format are single precision.
Parameters are one vector; what they mean follows from the attributes `network` and `network_settings`.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
from scipy.io import netcdf_file

from sloshlab.atomic_file import replaced
from sloshlab.errors import InputError
from sloshlab.reduced_order_model.agitation import Agitation
from sloshlab.reduced_order_model.break_up import BreakUp
from sloshlab.reduced_order_model.fill_input import FillInput
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.network_list import network_of
from sloshlab.reduced_order_model.regressors import Delays

FORMAT: Final = 1
# checked before reading: a file may hold anything
LARGEST_BYTES: Final = 50_000_000
Made = TypeVar("Made")
SCALING: Final = ("input_offset", "input_scale", "output_offset", "output_scale")


def save_model(model: ReducedOrderModel, path: str | os.PathLike[str]) -> None:
    """Write a model, completely or not at all.

    Parameters
    ----------
    model : ReducedOrderModel
    path : path-like
    """
    with replaced(path) as temporary, netcdf_file(temporary, "w", version=2, mmap=False) as file:
        file.sloshlab_reduced_order_model = FORMAT
        file.network = model.network.kind
        file.network_settings = json.dumps(model.network.settings(), sort_keys=True)
        file.facts = json.dumps(model.facts, sort_keys=True, ensure_ascii=True)
        if model.agitation is not None:
            file.agitation = json.dumps(model.agitation.facts(), sort_keys=True)
        if model.fill is not None:
            file.fill = json.dumps(model.fill.facts(), sort_keys=True)
        if model.break_up is not None:
            file.break_up = json.dumps(model.break_up.facts(), sort_keys=True)
        scaling = [getattr(model.scaling, name) for name in SCALING]
        for name, values, kind in (
            ("theta", model.theta, "f8"),
            # a variable, as attributes of this format are single precision
            ("sampling_rate_hz", np.array([model.sampling_rate_hz]), "f8"),
            ("scaling", np.array(scaling), "f8"),  # in the order of `SCALING`
            ("input_delays", np.array(model.delays.inputs), "i4"),
            ("output_delays", np.array(model.delays.outputs), "i4"),
        ):
            # the classic format has no dimension of length zero but the unlimited one
            if values.size:
                file.createDimension(name, values.size)
                file.createVariable(name, kind, (name,))[:] = values


def load_model(path: str | os.PathLike[str]) -> ReducedOrderModel:
    """Read a model that `save_model` wrote.

    Raises
    ------
    InputError
        If the file is missing, too large, damaged, or no model.
    """
    return read_classic(path, "model", _model)


def read_classic(path: str | os.PathLike[str], what: str, made_of: Callable[[Any], Made]) -> Made:
    """Make something of a netCDF classic file whose contents may be anything.

    Parameters
    ----------
    path : path
    what : str
        For messages, such as ``"model"``.
    made_of : callable
        (open file) → what is in it; may fail in any way that bad contents make it fail.

    Raises
    ------
    InputError
        If the file is missing, too large, damaged, or not what it should be.
    """
    file = Path(path)
    try:
        size = file.stat().st_size
        if size > LARGEST_BYTES:
            raise InputError(f"{what} {file}", got=f"{size} bytes", allowed=f"at most {LARGEST_BYTES}")
        with netcdf_file(file, "r", mmap=False) as source:
            return made_of(source)
    except InputError as error:
        raise error if str(file) in str(error) else _damaged(what, file, error) from error
    except OSError as error:
        raise InputError(f"{what} {file}", got=error.strerror or str(error), allowed="a readable file") from error
    except (TypeError, ValueError, KeyError, IndexError, AttributeError, AssertionError, MemoryError) as error:
        raise _damaged(what, file, error) from error


def _damaged(what: str, file: Path, error: Exception) -> InputError:
    reason = " ".join(str(error).split())[:160]
    return InputError(f"{what} {file}", got=f"contents that are no {what} ({reason})", remedy="train it again")


def _model(source: Any) -> ReducedOrderModel:
    if source.sloshlab_reduced_order_model != FORMAT:
        raise ValueError(f"format {source.sloshlab_reduced_order_model}")
    variables = {name: np.array(variable.data) for name, variable in source.variables.items()}
    settings = json.loads(source.network_settings)
    facts = json.loads(source.facts)
    if not isinstance(settings, dict) or not isinstance(facts, dict):
        raise ValueError("attributes")
    agitation = Agitation.from_facts(json.loads(source.agitation)) if hasattr(source, "agitation") else None
    inputs, outputs = (
        tuple(int(d) for d in variables.get(name, ())) for name in ("input_delays", "output_delays")
    )
    fill = FillInput.from_facts(json.loads(source.fill)) if hasattr(source, "fill") else None
    n_states = (0 if agitation is None else agitation.n_states) + (fill is not None)
    delays = Delays(inputs, outputs, n_states)
    return ReducedOrderModel(
        network_of(source.network.decode(), settings),
        variables["theta"].astype(np.float64),
        delays,
        Scaling(*(float(value) for value in variables["scaling"])),
        float(variables["sampling_rate_hz"][0]),
        facts,
        agitation,
        BreakUp(**json.loads(source.break_up)) if hasattr(source, "break_up") else None,
        fill,
    )
