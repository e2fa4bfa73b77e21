r"""The equations of one run in state space: wing, air with lags, hidden oscillators.

With the modes q of the wing, downwash d = −ẇ + Uθ + b(½ − a)θ̇ (and of the flap) at the three-quarter chord of
every strip and Jones' approximation of Theodorsen's function, circulatory lift per length is

.. math:: \rho U b\, C_{L\alpha}\, C(s) d, \qquad C(s) = 1 - \sum_l A_l \frac{s}{s + \lambda\beta_l U/b}

at the quarter chord (Theodorsen, NACA 496; Jones, NACA 681; gusts by Küssner's function with two lags). Every mode
has two lag states ẋ = q̇ − λβ(U/b)x. Lags stretch with λ; λ = 1 is the thin aerofoil.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.aeroelastic.lift_deficiency import JONES_LAGS, JONES_SHARES, KUSSNER_LAGS, KUSSNER_SHARES
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.flight_twin.described_wing import FlightWing
from sloshlab.flight_twin.modal_wing import ModalWing, StripIntegrals, flap_coefficients, frozen_inertia_kg_m2
from sloshlab.flight_twin.numbers import NOTHING, OF_A_TANK, of_tank

FloatArray = npt.NDArray[np.float64]
INPUTS: Final = ("gust", "flap", "flap rate", "root")
"""Gust [m/s], angle of the flap [rad] and its rate, acceleration of the root [m/s²]."""
_AT_ONCE: Final = 1 - sum(JONES_SHARES)
"""Of circulatory lift, that has no lag."""
_DAMPING_OF_LIQUID: Final = 0.005
"""Of a lateral sloshing mode, as of `sloshlab.aircraft`."""


@dataclass(frozen=True, eq=False)
class StateSpace:
    r"""ẋ = A x + B u + F f, with n coordinates first, then their rates, then lags.

    Attributes
    ----------
    system, inputs : ndarray, shape (n_states, n_states), (n_states, 4)
    forces : ndarray, shape (n_states, n_coordinates)
        Of generalised forces.
    sensor_rows, tank_rows : ndarray, shape (n_places, n_coordinates)
        Vertical displacement relative to the root.
    tip_row : ndarray, shape (n_coordinates,)
    lift_rows : ndarray, shape (n_strips, n_coordinates)
        Generalised force of a lift of one newton per metre on each strip.
    angle_rows : ndarray, shape (n_strips, n_states)
        Angle of attack that makes circulatory lift, with its lags; no strips where lift is linear.
    angle_inputs : ndarray, shape (n_strips, 4)
    lift_per_angle : float
        Lift per length and angle of attack [N/m].
    n_coordinates : int
    """

    system: FloatArray
    inputs: FloatArray
    forces: FloatArray
    sensor_rows: FloatArray
    tank_rows: FloatArray
    tip_row: FloatArray
    lift_rows: FloatArray
    angle_rows: FloatArray
    angle_inputs: FloatArray
    lift_per_angle: float
    n_coordinates: int


def numbers_with(values: Mapping[str, float], n_tanks: int) -> dict[str, float]:
    """All numbers of the twin: what is given, and nothing of every effect that is not.

    Parameters
    ----------
    values : mapping
    n_tanks : int
    """
    tanks = {of_tank(name, tank): value for name, value in OF_A_TANK.items() for tank in range(n_tanks)}
    return {**NOTHING, **tanks, **values}


def state_space(
    described: FlightWing,
    modal: ModalWing,
    numbers: Mapping[str, float],
    *,
    airspeed_m_per_s: float,
    density_kg_per_m3: float,
) -> StateSpace:
    """Equations of a run.

    Parameters
    ----------
    described : FlightWing
    modal : ModalWing
    numbers : mapping
        All, of `numbers_with`.
    airspeed_m_per_s : float
        As recorded.
    density_kg_per_m3 : float
    """
    structure = _structure(described, modal, numbers)
    speed = airspeed_m_per_s * (1 + numbers["airspeed_error"])
    air = _Air(described, modal.strips, numbers, speed, density_kg_per_m3)
    n, m = structure.mass.shape[0], modal.omega_rad_per_s.size
    mass, damping, stiffness = structure.mass.copy(), structure.damping.copy(), structure.stiffness.copy()
    mass[:m, :m] += air.added_mass
    damping[:m, :m] -= air.by_rate
    stiffness[:m, :m] -= air.by_angle
    inverse = np.linalg.inv(mass)
    size = 2 * n + 2 * m + 4
    system, inputs, forces = np.zeros((size, size)), np.zeros((size, 4)), np.zeros((size, n))
    forces[n : 2 * n] = inverse
    system[:n, n : 2 * n] = np.eye(n)
    system[n : 2 * n, :n], system[n : 2 * n, n : 2 * n] = -inverse @ stiffness, -inverse @ damping
    system[n : 2 * n, 2 * n :] = inverse[:, :m] @ air.lagged()
    inputs[n : 2 * n, 1:3] = inverse[:, :m] @ air.by_flap
    inputs[n : 2 * n, 3] = -inverse @ structure.rigid
    air.add_lags(system, inputs, 2 * n, m)
    rows, more = (modal.sensor_rows, modal.tank_rows, modal.tip_row[None], modal.strips.quarter_chord), n - m
    sensors, tanks, tip, lift = (np.pad(each, ((0, 0), (0, more))) if more else each for each in rows)
    is_linear = not np.isfinite(numbers["stall_angle_rad"])
    angle_rows, angle_inputs = (np.zeros((0, size)), np.zeros((0, 4))) if is_linear else air.angles(n)
    return StateSpace(
        system, inputs, forces, sensors, tanks, tip[0], lift, angle_rows, angle_inputs, air.lift_per_angle, n
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Structure:
    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    rigid: FloatArray


def _structure(described: FlightWing, modal: ModalWing, numbers: Mapping[str, float]) -> _Structure:
    mass, rigid = np.eye(modal.omega_rad_per_s.size), modal.rigid
    stiffness = numbers["bending stiffness"] * modal.bending + numbers["torsion stiffness"] * modal.torsion
    # a mode is damped as what bends, and what twists, stores of its energy
    twisting = np.clip(np.diag(modal.torsion) / modal.omega_rad_per_s**2, 0.0, 1.0)
    share = numbers["bending damping"] * (1 - twisting) + numbers["torsion damping"] * twisting
    damping = modal.damping * share + np.diag(numbers["loss_factor"] * modal.omega_rad_per_s)
    for i, tank in enumerate(described.tanks):
        row, twist = modal.tank_rows[i], modal.tank_twist_rows[i]
        fill, added = numbers[of_tank("fill_level", i)], numbers[of_tank("added_mass", i)]
        if fill <= 0 and added == 0:
            continue
        box = tank.box()
        other = tank.box(fill) if fill > 0 else box
        more = other.liquid_mass_kg * (1 + added) - box.liquid_mass_kg
        turned = frozen_inertia_kg_m2(other) - frozen_inertia_kg_m2(box)
        mass = mass + more * np.outer(row, row) + turned * np.outer(twist, twist)
        rigid = rigid + more * row
    whole = _Structure(mass, damping, stiffness, rigid)
    for i in range(len(described.tanks)):
        whole = _with_lateral_mode(whole, modal.tank_twist_rows[i], numbers, i)
    if numbers.get("missing_mode_kg", 0.0) > 0:
        kg, omega = numbers["missing_mode_kg"], 2 * np.pi * numbers["missing_mode_hz"]
        own = (kg, 2 * numbers["missing_mode_damping"] * omega * kg, kg * omega**2)
        whole = _with_coordinate(whole, modal.tip_row, kg, 0.0, own, rigid=kg)
    return whole


def _with_lateral_mode(
    whole: _Structure, twist: FloatArray, numbers: Mapping[str, float], tank: int
) -> _Structure:
    """Linear sloshing along the chord, driven by pitch: r̈ + … = −√m h θ̈ + g √m θ (App. D of the source, (D.3))."""
    kg = numbers[of_tank("lateral_mass_kg", tank)]
    if kg <= 0:
        return whole
    omega = 2 * np.pi * numbers[of_tank("lateral_hz", tank)]
    # h in multiples of g/ω²: there a slow and a fast rocking move it alike
    height = numbers[of_tank("lateral_height_ratio", tank)] * GRAVITY_M_PER_S2 / omega**2
    own = (1.0, 2 * _DAMPING_OF_LIQUID * omega, omega**2)
    return _with_coordinate(whole, twist, np.sqrt(kg) * height, GRAVITY_M_PER_S2 * np.sqrt(kg), own, rigid=0.0)


def _with_coordinate(
    whole: _Structure, row: FloatArray, inertial: float, static: float, own: tuple[float, ...], *, rigid: float
) -> _Structure:
    """One more coordinate, coupled along a row of the modes."""
    n = whole.mass.shape[0]
    along = np.append(row, np.zeros(n - row.size))

    def grown(matrix: FloatArray, coupling: float, corner: float) -> FloatArray:
        return np.block([[matrix, coupling * along[:, None]], [coupling * along[None, :], np.array([[corner]])]])

    mass, damping, stiffness = own
    return _Structure(
        grown(whole.mass, inertial, mass),
        grown(whole.damping, 0.0, damping),
        grown(whole.stiffness, -static, stiffness),
        np.append(whole.rigid, rigid),
    )


class _Air:
    """Forces of the air on the coordinates at one speed; oscillators have none."""

    def __init__(
        self,
        described: FlightWing,
        strips: StripIntegrals,
        numbers: Mapping[str, float],
        speed: float,
        density: float,
    ) -> None:
        b, a = described.wing.semi_chord_m, described.wing.elastic_axis
        self._strips, self._speed, self._b = strips, speed, b
        self._behind = b * (0.5 - a)
        self._flap = flap_coefficients(described.flap.hinge, a)
        gain = 1 + numbers["lift_gain"]
        carried = gain * np.pi * density * b**2
        self._per_downwash = gain * density * speed * b * described.wing.lift_slope
        self.lift_per_angle = self._per_downwash * speed
        ww, wt, tt = strips.squares
        added = ww + a * b * (wt + wt.T) + (0.125 + a * a) * b**2 * tt
        self.added_mass = (1 + numbers["apparent_mass"]) * carried * added
        self._of_rate = self._behind * strips.lift_twist - strips.lift_deflection
        self.by_angle = self.lift_per_angle * strips.lift_twist
        self.by_rate = _AT_ONCE * self._per_downwash * self._of_rate + carried * speed * (wt - self._behind * tt)
        plain = gain * density * b**2 * speed
        angle = _AT_ONCE * self.lift_per_angle * self._flap.downwash * strips.lift_of_flap
        angle = angle + plain * speed * self._flap.moment * strips.twist_of_flap
        rate = _AT_ONCE * self._per_downwash * b * self._flap.downwash_rate * strips.lift_of_flap
        rate = rate + plain * self._flap.lift_rate * strips.deflection_of_flap
        rate = rate + plain * b * self._flap.moment_rate * strips.twist_of_flap
        self.by_flap = np.stack([angle, rate], axis=1)
        self._rates = numbers["lag_ratio"] * np.array(JONES_LAGS) * speed / b
        self._gust_rates = numbers["lag_ratio"] * np.array(KUSSNER_LAGS) * speed / b

    def lagged(self) -> FloatArray:
        """Generalised forces of the modes by their lag states, and those of flap and gust, shape (n, 2 n + 4)."""
        strips, share_of = self._strips, self._per_downwash
        motion = [
            -share_of * share * (self._speed * strips.lift_twist - rate * self._of_rate)
            for share, rate in zip(JONES_SHARES, self._rates, strict=True)
        ]
        flap = [share_of * s * r * strips.lift_of_flap for s, r in zip(JONES_SHARES, self._rates, strict=True)]
        gust = [share_of * s * r * strips.lift for s, r in zip(KUSSNER_SHARES, self._gust_rates, strict=True)]
        return np.column_stack([*motion, *flap, *gust])

    def add_lags(self, system: FloatArray, inputs: FloatArray, first: int, n_modes: int) -> None:
        """Rates of the lag states, from a row on."""
        n, flap = n_modes, first + 2 * n_modes
        coordinates = (first) // 2
        for lag, rate in enumerate(self._rates):
            own = slice(first + lag * n, first + (lag + 1) * n)
            system[own, coordinates : coordinates + n] = np.eye(n)
            system[own, own] = -rate * np.eye(n)
            inputs[flap + lag, 1] = self._speed * self._flap.downwash
            inputs[flap + lag, 2] = self._b * self._flap.downwash_rate
            system[flap + lag, flap + lag] = -rate
        for lag, rate in enumerate(self._gust_rates):
            place = flap + 2 + lag
            inputs[place, 0] = 1.0
            system[place, place] = -rate

    def angles(self, n: int) -> tuple[FloatArray, FloatArray]:
        """Angle of attack that makes circulatory lift on every strip, per state and per input.

        Parameters
        ----------
        n : int
            Of coordinates, oscillators included.
        """
        strips, n_modes = self._strips, self._strips.twist.shape[1]
        rows = np.zeros((strips.flap_share.size, 2 * n + 2 * n_modes + 4))
        inputs = np.zeros((strips.flap_share.size, 4))
        if self._speed <= 0:
            return rows, inputs
        of_rate = self._behind * strips.twist - strips.deflection
        rows[:, :n_modes], rows[:, n : n + n_modes] = self._speed * strips.twist, _AT_ONCE * of_rate
        for lag, (share, rate) in enumerate(zip(JONES_SHARES, self._rates, strict=True)):
            own = slice(2 * n + lag * n_modes, 2 * n + (lag + 1) * n_modes)
            rows[:, own] = -share * (self._speed * strips.twist - rate * of_rate)
            rows[:, 2 * n + 2 * n_modes + lag] = share * rate * strips.flap_share
        for lag, (share, rate) in enumerate(zip(KUSSNER_SHARES, self._gust_rates, strict=True)):
            rows[:, 2 * n + 2 * n_modes + 2 + lag] = share * rate
        inputs[:, 1] = _AT_ONCE * self._speed * self._flap.downwash * strips.flap_share
        inputs[:, 2] = _AT_ONCE * self._b * self._flap.downwash_rate * strips.flap_share
        return rows / self._speed, inputs / self._speed
