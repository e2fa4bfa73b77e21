"""Experiments in closed form: what a report is drawn from, without any recording."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from pipelines.sweep.results import RigResult, RunResult, SweepExperiment, SweepOptions
from pipelines.sweep.window_signals import Excerpt
from sloshlab.conditioning.calibration import DryMass
from sloshlab.conditioning.clipping import Clipping
from sloshlab.conditioning.gaps import Gap
from sloshlab.conditioning.quality import ChannelQuality, RunQuality
from sloshlab.conditioning.redundancy import PairAgreement, SensorAgreement
from sloshlab.maps.energy_maps import EnergyMaps
from sloshlab.maps.interpolation import CrossValidation
from sloshlab.quantities import described
from sloshlab.recording import RunAttributes
from sloshlab.rig import Liquid, Rig, Tank
from sloshlab.sweep.law import LawKind, SweepLaw
from sloshlab.sweep.windows import WindowSettings

PEAK_W_BAR, PEAK_OMEGA_BAR, PEAK_ACCELERATION_G = 1.6, 3.8, 3.0
STROKE_M = 0.0125
SETTINGS = SweepOptions(WindowSettings())
LAW = SweepLaw(LawKind.OCTAVE, 5.0, 1 / 120, stated=True)
MASS_KG, DAMPING_KG_PER_S = 40.0, 60.0


def rig(fill_level: float = 0.5, surface_tension: float | None = 0.0728) -> Rig:
    """The source's tank with water."""
    tank = Tank(height_m=0.0272, length_m=0.1172, width_m=0.0780, dry_mass_kg=0.61)
    liquid = Liquid(
        name="water", density_kg_per_m3=1000.0, surface_tension_n_per_m=surface_tension, fill_level=fill_level
    )
    return Rig(tank=tank, liquid=liquid)


def w_bar_law(omega_bar: np.ndarray, acceleration_g: np.ndarray) -> np.ndarray:
    """A bell in the logarithms of frequency and acceleration with its top at a known place."""
    x = np.log(omega_bar / PEAK_OMEGA_BAR) / 0.6
    y = np.log(acceleration_g / PEAK_ACCELERATION_G) / 0.8
    return PEAK_W_BAR * np.exp(-(x**2) - y**2)


def shaker_run(
    run_id: str, level_g: float, the_rig: Rig, rig_name: str, *, n: int = 14, experiment: str = "shaker_sweep",
    down: bool = False, flags: tuple[str, ...] = (),
) -> RunResult:  # fmt: skip
    """One sweep of 5 … 20 Hz at a level, on the stroke limit where the level needs more."""
    frequency = np.geomspace(5.1, 19.9, n) * (1 + 0.002 * level_g)  # no two windows at the same place
    omega = 2 * np.pi * frequency
    level = np.minimum(level_g, STROKE_M * omega**2 / 9.81)
    if experiment == "shaker_vfa":
        level = level * np.linspace(0.3, 1.0, n)
    amplitude = level * 9.81 / omega**2
    mass = the_rig.liquid_mass_kg
    w_bar = w_bar_law(omega / the_rig.frequency_scale_rad_per_s, level)
    time = 120 * np.log2(frequency / 5.0)
    windows = _windows(
        run_id, frequency, amplitude, time=240 - time if down else time,
        work=w_bar * mass * (amplitude * omega) ** 2,
        apparent_mass=0.61 + mass * (1 + beta_law(level)), n_cycles=12,
    )  # fmt: skip
    scaled = {
        "w_bar": w_bar, "w_bar_std": 0.02 + 0 * w_bar, "beta": beta_law(level), "beta_std": 0.01 + 0 * w_bar,
        "loss_factor": w_bar / np.pi, "omega_bar": omega / the_rig.frequency_scale_rad_per_s,
        "u_bar": amplitude / 0.0272, "v_bar": omega * amplitude / the_rig.velocity_scale_m_per_s,
        "fill_level": np.full(n, the_rig.liquid.fill_level),
    }  # fmt: skip
    windows = described(windows.assign({name: ("window", values) for name, values in scaled.items()}))
    excerpts = tuple(
        excerpt(float(frequency[at]), float(level[at]), mass)
        for at in sorted({int(np.argmin(np.abs(frequency - wanted_hz))) for wanted_hz in (9, 13, 17)})
    )
    return _run(run_id, windows, LAW, excerpts, rig_name, experiment, level_g, flags)


