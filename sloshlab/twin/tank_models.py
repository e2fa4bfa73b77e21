"""Tank models by the names of a rig file's [twin] table, each a function that gives the forces of the liquid.

Another model is one function and one line::

    @tank_model("half_a_ball")
    def half_a_ball(rig, parameters, folder):
        return (BOUNCING_BALL(liquid_mass_kg=0.5 * rig.liquid_mass_kg, height_m=rig.tank.height_m, **parameters),)

The data-driven model ``rom`` is registered by `sloshlab.twin.reduced_order_model_force`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from sloshlab.errors import InputError, RigError
from sloshlab.rig import Rig
from sloshlab.twin.measured_maps import terms_from_maps
from sloshlab.twin.structure_forces import VISCOUS_DAMPING
from sloshlab.twin.tank_forces import BOUNCING_BALL
from sloshlab.twin.terms import Term

TankModel = Callable[[Rig, Mapping[str, Any], Path], tuple[Term, ...]]

_MODELS: dict[str, TankModel] = {}


def tank_model(name: str) -> Callable[[TankModel], TankModel]:
    """Make a tank model known by its name; it gets the rig, its parameters, and the folder of the rig file."""

    def register(model: TankModel) -> TankModel:
        _MODELS[name] = model
        return model

    return register


def tank_terms(rig: Rig, folder: Path | None = None) -> tuple[Term, ...]:
    """Forces of the liquid as [twin] describes them; none where there is no such table.

    Raises
    ------
    RigError
        If parameters are missing or impossible, or the model is not available.
    """
    if rig.twin is None:
        return ()
    name = rig.twin.tank_model
    if name not in _MODELS:
        raise RigError(
            "rig: twin.tank_model",
            got=name,
            allowed=", ".join(sorted(_MODELS)),
            remedy="import the module that registers this model, or choose another one",
        )
    try:
        return _MODELS[name](rig, rig.twin.parameters, folder or Path())
    except (InputError, TypeError) as error:
        if isinstance(error, RigError):
            raise
        raise RigError(f"rig: twin.parameters: {error}") from error


@tank_model("frozen")
def _frozen(rig: Rig, parameters: Mapping[str, Any], folder: Path) -> tuple[Term, ...]:
    if parameters:
        raise InputError("frozen", got=", ".join(sorted(parameters)), allowed="no parameters")
    return ()


@tank_model("viscous")
def _viscous(rig: Rig, parameters: Mapping[str, Any], folder: Path) -> tuple[Term, ...]:
    if "maps" in parameters:
        return terms_from_maps(rig, parameters, folder)
    unknown = sorted(set(parameters) - {"damping_kg_per_s"})
    if unknown or "damping_kg_per_s" not in parameters:
        got = ", ".join(unknown) or "nothing"
        raise InputError("viscous", got=got, allowed="damping_kg_per_s, or maps and metric")
    return (VISCOUS_DAMPING(place="tank", damping_n_s_per_m=parameters["damping_kg_per_s"]),)


@tank_model("bouncing_ball")
def _bouncing_ball(rig: Rig, parameters: Mapping[str, Any], folder: Path) -> tuple[Term, ...]:
    fixed = {"liquid_mass_kg": rig.liquid_mass_kg, "height_m": rig.tank.height_m}
    return (BOUNCING_BALL(**{**fixed, **parameters}),)
