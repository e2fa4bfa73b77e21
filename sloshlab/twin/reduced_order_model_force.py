"""The trained model as the tank of the twin: ``tank_model = "rom"``, ``parameters = {rom = "ROM.nc"}`` in a rig.

The model is carried whole by its force, so that a saved twin needs neither the model's file nor what trained it.
Where the rig's tank or liquid is another one than the model's, it is scaled (2.33–2.35); its delays then count
samples of another length, and nothing is resampled.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from sloshlab.errors import InputError
from sloshlab.reduced_order_model.break_up import BreakUp
from sloshlab.reduced_order_model.compiled_step import (
    N_HEADER,
    N_VALUES,
    NETWORK_NUMBERS,
    RADIAL,
    TANH,
    step_table,
    workspace_size,
)
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.networks.network import LARGEST_PARAMETERS
from sloshlab.reduced_order_model.regressors import MOST_DELAYS
from sloshlab.reduced_order_model.stepping import require_steppable
from sloshlab.reduced_order_model.storage import load_model
from sloshlab.reduced_order_model.tank_scaling import HYPOTHESES, TankScaling, model_for_tank
from sloshlab.reduced_order_model.validity_domain import ValidityDomain
from sloshlab.rig import Rig
from sloshlab.twin.reduced_order_model_law import force_between_instants, runaway, step_of_model
from sloshlab.twin.terms import ForceKind, Parameter, Term, register

FloatArray = npt.NDArray[np.float64]

NAME: Final = "reduced_order_model"
_MULTILAYER: Final = (TANH, RADIAL)
_LARGEST: Final = 1e9
MOST_CONSTANTS: Final = 1
"""Regressors that do not change during a run: the fill level."""


def _parts(table: FloatArray) -> dict[str, FloatArray]:
    """The parts of a table by name.

    Raises
    ------
    InputError
        If its numbers contradict each other: the law trusts them.
    """
    header = table[:N_HEADER]
    whole = header.size == N_HEADER and np.isfinite(header).all() and (header == np.floor(header)).all()
    if not whole or header.min() < 0 or header.max() > 10 * LARGEST_PARAMETERS:
        raise _broken("sizes")
    sizes = [int(value) for value in header[2:]]
    edges = np.cumsum([N_HEADER, sizes[0] + sizes[1], *sizes[2:]])
    if edges[-1] > table.size or header[0] != table.size or header[1] not in NETWORK_NUMBERS:
        raise _broken("sizes")
    delays, layers, theta, break_up, domain = (table[a:b] for a, b in pairwise(edges))
    constants = table[edges[-1] :]
    if constants.size > MOST_CONSTANTS or not np.isfinite(constants).all() or (constants.size and sizes[1]):
        raise _broken("sizes")
    if break_up.size not in (0, len(fields(BreakUp))) or (break_up.size and sizes[1]):
        raise _broken("break-up")
    if break_up.size:
        BreakUp(*break_up.tolist())  # refuses impossible ones
    for values, largest in ((delays, MOST_DELAYS), (layers, LARGEST_PARAMETERS)):
        if not values.size or not ((values >= 1) & (values <= largest) & (values == np.floor(values))).all():
            raise _broken("delays or layers")
    if (
        theta.size != _n_parameters(int(header[1]), delays.size + constants.size, layers)
        or not np.isfinite(theta).all()
    ):
        raise _broken("parameters")
    return {
        "delays": delays,
        "layers": layers,
        "theta": theta,
        "break_up": break_up,
        "domain": domain,
        "constants": constants,
    }


def _broken(what: str) -> InputError:
    return InputError(f"{NAME}: {what} of its table", got="numbers that contradict", remedy="save the twin again")


def _n_parameters(network: int, n_inputs: int, layers: FloatArray) -> int:
    if network in _MULTILAYER:
        widths = [n_inputs, *(int(n) for n in layers), 1]
        return sum((before + 1) * after for before, after in pairwise(widths))
    return (n_inputs + 1) * int(layers[0]) + network if layers.size == 1 else -1


def _workspace(values: Mapping[str, float], table: FloatArray) -> int:
    _parts(table)
    return int(workspace_size(table))


REDUCED_ORDER_MODEL = register(
    ForceKind(
        NAME,
        ("tank",),
        (
            Parameter("sampling_rate_hz", "Hz", 1e-3, 1e6),
            Parameter("input_offset_m_per_s", "m s-1", -_LARGEST, _LARGEST),
            Parameter("input_scale_m_per_s", "m s-1", 1e-12, _LARGEST),
            Parameter("output_offset_n", "N", -_LARGEST, _LARGEST),
            Parameter("output_scale_n", "N", 1e-12, _LARGEST),
            Parameter("height_m", "m", 1e-6, 100.0),
            # this tank over that of the training
            Parameter("height_ratio", "1", 1e-6, 1e6, 1.0),
            Parameter("liquid_mass_ratio", "1", 1e-9, 1e9, 1.0),
        ),
        force_between_instants,
        events=runaway,
        limits=("the output of the model runs away",),
        update=step_of_model,
        update_rate=lambda values: values["sampling_rate_hz"],
        workspace=_workspace,
        equation="Δf(t_k) = g(v(t_k−1) … v(t_k−n), Δf(t_k−1) … Δf(t_k−m)) (2.23), cubic between the instants",
    )
)
assert len(REDUCED_ORDER_MODEL.parameters) == N_VALUES


def reduced_order_model(rig: Rig, parameters: Mapping[str, Any], folder: Path) -> tuple[Term, ...]:
    """The trained model of a file as tank model ``rom``."""
    unknown = sorted(set(parameters) - {"rom"})
    if unknown or not isinstance(parameters.get("rom"), str):
        raise InputError("rom", got=", ".join(unknown) or "no file", allowed='rom = "file.nc", a trained model')
    return (term_of(load_model(folder / parameters["rom"]), rig),)


def term_of(model: ReducedOrderModel, rig: Rig) -> Term:
    """Force of a trained model in the tank of a rig.

    Parameters
    ----------
    model : ReducedOrderModel
        Whose facts tell the tank of its training (`tank_facts`).
    rig : Rig
        Its tank and liquid; the model is scaled where they are others.

    Raises
    ------
    InputError
        If the model sees the present input, does not tell its tank, or was trained at other fill levels.
    """
    require_steppable(model)
    scaled, factors = model_for_tank(model, rig)
    return REDUCED_ORDER_MODEL(
        table=step_table(scaled, _domain_numbers(scaled.facts)),
        sampling_rate_hz=scaled.sampling_rate_hz,
        input_offset_m_per_s=scaled.scaling.input_offset,
        input_scale_m_per_s=scaled.scaling.input_scale,
        output_offset_n=scaled.scaling.output_offset,
        output_scale_n=scaled.scaling.output_scale,
        height_m=rig.tank.height_m,
        height_ratio=factors.velocity**2,
        liquid_mass_ratio=factors.force,
    )


def _domain_numbers(facts: Mapping[str, Any]) -> FloatArray:
    """First bin, weakest and strongest speeds; nothing where the model does not tell."""
    if "domain" not in facts:
        return np.empty(0)
    try:
        domain = ValidityDomain.of_facts(facts["domain"])
        return np.array([domain.first_bin, *domain.weakest_m_per_s, *domain.strongest_m_per_s], np.float64)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise InputError(
            "rom: domain of validity", got=f"no domain ({error})"[:80], remedy="train the model again"
        ) from error


def domain_of(term: Term) -> ValidityDomain | None:
    """Where the model of a term was trained, in the units of its training; None where it does not tell."""
    numbers = _parts(term.table)["domain"]
    if numbers.size < 3 or numbers.size % 2 == 0 or not np.isfinite(numbers[0]):
        return None
    weakest, strongest = numbers[1:].reshape(2, -1)
    return ValidityDomain(int(numbers[0]), tuple(weakest.tolist()), tuple(strongest.tolist()))


def description_of(term: Term) -> list[str]:
    """What a reader must know of the model in a tank: its size and rate, and how it was scaled."""
    parts, values = _parts(term.table), term.values
    n_in, n_out = (int(n) for n in term.table[2:4])
    memory = ", memory of whether the liquid is broken up" if parts["break_up"].size else ""
    fill = ", the fill level among its inputs" if parts["constants"].size else ""
    lines = [
        f"model: {n_in} past velocities and {n_out} past forces, {' + '.join(f'{n:g}' for n in parts['layers'])} "
        f"neurons{memory}{fill}, its own steps at {values['sampling_rate_hz']:g} Hz"
    ]
    height, mass = values["height_ratio"], values["liquid_mass_ratio"]
    if max(abs(height - 1), abs(mass - 1)) > 1e-9:
        lines.append(
            f"scaled to this tank (2.33–2.35): times × {height**0.5:.4g}, velocities × {height**0.5:.4g}, "
            f"forces × {mass:.4g}; supposing that {'; '.join(HYPOTHESES)}"
        )
    # of another liquid in the same tank nothing is known here but its mass
    if abs(height - 1) > 1e-9:
        error = TankScaling(height**0.5, height**0.5, mass, math.nan, math.nan).error
        lines.append(f"{error}, for the same liquid")
    return lines