def beta_law(acceleration_g: np.ndarray) -> np.ndarray:
    """Negative everywhere, −0.1 at rest."""
    return -0.1 - 0.08 * acceleration_g


def excerpt(frequency_hz: float, acceleration_g: float, mass_kg: float) -> Excerpt:
    """Twelve periods of a force that lags its displacement."""
    omega = 2 * math.pi * frequency_hz
    time = np.linspace(0, 12 / frequency_hz, 600)
    amplitude = acceleration_g * 9.81 / omega**2
    force = mass_kg * acceleration_g * 9.81 * np.sin(omega * time - 0.6)
    return Excerpt(frequency_hz, acceleration_g, 50 + time, force, amplitude * np.sin(omega * time))


def _windows(
    run_id: str, frequency: np.ndarray, amplitude: np.ndarray, *, time: np.ndarray, work: np.ndarray,
    apparent_mass: np.ndarray, n_cycles: int,
) -> xr.Dataset:  # fmt: skip
    omega, n = 2 * np.pi * frequency, frequency.size
    speed2 = (amplitude * omega) ** 2
    acceleration_g = amplitude * omega**2 / 9.81
    strength = np.sqrt(acceleration_g)[:, None]
    labels = np.array(["quiet", "Faraday", "impacts", "chaotic"], dtype=object)
    columns = {
        "time_s": time, "frequency_hz": frequency, "amplitude_m": amplitude, "acceleration_g": acceleration_g,
        "n_cycles": np.full(n, n_cycles, dtype=np.int32), "work_j": work, "work_j_std": 0.1 * np.abs(work),
        "work_harmonic_j": 0.99 * work, "phase_error_rad": 0.3 + 0.01 * np.sin(time),
        "gamma_kg_per_s": work / (np.pi * amplitude**2 * omega), "apparent_mass_kg": apparent_mass,
        "dissipated_mass_kg": work / speed2, "dissipated_mass_kg_std": 0.03 * np.abs(work) / speed2,
        "regime": labels[np.clip((2 * acceleration_g).astype(int), 0, 3)],
        "force_ratio": 0.1 * acceleration_g, "subharmonic_share": np.full(n, 0.2),
        "harmonic_share": np.full(n, 0.3), "unrepeated_share": np.full(n, 0.5), "crest_factor": np.full(n, 1.9),
        "run": np.array([run_id] * n, dtype=object),
    }  # fmt: skip
    table = xr.Dataset({name: ("window", values) for name, values in columns.items()})
    table["harmonic_amplitude_n"] = (("window", "harmonic"), strength * 0.5 ** np.arange(5))
    table["subharmonic_amplitude_n"] = (("window", "subharmonic"), strength * np.array([0.2, 0.05]))
    return described(table.assign_coords(harmonic=np.arange(1, 6), subharmonic=np.array([0.5, 1.5])))


def _run(
    run_id: str, windows: xr.Dataset, law: SweepLaw, excerpts: tuple[Excerpt, ...], rig_name: str, experiment: str,
    level_g: float | None, flags: tuple[str, ...],
) -> RunResult:  # fmt: skip
    attributes = RunAttributes(
        sloshlab_format="1", run_id=run_id, experiment=experiment, configuration="sloshing",
        rig=rig_name or "none", sampling_rate_hz=500.0, start_time_utc="2026-01-31T12:00:00Z",
        acceleration_g=level_g,
    )  # fmt: skip
    return RunResult(
        Path(f"{run_id[:20].replace('/', '_')}.nc"), "0" * 64, attributes, rig_name, windows, law,
        law if law.stated else None, 0.004, quality(run_id), 2597, 3 if flags else 0, excerpts, flags,
    )  # fmt: skip


