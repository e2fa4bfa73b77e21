"""A half wing that is clamped at its root: beam, strips and boxes from values at stations along the span."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from sloshlab.aeroelastic.arrays import FloatArray
from sloshlab.aeroelastic.beam_spline import mirrored_beam_motion
from sloshlab.aeroelastic.bending_torsion_beam import WingBeam, WingModes, wing_modes
from sloshlab.aeroelastic.planform import Boxes, mirrored_boxes
from sloshlab.aeroelastic.section_forces import Section
from sloshlab.aeroelastic.splines import BoxMotion
from sloshlab.aeroelastic.strip import Strips, strips_of
from sloshlab.errors import AnalysisError


@dataclass(frozen=True)
class Station:
    """Values at one place of the span; between stations they are linear.

    Attributes
    ----------
    y_m : float
        From the root.
    leading_edge_m, chord_m : float
        x of the leading edge (aft positive), and the chord.
    elastic_axis : float
        Share of the chord from the leading edge.
    bending_stiffness_n_m2, torsion_stiffness_n_m2 : float
        EI and GJ.
    mass_kg_per_m, mass_centre, pitch_inertia_kg_m : float
        Mass per length; its centre as a share of the chord; inertia per length about the elastic axis.
    """

    y_m: float
    leading_edge_m: float
    chord_m: float
    elastic_axis: float
    bending_stiffness_n_m2: float
    torsion_stiffness_n_m2: float
    mass_kg_per_m: float
    mass_centre: float
    pitch_inertia_kg_m: float


@dataclass(frozen=True)
class CantileverWing:
    """The half wing to starboard; in flow it has a mirrored half that moves alike.

    Attributes
    ----------
    stations : tuple of Station
        From the root at y = 0 to the tip.
    """

    stations: tuple[Station, ...]

    def __post_init__(self) -> None:
        y = [station.y_m for station in self.stations]
        if len(y) < 2 or y[0] != 0 or any(a >= b for a, b in itertools.pairwise(y)):
            raise AnalysisError("stations", got=f"y = {y}", allowed="two or more, ascending from 0")

    def values(self, name: str, y_m: FloatArray) -> FloatArray:
        """A value of the stations at other places.

        Parameters
        ----------
        name : str
            Attribute of `Station`.
        y_m : ndarray
            Places.

        Returns
        -------
        ndarray
        """
        known = [getattr(station, name) for station in self.stations]
        return np.asarray(np.interp(y_m, [station.y_m for station in self.stations], known), dtype=float)

    @property
    def semi_span_m(self) -> float:
        """From root to tip."""
        return self.stations[-1].y_m

    @property
    def semi_chord_m(self) -> float:
        """Half of the mean chord, that of reduced frequencies."""
        y = np.array([station.y_m for station in self.stations])
        chord = np.array([station.chord_m for station in self.stations])
        return float(np.trapezoid(chord, y) / self.semi_span_m / 2)

    def axis_m(self, y_m: FloatArray) -> FloatArray:
        """x of the elastic axis.

        Parameters
        ----------
        y_m : ndarray
            Places.

        Returns
        -------
        ndarray
        """
        chord = self.values("chord_m", y_m)
        return self.values("leading_edge_m", y_m) + chord * self.values("elastic_axis", y_m)

    def modes(self, n_modes: int, *, n_elements: int) -> WingModes:
        """Dry modes.

        Parameters
        ----------
        n_modes : int
            How many.
        n_elements : int
            Equal elements.

        Returns
        -------
        WingModes
        """
        node = np.linspace(0.0, self.semi_span_m, n_elements + 1)
        middle = 0.5 * (node[:-1] + node[1:])
        behind = self.values("mass_centre", middle) - self.values("elastic_axis", middle)
        beam = WingBeam(
            node,
            self.values("bending_stiffness_n_m2", middle),
            self.values("torsion_stiffness_n_m2", middle),
            self.values("mass_kg_per_m", middle),
            behind * self.values("chord_m", middle),
            self.values("pitch_inertia_kg_m", middle),
        )
        return wing_modes(beam, n_modes)

    def section(self, y_m: float) -> Section:
        """Section of strip theory; sweep is left out.

        Parameters
        ----------
        y_m : float
            Place.

        Returns
        -------
        Section
        """
        place = np.array([y_m])
        axis = 2 * float(self.values("elastic_axis", place)[0]) - 1
        return Section(float(self.values("chord_m", place)[0]) / 2, axis)

    def strips(self, modes: WingModes, n_span: int) -> Strips:
        """Strips across the half wing.

        Parameters
        ----------
        modes : WingModes
            Of the beam.
        n_span : int
            How many.

        Returns
        -------
        Strips
        """
        return strips_of(modes, self.section, n_strips=n_span)

    def boxes(self, n_span: int, n_chord: int) -> Boxes:
        """Boxes of both halves.

        Parameters
        ----------
        n_span, n_chord : int
            Across one half, shared among the parts between stations by their width, and along the flow.

        Returns
        -------
        Boxes
        """
        edges = [(station.y_m, station.leading_edge_m, station.chord_m) for station in self.stations]
        return mirrored_boxes(edges, n_span, n_chord)

    def motion(self, boxes: Boxes, modes: WingModes) -> BoxMotion:
        """Motion of the boxes of both halves; only the right half does work on the half structure.

        Parameters
        ----------
        boxes : Boxes
            From `boxes`.
        modes : WingModes
            Of the beam.

        Returns
        -------
        BoxMotion
        """
        axis = self.axis_m(modes.node_m)
        shape = np.zeros((axis.size, 6, modes.deflection.shape[1]))
        sweep = np.gradient(axis, modes.node_m, edge_order=1)[:, None]
        shape[:, 2], shape[:, 4] = modes.deflection, modes.twist_rad
        # the axis rises by dw/dy along itself: its own part, and that of the twist where it is swept
        shape[:, 3] = modes.slope + sweep * modes.twist_rad
        return mirrored_beam_motion(boxes, np.stack([axis, modes.node_m, np.zeros_like(axis)], axis=1), shape)
