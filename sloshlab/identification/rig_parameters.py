"""The numbers of a rig that are retuned: their priors, and the structure and forces that they change."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sloshlab.identification.baseline_parameter import BaselineParameter
from sloshlab.identification.case import CaseRun
from sloshlab.identification.release import INSTANT, averaging_of_recorder, instant_s, tolerance_s
from sloshlab.missing_physics.units import named_and_units
from sloshlab.twin.structure import Structure
from sloshlab.twin.terms import Term
from sloshlab.twin.twin import Twin
from sloshlab.units import Dimension, dimension_of

RELEASE: Final = "release of "
FLUCTUATION: Final = "damping of the liquid in "
TOLERANCE_OF_FLUCTUATION: Final = 0.05
"""Of the damping of a chaotic liquid in one run, over its mean."""
_DAMPING_OF_LIQUID: Final = "damping_n_s_per_m"
_CLOSE_TOLERANCES: Final = 1.25
"""Bound of gains, that of the base's sensor in the participations among them, and upper one of losses: a gain that
is further off, or more loss, is an effect with a name."""
_TOLERANCE_OF_SHAPE: Final = 0.01
"""Of the value at the tip: position of a sensor, and a beam that is not quite uniform.

Mode shapes as constants made cross talk out of such errors.
"""
_MASS: Final = Dimension(mass=1)
_TUNED_NUMBERS: Final = ("damping_n_s_per_m", "damping_kg_per_s", "force_n", "stiffness_n_per_m")


@dataclass(frozen=True, eq=False)
class RunOfRig:
    """What a run adds to the numbers.

    Attributes
    ----------
    run : CaseRun
    compared : sequence of str
        Channels that the twin has a counterpart for.
    scaling : sequence of str
        Accelerometers whose gains scale the drive: of several those that are compared, or the only one.
    initial_displacement_m : float
        Of a release, as recorded.
    liquid_fluctuates : bool
    """

    run: CaseRun
    compared: Sequence[str]
    scaling: Sequence[str]
    initial_displacement_m: float
    liquid_fluctuates: bool


def rig_parameters(
    twin: Twin, runs: Sequence[RunOfRig], shapes: Mapping[str, Sequence[str]]
) -> tuple[BaselineParameter, ...]:
    """All numbers with their priors: those of structure and tank, of sensors, of single runs.

    Parameters
    ----------
    twin : Twin
    runs : sequence of RunOfRig
    shapes : mapping of str to sequence of str
        Names of what mode shapes are off by, per channel along a beam.
    """
    found: list[BaselineParameter] = []
    if twin.structure is not None:
        found += _structure_parameters(twin.structure, moves=any(not each.run.is_free for each in runs))
    for term in twin.terms:
        for name, value in term.values.items():
            # A force that is zero in the rig file is absent, and a tolerance of 20 % of zero would be none.
            if name in _TUNED_NUMBERS and value:
                number = f"{term.name}.{name}"
                tolerance, of_units = 0.2 * abs(value), dimension_of(named_and_units(name)[1])
                found.append(
                    BaselineParameter(number, value, tolerance, most_above=_CLOSE_TOLERANCES, dimension=of_units)
                )
    names = sorted({name for each in runs for name in each.compared})
    # Without a measured force nothing tells the carried mass from the modal masses.
    if any(name.startswith("force") for name in names):
        found.append(BaselineParameter("carried mass", 1.0, 0.01, dimension=_MASS))
    scaling = {name for each in runs for name in each.scaling}
    units = {
        name: str(each.run.recording[name].attrs["units"])
        for each in runs
        for name in (*each.compared, *each.scaling)
    }
    found += _sensor_parameters(units, scaling)
    found += [
        BaselineParameter(shape, 0.0, _TOLERANCE_OF_SHAPE, is_reading=True, channel=name)
        for name, of_channel in shapes.items()
        for shape in of_channel
    ]
    if any(each.run.is_free for each in runs):
        found.append(averaging_of_recorder())
    return (*found, *(parameter for each in runs for parameter in _run_parameters(each)))


def _sensor_parameters(units: Mapping[str, str], scaling: set[str]) -> list[BaselineParameter]:
    """Gains, and shares of the force cells, by the units of all channels.

    Several accelerometers drive the tank by their mean, over the mean of their gains: these gains change the
    motion, and so does that of the one at the root. For a base at rest it has none, as nothing tells it.
    """
    names = sorted(units)
    cells = cells_of(names)
    return [
        *(
            BaselineParameter(
                f"gain of {name}",
                1.0,
                0.01,
                is_reading=name not in scaling,
                most_below=_CLOSE_TOLERANCES,
                most_above=_CLOSE_TOLERANCES,
                channel="" if name in scaling else name,
                # A reading over what moves and acts.
                dimension=dimension_of(units[name]).inverse(),
            )
            for name in names
            if not name.endswith("_root") or name in scaling
        ),
        *(
            BaselineParameter(f"share of {name}", 1 / len(cells), 0.3 / len(cells), is_reading=True)
            for name in cells[:-1]
        ),
    ]


def _run_parameters(each: RunOfRig) -> list[BaselineParameter]:
    run, found = each.run, list[BaselineParameter]()
    # Liquid that moves chaotically never damps twice alike. One number for all runs would make the difference
    # physics.
    if each.liquid_fluctuates:
        fluctuation = FLUCTUATION + run.name
        found.append(BaselineParameter(fluctuation, 1.0, TOLERANCE_OF_FLUCTUATION, run=run.name, is_damping=True))
    if run.is_free:
        start = each.initial_displacement_m
        release = f"{RELEASE}{run.name}"
        found.append(BaselineParameter(release, start, 0.03 * abs(start) + 1e-5, "m", run=run.name))
        uncertain_s = tolerance_s(run.attributes.sampling_rate_hz)
        instant = instant_s(run.recording)
        found.append(
            BaselineParameter(f"{INSTANT}{run.name}", instant, uncertain_s, "s", is_reading=True, run=run.name)
        )
    for name in each.compared:
        if name.startswith("displacement"):
            offset = f"offset of {name} in {run.name}"
            size = float(np.nanmax(np.abs(run.recording[name].values)))
            found.append(
                BaselineParameter(offset, 0.0, 0.01 * size, "m", is_reading=True, channel=name, run=run.name)
            )
    return found


def cells_of(names: Iterable[str]) -> list[str]:
    """The force cells among some channels, sorted."""
    return sorted(name for name in names if name.startswith("force_cell"))


def _structure_parameters(structure: Structure, *, moves: bool) -> list[BaselineParameter]:
    """Frequencies, losses, masses and participations of the modes."""
    n = structure.masses_kg.size
    found = []
    for i in range(n):
        label = f"mode {i + 1}"
        found.append(BaselineParameter(f"frequency of {label}", 1.0, 0.02))
        damping = f"damping of {label}"
        found.append(BaselineParameter(damping, 1.0, 0.2, most_above=_CLOSE_TOLERANCES, is_damping=True))
    found += [BaselineParameter(f"modal mass of mode {i + 1}", 1.0, 0.01, dimension=_MASS) for i in range(n)]
    if moves:
        found += [
            BaselineParameter(
                f"base participation of mode {i + 1}",
                1.0,
                0.02,
                most_below=_CLOSE_TOLERANCES,
                most_above=_CLOSE_TOLERANCES,
            )
            for i in range(n)
        ]
    return found


def retuned_structure(structure: Structure, values: Mapping[str, float]) -> Structure:
    """The structure with the retuned frequencies, losses, masses and participations of its modes."""
    n = structure.masses_kg.size
    frequency = np.array([values.get(f"frequency of mode {i + 1}", 1.0) for i in range(n)])
    damping = np.array([values.get(f"damping of mode {i + 1}", 1.0) for i in range(n)])
    participation = np.array([values.get(f"base participation of mode {i + 1}", 1.0) for i in range(n)])
    mass = np.array([values.get(f"modal mass of mode {i + 1}", 1.0) for i in range(n)])
    return replace(
        structure,
        masses_kg=structure.masses_kg * mass,
        stiffnesses_n_per_m=structure.stiffnesses_n_per_m * mass * frequency**2,
        dampings_kg_per_s=structure.dampings_kg_per_s * mass * frequency * damping,
        base_participation_kg=structure.base_participation_kg * mass * participation,
    )


def retuned_term(term: Term, values: Mapping[str, float]) -> Term:
    """A force with its retuned numbers."""
    changed = {name: values[f"{term.name}.{name}"] for name in term.values if f"{term.name}.{name}" in values}
    return term.changed(**changed) if changed else term


def damps_as_liquid(term: Term) -> bool:
    """Whether a force of a twin is the damping of a liquid, believed as a number."""
    return term.place == "tank" and bool(term.values.get(_DAMPING_OF_LIQUID))


def fluctuating(term: Term, factor: float) -> Term:
    """The damping of the liquid in one run: that of a chaotic motion differs from run to run."""
    if factor == 1.0 or not damps_as_liquid(term):
        return term
    return term.changed(**{_DAMPING_OF_LIQUID: factor * term.values[_DAMPING_OF_LIQUID]})
