"""Limit cycles of a wing whose tanks slosh: reading them from a motion, and following them over the speed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.aeroelastic.gust import GustShape
from sloshlab.aircraft.linear_flight import LinearFlight
from sloshlab.aircraft.tank_simulation import FlightResponse, VerticalForce, simulate_flight

FloatArray = npt.NDArray[np.float64]
_CYCLES_OF_A_BLOCK: Final = 10
_STEADY: Final = 0.01
"""Largest change of the amplitude from one block of cycles to the next, and the spread within one, that is steady."""
_FEWEST_EXTREMA: Final = 8


@dataclass(frozen=True)
class LimitCycle:
    """The end of a motion.

    Attributes
    ----------
    amplitude : float
        Half the mean distance of maxima and minima over the last cycles, in the units of the signal.
    frequency_rad_per_s : float
    growth_per_s : float
        Of the amplitude between the last two blocks of cycles.
    is_converged : bool
        Whether the amplitude changes by less than 1 % from block to block.
    """

    amplitude: float
    frequency_rad_per_s: float
    growth_per_s: float
    is_converged: bool


def extrema(time_s: FloatArray, signal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Times and values of the largest and smallest value between crossings of zero, by parabolas.

    Parameters
    ----------
    time_s, signal : ndarray, shape (n,)
        Evenly sampled.

    Returns
    -------
    time_s, value : ndarray
        Signs of the values alternate; the parts before the first and after the last crossing are left out.
    """
    crossings = np.flatnonzero(np.signbit(signal[1:]) != np.signbit(signal[:-1])) + 1
    times, values = [], []
    for first, last in zip(crossings[:-1], crossings[1:], strict=True):
        place = first + int(np.argmax(np.abs(signal[first:last])))
        if not 0 < place < signal.size - 1:
            continue
        before, here, after = signal[place - 1 : place + 2]
        bend = before - 2 * here + after
        shift = 0.5 * (before - after) / bend if bend != 0 else 0.0
        times.append(time_s[place] + shift * (time_s[1] - time_s[0]))
        values.append(here - 0.25 * (before - after) * shift)
    return np.array(times), np.array(values)


def limit_cycle_of(time_s: FloatArray, signal: FloatArray) -> LimitCycle:
    """Read the end of a motion.

    Parameters
    ----------
    time_s, signal : ndarray, shape (n,)
        Evenly sampled.
    """
    when, value = extrema(time_s, signal - np.mean(signal[signal.size // 2 :]))
    if when.size < _FEWEST_EXTREMA:
        return LimitCycle(float(np.abs(signal).max(initial=0.0)), float("nan"), float("nan"), False)
    # neighbours on both sides: a slow drift is no amplitude
    swing = 0.5 * np.abs(np.diff(value))
    n = min(2 * _CYCLES_OF_A_BLOCK, swing.size // 2)
    last, before = swing[-n:], swing[-2 * n : -n]
    amplitude = float(last.mean())
    omega = np.pi * (n - 1) / (when[-1] - when[-n])
    change = np.log(amplitude / before.mean()) if before.mean() > 0 and amplitude > 0 else 0.0
    return LimitCycle(
        amplitude,
        float(omega),
        float(change / (when[-1] - when[-1 - n])),
        bool(abs(change) < _STEADY and n == 2 * _CYCLES_OF_A_BLOCK),
    )


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
    tank_amplitude_m : ndarray, shape (n_tanks,)
        Largest displacement of each tank over the last cycles, from its acceleration.
    ending : str
        Why it ended before it was steady: a divergence; empty otherwise.
    """

    speed_m_per_s: float
    cycle: LimitCycle
    duration_s: float
    largest_tank_acceleration_m_per_s2: float
    ending: str = ""


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
    vanished_m: float = 2e-4
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
    displacement = _tip_displacement(flight, tip_node)
    going: Mapping[str, VerticalForce] = tanks if state is None else {n: _Going(t) for n, t in tanks.items()}
    duration = 0.0
    while True:
        response = simulate_flight(
            flight, going, duration_s=settling.stretch_s, output_step_s=settling.output_step_s,
            gust=gust, initial_state=state,
        )  # fmt: skip
        going, gust = {name: _Going(tank) for name, tank in tanks.items()}, None
        duration += float(response.time_s[-1]) if response.time_s.size else 0.0
        state = response.states[-1]
        cycle = limit_cycle_of(response.time_s, response.states @ displacement)
        has_died = cycle.amplitude < settling.vanished_m
        if response.ending or has_died or cycle.is_converged or duration >= settling.longest_s - 1e-9:
            n_last = round(2.0 / settling.output_step_s)
            largest = float(np.abs(response.tank_acceleration_m_per_s2[-n_last:]).max(initial=0.0))
            point = BranchPoint(flight.speed_m_per_s, cycle, duration, largest, response.ending)
            return Settled(point, state, response)


def _tip_displacement(flight: LinearFlight, node: int) -> FloatArray:
    row = np.zeros(flight.n_states)
    motion = flight.model.structure.motion_at(node)[2] @ flight.to_structure
    row[: motion.size] = motion
    return row


def followed(
    flight_at: Callable[[float], LinearFlight],
    tanks: Mapping[str, VerticalForce],
    tip_node: int,
    speeds_m_per_s: Sequence[float],
    settling: Settling,
    *,
    first_gust: GustShape,
    advance: Callable[[str], None] | None = None,
) -> list[BranchPoint]:
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
        What starts the first motion, and any after one that has died or diverged.
    advance : callable, optional
        Told each speed.
    """
    points: list[BranchPoint] = []
    state: FloatArray | None = None
    for speed in speeds_m_per_s:
        gust = first_gust if state is None else None
        settled = settle(flight_at(speed), tanks, tip_node, settling, state=state, gust=gust)
        points.append(settled.point)
        lost = bool(settled.point.ending) or settled.point.cycle.amplitude < settling.vanished_m
        state = None if lost else settled.state
        if advance is not None:
            advance(f"{speed:.2f} m/s")
        if settled.point.ending:
            break
    return points
