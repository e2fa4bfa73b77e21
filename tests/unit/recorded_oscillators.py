"""Recordings of one mass on a spring, made by scipy and by closed forms: nothing of the twin is in them."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.integrate import solve_ivp

from sloshlab.identification.case import CaseRun
from sloshlab.identification.free_run_fit import fitted
from sloshlab.identification.free_run_problem import FreeRunFit, FreeRunProblem
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics.candidate import Surroundings, known_effects
from sloshlab.recording import run_attributes
from sloshlab.rig import Rig

DRY_KG, LIQUID_KG = 2.1169944, 0.1240056
MASS_KG = DRY_KG + LIQUID_KG
STIFFNESS, DAMPING = 3808.8, 0.9
OMEGA = float(np.sqrt(STIFFNESS / MASS_KG))
RATE_HZ = 250.0

RIG = f"""
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = {DRY_KG}
[liquid]
density_kg_per_m3 = {LIQUID_KG / (0.0272 * 0.1172 * 0.0780 * 0.5)}
fill_level = 0.5
[structure]
kind = "sdof"
mass_kg = {DRY_KG}
stiffness_n_per_m = {STIFFNESS}
damping_kg_per_s = {DAMPING}
[twin]
tank_model = "TANK_MODEL"
[twin.parameters]
"""


def rig(folder: Path, tank_damping: float = 0.0) -> Rig:
    """The rig of this module, its liquid frozen or a constant damper."""
    text = RIG.replace("TANK_MODEL", "viscous" if tank_damping else "frozen")
    file = folder / "rig.toml"
    file.write_text(text + (f"damping_kg_per_s = {tank_damping}\n" if tank_damping else ""), encoding="utf-8")
    return Rig.from_toml(file)


Force = Callable[[float, float, float], float]
"""(time, displacement, velocity) → force on the mass [N], upward positive, beyond spring and damper."""


def motion(
    start_m: float,
    duration_s: float,
    force: Force = lambda t, x, v: 0.0,
    *,
    mass_kg: float = MASS_KG,
    damping: float = DAMPING,
    friction_n: tuple[float, float] = (0.0, 0.0),
    base: Callable[[float], float] | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Time, displacement, velocity and acceleration relative to the base; friction from reversal to reversal."""
    known = _motion(start_m, duration_s, force, mass_kg, damping, friction_n, base)
    time, x, v, a = (values.copy() for values in known)
    return time, x, v, a


