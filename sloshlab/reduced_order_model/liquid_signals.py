"""From a recording to what a model of the liquid sees and says: velocity of the tank, dynamic sloshing force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sloshlab.conditioning.combined_channels import mean_acceleration, total_force
from sloshlab.conditioning.gaps import sampling_step_s
from sloshlab.conditioning.integration import integrated
from sloshlab.conditioning.resampling import resampled
from sloshlab.errors import AnalysisError
from sloshlab.reduced_order_model.regressors import Run
from sloshlab.rig import Rig

FloatArray = NDArray[np.float64]
_LARGEST_RATE_RATIO: Final = 1.0 + 1e-9


@dataclass(frozen=True)
class LiquidSignals:
    """Motion of the tank and force of the liquid, upward positive, without static weight.

    Attributes
    ----------
    velocity_m_per_s : ndarray, shape (n,)
        Of the tank, integrated from the acceleration, drift removed.
    dynamic_force_n : ndarray, shape (n,)
        Δf = F_S + m_l ü, the force of the liquid on the tank beyond that of a frozen one (2.22).
    acceleration_m_per_s2 : ndarray, shape (n,)
    sampling_rate_hz : float
    name : str
    """

    velocity_m_per_s: FloatArray
    dynamic_force_n: FloatArray
    acceleration_m_per_s2: FloatArray
    sampling_rate_hz: float
    name: str

    def run(self) -> Run:
        """Return velocity in, force out."""
        return Run(self.velocity_m_per_s, self.dynamic_force_n, self.name)

    def at_rate(self, sampling_rate_hz: float) -> LiquidSignals:
        """Return the signals at a lower rate, limited to the band that it can carry; no phase error.

        Parameters
        ----------
        sampling_rate_hz : float
            Not above the present one.

        Raises
        ------
        AnalysisError
            If it is.
        """
        ratio = sampling_rate_hz / self.sampling_rate_hz
        if not 0 < ratio <= _LARGEST_RATE_RATIO:
            raise AnalysisError(
                "sampling rate of the model",
                got=f"{sampling_rate_hz:g} Hz",
                allowed=f"at most {self.sampling_rate_hz:g} Hz, that of {self.name}",
            )
        if abs(ratio - 1) < 1e-9:
            return self
        positions = np.arange(0.0, self.velocity_m_per_s.size, 1 / ratio)
        velocity, force, acceleration = (
            resampled(values, positions, rate_ratio=ratio)
            for values in (self.velocity_m_per_s, self.dynamic_force_n, self.acceleration_m_per_s2)
        )
        return LiquidSignals(velocity, force, acceleration, sampling_rate_hz, self.name)


def liquid_signals(
    recording: xr.Dataset, rig: Rig, *, dry_mass_kg: float | None = None, gain_ratio: float = 1.0
) -> LiquidSignals:
    """Return velocity and dynamic sloshing force of a run on the shaker.

    Parameters
    ----------
    recording : xarray.Dataset
        With force and acceleration channels of the tank.
    rig : Rig
    dry_mass_kg : float, optional
        M_dry; that of the rig by default. Better identified (`identify_dry_mass`).
    gain_ratio : float
        Gain of the forces over that of the accelerations; forces are divided by it.

    Raises
    ------
    AnalysisError
        If channels are missing.

    Notes
    -----
    F_ext = M_dry ü − F_S and F_S = −m_l ü + Δf give Δf = (M_dry + m_l) ü − F_ext (1.6–1.7, 2.22).
    """
    # the gain first: everything after it is a difference of nearly equal forces
    force = np.asarray(total_force(recording).values, np.float64) / gain_ratio
    acceleration = np.array(mean_acceleration(recording).values, np.float64)
    # an offset would become a ramp of the velocity
    acceleration -= np.nanmean(acceleration)
    step_s = sampling_step_s(recording)
    mass_kg = (rig.tank.dry_mass_kg if dry_mass_kg is None else dry_mass_kg) + rig.liquid_mass_kg
    # (1.19, 2.22); static weight removed with the mean, as in all forces here
    dynamic = mass_kg * acceleration - (force - np.nanmean(force))
    return LiquidSignals(
        integrated(acceleration, step_s),
        dynamic,
        acceleration,
        1 / step_s,
        str(recording.attrs.get("run_id", "run")),
    )
