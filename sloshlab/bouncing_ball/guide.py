"""The guide of a tank by a decay with the liquid frozen: stiffness, dry friction and viscous damping.

A ball that is fitted to a decay makes up for whatever the rig file states wrongly about the guide; a decay without
sloshing tells what the guide does alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares, nnls

from sloshlab.bouncing_ball.free_decay import DampingCurve, measured_curve, simulated_curve, simulated_decay
from sloshlab.errors import RigError
from sloshlab.modal.free_decay import analyse_free_decay
from sloshlab.rig import Rig, Structure

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Guide:
    """What carries the tank.

    Attributes
    ----------
    stiffness_n_per_m, coulomb_force_n, damping_kg_per_s : float
        K, b₀ and b₁ of (2.12).
    """

    stiffness_n_per_m: float
    coulomb_force_n: float
    damping_kg_per_s: float

    @classmethod
    def of_rig(cls, rig: Rig) -> Guide:
        """As the rig file states it.

        Raises
        ------
        RigError
            If the rig has no structure of one degree of freedom.
        """
        structure = _structure(rig)
        return cls(
            structure.stiffness_n_per_m or 0.0, structure.coulomb_force_n or 0.0, structure.damping_kg_per_s or 0.0
        )

    def on(self, rig: Rig) -> Rig:
        """The rig with this guide."""
        values = {
            "stiffness_n_per_m": self.stiffness_n_per_m,
            "coulomb_force_n": self.coulomb_force_n,
            "damping_kg_per_s": self.damping_kg_per_s,
        }
        return rig.model_copy(update={"structure": _structure(rig).model_copy(update=values)})


@dataclass(frozen=True, eq=False)
class FrozenDecay:
    """A decay with the liquid frozen, and the guide that it shows.

    Attributes
    ----------
    guide : Guide
    measured, simulated : DampingCurve
        ζ(a), and that of the structure on this guide.
    """

    guide: Guide
    measured: DampingCurve
    simulated: DampingCurve


def guide_from_decay(
    acceleration: FloatArray,
    sampling_rate_hz: float,
    rig: Rig,
    *,
    initial_displacement_m: float,
    lowest_acceleration_g: float = 0.3,
) -> FrozenDecay:
    """Stiffness from the frequency, friction and damping from ζ(a), of a release with the liquid frozen.

    Parameters
    ----------
    acceleration : ndarray, shape (n,)
        Of the tank [m/s²].
    sampling_rate_hz : float
    rig : Rig
        Its masses are taken as stated.
    initial_displacement_m : float
        From which it was released.
    lowest_acceleration_g : float
        ζ is matched down to it.

    Returns
    -------
    FrozenDecay

    Raises
    ------
    AnalysisError
        If nothing decays, or too few values are left.
    RigError
        If the rig has no structure of one degree of freedom.
    """
    # masses are taken as stated; the frequency then tells the stiffness
    mass = (_structure(rig).mass_kg or 0.0) + rig.liquid_mass_kg
    measured = measured_curve(acceleration, sampling_rate_hz, lowest_acceleration_g=lowest_acceleration_g)
    reading = analyse_free_decay(acceleration, sampling_rate_hz).log_decrement
    stiffness = mass * (2 * math.pi * float(np.median(reading.frequency_hz[reading.used]))) ** 2
    duration = acceleration.size / sampling_rate_hz
    # closed form for small ζ, which is linear in b₀ and b₁; the simulation goes on from there
    start = _closed_form(measured, mass, stiffness)

    def curve(values: FloatArray) -> DampingCurve:
        on_guide = Guide(stiffness, float(values[0]), float(values[1])).on(rig)
        decay = simulated_decay(
            None, on_guide, initial_displacement_m, duration, sampling_rate_hz=sampling_rate_hz
        )
        return simulated_curve(decay, measured.frequency_hz)

    def residuals(values: FloatArray) -> FloatArray:
        # relative: friction shows at small amplitudes, where ζ is largest, viscous damping at large ones
        return curve(values).at(measured.acceleration_m_per_s2) / measured.damping_ratio - 1

    found = least_squares(residuals, start, bounds=(0.0, np.inf), x_scale=start, diff_step=1e-3, max_nfev=20).x
    return FrozenDecay(Guide(stiffness, float(found[0]), float(found[1])), measured, curve(found))


def _closed_form(measured: DampingCurve, mass_kg: float, stiffness_n_per_m: float) -> FloatArray:
    """b₀ and b₁ by ζ = 2b₀/(πKx) + b₁/(2√(Km)), x = a m/K, for small ζ; never quite zero."""
    displacement = measured.acceleration_m_per_s2 * mass_kg / stiffness_n_per_m
    friction = 2 / (np.pi * stiffness_n_per_m * displacement)
    viscous = np.full(displacement.shape, 1 / (2 * math.sqrt(stiffness_n_per_m * mass_kg)))
    # neither can be negative; scatter must not trade one against the other beyond zero
    found, _ = nnls(np.stack([friction, viscous], axis=1), measured.damping_ratio)
    # a start at zero would leave the search without a scale
    smallest = 1e-3 * measured.damping_ratio.mean() / np.array([friction.mean(), viscous.mean()])
    return np.asarray(np.maximum(found, smallest))


def _structure(rig: Rig) -> Structure:
    if rig.structure is None or rig.structure.kind != "sdof":
        raise RigError("rig: structure.kind", got="none or beam", allowed="sdof", remedy="give the sdof rig")
    return rig.structure
