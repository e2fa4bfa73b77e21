"""An aircraft at one speed as a linear system that vertical forces of its tanks and a gust act on.

    ẋ = A x + B_f Δf + B_w (w_g, ẇ_g),   x = (η, r, ν, ṙ, a, a_g)

η and ν are coordinates and rates of the aircraft (in body axes if it is free, else ν = η̇), r sloshing coordinates,
a lags of the air, a_g those of the gust. Tanks feel and push upward, in axes of the structure (z up).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from sloshlab.aeroelastic.arrays import require_positive, require_shape
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aircraft.flight_stability import Liquids, flight_system
from sloshlab.aircraft.model import AircraftModel
from sloshlab.aircraft.practical_mean_axes import to_body_axes
from sloshlab.lateral_sloshing.box_tank import equivalent_model

FloatArray = npt.NDArray[np.float64]
LiquidModel = Literal["frozen", "lateral", "vertical", "full"]
LIQUID_MODELS: Final[dict[LiquidModel, tuple[Liquids, bool]]] = {
    "frozen": ("frozen", False),
    "lateral": ("lateral", False),
    "vertical": ("frozen", True),
    "full": ("lateral", True),
}
"""Which liquids the linear part has, and whether models of vertical sloshing act."""
_UP, _NOSE_UP = 2, 4
"""Among the six directions of a place, in axes x aft, z up."""


@dataclass(frozen=True, eq=False)
class LinearFlight:
    """Matrices of one aircraft, liquid and speed.

    Attributes
    ----------
    model : AircraftModel
    speed_m_per_s : float
        U; 0 without air.
    names : tuple of str
        Of the coordinates: of the aircraft, then of the liquids.
    matrix : ndarray, shape (n_states, n_states)
    of_forces : ndarray, shape (n_states, n_tanks)
        Rates of change per newton of Δf, upward on each tank.
    of_wind : ndarray, shape (n_states, 2)
        Rates of change per w_g [m/s], up, and per ẇ_g [m/s²].
    tank_velocity : ndarray, shape (n_tanks, n_states)
        Absolute vertical velocity of each tank's centre [m/s], up, per state.
    to_structure : ndarray, shape (n, n)
        Coordinates in axes of the structure per η.
    """

    model: AircraftModel
    speed_m_per_s: float
    names: tuple[str, ...]
    matrix: FloatArray
    of_forces: FloatArray
    of_wind: FloatArray
    tank_velocity: FloatArray
    to_structure: FloatArray

    @property
    def n_states(self) -> int:
        """Length of x."""
        return int(self.matrix.shape[0])

    @property
    def n_coordinates(self) -> int:
        """Of aircraft and liquids; so many rates follow them in x."""
        return len(self.names)

    @property
    def rates(self) -> slice:
        """Of the coordinates, in x."""
        return slice(self.n_coordinates, 2 * self.n_coordinates)

    @property
    def liquids(self) -> tuple[str, ...]:
        """Names of the coordinates of liquids that slosh sideways; none if they are frozen."""
        return self.names[self.to_structure.shape[0] :]

    @property
    def liquid_masses_kg(self) -> FloatArray:
        """Equivalent mass m_n of each of `liquids`: its displacement against the tank is r/√m_n."""
        if not self.liquids:
            return np.zeros(0)
        planes = [
            equivalent_model(tank.box, axis, n_modes=tank.n_sloshing_modes).masses_kg
            for tank in self.model.tanks
            for axis in ("x", "y")
        ]
        return np.concatenate(planes)

    def displacement_at(self, node: int) -> FloatArray:
        """Vertical displacement of a node [m], up, per state; of a free aircraft by its place and attitude, too.

        Parameters
        ----------
        node : int

        Returns
        -------
        ndarray, shape (n_states,)
        """
        row = np.zeros(self.n_states)
        moved = self.model.structure.motion_at(node)[_UP] @ self.to_structure
        row[: moved.size] = moved
        return row

    def velocity_at(self, node: int) -> FloatArray:
        """Absolute vertical velocity of a node [m/s], up, per state; its rate of change is the acceleration.

        Parameters
        ----------
        node : int

        Returns
        -------
        ndarray, shape (n_states,)
        """
        n = self.to_structure.shape[0]
        return np.asarray(self.model.structure.motion_at(node)[_UP] @ self.to_structure @ self.matrix[:n])

    def angle_of_attack_at(self, node: int) -> FloatArray:
        """Angle of attack of a place that motion makes [rad], nose up positive, per state.

        Parameters
        ----------
        node : int

        Returns
        -------
        ndarray, shape (n_states,)
            Δw/U of the place through the air and the elastic twist there; without the angle w_g/U of the gust.
        """
        require_positive(speed_m_per_s=self.speed_m_per_s)
        motion = self.model.structure.motion_at(node)
        return np.asarray(self._angles(motion[None])[0])

    def angles_of_attack(self) -> FloatArray:
        """As `angle_of_attack_at`, of all nodes, shape (n_nodes, n_states)."""
        require_positive(speed_m_per_s=self.speed_m_per_s)
        structure = self.model.structure
        return self._angles(np.array([structure.motion_at(node) for node in structure.nodes]))

    def _angles(self, motion: FloatArray) -> FloatArray:
        n, n_rigid = self.to_structure.shape[0], 6 if self.model.structure.is_free else 0
        rows = np.zeros((motion.shape[0], self.n_states))
        # ν is motion through the air: where the body points is in it already, where the wing twists is not
        rows[:, self.rates][:, :n] = -motion[:, _UP] @ self.to_structure / self.speed_m_per_s
        rows[:, n_rigid:n] = motion[:, _NOSE_UP, n_rigid:]
        return rows


def linear_flight(
    model: AircraftModel,
    liquids: Liquids,
    *,
    speed_m_per_s: float = 0.0,
    air: RationalForces | None = None,
    gust: RationalForces | None = None,
    density_kg_per_m3: float = 0.0,
    gravity: bool = True,
) -> LinearFlight:
    """Join structure, liquids, air and a gust that is the same everywhere.

    Parameters
    ----------
    model : AircraftModel
    liquids : str
        ``frozen`` or ``lateral``, of `LIQUID_MODELS`.
    speed_m_per_s : float
        U; with air above 0.
    air : RationalForces, optional
        Of the aircraft's coordinates in axes x aft, z up; none is vacuum.
    gust : RationalForces, optional
        By w_g/U of one zone (`gust_fit`).
    density_kg_per_m3 : float
        Of the air.
    gravity : bool
        Whether weight acts on what tilts, in body axes.

    Raises
    ------
    InputError
        If the mass matrix is not positive.
    AnalysisError
        If air or gust belong to other coordinates, or speed or density is missing.
    """
    n = model.structure.mass_matrix.shape[0]
    if air is not None:
        require_positive(speed_m_per_s=speed_m_per_s, density_kg_per_m3=density_kg_per_m3)
    forces, of_gust = air or _vacuum(n, n), gust or _vacuum(n, 1)
    require_shape("gust forces", of_gust.a0, (n, 1))
    density = density_kg_per_m3 if air else 0.0
    # a clamped structure in vacuum knows neither speed nor density, but the equations divide by them
    system = flight_system(model, forces, liquids, density_kg_per_m3=density or 1.0, gravity=gravity)
    own = system.matrix_at(speed_m_per_s if model.structure.is_free or air else 1.0)
    turn = to_body_axes(model.structure.n_modes) if model.structure.is_free else np.eye(n)
    to_rates = _to_rates(system.structure.mass, turn, 0.5 * density * forces.semi_chord_m**2 * forces.a2)
    matrix, of_wind = _with_gust(own, to_rates, of_gust, speed_m_per_s, density)
    ups = np.array([tank.motion[_UP] for tank in model.tanks]).reshape(-1, n)
    n_all = len(system.names)
    of_forces = np.zeros((matrix.shape[0], len(model.tanks)))
    of_forces[n_all : 2 * n_all] = to_rates @ ups.T
    # η̇ = ν + T η stands in the first rows of the matrix: velocities in inertial axes
    velocity = ups @ turn @ matrix[:n]
    return LinearFlight(model, speed_m_per_s, system.names, matrix, of_forces, of_wind, velocity, turn)


def _to_rates(mass: FloatArray, turn: FloatArray, of_air: FloatArray) -> FloatArray:
    """Accelerations of all coordinates per force on each of the aircraft's, in axes of the structure."""
    n, whole_turn = turn.shape[0], np.eye(mass.shape[0])
    whole_turn[:n, :n] = turn
    turned = whole_turn.T @ mass @ whole_turn
    turned[:n, :n] -= turn.T @ of_air @ turn
    return np.asarray(np.linalg.inv(turned)[:, :n] @ turn.T)


