"""Tank models by the names of a rig file's [twin] table, each a function that gives the forces of the liquid.

Another model is one function and one line::

    @tank_model("half_a_ball")
    def half_a_ball(rig, parameters, folder):
        return (BOUNCING_BALL(liquid_mass_kg=0.5 * rig.liquid_mass_kg, height_m=rig.tank.height_m, **parameters),)

An installed package declares its model as an entry point of the group ``sloshlab.tank_models`` instead; then every
command knows it. The names stand in `sloshlab.rig`, which checks them when a rig file is read.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from sloshlab.errors import InputError, RigError
from sloshlab.rig import TANK_MODELS, Rig
from sloshlab.twin.measured_maps import terms_from_maps
from sloshlab.twin.rocking_liquid import rocking_liquid
from sloshlab.twin.structure_forces import VISCOUS_DAMPING
from sloshlab.twin.tank_forces import BOUNCING_BALL
from sloshlab.twin.terms import Term

TankModel = Callable[[Rig, Mapping[str, Any], Path], tuple[Term, ...]]


def tank_model(name: str) -> Callable[[TankModel], TankModel]:
    """Make a tank model known by its name; it gets the rig, its parameters, and the folder of the rig file."""
    return TANK_MODELS.register(name)


def tank_terms(rig: Rig, folder: Path | None = None) -> tuple[Term, ...]:
    """Forces of the liquid as [twin] describes them; none where there is no such table.

    Raises
    ------
    RigError
        If parameters are missing or impossible, or the model is not available.
    """
    if rig.twin is None:
        return ()
    model: TankModel = TANK_MODELS[rig.twin.tank_model]
    try:
        return model(rig, rig.twin.parameters, folder or Path())
    except (InputError, TypeError) as error:
        if isinstance(error, RigError):
            raise
        raise RigError(f"rig: twin.parameters: {error}") from error


def frozen(rig: Rig, parameters: Mapping[str, Any], folder: Path) -> tuple[Term, ...]:
    """Liquid that moves with the tank: no force beside its inertia."""
    if parameters:
        raise InputError("frozen", got=", ".join(sorted(parameters)), allowed="no parameters")
    return ()


def viscous(rig: Rig, parameters: Mapping[str, Any], folder: Path) -> tuple[Term, ...]:
    """A damper between tank and liquid, of one coefficient or as maps say."""
    if "maps" in parameters:
        return terms_from_maps(rig, parameters, folder)
    unknown = sorted(set(parameters) - {"damping_kg_per_s"})
    if unknown or "damping_kg_per_s" not in parameters:
        got = ", ".join(unknown) or "nothing"
        raise InputError("viscous", got=got, allowed="damping_kg_per_s, or maps and metric")
    return (VISCOUS_DAMPING(place="tank", damping_n_s_per_m=parameters["damping_kg_per_s"]),)


def bouncing_ball(rig: Rig, parameters: Mapping[str, Any], folder: Path) -> tuple[Term, ...]:
    """The bouncing ball of (2.1); height and mass are those of the rig unless stated."""
    fixed = {"liquid_mass_kg": rig.liquid_mass_kg, "height_m": rig.tank.height_m}
    # what the file states wins over what follows from the rig
    return (BOUNCING_BALL(**{**fixed, **parameters}),)


def lateral(rig: Rig, parameters: Mapping[str, Any], folder: Path) -> tuple[Term, ...]:
    """Liquid that sloshes along a beam whose tip rocks the tank; masses and moments are those of the box."""
    return rocking_liquid(rig, **parameters)
