"""Liquid that sloshes sideways in a tank that rocks, as at the tip of a beam: the equivalent mechanical model.

The tip turns with its deflection, by one ratio: that of the first mode. Its moment comes back as a force by the
same ratio, so its sign plays no part.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi

import numpy as np

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import InputError, RigError
from sloshlab.lateral_sloshing.box_tank import Axis, BoxTank, equivalent_model
from sloshlab.modal.rig_beam import shapes_at
from sloshlab.rig import Rig
from sloshlab.twin.law import DISPLACEMENT, VELOCITY, law
from sloshlab.twin.terms import ForceKind, Parameter, Term, register

# the laws are compiled, so their arguments are described once, in sloshlab.twin.law
# mypy: disable-error-code="no-untyped-def"

_G = GRAVITY_M_PER_S2
_LEAST_LEVER_M = 1e-6


@law
def _rocking(motion, parameters, memory, rates):
    """−c² m (h ẍ − g (x − h u)), x = (h + g/ω²) p; the part of the acceleration ü in ẍ is an added mass."""
    omega = 2 * pi * parameters[0]
    mass, height, ratio = parameters[1], parameters[2], parameters[3]
    lever = height + _G / (omega * omega)
    x, speed = lever * memory[0], lever * memory[1]
    above = x - height * motion[DISPLACEMENT]
    pull = (
        _G * motion[DISPLACEMENT]
        - omega * omega * above
        - 2 * parameters[4] * omega * (speed - height * motion[VELOCITY])
    )
    rates[0], rates[1] = memory[1], pull / lever
    return ratio * ratio * mass * (_G * above - height * pull)


def _added_mass(values: Mapping[str, float]) -> float:
    of_mode = values["mass_kg"] * values["height_m"] ** 2
    return -(values["rotation_rad_per_m"] ** 2) * (of_mode + values["inertia_less_kg_m2"])


def _check(values: Mapping[str, float]) -> None:
    lever = values["height_m"] + _G / (2 * pi * values["frequency_hz"]) ** 2
    if abs(lever) < _LEAST_LEVER_M:
        raise InputError(
            "rocking_liquid: height_m", got=f"{values['height_m']:g}", allowed="not −g/ω², where nothing moves it"
        )


ROCKING_LIQUID = register(
    ForceKind(
        "rocking_liquid",
        ("structure",),
        (
            Parameter("frequency_hz", "Hz", 0.01, 1e4),
            Parameter("mass_kg", "kg", 0.0, 1e3),
            Parameter("height_m", "m", -100.0, 100.0),
            Parameter("rotation_rad_per_m", "rad m-1", -1e3, 1e3),
            Parameter("damping_ratio", "1", 0.0, 1.0, 0.005),
            Parameter("inertia_less_kg_m2", "kg m2", 0.0, 1e3, 0.0),
        ),
        _rocking,
        memory=lambda values, table: (0.0, 0.0),
        mass=_added_mass,
        moves_with_place=True,
        check=_check,
        equation="−c² m (h ẍ − g (x − h u)), ẍ = g u − ω² (x − h u) − 2ζω (ẋ − h u̇): a mass h above the axis, "
        "on a spring, in a tank that turns by c u; inertia that the liquid lacks against a solid is given back",
    )
)


def rotation_at_tip_rad_per_m(rig: Rig) -> float:
    """Rotation of the beam's tip over its deflection in the first mode [rad/m].

    Raises
    ------
    RigError
        If the rig has no beam, or its dimensions are not known.
    """
    described = rig.structure
    if described is None or described.kind != "beam":
        raise RigError("rig: structure", got="no beam", remedy="leave the model out: nothing rocks the tank")
    if described.length_m is None:
        raise RigError("rig: structure.length_m", got="nothing", remedy="give the beam's dimensions")
    step = 1e-4 * described.length_m
    tip, before, further = shapes_at(described, described.length_m - step * np.arange(3))[:, 0]
    return float((3 * tip - 4 * before + further) / (2 * step) / tip)


def rocking_liquid(
    rig: Rig,
    *,
    along: str = "length",
    centre_above_beam_m: float = 0.0,
    n_modes: int = 3,
    damping_ratio: float = 0.005,
    rotation_rad_per_m: float | None = None,
) -> tuple[Term, ...]:
    """Forces of the liquid that sloshes along the beam, beyond frozen liquid, one for each sloshing mode.

    Parameters
    ----------
    rig : Rig
    along : {"length", "width"}
        Side of the tank that lies along the beam.
    centre_above_beam_m : float
        Of the tank's centre above the beam's axis, about which the tip turns.
    n_modes : int
        Sloshing modes, ≥ 1.
    damping_ratio : float
    rotation_rad_per_m : float, optional
        Of the tank over its deflection; that of the beam's first mode unless stated.

    Raises
    ------
    InputError
        If the rig has no beam with dimensions, or a number is impossible.
    """
    axes: dict[str, Axis] = {"length": "x", "width": "y"}
    if along not in axes:
        raise InputError("lateral: along", got=repr(along)[:80], allowed="length or width")
    if n_modes < 1:
        raise InputError("lateral: n_modes", got=f"{n_modes}", allowed="≥ 1")
    tank = box_of(rig)
    model = equivalent_model(tank, axes[along], n_modes=n_modes, damping_ratio=damping_ratio)
    ratio = rotation_at_tip_rad_per_m(rig) if rotation_rad_per_m is None else rotation_rad_per_m
    solid = float(tank.solid_inertia_kg_m2[1 if along == "length" else 0])
    return tuple(
        ROCKING_LIQUID(
            frequency_hz=float(model.frequencies_rad_per_s[n]) / (2 * pi),
            mass_kg=float(model.masses_kg[n]),
            height_m=float(model.heights_m[n]) + tank.liquid_centre_m + centre_above_beam_m,
            rotation_rad_per_m=ratio,
            damping_ratio=damping_ratio,
            # once, with the first mode
            inertia_less_kg_m2=solid - model.inertia_kg_m2 if n == 0 else 0.0,
        )
        for n in range(n_modes)
    )


def box_of(rig: Rig) -> BoxTank:
    """The tank of a rig and its liquid."""
    tank, liquid = rig.tank, rig.liquid
    return BoxTank(
        tank.length_m, tank.width_m, tank.height_m, liquid.fill_level, liquid.density_kg_per_m3
    )  # fmt: skip


def equivalent_lateral_mass_kg(term: Term) -> float:
    """Mass that, moved up and down with the tank as `lateral_mode` moves it, resonates as strongly [kg].

    c² m (h + g/ω²)²: near its frequency a rocking mode and a `lateral_mode` of this mass are one.
    """
    values = term.values
    lever = values["height_m"] + _G / (2 * pi * values["frequency_hz"]) ** 2
    return float(values["rotation_rad_per_m"] ** 2 * values["mass_kg"] * lever**2)