def quality(run_id: str) -> RunQuality:
    """Two channels, one with a gap and two clipped samples."""
    whole = Clipping(0, 0, 0, None, True, False, 0)
    cut = Clipping(2, 1, 2, 17.0, True, False, 0)
    channels = (
        ChannelQuality("acceleration_roof_1", "acceleration", "m s-2", -15.0, 15.0, 0.0, 9.0, 120000, 0, whole),
        ChannelQuality("force_cell_1", "force", "N", -9.0, 9.0, 0.0, 5.0, 120000, 12, cut),
    )
    pair = PairAgreement("acceleration_roof_2", "acceleration_roof_1", 1.004, 2e-6, -2.5e-4, 1, 0.01)
    agreed = SensorAgreement("acceleration_roof_1", (pair,), ())
    gap = Gap(17.0, 17.024, 12)
    cut = ("force_cell_1: cut",)
    return RunQuality(run_id, 500.0, 240.0, 120000, channels, (gap,), 0, 0, 0, 0, agreed, (), cut)


def shaker_experiment(
    fills: Sequence[float] = (0.5, 0.25), levels_g: Sequence[float] = (0.5, 1.5, 3.0, 6.0), *,
    run_prefix: str = "fill", flags: tuple[str, ...] = (), surface_tension: float | None = 0.0728,
    title: str = "Tank on the shaker", extra: bool = False,
) -> SweepExperiment:  # fmt: skip
    """The family of runs of the source, coarser."""
    rigs, runs = [], []
    for fill in fills:
        the_rig, name = rig(fill, surface_tension), f"rig_{fill:.2f}.toml"
        own = [shaker_run(f"{run_prefix} {fill} {level} g", level, the_rig, name) for level in levels_g]
        if extra:
            own.append(shaker_run(f"{run_prefix} {fill} down", 3.0, the_rig, name, down=True, flags=("late",)))
            own.append(shaker_run(f"{run_prefix} {fill} vfa", 5.0, the_rig, name, experiment="shaker_vfa"))
        windows = xr.concat([run.windows for run in own], dim="window", combine_attrs="drop")
        dry = DryMass(0.6123, 3e-4, 0.6184, -4e-7, 3e-7, 1.01, 5e-4, ("empty", "frozen"))
        rigs.append(RigResult(name, the_rig, dry, windows, liquid_maps(the_rig)))
        runs += own
    everything = xr.concat([rig.windows for rig in rigs], dim="window", combine_attrs="drop")
    provenance = {
        "command": f"sloshlab shaker {run_prefix}",
        "inputs": {run.path.name: run.sha256 for run in runs},
        "versions": {"python": "3.11"},
    }
    return SweepExperiment(
        title, "shaker", tuple(runs), tuple(rigs), everything, rigs[0].maps.dataset, SETTINGS,
        provenance=provenance, flags=flags,
    )  # fmt: skip


def _work_variables(frequency: np.ndarray, amplitude: np.ndarray, work: np.ndarray, inside: np.ndarray) -> dict:
    """The map of the work over frequency and displacement, with its error."""
    dimensions = ("frequency_hz", "amplitude_m")
    measured = np.where(inside, work, np.nan)
    return {
        "work_j": (dimensions, measured), "work_j_std": (dimensions, 0.05 * np.abs(measured)),
        "frequency_hz": ("frequency_hz", frequency), "amplitude_m": ("amplitude_m", amplitude),
    }  # fmt: skip


