"""Flights drawn by a seed: what is hidden in each, how strong, and its truth in the words of a challenge."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy.optimize import lsq_linear

from acquisition.virtual_flight.described_wing import DescribedWing
from acquisition.virtual_flight.flight_test import CARD, FlightPoint
from acquisition.virtual_flight.hidden_physics import HiddenFlight, Oscillator
from acquisition.virtual_flight.recorded_flight import (
    ACCELEROMETER_NOISE,
    FLAP,
    NOISE,
    Laboratory,
    drawn_laboratory,
    perfect_run,
)

FloatArray = npt.NDArray[np.float64]
Generator = np.random.Generator
_SHARES: Final = {"nothing": 15, "effects": 33, "look_alikes": 6, "outside": 6}
"""Of sixty flights; others in proportion."""
_WEAKEST, _STRONGEST = 4.0, 40.0
"""Of a hidden effect beyond what retuning takes, in noise floors of the channel that shows it most."""
_MOST_TRIES: Final = 12
_RETUNED: Final = {"bending": 0.16, "torsion": 0.16, "damping": 0.8, "actuator": 0.08}
"""Relative, as far as retuning may go."""
_LARGEST_GAIN: Final = 0.0125
"""The same of every sensor: more is a fault."""
_REFERENCE_SEED: Final = 20260


@dataclass(frozen=True, eq=False)
class DrawnEffect:
    """One hidden effect of a size.

    Attributes
    ----------
    name, block : str
    parameters : dict of str to float
        Under the names of the vocabulary.
    hidden : HiddenFlight
    equals : tuple of str
        Names that explain the recordings as well.
    """

    name: str
    block: str
    parameters: dict[str, float]
    hidden: HiddenFlight
    equals: tuple[str, ...] = ()


Draw = Callable[[DescribedWing, Generator, float], DrawnEffect]
"""(wing, generator, size about one) → effect."""


def _either(generator: Generator) -> float:
    return float(generator.choice([-1.0, 1.0]))


def _lift_gain(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    ratio = _either(generator) * 0.12 * size
    return DrawnEffect("lift_gain", "aerodynamics", {"ratio": ratio}, HiddenFlight(lift_gain=ratio))


def _lag(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    ratio = float(np.exp(_either(generator) * 0.7 * size))
    return DrawnEffect("aerodynamic_lag", "aerodynamics", {"lag_ratio": ratio}, HiddenFlight(lag_ratio=ratio))


def _stall(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    angle = 0.085 / size**0.5
    hidden = HiddenFlight(stall_angle_rad=angle)
    return DrawnEffect("aerodynamic_nonlinearity", "aerodynamics", {"stall_angle_rad": angle}, hidden)


def _airspeed(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    ratio = _either(generator) * 0.06 * size
    return DrawnEffect("airspeed_error", "sensor", {"ratio": ratio}, HiddenFlight(airspeed_ratio=ratio))


def _gust_delay(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    delay = 0.010 * size
    return DrawnEffect("gust_shape", "excitation", {"delay_s": delay}, HiddenFlight(gust_delay_s=delay))


def _gust_low_pass(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    constant = 0.015 * size
    hidden = HiddenFlight(gust_time_constant_s=constant)
    return DrawnEffect("gust_shape", "excitation", {"time_constant_s": constant}, hidden)


def _saturation(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    limit = 0.22 / size**0.5
    return DrawnEffect("control_saturation", "control", {"limit_rad": limit}, HiddenFlight(flap_limit_rad=limit))


def _rate_limit(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    rate = 3.0 / size**0.5
    hidden = HiddenFlight(flap_rate_rad_per_s=rate)
    return DrawnEffect("control_rate_limit", "control", {"rate_rad_per_s": rate}, hidden)


def _delay(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    delay = 0.012 * size
    return DrawnEffect("actuator_delay", "control", {"delay_s": delay}, HiddenFlight(actuator_delay_s=delay))


def _play(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    play = 0.03 * size
    return DrawnEffect("control_freeplay", "control", {"play_rad": play}, HiddenFlight(play_rad=play))


def _loss(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    factor = 0.05 * size
    hidden = HiddenFlight(loss_factor=factor)
    return DrawnEffect("structural_damping", "structure", {"loss_factor": factor}, hidden)


def _mode(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    mass, frequency, ratio = 0.04 * size, float(generator.uniform(3.0, 9.0)), float(generator.uniform(0.01, 0.05))
    oscillator = Oscillator(wing.semi_span_m, 0.0, frequency, ratio, mass, mass)
    parameters = {"mass_kg": mass, "frequency_hz": frequency, "damping_ratio": ratio}
    return DrawnEffect("missing_mode", "structure", parameters, HiddenFlight(oscillators=(oscillator,)))


def _sloshing(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    tank = len(wing.tanks) - 1
    threshold, peak = float(generator.uniform(0.3, 0.8)), 0.8 * size
    hidden = HiddenFlight(sloshing={tank: (threshold, peak)})
    return DrawnEffect("liquid_sloshing", "tank", {"threshold_g": threshold, "peak_w_bar": peak}, hidden)


def _liquid_loss(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    tank, rate = len(wing.tanks) - 1, 0.015 * size
    hidden = HiddenFlight(liquid_loss_kg_per_s={tank: rate})
    return DrawnEffect("liquid_loss", "tank", {"rate_kg_per_s": rate}, hidden)


def _sensor(name: str, kind: str, number: Callable[[Generator, float], float], parameter: str) -> Draw:
    def drawn(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
        channel = wing.accelerometers[int(generator.integers(len(wing.accelerometers)))][0]
        value = number(generator, size)
        return DrawnEffect(name, "sensor", {parameter: value}, HiddenFlight(sensor=((channel, kind, value),)))

    return drawn


SINGLES: Final[tuple[Draw, ...]] = (
    _lift_gain,
    _lag,
    _stall,
    _airspeed,
    _gust_delay,
    _gust_low_pass,
    _saturation,
    _rate_limit,
    _delay,
    _play,
    _loss,
    _mode,
    _sloshing,
    _liquid_loss,
    _sensor("sensor_gain", "gain", lambda generator, size: _either(generator) * 0.06 * size, "ratio"),
    _sensor("sensor_delay", "delay", lambda generator, size: 0.004 * size, "delay_s"),
)


def _mass(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    tank, share = len(wing.tanks) - 1, _either(generator) * 0.25 * size
    if generator.random() < 0.5:
        hidden = HiddenFlight(effective_mass={tank: share})
        return DrawnEffect("effective_mass", "tank", {"beta": share}, hidden, ("fuel_state",))
    fill = min(max(wing.tanks[tank].fill_level * (1 + share), 0.05), 0.95)
    return DrawnEffect(
        "fuel_state", "tank", {"fill_level": fill}, HiddenFlight(fill_levels={tank: fill}), ("effective_mass",)
    )


def _cubic_spring(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    hidden = HiddenFlight(tip_stiffness_n_per_m3=2e4 * size)
    return DrawnEffect("unknown", "structure", {}, hidden)


def _buffet(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    strouhal = float(generator.uniform(0.05, 0.15))
    hidden = HiddenFlight(buffet_lift_coefficient=0.02 * size, buffet_strouhal=strouhal)
    return DrawnEffect("unknown", "aerodynamics", {}, hidden)


def _hunting(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    hidden = HiddenFlight(hunting_rad=0.004 * size, hunting_hz=float(generator.uniform(3.0, 8.0)))
    return DrawnEffect("unknown", "control", {}, hidden)


def _slug(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    hidden = HiddenFlight(slug_kg=0.4 * size, slug_threshold_g=float(generator.uniform(0.4, 0.7)))
    return DrawnEffect("unknown", "tank", {}, hidden)


LOOK_ALIKES: Final[tuple[Draw, ...]] = (_mass,)
OUTSIDE: Final[tuple[Draw, ...]] = (_cubic_spring, _buffet, _hunting, _slug)


@dataclass(frozen=True, eq=False)
class Flight:
    """One drawn case.

    Attributes
    ----------
    name : str
    hidden : HiddenFlight
    laboratory : Laboratory
    card : tuple of FlightPoint
    truth : dict
        As `sloshlab trial commit` reads it.
    seed : list of int
        Of what is done and of its noise.
    """

    name: str
    hidden: HiddenFlight
    laboratory: Laboratory
    card: tuple[FlightPoint, ...]
    truth: dict[str, Any]
    seed: list[int] = field(default_factory=list)


class FlightDrawing:
    """Draws flights of a wing.

    Parameters
    ----------
    wing : DescribedWing
    seed : int
    """

    def __init__(self, wing: DescribedWing, seed: int) -> None:
        self._wing, self._seed = wing, seed
        self._believed = self._runs(HiddenFlight(), Laboratory())
        self._retuned = self._directions()
        self._orthonormal, self._upper = np.linalg.qr(self._retuned.T)
        n_channels = self._retuned.shape[0] - len(_RETUNED)
        self._limits = np.array([*_RETUNED.values(), *[_LARGEST_GAIN] * n_channels])

    def flights(self, n: int, said: Callable[[str], None] = lambda name: None) -> list[Flight]:
        """Flights in a drawn order of classes.

        Parameters
        ----------
        n : int
        said : callable, optional
            Told the name of every flight that is drawn.
        """
        kinds = _in_proportion(n)
        np.random.default_rng([self._seed, 0]).shuffle(kinds)
        found, counts = [], dict.fromkeys(_SHARES, 0)
        orders = {
            "effects": _turns(SINGLES, np.random.default_rng([self._seed, 1])),
            "look_alikes": _turns(LOOK_ALIKES, np.random.default_rng([self._seed, 2])),
            "outside": _turns(OUTSIDE, np.random.default_rng([self._seed, 3])),
        }
        for number, kind in enumerate(kinds):
            name = f"case_{number + 1:03d}"
            draw = orders[kind](counts[kind]) if kind in orders else None
            counts[kind] += 1
            found.append(self._flight(name, number, kind, draw))
            said(name)
        return found

    def _flight(self, name: str, number: int, kind: str, draw: Draw | None) -> Flight:
        generator = np.random.default_rng([self._seed, 10, number])
        laboratory = drawn_laboratory(self._wing, generator)
        speeds = {14.0: float(generator.uniform(13.0, 15.0)), 20.0: float(generator.uniform(18.5, 20.5)), 0.0: 0.0}
        card = tuple(replace(point, airspeed_m_per_s=speeds[point.airspeed_m_per_s]) for point in CARD)
        hidden, truth = HiddenFlight(), dict[str, Any](hidden=kind)
        if draw is not None:
            seed = [self._seed, 20, number]
            effect, strength = self._of_a_strength(draw, number, lambda hidden: self._change(card, seed, hidden))
            stated: dict[str, Any] = {"block": effect.block, "strength": strength}
            if effect.name != "unknown":
                stated |= {"name": effect.name, "parameters": effect.parameters}
            hidden, truth = effect.hidden, {"hidden": kind, "effects": [stated]}
            if effect.equals:
                truth["equals"] = [[other] for other in effect.equals]
        return Flight(name, hidden, laboratory, card, truth, [self._seed, 20, number])

    def _change(self, card: Sequence[FlightPoint], seed: list[int], hidden: HiddenFlight) -> float:
        """What it changes in the case itself, RMS over the noise: a limit may lie beyond what is done there."""
        believed, other = (self._runs(each, Laboratory(), card, [*seed, 0]) for each in (HiddenFlight(), hidden))
        return float(np.sqrt(((other - believed) ** 2).mean(axis=-1)).max())

    def _of_a_strength(
        self, draw: Draw, number: int, change: Callable[[HiddenFlight], float]
    ) -> tuple[DrawnEffect, float]:
        """An effect that shows, larger until it does and smaller until it does not shout."""
        size = float(np.exp(np.random.default_rng([self._seed, 11, number]).uniform(-0.3, 0.9)))
        for _ in range(_MOST_TRIES):
            # the same draws at every size
            effect = draw(self._wing, np.random.default_rng([self._seed, 12, number]), size)
            strength = self.strength(effect.hidden)
            if strength < _WEAKEST or change(effect.hidden) < _WEAKEST:
                size *= 1.5
            elif strength > _STRONGEST:
                size /= 1.5
            else:
                break
        return effect, strength

    def strength(self, hidden: HiddenFlight) -> float:
        """What it changes beyond retuning, RMS over the noise, in the channel and run where that is most."""
        change = self._runs(hidden, Laboratory()) - self._believed
        found = lsq_linear(self._upper, self._orthonormal.T @ change.ravel(), (-self._limits, self._limits))
        left = (change.ravel() - self._retuned.T @ found.x).reshape(change.shape)
        return float(np.sqrt((left**2).mean(axis=-1)).max())

    def _runs(
        self,
        hidden: HiddenFlight,
        laboratory: Laboratory,
        card: Sequence[FlightPoint] = CARD,
        seed: Sequence[int] = (_REFERENCE_SEED,),
    ) -> FloatArray:
        """All compared channels of all runs over their noise, shape (n_runs, n_channels, n)."""
        channels = [*(name for name, _, _ in self._wing.accelerometers), FLAP]
        noise = np.array([NOISE.get(name, ACCELEROMETER_NOISE) for name in channels])
        runs = [
            perfect_run(self._wing, hidden, laboratory, point, [*seed, number])
            for number, point in enumerate(card, start=1)
            if point.repeat == 1
        ]
        return np.stack([np.stack([run[name] for name in channels]) / noise[:, None] for run in runs])

    def _directions(self) -> FloatArray:
        """What the believed numbers change, one row each."""
        found = []
        for name in _RETUNED:
            step = 0.05 if name == "damping" else 0.002
            found.append((self._runs(HiddenFlight(), Laboratory({name: 1 + step})) - self._believed) / step)
        for k in range(self._believed.shape[1]):
            alone = np.zeros(self._believed.shape)
            alone[:, k] = self._believed[:, k]
            found.append(alone)
        return np.stack([each.ravel() for each in found])


def _in_proportion(n: int) -> list[str]:
    exact = {kind: n * share / sum(_SHARES.values()) for kind, share in _SHARES.items()}
    counts = {kind: int(value) for kind, value in exact.items()}
    for kind in sorted(exact, key=lambda kind: counts[kind] - exact[kind])[: n - sum(counts.values())]:
        counts[kind] += 1
    return [kind for kind, count in counts.items() for _ in range(count)]


def _turns(draws: Sequence[Draw], generator: Generator) -> Callable[[int], Draw]:
    """Every one in turn, in a drawn order."""
    order = generator.permutation(len(draws))
    return lambda number: draws[int(order[number % len(draws)])]