def _vacuum(n: int, n_inputs: int) -> RationalForces:
    none = np.zeros((n, n_inputs))
    return RationalForces(none, none, none, np.zeros((n, 0)), np.zeros(0), np.zeros((0, n_inputs)), 1.0)


def _with_gust(
    own: FloatArray, to_rates: FloatArray, gust: RationalForces, speed: float, density: float
) -> tuple[FloatArray, FloatArray]:
    """The system with lags of the gust, and what w_g and ẇ_g do (5.5 with equations of `aeroelastic.gust`)."""
    n_own, n_all, n_lags = own.shape[0], to_rates.shape[0], gust.lags.size
    b, per_speed, rows = gust.semi_chord_m, 0.5 * density * speed, slice(n_all, 2 * n_all)
    matrix = np.zeros((n_own + n_lags,) * 2)
    inputs = np.zeros((n_own + n_lags, 2))
    matrix[:n_own, :n_own] = own
    matrix[rows, n_own:] = to_rates @ (per_speed * gust.lag_output)
    matrix[n_own:, n_own:] = -speed / b * np.diag(gust.lags)
    inputs[rows, :1] = to_rates @ (per_speed * gust.a0)
    inputs[rows, 1:] = to_rates @ (0.5 * density * b * gust.a1)
    inputs[n_own:, 1:] = gust.lag_input
    return matrix, inputs
