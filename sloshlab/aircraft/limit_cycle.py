"""Limit cycles of a wing whose tanks slosh, followed over the speed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sloshlab.aeroelastic.gust import GustShape
from sloshlab.aircraft.linear_flight import LinearFlight
from sloshlab.aircraft.oscillation_measures import LimitCycle, limit_cycle_of
from sloshlab.aircraft.tank_simulation import FlightResponse, VerticalForce, simulate_flight

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """The motion that a wing ended on at one speed.

    Attributes
    ----------
    speed_m_per_s : float
    cycle : LimitCycle
        Of the displacement of the tip [m].
    duration_s : float
        That was simulated.
    largest_tank_acceleration_m_per_s2 : float
        Of any tank over the last two seconds.
    ending : str
        Why it ended before it was steady: a divergence; empty otherwise.
    vanished_m : float
        Amplitude below which the motion has died.
    """

    speed_m_per_s: float
    cycle: LimitCycle
    duration_s: float
    largest_tank_acceleration_m_per_s2: float
    ending: str = ""
    vanished_m: float = 1e-3

    @property
    def is_alive(self) -> bool:
        """Whether there is motion in the end that does not diverge."""
        return not self.ending and self.cycle.amplitude >= self.vanished_m


class _Going:
    """A model of a tank that goes on where it was: the next stretch does not begin at rest."""

    def __init__(self, force: VerticalForce) -> None:
        self._force, self.sampling_rate_hz = force, force.sampling_rate_hz

    def begin(self) -> None:
        """Nothing: the liquid keeps its motion."""

    def step(self, velocity_m_per_s: float) -> FloatArray:
        """As of the model."""
        return self._force.step(velocity_m_per_s)

    @property
    def runs_away(self) -> bool:
        """As of the model."""
        return self._force.runs_away


@dataclass(frozen=True)
class Settling:
    """How long a motion is waited for.

    Attributes
    ----------
    stretch_s, longest_s : float
        Simulated at a time, and at most.
    vanished_m : float
        Amplitude of the tip below which the motion has died.
    output_step_s : float
    """

    stretch_s: float = 10.0
    longest_s: float = 60.0
    vanished_m: float = 1e-3
    output_step_s: float = 5e-3


@dataclass(frozen=True, eq=False)
class Settled:
    """Where a motion ended: what the next speed starts from."""

    point: BranchPoint
    state: FloatArray
    response: FlightResponse


def settle(
    flight: LinearFlight,
    tanks: Mapping[str, VerticalForce],
    tip_node: int,
    settling: Settling,
    *,
    state: FloatArray | None = None,
    gust: GustShape | None = None,
) -> Settled:
    """Simulate until the motion is a limit cycle, has died, diverges, or takes too long.

    Parameters
    ----------
    flight : LinearFlight
    tanks : mapping
        Models of vertical sloshing by tank; they go on where they are if `state` is given.
    tip_node : int
    settling : Settling
    state : ndarray, optional
        Where to start; from rest without it.
    gust : callable, optional
        In the first stretch.
    """
    displacement = flight.displacement_at(tip_node)
    going: Mapping[str, VerticalForce] = tanks if state is None else {n: _Going(t) for n, t in tanks.items()}
    duration = 0.0
    while True:
        response = simulate_flight(
            flight, going, duration_s=settling.stretch_s, output_step_s=settling.output_step_s,
            gust=gust, initial_state=state,
        )  # fmt: skip
        going, gust = {name: _Going(tank) for name, tank in tanks.items()}, None
        if not response.time_s.size:
            return _at_once(flight, settling, duration, response)
        duration += float(response.time_s[-1])
        state = response.states[-1]
        cycle = limit_cycle_of(response.time_s, response.states @ displacement)
        has_died = cycle.amplitude < settling.vanished_m
        if response.ending or has_died or cycle.is_converged or duration >= settling.longest_s - 1e-9:
            n_last = round(2.0 / settling.output_step_s)
            largest = float(np.abs(response.tank_acceleration_m_per_s2[-n_last:]).max(initial=0.0))
            point = BranchPoint(
                flight.speed_m_per_s, cycle, duration, largest, response.ending, settling.vanished_m
            )
            return Settled(point, state, response)


def _at_once(flight: LinearFlight, settling: Settling, duration_s: float, response: FlightResponse) -> Settled:
    """A motion whose model of a tank ran away before the first output."""
    none = LimitCycle(float("nan"), float("nan"), float("nan"), False)
    point = BranchPoint(flight.speed_m_per_s, none, duration_s, float("nan"), response.ending, settling.vanished_m)
    return Settled(point, np.zeros(flight.n_states), response)


def followed(
    flight_at: Callable[[float], LinearFlight],
    tanks: Mapping[str, VerticalForce],
    tip_node: int,
    speeds_m_per_s: Sequence[float],
    settling: Settling,
    *,
    first_gust: GustShape,
    start: FloatArray | None = None,
    advance: Callable[[str], None] | None = None,
) -> tuple[list[BranchPoint], FloatArray | None]:
    """Continuation: each speed starts from the motion and the liquid that the speed before ended with.

    Parameters
    ----------
    flight_at : callable
        The wing at a speed; all with the same states.
    tanks : mapping
    tip_node : int
    speeds_m_per_s : sequence of float
        In the order in which they are followed.
    settling : Settling
    first_gust : callable
        What starts the first motion, and any after one that has died.
    start : ndarray, optional
        State from which the first speed goes on, with the liquid as `tanks` have it; else it starts from rest.
    advance : callable, optional
        Told each speed.

    Returns
    -------
    points : list of BranchPoint
        Up to the first that diverges.
    state : ndarray or None
        Of the last motion that was alive, with which `tanks` go on if it was the last; None if that has died.
    """
    points: list[BranchPoint] = []
    state = start
    for speed in speeds_m_per_s:
        gust = first_gust if state is None else None
        settled = settle(flight_at(speed), tanks, tip_node, settling, state=state, gust=gust)
        points.append(settled.point)
        state = settled.state if settled.point.is_alive else None
        if advance is not None:
            advance(f"{speed:.2f} m/s")
        if settled.point.ending:
            break
    return points, state