@functools.cache
def _motion(
    start_m: float,
    duration_s: float,
    force: Force,
    mass_kg: float,
    damping: float,
    friction_n: tuple[float, float],
    base: Callable[[float], float] | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The same, integrated once: many tests begin with the same decays."""
    time = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
    x, v, a = (np.zeros(time.size) for _ in range(3))

    def rest(t: float, position: float, speed: float) -> float:
        driven = -mass_kg * base(t) if base else 0.0
        return force(t, position, speed) - STIFFNESS * position - damping * speed + driven

    state, at = np.array([start_m, 0.0]), 0.0
    while at < time[-1]:
        push = rest(at, state[0], 0.0)
        if base is None and -friction_n[0] <= -push <= friction_n[1] and friction_n != (0.0, 0.0):
            x[time >= at] = state[0]
            break
        side = 1.0 if (push > 0 if friction_n != (0.0, 0.0) else True) else -1.0
        held = friction_n[0] if side > 0 else -friction_n[1]

        def rates(t: float, y: np.ndarray, held: float = held) -> list[float]:
            return [y[1], (rest(t, y[0], y[1]) - held) / mass_kg]

        def turns(t: float, y: np.ndarray, side: float = side) -> float:
            return side * y[1] + 1e-12

        turns.terminal, turns.direction = friction_n != (0.0, 0.0), -1.0  # type: ignore[attr-defined]
        nudged = np.array([state[0], state[1] + (1e-9 * side if friction_n != (0.0, 0.0) else 0.0)])
        found = solve_ivp(
            rates,
            (at, time[-1] + 1e-9),
            nudged,
            rtol=1e-9,
            atol=1e-11,
            dense_output=True,
            events=turns,
            max_step=0.01,
        )
        inside = (time >= at) & (time <= found.t[-1])
        if inside.any():
            x[inside], v[inside] = found.sol(time[inside])
        for i in np.flatnonzero(inside):
            a[i] = rates(time[i], np.array([x[i], v[i]]))[1]
        state, at = found.y[:, -1] * [1.0, 0.0 if found.status == 1 else 1.0], float(found.t[-1])
    return time, x, v, a


def run_of(
    name: str, channels: Mapping[str, np.ndarray], noise: Mapping[str, float], seed: int, **attributes: Any
) -> CaseRun:
    """A recording of channels with white noise of known size."""
    generator = np.random.default_rng(seed)
    units = {"acceleration": "m s-2", "displacement": "m", "force": "N"}
    variables = {}
    for channel, values in channels.items():
        quantity = channel.partition("_")[0]
        size = noise.get(channel, 0.0)
        described: dict[str, Any] = {"units": units[quantity], "quantity": quantity}
        if size:
            described["noise_std"] = size
        if quantity == "force":
            described |= {"block_from": "structure", "block_to": "tank"}
        variables[channel] = ("time", values + size * generator.normal(size=values.size), described)
    n = next(iter(channels.values())).size
    described_run = {
        "sloshlab_format": "1",
        "run_id": name,
        "experiment": "sdof_free",
        "configuration": "sloshing",
        "rig": "rig.toml",
        "sampling_rate_hz": RATE_HZ,
        "start_time_utc": "2026-01-01T00:00:00Z",
        **attributes,
    }
    recording = xr.Dataset(variables, {"time": ("time", np.arange(n) / RATE_HZ, {"units": "s"})}, described_run)
    return CaseRun(name, recording, run_attributes(recording))


NOISE = {"displacement_tank": 2e-5, "acceleration_tip": 0.03, "force_interface": 0.02}


def decays(
    starts_m: Sequence[float] = (0.006, 0.018),
    duration_s: float = 4.0,
    changed: Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]] = lambda channels: channels,
    noise: Mapping[str, float] = NOISE,
    seed: int = 1,
    **physics: Any,
) -> list[CaseRun]:
    """Free decays from several deflections."""
    found = []
    for i, start in enumerate(starts_m):
        _, x, _, a = motion(start, duration_s, **physics)
        channels = changed({"displacement_tank": x, "acceleration_tip": a})
        found.append(run_of(f"decay_{i}", channels, noise, seed + i, initial_displacement_m=start))
    return found


def base_motion(t: float) -> float:
    """Acceleration of the base [m/s²]: four sines that begin and end smoothly."""
    lines = ((4.1, 0.6, 0.3), (6.3, 0.5, 1.1), (7.7, 0.5, 2.0), (11.9, 0.8, 0.4))
    window = float(np.sin(np.pi * min(max(t, 0.0), 6.0) / 6.0) ** 2)
    return window * sum(a * np.sin(2 * np.pi * f * t + p) for f, a, p in lines)


def driven(
    changed: Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]] = lambda channels: channels,
    noise: Mapping[str, float] = NOISE,
    seed: int = 11,
    **physics: Any,
) -> list[CaseRun]:
    """One run on a moving base; the accelerometer is absolute, and so is the displacement."""
    time, _, _, a = motion(0.0, 6.0, base=base_motion, **physics)
    root = np.array([base_motion(t) for t in time])
    channels = changed({"acceleration_tip": a + root, "acceleration_root": root})
    return [run_of("driven", channels, noise, seed, experiment="other")]


def fitted_from(
    problem: FreeRunProblem, starts: Sequence[Mapping[str, float]], n_iterations: int = 6
) -> FreeRunFit:
    """The best of the fits from several starts."""
    return min(
        (fitted(problem, start, n_iterations=n_iterations)[0] for start in starts), key=lambda fit: fit.cost
    )


def surroundings(model: RigModel) -> Surroundings:
    """Sizes of the motion, by hand from the recordings."""
    names = ["displacement_tank", "acceleration_tip", "acceleration_root"]
    values = {
        name: np.concatenate([run.recording[name].values for run in model.runs if name in run.recording])
        for name in names
        if any(name in run.recording for run in model.runs)
    }
    peak = float(np.abs(values["acceleration_tip"]).max())
    return Surroundings(
        rig=model.rig,
        twin=model.twin,
        displacement_m=peak / OMEGA**2,
        velocity_m_per_s=peak / OMEGA,
        acceleration_m_per_s2=peak,
        frequency_hz=OMEGA / (2 * np.pi),
        force_n=MASS_KG * peak,
        channels={name: float(np.std(series)) for name, series in values.items()},
        driving=tuple(name for name in values if name.endswith("root")),
        sampling_rate_hz=RATE_HZ,
        longest_run_s=max(run.duration_s for run in model.runs),
        peaks={name: float(np.abs(series).max()) for name, series in values.items()},
    )


def effect(key: str) -> Any:
    """A registered effect by block and name."""
    return next(
        known_effect for known_effect in known_effects() if f"{known_effect.block}.{known_effect.name}" == key
    )
