"""A tank on a shaker with a wave at half the frequency, whose phase is another one in every repeat."""

from __future__ import annotations

from typing import Final

import numpy as np

from studies.other_laboratories.case_files import LaboratoryCase, RightAnswer, Run
from studies.other_laboratories.integration import FloatArray, Sampling, integrated, multisine, ramp

SAMPLING: Final = Sampling(256.0, 7680, 8)
BAND_HZ: Final = (9.4, 11.6)
LEVELS_G: Final = (0.6, 1.2, 1.8)
DRY_KG: Final = 0.61
LIQUID_KG: Final = 0.0272 * 0.1172 * 0.0780 * 0.5 * 1000.0
WAVE_HZ: Final = 5.2
FORCE_N: Final = 0.058
"""On the tank per unit of the wave, so that its RMS at the higher levels is 6.4 times the noise of both cells."""

RIG: Final = """# Tank on the electrodynamic shaker; two force cells under the base.
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.61
[liquid]
name = "water"
density_kg_per_m3 = 1000.0
surface_tension_n_per_m = 0.0728
kinematic_viscosity_m2_per_s = 1.0e-6
fill_level = 0.50
[twin]
tank_model = "frozen"
"""


def half_frequency_wave() -> list[LaboratoryCase]:
    """Sweeps at three levels, three times each; the wave needs a threshold and starts from ripples.

    Notes
    -----
    Faraday's instability with a loss that grows with the wave,
    ÿ + 2 (ζ + ζ₂ y²) ω ẏ + ω² (1 + g a/9.81) y + ω² y³/10 = ω² r: y answers at half the frequency of a, and −y
    does as well. Which of the two it is, and when it sets in, ripples r decide, which are others in every run.
    It grows from g a > 4 ζ on, at 0.6 g.
    """
    repeats = [(level, repeat) for level in LEVELS_G for repeat in (1, 2, 3)]
    time = SAMPLING.half_steps_s
    shaken = np.stack([_acceleration(time, level) for level, _ in repeats])
    wave = waves(shaken, seed=151)
    runs = []
    for i, (level, repeat) in enumerate(repeats):
        acceleration = SAMPLING.samples(shaken[i])
        force = 1.004 * (DRY_KG + LIQUID_KG) * acceleration + FORCE_N * wave[i]
        channels = {
            "force_cell_1": 0.49 * force,
            "force_cell_2": 0.51 * force,
            "acceleration_control": acceleration,
            "acceleration_roof_1": acceleration,
        }
        attributes = {
            "experiment": "shaker_sweep",
            "configuration": "sloshing",
            "acceleration_g": level,
            "sweep_start_hz": BAND_HZ[0],
            "sweep_rate_octave_per_s": float(np.log2(BAND_HZ[1] / BAND_HZ[0]) / time[-1]),
            "repeat": repeat,
        }
        runs.append(Run(f"sweep_{level:g}g_{repeat}", channels, attributes))
    noise = {
        "force_cell_1": 0.006,
        "force_cell_2": 0.006,
        "acceleration_control": 0.01,
        "acceleration_roof_1": 0.01,
    }
    right = [
        *(RightAnswer(verdict, ("faraday_wave",)) for verdict in ("named", "indistinguishable")),
        RightAnswer("unknown", block="tank"),
    ]
    story = "A wave at half the frequency of the sweep; power, band and threshold repeat, the phase does not."
    numbers = {"frequency_hz": WAVE_HZ, "force_rms_n": FORCE_N * float(wave[3:].std())}
    return [
        LaboratoryCase(
            "half_frequency_wave", story, SAMPLING.rate_hz, runs, noise, right, numbers, rig=RIG, seed=17
        )
    ]


def waves(shaken: FloatArray, seed: int) -> FloatArray:
    """The wave per run, shape (n_runs, n_samples), from an acceleration at half steps; ripples drawn by a seed."""
    omega, n_runs = 2 * np.pi * WAVE_HZ, shaken.shape[0]
    ripples = np.stack([multisine(SAMPLING, (3.0, 8.0), 1e-3, seed + i) for i in range(n_runs)])

    def rates(state: FloatArray, both: FloatArray) -> FloatArray:
        (y, v), acceleration, ripple = state, both[:n_runs], both[n_runs:]
        loss = 2 * (0.03 + 0.02 * y**2) * omega * v
        spring = (1 + 0.2 * acceleration / 9.80665) * y + 0.1 * y**3
        return np.stack([v, -loss - omega**2 * (spring - ripple)])

    return integrated(rates, np.zeros((2, n_runs)), np.concatenate([shaken, ripples]), SAMPLING)[:, 0].T


def _acceleration(time_s: FloatArray, level_g: float) -> FloatArray:
    """Of a sweep in octaves at one level [m/s²]."""
    rate = np.log(BAND_HZ[1] / BAND_HZ[0]) / time_s[-1]
    phase = 2 * np.pi * BAND_HZ[0] * np.expm1(rate * time_s) / rate
    ends = ramp(time_s, 1.0) * ramp(time_s[-1] - time_s, 1.0)
    return np.asarray(9.80665 * level_g * np.sin(phase) * ends, np.float64)
