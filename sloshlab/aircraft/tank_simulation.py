"""An aircraft in a gust whose tanks slosh vertically as trained models, each tank at a rate of its own.

The linear part steps exactly between the instants of all tanks and outputs, which are merged and never rounded.
Between two instants of a tank its force is a cubic, known ahead (the models' delays start at 1), and the gust is
linear between outputs: both are states of one linear system, whose exponential is all that a step needs. So the
only error of time stepping is that of the gust's straight lines, (π f h)²/4 of its amplitude with h the output
step and f = U/L_g.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from sloshlab.aeroelastic.arrays import require_positive, require_shape
from sloshlab.aeroelastic.gust import GustShape
from sloshlab.aircraft.exact_steps import ExactSteps
from sloshlab.aircraft.linear_flight import LinearFlight
from sloshlab.errors import AnalysisError, InputError

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
LARGEST_ANGLE_RAD: Final = 1.0
"""Angle of attack of a node beyond which forces that are linear in it mean nothing; a simulation ends there."""
_MOST_INSTANTS: Final = 5_000_000
_MOST_NUMBERS: Final = 200_000_000
_OUTPUT: Final = -1
"""In place of the number of a tank."""


class VerticalForce(Protocol):
    """What gives a tank its force: `sloshlab.reduced_order_model.stepping.SteppedModel`, or anything like it."""

    sampling_rate_hz: float

    def begin(self) -> None:
        """Put the liquid to rest."""

    def step(self, velocity_m_per_s: float) -> FloatArray:
        """From the velocity of this instant, coefficients of the cubic [N] over the step to the next."""

    @property
    def runs_away(self) -> bool:
        """Whether its force has lost all bounds."""


@dataclass(frozen=True, eq=False)
class FlightResponse:
    """What happened.

    Attributes
    ----------
    flight : LinearFlight
    time_s : ndarray, shape (n_times,)
        From 0, as far as the simulation came.
    states : ndarray, shape (n_times, n_states)
    force_n : ndarray, shape (n_times, n_tanks)
        Δf of each tank, upward positive; 0 where it has no model.
    wind : ndarray, shape (n_times, 2)
        w_g [m/s], up, and its rate until the next output [m/s²].
    seen_velocity_m_per_s : dict of str to ndarray
        What the model of each tank saw, at its own instants.
    model_rate_hz : dict of str to float
    ending : str
        Why it ended before its time, and when; empty where it did not.
    """

    flight: LinearFlight
    time_s: FloatArray
    states: FloatArray
    force_n: FloatArray
    wind: FloatArray
    seen_velocity_m_per_s: dict[str, FloatArray]
    model_rate_hz: dict[str, float]
    ending: str = ""

    def coordinate(self, name: str) -> FloatArray:
        """Of the aircraft or a liquid, by its name, such as ``mode 1`` or ``centre x1``.

        Raises
        ------
        InputError
            If there is none of this name.
        """
        if name not in self.flight.names:
            raise InputError("coordinate", got=name, allowed=", ".join(self.flight.names))
        return np.asarray(self.states[:, self.flight.names.index(name)])

    @property
    def liquid_displacement_m(self) -> FloatArray:
        """Of each sideways equivalent mass against its tank, shape (n_times, n_liquids); see `flight.liquids`."""
        n = self.flight.n_coordinates
        return np.asarray(self.states[:, n - len(self.flight.liquids) : n] / np.sqrt(self.flight.liquid_masses_kg))

    @property
    def state_rates(self) -> FloatArray:
        """ẋ, shape (n_times, n_states)."""
        flight = self.flight
        return np.asarray(
            self.states @ flight.matrix.T + self.force_n @ flight.of_forces.T + self.wind @ flight.of_wind.T
        )

    @property
    def tank_velocity_m_per_s(self) -> FloatArray:
        """Absolute and vertical, up, of each tank's centre, shape (n_times, n_tanks)."""
        return np.asarray(self.states @ self.flight.tank_velocity.T)

    @property
    def tank_acceleration_m_per_s2(self) -> FloatArray:
        """As the velocity, shape (n_times, n_tanks); without the weight."""
        return np.asarray(self.state_rates @ self.flight.tank_velocity.T)

    def acceleration_at(self, node: int) -> FloatArray:
        """Absolute vertical acceleration of a node [m/s²], up, shape (n_times,)."""
        return np.asarray(self.state_rates @ self.flight.velocity_at(node))

    def angle_of_attack_at(self, node: int) -> FloatArray:
        """Of a node [rad], by motion alone, nose up positive, shape (n_times,)."""
        return np.asarray(self.states @ self.flight.angle_of_attack_at(node))


