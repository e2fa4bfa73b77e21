"""The sensors of the virtual shaker rig: from true force and motion to ADC counts.

Two force cells under the tank base share F_ext unequally, and the share rocks a little; their sum is
F_ext. Two roof accelerometers and the control accelerometer see the same rigid motion. Every sensor
has its gain error, noise and offset. What is unknown to the analysis is drawn once per laboratory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.channel_names import ACCELERATION_CONTROL, ACCELERATION_ROOF, FORCE_CELL, numbered

FloatArray = NDArray[np.float64]

FORCE_CELLS: Final = numbered(FORCE_CELL, 2)
ACCELEROMETERS: Final = (*numbered(ACCELERATION_ROOF, 2), ACCELERATION_CONTROL)
CHANNELS: Final = FORCE_CELLS + ACCELEROMETERS
LOST_COUNT: Final = -32768
"""Count that stands for a lost sample."""

# 9 to 10 bits each way
_HALF_SCALE_COUNTS: Final = {"force": 640, "acceleration": 448}
_NOISE_COUNTS = 0.6
_HEADROOM = 1.15


@dataclass(frozen=True)
class Laboratory:
    """The truth about one laboratory that its rig file does not tell.

    Attributes
    ----------
    dry_mass_factor
        True dry mass over the believed one.
    gain
        Channel → reading over truth.
    cell_1_share, rocking
        Mean share of F_ext on cell 1, and amplitude of its slow change.
    offset_share
        Channel → constant offset over the full scale.
    """

    dry_mass_factor: float
    gain: dict[str, float]
    cell_1_share: float
    rocking: float
    offset_share: dict[str, float]

    @classmethod
    def drawn(cls, seed: int, channels: Sequence[str] = CHANNELS) -> Laboratory:
        """Draw a laboratory with these channels: gains and dry mass within ±1 %, most within ±0.5 %."""
        # a stream of its own: nothing that is drawn for a run can change the laboratory
        generator = np.random.default_rng([seed, 7301])

        def near_one() -> float:
            return float(1 + np.clip(0.004 * generator.standard_normal(), -0.01, 0.01))

        return cls(
            dry_mass_factor=near_one(),
            gain={channel: near_one() for channel in channels},
            cell_1_share=float(generator.uniform(0.47, 0.53)),
            rocking=0.01,
            offset_share={channel: float(generator.uniform(-0.004, 0.004)) for channel in channels},
        )

    @classmethod
    def perfect(cls, channels: Sequence[str] = CHANNELS) -> Laboratory:
        """No errors at all: believed mass, unit gains, equal shares."""
        return cls(1.0, dict.fromkeys(channels, 1.0), 0.5, 0.0, dict.fromkeys(channels, 0.0))

    def deviations(self) -> dict[str, Any]:
        """In what this laboratory differs from what its rig tells, as JSON can hold it."""
        return asdict(self)


@dataclass(frozen=True)
class Reading:
    """One channel as recorded.

    Attributes
    ----------
    counts : ndarray of int16
        What the converter gave; `LOST_COUNT` where lost.
    step : float
        Units per count.
    half_scale : float
        Range limit in units, both ways.
    noise_std : float
        Standard deviation of the sensor noise in units.
    """

    counts: NDArray[np.int16]
    step: float
    half_scale: float
    noise_std: float

    @property
    def values(self) -> FloatArray:
        """Readings in units, NaN where lost."""
        return np.where(self.counts == LOST_COUNT, np.nan, self.counts * np.float64(self.step))

    @property
    def clipped(self) -> NDArray[np.bool_]:
        """Samples at the limit."""
        limit = round(self.half_scale / self.step)
        return np.asarray((np.abs(self.counts.astype(int)) >= limit) & (self.counts != LOST_COUNT))


def cell_forces(
    external_force_n: FloatArray, time_s: FloatArray, laboratory: Laboratory
) -> tuple[FloatArray, ...]:
    """F_ext shared by the two cells; their sum is F_ext."""
    share = laboratory.cell_1_share + laboratory.rocking * np.sin(2 * np.pi * 0.11 * time_s)
    # the share rocks slowly, so that a single cell means nothing and only the sum does
    return share * external_force_n, (1 - share) * external_force_n


def reading(
    truth: FloatArray,
    *,
    quantity: str,
    gain: float,
    offset_share: float,
    generator: np.random.Generator,
    noisy: bool = True,
    n_clipped: int = 0,
    noisy_half_scale_counts: int | None = None,
) -> Reading:
    """Read one channel.

    Parameters
    ----------
    truth : ndarray
        True values in SI units.
    quantity : str
        ``force`` or ``acceleration``; sets the resolution where `noisy_half_scale_counts` does not.
    gain, offset_share : float
        Of the sensor.
    generator : numpy.random.Generator
        Of the noise.
    noisy : bool
        If false there is no noise, and the converter has 15 bits on each side instead of 9 or 10.
    n_clipped : int
        The range is chosen so small that about this many samples are clipped; 0 for none.
    noisy_half_scale_counts : int, optional
        Counts on each side of a noisy reading.

    Returns
    -------
    Reading
        The range is one of 1, 2, 2.5, 5 times a power of ten, as an amplifier has them.
    """
    largest = float(np.abs(truth).max()) or 1.0
    half_scale = _amplifier_range(largest * _HEADROOM)
    if n_clipped:
        # the range that so many samples reach
        half_scale = float(np.sort(np.abs(truth * gain))[-n_clipped])
    n_counts = (noisy_half_scale_counts or _HALF_SCALE_COUNTS[quantity]) if noisy else 32000
    step = half_scale / n_counts
    noise = _NOISE_COUNTS * step if noisy else 0.0
    measured = truth * gain + offset_share * half_scale + noise * generator.standard_normal(truth.size)
    counts = np.clip(np.round(measured / step), -n_counts, n_counts).astype(np.int16)
    return Reading(counts, step, half_scale, noise)


def _amplifier_range(largest: float) -> float:
    decade = 10.0 ** np.floor(np.log10(largest))
    return float(next(factor * decade for factor in (1.0, 2.0, 2.5, 5.0, 10.0) if factor * decade >= largest))