def liquid_maps(the_rig: Rig, n: int = 41) -> EnergyMaps:
    """The closed forms on grids, inside 0.5 … 6 g and the stroke limit."""
    frequency = np.linspace(5.1, 19.9, n)
    omega, omega_bar = 2 * np.pi * frequency, 2 * np.pi * frequency / the_rig.frequency_scale_rad_per_s
    amplitude = np.linspace(0, STROKE_M, n + 1)[1:]
    level = amplitude * omega[:, None] ** 2 / 9.81
    inside = (level > 0.5) & (level < 6)
    w_bar = w_bar_law(omega_bar[:, None], level)
    work = w_bar * the_rig.liquid_mass_kg * (amplitude * omega[:, None]) ** 2
    variables = _work_variables(frequency, amplitude, work, inside)
    u_bar, v_bar = amplitude / 0.0272, np.linspace(0, 1.6, n + 1)[1:]
    variables |= {"omega_bar": ("omega_bar", omega_bar), "u_bar": ("u_bar", u_bar), "v_bar": ("v_bar", v_bar)}
    for suffix, axis, a in (("", "u_bar", level), ("_over_v_bar", "v_bar", v_bar * omega_bar[:, None])):
        mask = (a > 0.5) & (a < 6)
        for name, values in (("w_bar", w_bar_law(omega_bar[:, None], a)), ("beta", beta_law(a))):
            variables[name + suffix] = (("omega_bar", axis), np.where(mask, values, np.nan))
            variables[f"{name}{suffix}_std"] = (("omega_bar", axis), np.where(mask, 0.02 + 0.01 * a, np.nan))
    error = CrossValidation(0.012, 0.034, "logarithmic", 0.001)
    return EnergyMaps(xr.Dataset(variables), {"work_j": error, "w_bar": error, "beta": error})


def work_maps(stiffness_n_per_m: float, n: int = 41) -> EnergyMaps:
    """Work of the damper over frequency and displacement."""
    frequency, amplitude = np.linspace(3.0, 15.0, n), np.linspace(0, 0.004, n + 1)[1:]
    omega = 2 * np.pi * frequency[:, None]
    work = np.pi * DAMPING_KG_PER_S * omega * amplitude**2
    force = amplitude * np.hypot(MASS_KG * omega**2 - stiffness_n_per_m, DAMPING_KG_PER_S * omega)
    dataset = xr.Dataset(_work_variables(frequency, amplitude, work, (force > 15) & (force < 60)))
    return EnergyMaps(dataset, {"work_j": CrossValidation(0.4, float("nan"), "logarithmic", 0.0)})


def resonance_hz(stiffness_n_per_m: float) -> float:
    """Where |ü/F| of a mass, a spring and a damper is largest: ω₀/√(1 − 2ζ²)."""
    omega = math.sqrt(stiffness_n_per_m / MASS_KG)
    zeta = DAMPING_KG_PER_S / (2 * MASS_KG * omega)
    return omega / math.sqrt(1 - 2 * zeta**2) / (2 * math.pi)


def work_experiment(
    stiffness_n_per_m: Sequence[float] = (82_000.0, 78_000.0, 74_000.0), run_prefix: str = "level"
) -> SweepExperiment:
    """A mass on a spring that is softer at every level, driven by a force of constant amplitude, downwards."""
    runs = []
    for number, stiffness in enumerate(stiffness_n_per_m, start=1):
        frequency = np.linspace(15.0, 3.0, 241)
        omega = 2 * np.pi * frequency
        apparent = MASS_KG - stiffness / omega**2
        impedance = np.abs(apparent - 1j * DAMPING_KG_PER_S / omega)
        amplitude = 20.0 * number / impedance / omega**2
        windows = _windows(
            f"{run_prefix} {number}", frequency, amplitude, time=np.linspace(1, 239, 241),
            work=np.pi * DAMPING_KG_PER_S * omega * amplitude**2, apparent_mass=apparent, n_cycles=6,
        )  # fmt: skip
        law = SweepLaw(LawKind.LINEAR, 15.0, -0.05, stated=False)
        excerpts = tuple(excerpt(f, 0.1 * number, MASS_KG) for f in (5.0, 9.0, 12.0))
        runs.append(_run(f"{run_prefix} {number}", windows, law, excerpts, "", "other", None, ()))
    windows = xr.concat([run.windows for run in runs], dim="window", combine_attrs="drop")
    maps = work_maps(stiffness_n_per_m[1])
    return SweepExperiment(
        "Work per cycle", "work", tuple(runs), (), windows, maps.dataset, SETTINGS, work_maps=maps
    )