def simulate_flight(
    flight: LinearFlight,
    tanks: Mapping[str, VerticalForce] | None = None,
    *,
    duration_s: float,
    output_step_s: float = 2e-3,
    gust: GustShape | None = None,
    initial_state: npt.ArrayLike | None = None,
    watch: Callable[[float], None] | None = None,
) -> FlightResponse:
    """Follow the aircraft through a gust, or from an initial state.

    Parameters
    ----------
    flight : LinearFlight
        With frozen or lateral liquids.
    tanks : mapping, optional
        Models of vertical sloshing by the names of tanks; the others stay as `flight` has them.
    duration_s, output_step_s : float
        Of the simulation; the gust is linear between outputs.
    gust : callable, optional
        w_g over time, uniform over the aircraft.
    initial_state : array_like, shape (n_states,), optional
        Rest by default.
    watch : callable, optional
        Told the share that is done, now and then.

    Returns
    -------
    FlightResponse

    Raises
    ------
    InputError
        If there is no tank of a name.
    AnalysisError
        If the simulation is too long, or its initial state of another length.
    """
    require_positive(duration_s=duration_s, output_step_s=output_step_s)
    models = _Models(flight, tanks or {})
    n_outputs = round(duration_s / output_step_s) + 1
    instants, actors = _instants(models, n_outputs, output_step_s)
    if n_outputs * flight.n_states > _MOST_NUMBERS:
        got = f"{n_outputs} outputs of {flight.n_states} states"
        raise AnalysisError("simulation of a flight", got=got, remedy="take a shorter one or a larger step")
    start = np.zeros(flight.n_states) if initial_state is None else np.asarray(initial_state, float)
    require_shape("initial_state", start, (flight.n_states,))
    wind = _wind(gust, n_outputs, output_step_s)
    run = _Run(flight, models, wind, start)
    ending = run.follow(instants, actors, ExactSteps(models.whole_matrix(), output_step_s), watch)
    n = run.n_done
    force = np.zeros((n, len(flight.model.tanks)))
    force[:, models.tank_numbers] = run.values[:n, models.force_places]
    return FlightResponse(
        flight,
        np.asarray(output_step_s * np.arange(n), np.float64),
        run.values[:n, : flight.n_states],
        force,
        wind[:n],
        {name: np.array(seen) for name, seen in zip(models.names, run.seen, strict=True)},
        {name: model.sampling_rate_hz for name, model in zip(models.names, models.forces, strict=True)},
        ending,
    )


class _Models:
    """The tanks that have models, and their places in the whole state (x, four numbers of each tank, w_g, ẇ_g)."""

    def __init__(self, flight: LinearFlight, tanks: Mapping[str, VerticalForce]) -> None:
        known = [tank.name for tank in flight.model.tanks]
        for name in tanks:
            if name not in known:
                raise InputError("tank", got=name, allowed=", ".join(known) or "none; the model has no [[tanks]]")
        self.flight = flight
        self.names = [name for name in known if name in tanks]
        self.forces = [tanks[name] for name in self.names]
        if len({id(force) for force in self.forces}) != len(self.forces):
            raise InputError("tanks", got="one model object for two of them", remedy="make one for each")
        self.tank_numbers = [known.index(name) for name in self.names]
        self.force_places = [flight.n_states + 4 * number for number in range(len(self.names))]
        self.wind_place = flight.n_states + 4 * len(self.names)

    def whole_matrix(self) -> FloatArray:
        """Of the linear system with cubic forces and a linear wind as states of their own."""
        flight, n = self.flight, self.flight.n_states
        matrix = np.zeros((self.wind_place + 2,) * 2)
        matrix[:n, :n] = flight.matrix
        for number, force, place in zip(self.tank_numbers, self.forces, self.force_places, strict=True):
            matrix[:n, place] = flight.of_forces[:, number]
            # f, f'/rate, f''/rate² … in newton: the rate of change of each is rate times the next
            for order in range(3):
                matrix[place + order, place + order + 1] = force.sampling_rate_hz
        matrix[:n, self.wind_place :] = flight.of_wind
        matrix[self.wind_place, self.wind_place + 1] = 1.0
        return matrix


