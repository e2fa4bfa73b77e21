"""Recordings of a shaken tank from closed forms; no code of the analysis is used."""

from __future__ import annotations

import numpy as np
import xarray as xr

RATE_HZ = 512.0
DRY_KG, LIQUID_KG = 0.61, 0.12433
STEP_FORCE, STEP_ACCELERATION = 1 / 128, 1 / 32


def motion(duration_s=60.0, level_g=3.0, start_hz=5.0, octave_per_s=1 / 30, ramp_s=4.0, stop_s=0.0):
    """Time and acceleration of an octave sweep that begins at rest, and ends so within the time to stop."""
    rate_hz = RATE_HZ
    time = np.arange(round(duration_s * rate_hz)) / rate_hz
    frequency = start_hz * 2.0 ** (octave_per_s * time)
    phase = 2 * np.pi * frequency / (octave_per_s * np.log(2))
    level = 9.80665 * level_g * np.clip(time / ramp_s, 0, 1)
    if stop_s:
        level = level * np.clip((duration_s - time) / stop_s, 0, 1)
    return time, level * np.sin(phase)


def shifted(values, n_samples):
    """Values that come later by a part of a sample, by the Fourier shift of the padded signal."""
    padded = np.concatenate([values, np.zeros(values.size)])
    turn = np.exp(-2j * np.pi * np.fft.rfftfreq(padded.size) * n_samples)
    return np.fft.irfft(np.fft.rfft(padded) * turn, padded.size)[: values.size]


def tank_run(
    *,
    mass_kg=DRY_KG + LIQUID_KG,
    configuration="sloshing",
    delay_samples=0.0,
    seed=1,
    noise=0.6,
    share=0.5,
    level_g=3.0,
    duration_s=60.0,
    experiment="shaker_sweep",
    stop_s=0.0,
    **attributes,
):
    """A run of a rigid mass on two cells, with noise in units of the converter's step."""
    time, acceleration = motion(duration_s=duration_s, level_g=level_g, stop_s=stop_s)
    generator = np.random.default_rng(seed)
    force = shifted(mass_kg * acceleration, delay_samples)

    def read(values, step):
        return step * np.round(values / step + noise * generator.standard_normal(values.size))

    channels = {
        "force_cell_1": read(share * force, STEP_FORCE),
        "force_cell_2": read((1 - share) * force, STEP_FORCE),
        "acceleration_roof_1": read(acceleration, STEP_ACCELERATION),
        "acceleration_roof_2": read(acceleration, STEP_ACCELERATION),
        "acceleration_control": read(acceleration, STEP_ACCELERATION),
    }
    quantity = {name: name.partition("_")[0] for name in channels}
    units = {"force": "N", "acceleration": "m s-2"}
    steps = {"force": STEP_FORCE, "acceleration": STEP_ACCELERATION}
    variables = {
        name: (
            "time",
            values,
            {
                "units": units[quantity[name]],
                "quantity": quantity[name],
                "noise_std": noise * steps[quantity[name]],
            },
        )
        for name, values in channels.items()
    }
    attrs = {
        "run_id": "run",
        "experiment": experiment,
        "configuration": configuration,
        "sampling_rate_hz": RATE_HZ,
        "acceleration_g": level_g,
        "sweep_start_hz": 5.0,
        "sweep_rate_octave_per_s": 1 / 30,
        **attributes,
    }
    return xr.Dataset(variables, coords={"time": ("time", time, {"units": "s"})}, attrs=attrs)


def with_channel(recording, name, change):
    """The recording with one channel changed by a function of its values."""
    changed = recording.copy()
    changed[name] = recording[name].copy(data=change(recording[name].values.copy()))
    return changed
