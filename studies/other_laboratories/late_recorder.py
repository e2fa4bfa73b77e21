"""Free decays through a recorder whose anti-alias filter makes all channels late; the release is on no sample."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import bessel, sosfilt, sosfilt_zi

from studies.other_laboratories.case_files import FloatArray, LaboratoryCase, RightAnswer, Run

RATE_HZ: Final = 1000.0
DURATION_S: Final = 4.0
N_BETWEEN: Final = 20
"""Instants per sample at which the filter is computed."""
CORNER_OVER_RATE: Final = 0.35
FRACTIONS: Final = (0.35, 0.6)
"""Of a sample, by which the first sample comes before the release, in the two repeats."""

SDOF_RIG: Final = """# A tank on springs, guided vertically.
[tank]
height_m = 0.060
length_m = 0.100
width_m = 0.060
dry_mass_kg = 2.061
[liquid]
name = "water"
density_kg_per_m3 = 1000.0
surface_tension_n_per_m = 0.0728
kinematic_viscosity_m2_per_s = 1.0e-6
fill_level = 0.50
[structure]
kind = "sdof"
mass_kg = 2.061
stiffness_n_per_m = 3808.8
damping_kg_per_s = 1.58
[twin]
tank_model = "frozen"
"""
BEAM_RIG: Final = """# The tank at the tip of a clamped beam.
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.314
[liquid]
name = "water"
density_kg_per_m3 = 1000.0
surface_tension_n_per_m = 0.0728
kinematic_viscosity_m2_per_s = 1.0e-6
fill_level = 0.50
[structure]
kind = "beam"
length_m = 0.74
width_m = 0.10
thickness_m = 0.01
frequencies_hz = [10.87, 78.31, 226.5]
damping_ratios = [0.0032, 0.0090, 0.0176]
modal_masses_kg = [0.8956, 1.0692, 0.9655]
tip_mode_shape = [1.0, 1.0, 1.0]
[twin]
tank_model = "frozen"
"""


@dataclass(frozen=True, eq=False)
class Modes:
    """A structure in modes whose shapes are one at the tank.

    Attributes
    ----------
    masses_kg, stiffnesses_n_per_m, dampings_kg_per_s : ndarray, shape (n_modes,)
    tank_kg : float
        Tank and frozen liquid, which `force_interface` accelerates.
    friction_n, cubic_n_per_m3 : float
        What the rig file does not know.
    """

    masses_kg: FloatArray
    stiffnesses_n_per_m: FloatArray
    dampings_kg_per_s: FloatArray
    tank_kg: float
    friction_n: float = 0.0
    cubic_n_per_m3: float = 0.0

    def acceleration(self, q: FloatArray, v: FloatArray, side: float) -> FloatArray:
        """Of the modes, shape of q (n_modes, …), while friction pulls against `side`."""
        force = -self.cubic_n_per_m3 * q.sum(axis=0) ** 3 - self.friction_n * side
        own = self.stiffnesses_n_per_m * q.T + self.dampings_kg_per_s * v.T
        return np.asarray(((np.asarray(force)[..., None] - own) / self.masses_kg).T)


def late_recorder() -> list[LaboratoryCase]:
    """Guided tank and beam, with nothing missing and with one effect, at three levels twice."""
    liquid_kg = 0.06 * 0.1 * 0.06 * 0.5 * 1000.0
    sdof = Modes(
        masses_kg=np.array([2.061 + liquid_kg]),
        stiffnesses_n_per_m=np.array([3808.8 * 1.006]),
        dampings_kg_per_s=np.array([1.58 * 0.93]),
        tank_kg=2.061 + liquid_kg,
    )
    omega = 2 * np.pi * np.array([10.87 * 1.004, 78.31 * 0.997, 226.5 * 1.005])
    masses = np.array([0.8956, 1.0692, 0.9655])
    beam = Modes(
        masses_kg=masses,
        stiffnesses_n_per_m=masses * omega**2,
        dampings_kg_per_s=2 * np.array([0.0034, 0.0085, 0.0180]) * omega * masses,
        tank_kg=0.314 + 0.0272 * 0.1172 * 0.0780 * 0.5 * 1000.0,
    )
    nothing = (RightAnswer("nothing_missing"),)
    friction = _named("coulomb_friction")
    cubic = _named("cubic_stiffness")
    return [
        _case("late_sdof", "sdof", sdof, nothing),
        _case("late_beam", "beam", beam, nothing),
        _case("late_sdof_friction", "sdof", replace(sdof, friction_n=0.35), friction),
        _case("late_sdof_cubic", "sdof", replace(sdof, cubic_n_per_m3=6e4), cubic),
        _case("late_beam_cubic", "beam", replace(beam, cubic_n_per_m3=6e5), cubic),
    ]


def _named(effect: str) -> tuple[RightAnswer, ...]:
    return (RightAnswer("named", (effect,)), RightAnswer("indistinguishable", (effect,)))


def _case(name: str, kind: str, modes: Modes, right: Sequence[RightAnswer]) -> LaboratoryCase:
    levels = {"sdof": (0.02, 0.035, 0.06), "beam": (-0.005, -0.009, -0.0146)}[kind]
    generator = np.random.default_rng(23)
    runs = []
    for level in levels:
        for repeat, fraction in enumerate(FRACTIONS, start=1):
            start = level * (1 + 0.004 * generator.standard_normal())
            attributes = {
                "experiment": f"{kind}_free",
                "initial_displacement_m": level,
                "repeat": repeat,
            }
            channels = recorded_decay(modes, start, fraction)
            runs.append(Run(f"release_{1000 * abs(level):g}mm_{repeat}", channels, attributes))
    noise = {
        "sdof": {"acceleration_tip": 0.015, "force_interface": 0.0375, "displacement_tank": 7.5e-6},
        "beam": {"acceleration_tip": 0.019, "force_interface": 0.0075, "displacement_tank": 1.5e-6},
    }[kind]
    story = f"Free decays of a {kind} through a Bessel filter of fourth order at {CORNER_OVER_RATE:g} of the rate."
    numbers = {"force_n": modes.friction_n, "stiffness_n_per_m3": modes.cubic_n_per_m3}
    rig = {"sdof": SDOF_RIG, "beam": BEAM_RIG}[kind]
    sizes = {size: value for size, value in numbers.items() if value}
    return LaboratoryCase(name, story, RATE_HZ, runs, noise, right, sizes, rig=rig, seed=13)


def recorded_decay(modes: Modes, start_m: float, fraction: float) -> dict[str, FloatArray]:
    """Channels of a decay after the recorder's filter; the first sample is `fraction` of one before the release.

    Before the release the structure stands still, deflected by a force at the tank.
    """
    n_samples = round(DURATION_S * RATE_HZ)
    time = (np.arange(n_samples * N_BETWEEN) / N_BETWEEN - fraction) / RATE_HZ
    free = time >= 0
    # What the modes' springs bear; a cubic spring at the tank bears the rest of the load.
    pull = start_m / (1.0 / modes.stiffnesses_n_per_m).sum()
    q, acceleration = motion(modes, pull / modes.stiffnesses_n_per_m, time[free])
    displacement, of_tip = np.full(time.size, start_m), np.zeros(time.size)
    displacement[free], of_tip[free] = q.sum(axis=0), acceleration.sum(axis=0)
    channels = {
        "acceleration_tip": of_tip,
        "force_interface": modes.tank_kg * of_tip,
        "displacement_tank": displacement,
    }
    return {name: filtered(values)[::N_BETWEEN] for name, values in channels.items()}


def filtered(values: FloatArray) -> FloatArray:
    """After a Bessel filter of fourth order, −3 dB at its corner, by the bilinear transform between samples.

    It is late by 2.114/(2π × corner), 0.96 ms.
    """
    sos = bessel(4, CORNER_OVER_RATE * RATE_HZ, fs=N_BETWEEN * RATE_HZ, output="sos", norm="mag")
    return np.asarray(sosfilt(sos, values, zi=sosfilt_zi(sos) * values[0])[0])


def motion(modes: Modes, start: FloatArray, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Modes and their accelerations after the release, (n_modes, n).

    Under friction, which one mode alone may have, from reversal to reversal until it holds the tank.
    """
    n = modes.masses_kg.size
    if modes.friction_n and n > 1:
        raise NotImplementedError("friction at the tip of a beam: the tip sticks while higher modes go on")
    q, acceleration = np.empty((n, time_s.size)), np.zeros((n, time_s.size))
    state, begin = np.concatenate([start, np.zeros(n)]), 0.0
    while begin < time_s[-1]:
        q[:, time_s >= begin] = state[:n, None]
        pull = modes.acceleration(state[:n], state[n:], 0.0).sum()
        side = float(np.sign(pull))
        if modes.friction_n and abs(pull) * modes.masses_kg[0] <= modes.friction_n:
            break
        found = solve_ivp(
            lambda _, y, side=side: np.concatenate([y[n:], modes.acceleration(y[:n], y[n:], side)]),
            (begin, time_s[-1] + 1e-9),
            state,
            method="DOP853",
            rtol=1e-9,
            atol=1e-12,
            dense_output=True,
            events=_reversal(n, side) if modes.friction_n else None,
        )
        within = (time_s >= begin) & (time_s <= found.t[-1])
        y = found.sol(time_s[within])
        q[:, within], acceleration[:, within] = y[:n], modes.acceleration(y[:n], y[n:], side)
        # Exactly at the reversal the speed is zero.
        state, begin = np.concatenate([found.y[:n, -1], np.zeros(n)]), float(found.t[-1])
    return q, acceleration


def _reversal(n: int, side: float) -> Callable[[float, FloatArray], float]:
    def speed(_: float, y: FloatArray) -> float:
        return float(side * y[n:].sum()) + 1e-13

    speed.terminal, speed.direction = True, -1.0  # type: ignore[attr-defined]
    return speed