_FACTORIALS: Final = np.array([1.0, 1.0, 2.0, 6.0])


class _Run:
    """The state on its way."""

    def __init__(self, flight: LinearFlight, models: _Models, wind: FloatArray, start: FloatArray) -> None:
        self.flight, self.models, self.wind = flight, models, wind
        self.state = np.zeros(models.wind_place + 2)
        self.state[: flight.n_states] = start
        self.values = np.zeros((wind.shape[0], models.wind_place))
        self.seen: list[list[float]] = [[] for _ in models.names]
        self.n_done = 0
        self._velocity = flight.tank_velocity[models.tank_numbers]
        is_in_air = flight.speed_m_per_s > 0
        self._angles = flight.angles_of_attack() if is_in_air else np.zeros((1, flight.n_states))

    def follow(
        self, instants: FloatArray, actors: IntArray, steps: ExactSteps, watch: Callable[[float], None] | None
    ) -> str:
        """Go through all instants; return why it ended early."""
        for force in self.models.forces:
            force.begin()
        now, n_outputs = 0.0, self.wind.shape[0]
        for time, actor in zip(instants.tolist(), actors.tolist(), strict=True):
            if time > now:
                self.state, now = steps.advanced(self.state, time - now), time
            ending = self._output() if actor == _OUTPUT else self._step_of_tank(actor)
            if ending:
                return f"{ending} at {now:.3f} s"
            if watch is not None and actor == _OUTPUT and self.n_done % 256 == 0:
                watch(self.n_done / n_outputs)
        return ""

    def _step_of_tank(self, number: int) -> str:
        models, place = self.models, self.models.force_places[number]
        velocity = float(self._velocity[number] @ self.state[: self.flight.n_states])
        self.seen[number].append(velocity)
        self.state[place : place + 4] = models.forces[number].step(velocity) * _FACTORIALS
        if models.forces[number].runs_away:
            return f"tank {models.names[number]}: the output of its model runs away"
        return ""

    def _output(self) -> str:
        state = self.state
        largest = float(np.abs(self._angles @ state[: self.flight.n_states]).max())
        # written so that NaN is caught, too
        if not (np.isfinite(state).all() and largest <= LARGEST_ANGLE_RAD):
            return f"the motion diverges: an angle of attack of {largest:.3g} rad, beyond {LARGEST_ANGLE_RAD:g}"
        state[self.models.wind_place :] = self.wind[self.n_done]
        self.values[self.n_done] = state[: self.models.wind_place]
        self.n_done += 1
        return ""


def _instants(models: _Models, n_outputs: int, output_step_s: float) -> tuple[FloatArray, IntArray]:
    """All instants in order, tanks before outputs where they coincide, and whose they are."""
    end_s = (n_outputs - 1) * output_step_s
    counts = [int(end_s * force.sampling_rate_hz * (1 + 1e-12)) + 1 for force in models.forces] + [n_outputs]
    if sum(counts) > _MOST_INSTANTS:
        raise AnalysisError("instants of a flight", got=f"{sum(counts)}", allowed=f"≤ {_MOST_INSTANTS}")
    periods = [*(1 / force.sampling_rate_hz for force in models.forces), output_step_s]
    times = [period * np.arange(count) for count, period in zip(counts, periods, strict=True)]
    actors = np.repeat([*range(len(models.forces)), _OUTPUT], counts)
    every = np.concatenate(times)
    order = np.argsort(every, kind="stable")
    # the last instants of a tank may lie a rounding error behind the end
    return np.minimum(every[order], end_s), np.asarray(actors[order], np.int64)


def _wind(gust: GustShape | None, n_outputs: int, step_s: float) -> FloatArray:
    """w_g at the outputs, and its rate to the next."""
    wind = np.zeros((n_outputs, 2))
    if gust is not None:
        wind[:, 0] = gust(np.asarray(step_s * np.arange(n_outputs), np.float64))
        wind[:-1, 1] = np.diff(wind[:, 0]) / step_s
    return wind
