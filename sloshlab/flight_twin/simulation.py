"""A wing in flight as a twin whose numbers are retuned and extended: one run from its recorded drives."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Mapping
from typing import Final, Generic, TypeVar

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from sloshlab.errors import InputError
from sloshlab.flight_twin.described_wing import FlightWing
from sloshlab.flight_twin.flap_chain import flap_angles
from sloshlab.flight_twin.modal_wing import ModalWing, modal_wing
from sloshlab.flight_twin.numbers import BELIEVED, of_tank
from sloshlab.flight_twin.state_space import StateSpace, numbers_with, state_space
from sloshlab.flight_twin.stepping import Inputs, Nonlinear, Transition, inputs_of, stepped, transition
from sloshlab.user_twin.description import Response, TwinRun

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
GUST, AIRSPEED, COMMAND, ROOT, FLAP = (
    "velocity_gust",
    "velocity_airspeed",
    "displacement_flap_command",
    "acceleration_root",
    "displacement_flap",
)
DRIVING: Final = (GUST, AIRSPEED, COMMAND, ROOT)
DENSITY: Final = "air_density_kg_per_m3"
"""Attribute of a recording."""
_LINEAR_SUBSTEPS: Final = 2
_SUBSTEPS: Final = 4
"""Per sample, of forces that are not linear."""
_FLAP_SUBSTEPS: Final = 8
"""Per sample, of the actuator with its limits; a multiple of the others."""
_MOST_KEPT: Final = 64
_MOST_RESPONSES: Final = 400


class FlightSimulation:
    """Runs of a wing.

    Parameters
    ----------
    described : FlightWing
    """

    def __init__(self, described: FlightWing) -> None:
        self.described = described
        self.modal: ModalWing = modal_wing(described)
        self._liquid_kg = [tank.box().liquid_mass_kg for tank in described.tanks]
        self._drives = Kept[FloatArray](_MOST_KEPT)
        self._acting = Kept[tuple[Inputs, FloatArray]](_MOST_KEPT)
        self._equations = Kept[tuple[StateSpace, Transition]](_MOST_KEPT)
        self._responses = Kept[Response](_MOST_RESPONSES)

    def simulate(self, run: TwinRun, values: Mapping[str, float]) -> Response:
        """What perfect sensors read in a run, and the motion of the tip.

        Parameters
        ----------
        run : TwinRun
        values : mapping
            Numbers of the twin; those that are absent are as believed, effects not there.
        """
        numbers = numbers_with({**dict.fromkeys(BELIEVED, 1.0), **values}, len(self.described.tanks))
        # a fit asks for the same motion again and again: numbers that a run does not show change nothing
        shown = tuple(item for item in numbers.items() if not _is_hidden(item[0], run))
        return self._responses.of((id(run), shown), lambda: self._simulated(run, numbers), run)

    def _simulated(self, run: TwinRun, numbers: Mapping[str, float]) -> Response:
        nonlinear = self._nonlinear(numbers, run.sampling_rate_hz)
        # where a play is taken up the flap begins to move within a step
        is_smooth = nonlinear.is_none and not (numbers["play_rad"] > 0 and run.channels[COMMAND].any())
        every = _LINEAR_SUBSTEPS if is_smooth else _SUBSTEPS
        of_inputs = tuple(numbers[name] for name in _OF_INPUTS)
        inputs, actuator = self._acting.of(
            (id(run), every, of_inputs), lambda: self._inputs(run, numbers, every), run
        )
        equations, through = self._solved(run, numbers, 1.0 / (every * run.sampling_rate_hz))
        states, moved = stepped(equations, through, inputs, nonlinear)
        n, root, tip = equations.n_coordinates, inputs.at_steps[::every, 3], equations.tip_row
        readings = {each.name: moved[:, k] + root for k, each in enumerate(self.described.accelerometers)}
        readings[FLAP] = self.described.flap_chord_m * actuator
        motion = np.stack([states[:, :n] @ tip, states[:, n : 2 * n] @ tip, moved[:, -1]], axis=-1)
        return Response(readings, motion)

    def _solved(self, run: TwinRun, numbers: Mapping[str, float], step_s: float) -> tuple[StateSpace, Transition]:
        speed, density = flow_of(run)
        key = (speed, density, step_s, *(value for name, value in numbers.items() if name not in _NOT_LINEAR))

        def solved() -> tuple[StateSpace, Transition]:
            equations = self.equations(run, numbers)
            return equations, transition(equations.system, step_s)

        return self._equations.of(key, solved)

    def equations(self, run: TwinRun, numbers: Mapping[str, float]) -> StateSpace:
        """The linear part of a run.

        Parameters
        ----------
        run : TwinRun
        numbers : mapping
            All, of `numbers_with`.
        """
        speed, density = flow_of(run)
        return state_space(self.described, self.modal, numbers, airspeed_m_per_s=speed, density_kg_per_m3=density)

    def _nonlinear(self, numbers: Mapping[str, float], rate_hz: float) -> Nonlinear:
        tanks = range(len(self.described.tanks))
        sloshing = [
            [
                numbers[of_tank("threshold_g", i)],
                numbers[of_tank("peak_w_bar", i)],
                self._liquid_kg[i],
                numbers[of_tank("onset_exponent", i)],
            ]
            for i in tanks
        ]
        loss = np.array([numbers[of_tank("loss_kg_per_s", i)] for i in tanks])
        half_a_period = float(np.pi / self.modal.omega_rad_per_s[0])
        stops = (numbers["clearance_m"], numbers["clearance_n_per_m"])
        return Nonlinear(
            numbers["stall_angle_rad"],
            np.array(sloshing),
            loss,
            *stops,
            half_a_period,
            1.0 / (_SUBSTEPS * rate_hz),
        )

    def _inputs(self, run: TwinRun, numbers: Mapping[str, float], every: int) -> tuple[Inputs, FloatArray]:
        """Inputs at every step, some a sample, and the angle of the actuator at every sample."""
        fine = self._fine(run)[:: _FLAP_SUBSTEPS // every]
        step = 1.0 / (every * run.sampling_rate_hz)
        gust = _later(fine[:, 0], numbers["gust_delay_s"] / step)
        if numbers["gust_time_constant_s"] > 0:
            # exact for an input that is linear within a step
            ratio = step / numbers["gust_time_constant_s"]
            decay = np.exp(-ratio)
            now, before = 1 - (1 - decay) / ratio, (1 - decay) / ratio - decay
            gust = lfilter([now, before], [1.0, -decay], gust)
        command = self._fine(run)[:, 1]
        actuator, flap = flap_angles(self.described.flap, numbers, command, step * every / _FLAP_SUBSTEPS)
        flap = flap[:: _FLAP_SUBSTEPS // every]
        # of the steps that are made: where a limit or a play stops the flap no part of its way is lost
        rate = np.gradient(flap) / step if flap.any() else flap
        inputs = np.stack([gust, flap, rate, fine[:, 2]], axis=-1)
        return inputs_of(inputs, every), actuator[::_FLAP_SUBSTEPS]

    def _fine(self, run: TwinRun) -> FloatArray:
        """Gust, command [rad] and root at `_FLAP_SUBSTEPS` per sample; kept, as a fit asks for them again."""
        return self._drives.of(id(run), lambda: self._resampled(run), run)

    def _resampled(self, run: TwinRun) -> FloatArray:
        n = run.n_samples
        at = np.arange((n - 1) * _FLAP_SUBSTEPS + 1) / _FLAP_SUBSTEPS
        samples = np.arange(n)
        # a flight computer's command is linear between its instants, the air and the ground are smooth
        command = np.interp(at, samples, run.channels[COMMAND]) / self.described.flap_chord_m
        gust, root = (CubicSpline(samples, run.channels[name])(at) for name in (GUST, ROOT))
        return np.stack([gust, command, root], axis=-1)


def flow_of(run: TwinRun) -> tuple[float, float]:
    """Mean airspeed [m/s] and density of the air [kg/m³] of a run.

    Raises
    ------
    InputError
        If the run does not say the density of its air.
    """
    density = run.attributes.get(DENSITY)
    if not isinstance(density, int | float | np.number) or not 0 < float(density) < 20:
        allowed = "the density of the air, 0 … 20 kg/m³"
        raise InputError(f"run {run.name}: attribute {DENSITY}", got=repr(density)[:60], allowed=allowed)
    return float(np.mean(run.channels[AIRSPEED])), float(density)


_OF_CONTROL: Final = frozenset(
    {"flap_limit_rad", "flap_rate_rad_per_s", "actuator_delay_s", "play_rad", "actuator frequency"}
)
_OF_GUSTS: Final = frozenset({"gust_delay_s", "gust_time_constant_s"})
_OF_INPUTS: Final = tuple(sorted(_OF_CONTROL | _OF_GUSTS))
_OF_SPEED: Final = frozenset({"airspeed_error", "lag_ratio", "stall_angle_rad"})
_NOT_LINEAR: Final = _OF_CONTROL | _OF_GUSTS | {"clearance_m", "clearance_n_per_m"}
"""Numbers that do not enter the linear equations."""


def _is_hidden(number: str, run: TwinRun) -> bool:
    """Whether a run cannot show a number: nothing that it acts on moves."""
    if number in _OF_CONTROL:
        return not run.channels[COMMAND].any()
    if number in _OF_GUSTS:
        return not run.channels[GUST].any()
    return number in _OF_SPEED and not run.channels[AIRSPEED].any()


_Value = TypeVar("_Value")


class Kept(Generic[_Value]):
    """The latest results of a function, by a key.

    Parameters
    ----------
    most : int
        Results that are kept.
    """

    def __init__(self, most: int) -> None:
        self._most, self._lock = most, threading.Lock()
        self._kept: OrderedDict[Hashable, tuple[_Value, object]] = OrderedDict()

    def of(self, key: Hashable, make: Callable[[], _Value], owner: object = None) -> _Value:
        """What was made for a key, or what `make` makes; `owner` is kept besides: its identity stays its own."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key][0]
        made = make()
        with self._lock:
            self._kept[key] = made, owner
            while len(self._kept) > self._most:
                self._kept.popitem(last=False)
        return made


def _later(values: FloatArray, steps: float) -> FloatArray:
    if steps == 0:
        return values
    place = np.arange(values.size)
    return np.asarray(np.interp(place - steps, place, values))
