"""Energy that a structure stores or gives back because the sweep moves on.

In a sweep the amplitude changes from cycle to cycle, and with it the elastic and the kinetic energy. A
cycle that begins where ü has the phase θ counts the change of ½ k u₀² cos²θ + ½ m (Ωu₀)² sin²θ as work;
cycles counted by the motion itself have θ = 0. Where the velocity is integrated from ü and made periodic
in every cycle, the share of μ is gone already, and k/Ω² = m − μ stands for m.

Without correction a spring would appear to dissipate or to feed energy: in an octave sweep at constant
acceleration by the part 4 R ln2 k/(c Ω²) of the work. The phasors of such a cycle count in addition
−¼ μ (Ωu₀)² cos 2θ ΔΩ/Ω, because Ω changes within the cycle (first order in ΔΩ/Ω and Δu₀/u₀).

Stiffness and mass follow from the measured μ = Re F/ü. Near one frequency every lossless structure
looks like a mass and a spring, μ = m − k/Ω², so that −k is the slope of μ over 1/Ω². This is Foster's
relation between the stored energy and the slope of the susceptance, ¼|u̇|² dB/dΩ with B = Ωμ
(R. M. Foster, Bell System Technical Journal 3 (1924) 259, doi:10.1002/j.1538-7305.1924.tb01358.x).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_HALF_WIDTH = 2
"""Windows to each side from which the stiffness at one is found."""
_SMALLEST_FREQUENCY_SPREAD = 2e-3
"""Over the frequency: within less, the slope of μ is that of its scatter."""


@dataclass(frozen=True)
class StoredWork:
    """Work per cycle that is stored, not dissipated [J]; positive when the structure takes up energy.

    Attributes
    ----------
    in_loop : ndarray, shape (n_windows,)
        ½ k Δ(u₀² cos²θ) + ½ m Δ(Ω²u₀² sin²θ), contained in the loop integral.
    in_phasors : ndarray, shape (n_windows,)
        The same − ¼ μ (Ωu₀)² cos 2θ ΔΩ/Ω, contained in ½ T Re(F₁ u̇₁*).
    """

    in_loop: FloatArray
    in_phasors: FloatArray


@dataclass(frozen=True)
class Changes:
    """How a window differs from one cycle to the next; all arrays of shape (n_windows,).

    Attributes
    ----------
    elastic_m2 : ndarray
        Δ(u₀² cos²θ).
    kinetic_m2_per_s2 : ndarray
        Δ(Ω²u₀² sin²θ).
    chirp_m2_per_s2 : ndarray
        (Ωu₀)² cos 2θ ΔΩ/Ω.
    """

    elastic_m2: FloatArray
    kinetic_m2_per_s2: FloatArray
    chirp_m2_per_s2: FloatArray


def stored_work(
    omega_rad_per_s: FloatArray,
    apparent_mass_kg: FloatArray,
    changes: Changes,
    *,
    velocity_is_measured: bool = False,
) -> StoredWork:
    """Stored work per cycle in consecutive windows of one sweep.

    Parameters
    ----------
    omega_rad_per_s, apparent_mass_kg : ndarray, shape (n_windows,)
        Ω and μ = Re F/ü.
    changes : Changes
        From cycle to cycle.
    velocity_is_measured : bool
        False if the velocity was integrated from the acceleration and made periodic in every cycle.

    Returns
    -------
    StoredWork
        With k = 0 where the frequency stands still or turns, because k is not known there.

    Examples
    --------
    >>> omega = np.linspace(40.0, 50.0, 21)
    >>> changes = Changes(np.full(21, -1e-6), np.zeros(21), np.zeros(21))
    >>> stored = stored_work(omega, 0.7 - 900.0 / omega**2, changes)
    >>> bool(np.allclose(stored.in_loop, 0.5 * 900.0 * -1e-6))
    True
    """
    # from the measured response, not from the rig: it holds for any structure without loss, known or not
    stiffness = _local_stiffness(omega_rad_per_s, apparent_mass_kg)
    # m = μ + k/Ω² (Foster). A velocity made periodic in every cycle has lost the share of μ already.
    mass = stiffness / omega_rad_per_s**2 + (apparent_mass_kg if velocity_is_measured else 0.0)
    in_loop = 0.5 * (stiffness * changes.elastic_m2 + mass * changes.kinetic_m2_per_s2)
    # phasors count the change of Ω within the cycle in addition; the loop does not
    return StoredWork(in_loop, in_loop - 0.25 * apparent_mass_kg * changes.chirp_m2_per_s2)


def _local_stiffness(omega: FloatArray, apparent_mass_kg: FloatArray) -> FloatArray:
    """k from the slope of μ over 1/Ω² in the windows around each; 0 where Ω does not sweep on."""
    stiffness = np.zeros(omega.size)
    for at in range(omega.size):
        near = slice(max(0, at - _HALF_WIDTH), at + _HALF_WIDTH + 1)
        direction = np.sign(np.diff(omega[near]))
        # where the frequency stands still or turns, the slope over 1/Ω² is a slope over scatter
        sweeps_on = direction.size >= 2 and abs(direction.sum()) == direction.size
        if sweeps_on and np.ptp(omega[near]) > _SMALLEST_FREQUENCY_SPREAD * omega[at]:
            # a mass on a spring: μ = m − k/Ω²
            stiffness[at] = -np.polyfit(omega[near] ** -2.0, apparent_mass_kg[near], 1)[0]
    return stiffness
