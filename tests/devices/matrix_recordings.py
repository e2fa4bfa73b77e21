"""Short recordings whose every count is known from a formula, for devices to play and files to be judged by.

The formulas share nothing with the simulated devices: whole numbers modulo a prime, and sine waves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import netCDF4
import numpy as np
from numpy.typing import NDArray

RATE_HZ = 512.0
NAMES = ("force_cell_1", "force_cell_2", "acceleration_roof_1", "acceleration_roof_2", "acceleration_tip")
BITS = np.array([16, 16, 16, 16, 24])
SCALES = np.array([1e-3, 1e-3, 1e-3, 1e-3, 1e-5])
"""N and m/s² per count."""

_PRIMES = np.array([65_521, 65_521, 65_521, 65_521, 16_777_213])
_FACTORS = np.array([40_503, 30_011, 51_239, 20_021, 7_654_321])

_AMPLITUDES = np.array([30.0, 22.0, 25.0, 25.0, 42.0])
_PHASES_RAD = np.array([0.3, 1.1, 0.0, 0.0, 2.0])
_FREQUENCIES_HZ = (9.0, 17.0)

RIG = """[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.61
[liquid]
name = "water"
density_kg_per_m3 = 1000.0
fill_level = 0.5
"""


@dataclass(frozen=True)
class Pattern:
    """Counts of which none comes twice in a channel, so that a sample in a wrong place has a wrong count.

    Channel c of sample s is (s f_c + 1000 c) mod p_c − (p_c − 1)/2 with primes p_c.
    """

    n_samples: int

    def counts(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """Counts, shape (n, n_channels), of whole sample numbers."""
        number = samples.astype(np.int64)[:, None]
        return ((number * _FACTORS + 1000 * np.arange(len(NAMES))) % _PRIMES - _PRIMES // 2).astype(np.float64)


@dataclass(frozen=True)
class Motion:
    """A rigid tank that is shaken: both accelerometers on the roof read the same, the tip moves otherwise.

    Channel c at time t is A_c sin²(πt/T) (0.7 sin(2π 9 Hz t + φ_c) + 0.3 sin(2π 17 Hz t + 2 φ_c)).
    """

    n_samples: int

    def counts(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """Counts, shape (n, n_channels), at sample numbers that need not be whole."""
        time_s = np.asarray(samples, dtype=np.float64)[:, None] / RATE_HZ
        first, second = (2 * np.pi * frequency_hz * time_s for frequency_hz in _FREQUENCIES_HZ)
        swing = 0.7 * np.sin(first + _PHASES_RAD) + 0.3 * np.sin(second + 2 * _PHASES_RAD)
        envelope = np.sin(np.pi * time_s * RATE_HZ / self.n_samples) ** 2
        return np.rint(_AMPLITUDES * envelope * swing / SCALES)

    def tolerance(self) -> NDArray[np.float64]:
        """Of resampled counts: one for rounding before, one for after, and 10⁻⁶ of the amplitude between."""
        return 2.0 + 1e-6 * _AMPLITUDES / SCALES

    def steepest(self) -> NDArray[np.float64]:
        """Largest change of each channel [counts/s]."""
        samples = np.arange(0, self.n_samples, 0.25)
        return np.abs(np.diff(self.counts(samples), axis=0)).max(axis=0) * 4 * RATE_HZ


def write_truth(path: Path, truth: Pattern | Motion, ranges: Mapping[str, float]) -> None:
    """A recording of `truth` for a device to play; `ranges` are the limits ± of single channels [units]."""
    counts = truth.counts(np.arange(truth.n_samples))
    with netCDF4.Dataset(path, "w") as file:
        file.setncatts(
            {
                "sloshlab_format": "1",
                "run_id": "truth",
                "experiment": "shaker_sweep",
                "configuration": "sloshing",
                "rig": "rig.toml",
                "sampling_rate_hz": RATE_HZ,
                "start_time_utc": "2026-01-31T12:00:00Z",
            }
        )
        file.createDimension("time", truth.n_samples)
        time = file.createVariable("time", "f8", ("time",))
        time.units = "s"
        time[:] = np.arange(truth.n_samples) / RATE_HZ
        for column, name in enumerate(NAMES):
            variable = file.createVariable(name, "i2" if BITS[column] == 16 else "i4", ("time",))
            variable.set_auto_maskandscale(False)
            variable.quantity = name.partition("_")[0]
            variable.units = "N" if variable.quantity == "force" else "m s-2"
            variable.scale_factor = SCALES[column]
            if name in ranges:
                variable.range_min, variable.range_max = -ranges[name], ranges[name]
            variable[:] = counts[:, column].astype(np.int64)
