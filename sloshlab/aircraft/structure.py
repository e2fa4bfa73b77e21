"""What of an aircraft's structure a simulation needs: masses, modes at nodes, surfaces; SI units, dry tanks."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy.io import netcdf_file

from sloshlab.aircraft.deck import Deck, Panel, SurfaceSpline
from sloshlab.aircraft.normal_modes import NormalModes, normal_modes
from sloshlab.atomic_file import replaced
from sloshlab.errors import InputError
from sloshlab.lateral_sloshing.coupling import require_positive_definite, rigid_motion

FloatArray = npt.NDArray[np.float64]
FORMAT: Final = 1
_LARGEST_BYTES: Final = 200_000_000
_RIGID_BELOW: Final = 0.1
"""Of the seventh frequency; six modes below it are those of a free aircraft, perhaps on weak springs."""


@dataclass(frozen=True, eq=False)
class AircraftStructure:
    """An aircraft without its liquids, in axes x aft, y to starboard, z up.

    Attributes
    ----------
    nodes : tuple of int
        Their numbers.
    places_m : ndarray, shape (n_nodes, 3)
    frequencies_hz, modal_masses_kg : ndarray, shape (n_modes,)
        Of the flexible modes.
    shapes : ndarray, shape (n_modes, n_nodes, 6)
        Displacements [m/m] and rotations [rad/m] per unit of each modal coordinate [m].
    mass_centre_m : ndarray, shape (3,)
    rigid_mass : ndarray, shape (6, 6)
        Mass [kg] and inertia [kg m²] about the centre of mass.
    is_free : bool
        Whether it flies; a clamped wing has no rigid modes.
    panels, splines : tuple
        Surfaces [m], and which nodes move their boxes.
    reference_chord_m, density_kg_per_m3 : float or None
        Of the aerodynamic reference of the deck.
    """

    nodes: tuple[int, ...]
    places_m: FloatArray
    frequencies_hz: FloatArray
    modal_masses_kg: FloatArray
    shapes: FloatArray
    mass_centre_m: FloatArray
    rigid_mass: FloatArray
    is_free: bool
    panels: tuple[Panel, ...] = ()
    splines: tuple[SurfaceSpline, ...] = ()
    reference_chord_m: float | None = None
    density_kg_per_m3: float | None = None
    facts: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n_modes, n_nodes = self.frequencies_hz.size, len(self.nodes)
        for name, array, shape in (
            ("places_m", self.places_m, (n_nodes, 3)),
            ("modal_masses_kg", self.modal_masses_kg, (n_modes,)),
            ("shapes", self.shapes, (n_modes, n_nodes, 6)),
            ("mass_centre_m", self.mass_centre_m, (3,)),
            ("rigid_mass", self.rigid_mass, (6, 6)),
        ):
            if array.shape != shape or not np.isfinite(array).all():
                raise InputError(f"aircraft: {name}", got=f"shape {array.shape}", allowed=f"{shape}, finite")
        if len(set(self.nodes)) != n_nodes or n_nodes == 0:
            raise InputError("aircraft: nodes", got="none or one twice", allowed="each number once")
        if n_modes and (self.frequencies_hz.min() <= 0 or self.modal_masses_kg.min() <= 0):
            raise InputError("aircraft: modes", got="a frequency or modal mass of 0 or less", allowed="> 0")
        require_positive_definite(self.rigid_mass, "aircraft: mass matrix")

    @property
    def n_modes(self) -> int:
        """Flexible modes."""
        return int(self.frequencies_hz.size)

    def row_of(self, node: int) -> int:
        """Place of a node among the arrays.

        Raises
        ------
        InputError
            If there is no such node.
        """
        if node not in self.nodes:
            near = sorted(self.nodes, key=lambda other: abs(other - node))[:3]
            raise InputError(f"aircraft: node {node}", allowed=f"a node, such as {', '.join(map(str, near))}")
        return self.nodes.index(node)

    def motion_at(self, node: int, arm_m: npt.ArrayLike = (0.0, 0.0, 0.0)) -> FloatArray:
        """Motion of a place that is fixed to a node, per generalised coordinate.

        Parameters
        ----------
        node : int
        arm_m : array_like, shape (3,)
            From the node to the place.

        Returns
        -------
        ndarray, shape (6, n)
            Of displacements and rotations at the place per coordinate (six of the body about the centre of mass
            if it is free, then those of the modes), in axes x aft, y to starboard, z up.
        """
        row, arm = self.row_of(node), np.asarray(arm_m, dtype=np.float64)
        flexible = rigid_motion(arm) @ self.shapes[:, row].T
        if not self.is_free:
            return np.asarray(flexible)
        return np.hstack([rigid_motion(self.places_m[row] + arm - self.mass_centre_m), flexible])

    @property
    def mass_matrix(self) -> FloatArray:
        """Of the generalised coordinates, shape (n, n)."""
        modal = np.diag(self.modal_masses_kg)
        if not self.is_free:
            return modal
        n = 6 + self.n_modes
        whole = np.zeros((n, n))
        whole[:6, :6], whole[6:, 6:] = self.rigid_mass, modal
        return whole

    @property
    def stiffness_matrix(self) -> FloatArray:
        """Of the generalised coordinates, without gravity, shape (n, n)."""
        modal = self.modal_masses_kg * (2 * np.pi * self.frequencies_hz) ** 2
        return np.diag(np.concatenate([np.zeros(6 if self.is_free else 0), modal]))


def structure_of_deck(
    deck: Deck,
    *,
    length_m: float,
    mass_kg: float,
    n_modes: int = 20,
    constraint_set: int | None = None,
    facts: dict[str, str] | None = None,
) -> AircraftStructure:
    """An aircraft from a finite-element deck.

    Parameters
    ----------
    deck : Deck
    length_m, mass_kg : float
        The deck's unit of length, and of mass after PARAM WTMASS: 0.0254 and 175.1268 for inch and lbf s²/inch.
    n_modes : int
        With the six rigid ones of a free aircraft.
    constraint_set : int, optional
        Number of the SPC cards of a clamped wing.
    facts : dict, optional
        Kept with it.

    Raises
    ------
    InputError
        If a unit is impossible, or as `normal_modes` and the structure itself.
    """
    for name, value in (("length_m", length_m), ("mass_kg", mass_kg)):
        if not (isfinite(value) and value > 0):
            raise InputError(f"deck: {name}", got=f"{value:g}", allowed="> 0")
    modes = normal_modes(deck, n_modes=n_modes, constraint_set=constraint_set)
    first = _first_flexible(modes)
    shapes = modes.shapes[first:].copy()
    # modal mass 1 in the deck's unit of mass becomes 1 kg
    shapes[:, :, :3] /= np.sqrt(mass_kg)
    shapes[:, :, 3:] /= length_m * np.sqrt(mass_kg)
    centre = modes.mass_centre
    to_centre = rigid_motion(-centre)
    about = to_centre.T @ modes.rigid_mass @ to_centre
    scale = np.concatenate([np.ones(3), np.full(3, length_m)])
    reference = deck.reference
    return AircraftStructure(
        nodes=modes.nodes,
        places_m=modes.places * length_m,
        frequencies_hz=modes.frequencies_hz[first:],
        modal_masses_kg=np.ones(modes.frequencies_hz.size - first),
        shapes=shapes,
        mass_centre_m=centre * length_m,
        rigid_mass=about * np.outer(scale, scale) * mass_kg,
        is_free=first == 6,
        panels=tuple(_panel_in_m(panel, length_m) for panel in deck.panels.values()),
        splines=tuple(deck.splines.values()),
        reference_chord_m=None if reference is None else reference.chord * length_m,
        density_kg_per_m3=None if reference is None else reference.density * mass_kg / length_m**3,
        facts=dict(facts or {}),
    )


def _first_flexible(modes: NormalModes) -> int:
    f = modes.frequencies_hz
    return 6 if f.size > 6 and f[5] < _RIGID_BELOW * f[6] else 0


def _panel_in_m(panel: Panel, length_m: float) -> Panel:
    first, second = (
        (length_m * edge[0], length_m * edge[1], length_m * edge[2]) for edge in (panel.first, panel.second)
    )
    return Panel(
        panel.number, first, second, panel.first_chord * length_m, panel.second_chord * length_m,
        panel.spanwise, panel.chordwise,
    )  # fmt: skip


def save_structure(structure: AircraftStructure, path: str | os.PathLike[str]) -> None:
    """Write a structure as one netCDF file (classic format); the same structure gives the same bytes."""
    with replaced(path) as temporary, netcdf_file(temporary, "w", version=2, mmap=False) as file:
        file.sloshlab_aircraft_structure = FORMAT
        for name, text in sorted(structure.facts.items()):
            setattr(file, f"fact_{name}", text.encode("utf-8"))
        for name, values, units in _variables(structure):
            for number, size in enumerate(values.shape):
                file.createDimension(f"{name}_{number}", size)
            kind = "i4" if values.dtype.kind == "i" else "f8"
            dimensions = tuple(f"{name}_{number}" for number in range(values.ndim))
            variable = file.createVariable(name, kind, dimensions)
            variable[:] = values
            variable.units = units


def _variables(structure: AircraftStructure) -> list[tuple[str, npt.NDArray[Any], str]]:
    """Name, values, units; what is empty is left out, as the format has no length of zero."""
    panels, splines = structure.panels, structure.splines
    values: list[tuple[str, Any, str]] = [
        ("node", np.array(structure.nodes, dtype=np.int32), "1"),
        ("place", structure.places_m, "m"),
        ("frequency", structure.frequencies_hz, "Hz"),
        ("modal_mass", structure.modal_masses_kg, "kg"),
        ("shape", structure.shapes, "m m-1, rad m-1"),
        ("mass_centre", structure.mass_centre_m, "m"),
        ("rigid_mass", structure.rigid_mass, "kg, kg m, kg m2"),
        ("is_free", np.array([int(structure.is_free)], dtype=np.int32), "1"),
        ("panel_number", _whole([panel.number for panel in panels]), "1"),
        ("panel_first", np.array([panel.first for panel in panels]), "m"),
        ("panel_second", np.array([panel.second for panel in panels]), "m"),
        ("panel_chord", np.array([(panel.first_chord, panel.second_chord) for panel in panels]), "m"),
        *_ragged("panel_spanwise", [panel.spanwise for panel in panels], float),
        *_ragged("panel_chordwise", [panel.chordwise for panel in panels], float),
        ("spline_number", _whole([spline.number for spline in splines]), "1"),
        ("spline_panel", _whole([spline.panel for spline in splines]), "1"),
        ("spline_is_thin_plate", _whole([int(spline.method == "TPS") for spline in splines]), "1"),
        *_ragged("spline_boxes", [spline.boxes for spline in splines], int),
        *_ragged("spline_nodes", [spline.nodes for spline in splines], int),
    ]
    for name, value, units in (
        ("reference_chord", structure.reference_chord_m, "m"),
        ("density", structure.density_kg_per_m3, "kg m-3"),
    ):
        if value is not None:
            values.append((name, np.array([value]), units))
    return [(name, array, units) for name, array, units in values if array.size]


def _whole(numbers: Sequence[int]) -> npt.NDArray[np.int32]:
    return np.array(numbers, dtype=np.int32)


def _ragged(name: str, rows: Sequence[Sequence[float]], kind: type) -> list[tuple[str, npt.NDArray[Any], str]]:
    """Rows of unequal length as one after another, and the number of each."""
    flat = [value for row in rows for value in row]
    array: npt.NDArray[Any] = _whole([int(v) for v in flat]) if kind is int else np.array(flat, dtype=np.float64)
    return [(name, array, "1"), (f"n_{name}", _whole([len(row) for row in rows]), "1")]


def load_structure(path: str | os.PathLike[str]) -> AircraftStructure:
    """Read a structure that `save_structure` wrote.

    Raises
    ------
    InputError
        If the file is missing, too large, damaged, or no structure.
    """
    file = Path(path)
    what = f"aircraft structure {file}"
    try:
        if file.stat().st_size > _LARGEST_BYTES:
            raise InputError(what, got=f"{file.stat().st_size} bytes", allowed=f"≤ {_LARGEST_BYTES}")
        with netcdf_file(file, "r", mmap=False) as source:
            return _structure(source)
    except InputError as error:
        raise error if str(file) in str(error) else InputError(f"{what}: {error}") from error
    except OSError as error:
        raise InputError(what, got=error.strerror or str(error), allowed="a readable file") from error
    except (TypeError, ValueError, KeyError, IndexError, AttributeError, AssertionError, MemoryError) as error:
        reason = " ".join(str(error).split())[:160]
        raise InputError(what, got=f"contents that are no structure ({reason})", remedy="convert again") from error


def _structure(source: Any) -> AircraftStructure:
    if source.sloshlab_aircraft_structure != FORMAT:
        raise ValueError(f"format {source.sloshlab_aircraft_structure}")
    held = {name: np.array(variable.data) for name, variable in source.variables.items()}

    def floats(name: str) -> FloatArray:
        return np.asarray(held[name], dtype=np.float64)

    def number(name: str) -> float | None:
        return float(held[name][0]) if name in held else None

    facts = {
        name.removeprefix("fact_"): value.decode("utf-8")
        for name, value in source._attributes.items()
        if name.startswith("fact_")
    }
    return AircraftStructure(
        nodes=tuple(int(node) for node in held["node"]),
        places_m=floats("place"),
        frequencies_hz=floats("frequency"),
        modal_masses_kg=floats("modal_mass"),
        shapes=floats("shape"),
        mass_centre_m=floats("mass_centre"),
        rigid_mass=floats("rigid_mass"),
        is_free=bool(held["is_free"][0]),
        panels=_panels(held),
        splines=_splines(held),
        reference_chord_m=number("reference_chord"),
        density_kg_per_m3=number("density"),
        facts=facts,
    )


def _panels(held: Mapping[str, Any]) -> tuple[Panel, ...]:
    rows = zip(
        held.get("panel_number", ()), _rows(held, "panel_spanwise"), _rows(held, "panel_chordwise"), strict=True
    )
    return tuple(
        Panel(
            int(number), _three(held["panel_first"][n]), _three(held["panel_second"][n]),
            float(held["panel_chord"][n][0]), float(held["panel_chord"][n][1]), tuple(along), tuple(across),
        )
        for n, (number, along, across) in enumerate(rows)
    )  # fmt: skip


def _splines(held: Mapping[str, Any]) -> tuple[SurfaceSpline, ...]:
    rows = zip(
        held.get("spline_number", ()), _rows(held, "spline_boxes"), _rows(held, "spline_nodes"), strict=True
    )
    return tuple(
        SurfaceSpline(
            int(number), int(held["spline_panel"][n]), tuple(boxes), tuple(nodes),
            "TPS" if held["spline_is_thin_plate"][n] else "IPS",
        )
        for n, (number, boxes, nodes) in enumerate(rows)
    )  # fmt: skip


def _rows(held: Mapping[str, Any], name: str) -> list[list[Any]]:
    """Lists of different lengths that are stored one behind the other."""
    if name not in held:
        return []
    cuts = np.cumsum(held[f"n_{name}"])
    if cuts[-1] != held[name].size or held[f"n_{name}"].min() < 0:
        raise ValueError(name)
    return [part.tolist() for part in np.split(held[name], cuts[:-1])]


def _three(values: npt.NDArray[Any]) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
