"""Recordings of a beam and of a guided tank whose damping is known in closed form.

The beam's shapes come from the virtual laboratory, which shares no code with the analysis; the motion is written
down, not integrated.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy import signal as signals

from acquisition.virtual_laboratory.cantilever import fitted_to
from sloshlab.recording import write_recording

RATE_HZ = 1024.0
FREQUENCIES_HZ = (10.87, 78.31, 226.5)
DAMPING_RATIOS = (0.0032, 0.0090, 0.0176)
LIQUID_KG, DRY_KG = 0.12433344, 0.314
BEAM_RIG = """
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.314
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
[structure]
kind = "beam"
length_m = 0.74
width_m = 0.10
thickness_m = 0.01
frequencies_hz = [10.87, 78.31, 226.5]
damping_ratios = [0.0032, 0.0090, 0.0176]
modal_masses_kg = [0.8956, 1.0692, 0.9655]
tip_mode_shape = [1.0, 1.0, 1.0]
"""
GUIDE_RIG = """
[tank]
height_m = 0.060
length_m = 0.100
width_m = 0.060
dry_mass_kg = 2.061
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
[structure]
kind = "sdof"
mass_kg = 2.061
stiffness_n_per_m = 3808.8
coulomb_force_n = 0.37
damping_kg_per_s = 1.58
"""
PLACES_M = {"acceleration_beam_1": 0.185, "acceleration_beam_2": 0.37, "acceleration_beam_3": 0.555,
            "acceleration_tip": 0.74}  # fmt: skip


def decaying(
    amplitude: np.ndarray | float, frequency_hz: float, phase_rad: float, time_s: np.ndarray
) -> np.ndarray:
    """A motion of slowly falling amplitude."""
    return np.asarray(amplitude * np.cos(2 * np.pi * frequency_hz * time_s + phase_rad))


def quadratic_amplitude(start: float, coefficient: float, frequency_hz: float, time_s: np.ndarray) -> np.ndarray:
    """a(t) of ȧ = −ω ζ a with ζ = c a: a₀/(1 + ω c a₀ t)."""
    return np.asarray(start / (1 + 2 * np.pi * frequency_hz * coefficient * start * time_s))


def beam_decay(
    run_id: str, *, configuration: str = "frozen", coefficient: float = 0.0, seed: int = 1, duration_s: float = 6.0
) -> xr.Dataset:
    """Release of the beam: ζ₁ = 0.32 % and with a liquid `coefficient`·a more; higher modes linear.

    Parameters
    ----------
    coefficient : float
        ζ₁ per acceleration amplitude [s²/m]; 0 is linear. With a coefficient the linear part is left out.
    """
    time = np.arange(int(duration_s * RATE_HZ)) / RATE_HZ
    modal = []
    for mode, (frequency, damping) in enumerate(zip(FREQUENCIES_HZ, DAMPING_RATIOS, strict=True)):
        amplitude = np.asarray((65.0, 20.0, 8.0)[mode] * np.exp(-2 * np.pi * frequency * damping * time))
        if mode == 0 and coefficient:
            amplitude = quadratic_amplitude(65.0, coefficient, frequency, time)
        modal.append(decaying(amplitude, frequency, 0.3 * mode, time))
    return _beam_recording(run_id, np.array(modal), np.zeros(time.size), "beam_free", configuration, seed)


def beam_random(
    run_id: str, *, damping_ratio: float, rms_g: float, configuration: str = "frozen", duration_s: float = 60.0
) -> xr.Dataset:
    """Random motion of the root; mode 1 by its exact discrete filter, the others not excited."""
    generator = np.random.default_rng(round(1000 * rms_g))
    n_samples = int(duration_s * RATE_HZ)
    low_pass = signals.butter(4, [3, 30], btype="bandpass", fs=RATE_HZ, output="sos")
    root = signals.sosfilt(low_pass, generator.normal(size=n_samples + 4096))[4096:]
    root *= rms_g * 9.81 / root.std()
    omega = 2 * np.pi * FREQUENCIES_HZ[0]
    # q̈ + 2ζω q̇ + ω² q = −Γ a: relative acceleration −Γ s²/(s² + 2ζωs + ω²) a, Γ = 1.35
    system = signals.cont2discrete(
        ([-1.35, 0, 0], [1, 2 * damping_ratio * omega, omega**2]), 1 / RATE_HZ, "bilinear"
    )
    modal = np.zeros((3, n_samples))
    modal[0] = signals.lfilter(np.ravel(system[0]), system[1], root)
    return _beam_recording(run_id, modal, root, "beam_random", configuration, 7, acceleration_rms_g=rms_g)


def _beam_recording(
    run_id: str, modal: np.ndarray, root: np.ndarray, experiment: str, configuration: str, seed: int, **more: Any
) -> xr.Dataset:
    beam = fitted_to(FREQUENCIES_HZ[0], 0.74, 0.10, 0.01)
    generator = np.random.default_rng(seed)
    values = {
        name: root + sum(float(beam.shape(n + 1, [place])[0]) * modal[n] for n in range(3))
        for name, place in PLACES_M.items()
    }
    channels: dict[str, Any] = {"acceleration_root": (root, 0.0)}
    channels |= {name: (value, PLACES_M[name]) for name, value in values.items()}
    variables = {
        name: _channel(values + generator.normal(0, 0.01, values.size), "acceleration", x_m=place)
        for name, (values, place) in channels.items()
    }
    force = (DRY_KG + LIQUID_KG) * values["acceleration_tip"]
    variables["force_interface"] = _channel(force + generator.normal(0, 0.005, force.size), "force")
    return _recording(variables, run_id, experiment, configuration, "rig_beam.toml", **more)


def guide_decay(run_id: str, *, configuration: str = "frozen", duration_s: float = 4.0) -> xr.Dataset:
    """Release of the guided tank with dry friction alone: half cosines about ±x_f, exact."""
    frequency, offset, start = 6.56, 0.37 / 3808.8, 0.064
    time = np.arange(int(duration_s * RATE_HZ)) / RATE_HZ
    half = np.floor(2 * frequency * time)
    sign = np.where(half % 2 == 0, 1.0, -1.0)
    inside = np.cos(2 * np.pi * frequency * time - np.pi * half)
    acceleration = -((2 * np.pi * frequency) ** 2) * sign * (start - offset - 2 * offset * half) * inside
    noise = np.random.default_rng(3).normal(0, 0.01, time.size)
    variables = {
        "acceleration_tip": _channel(acceleration + noise, "acceleration"),
        "force_interface": _channel((2.061 + 0.18) * acceleration, "force"),
    }
    return _recording(
        variables, run_id, "sdof_free", configuration, "rig_guide.toml", initial_displacement_m=start
    )


def _channel(values: np.ndarray, quantity: str, **attributes: Any) -> xr.Variable:
    units = {"acceleration": "m s-2", "force": "N"}[quantity]
    return xr.Variable(("time",), values, {"units": units, "quantity": quantity, **attributes})


def _recording(
    variables: dict[str, xr.Variable], run_id: str, experiment: str, configuration: str, rig: str, **more: Any
) -> xr.Dataset:
    n_samples = next(iter(variables.values())).size
    attributes = {
        "sloshlab_format": "1",
        "run_id": run_id,
        "experiment": experiment,
        "configuration": configuration,
        "rig": rig,
        "sampling_rate_hz": RATE_HZ,
        "start_time_utc": "2026-01-12T09:00:00Z",
        **more,
    }
    time = ("time", np.arange(n_samples) / RATE_HZ, {"units": "s"})
    return xr.Dataset(variables, coords={"time": time}, attrs=attributes)


def make_beam_folder(folder: Path) -> None:
    """``rig_beam.toml``, a frozen decay, two sloshing ones and two random runs."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig_beam.toml").write_text(BEAM_RIG, encoding="utf-8")
    write_recording(beam_decay("frozen"), folder / "decay_frozen.nc")
    for repeat, coefficient in ((1, 4.0e-4), (2, 4.4e-4)):
        run = beam_decay(f"sloshing_{repeat}", configuration="sloshing", coefficient=coefficient, seed=repeat)
        write_recording(run, folder / f"decay_sloshing_{repeat}.nc")
    quiet = beam_random("random_frozen", damping_ratio=0.0032, rms_g=0.1)
    write_recording(quiet, folder / "random_frozen.nc")
    loud = beam_random("random_sloshing", damping_ratio=0.025, rms_g=0.4, configuration="sloshing")
    write_recording(loud, folder / "random_sloshing.nc")


def make_guide_folder(folder: Path) -> None:
    """``rig_guide.toml`` and one decay under dry friction."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig_guide.toml").write_text(GUIDE_RIG, encoding="utf-8")
    write_recording(guide_decay("guide"), folder / "decay.nc")
