"""Energy that a structure stores or gives back because the sweep moves on.

In a sweep the amplitude changes from cycle to cycle, and with it the elastic energy. A cycle that
begins and ends at an extreme of the displacement, where the velocity is zero, counts the change of
½ k u₀² as work. Without correction a spring would appear to dissipate or to feed energy: in an octave
sweep at constant acceleration by the part 4 R ln2 k/(c Ω²) of the work. The phasors of such a cycle
count in addition −¼ μ (Ωu₀)² ΔΩ/Ω, because Ω changes within the cycle (first order in ΔΩ/Ω and Δu₀/u₀).

The stiffness follows from the measured μ = Re F/ü. Near one frequency every lossless structure
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
_SMALLEST_FREQUENCY_SPREAD = 2e-3


@dataclass(frozen=True)
class StoredWork:
    """Work per cycle that is stored, not dissipated [J]; positive when the structure takes up energy.

    Attributes
    ----------
    in_loop : ndarray, shape (n_windows,)
        ½ k Δ(u₀²), contained in the loop integral between extremes of the displacement.
    in_phasors : ndarray, shape (n_windows,)
        ½ k Δ(u₀²) − ¼ μ (Ωu₀)² ΔΩ/Ω, contained in ½ T Re(F₁ u̇₁*).
    """

    in_loop: FloatArray
    in_phasors: FloatArray


def stored_work(
    omega_rad_per_s: FloatArray,
    apparent_mass_kg: FloatArray,
    amplitude_m: FloatArray,
    change_of_squared_amplitude_m2: FloatArray,
    change_of_log_omega: FloatArray,
) -> StoredWork:
    """Stored work per cycle in consecutive windows of one sweep.

    Parameters
    ----------
    omega_rad_per_s, apparent_mass_kg, amplitude_m : ndarray, shape (n_windows,)
        Ω, μ = Re F/ü, and u₀.
    change_of_squared_amplitude_m2, change_of_log_omega : ndarray, shape (n_windows,)
        Change of u₀² and of ln Ω from one cycle to the next.

    Returns
    -------
    StoredWork
        With k = 0 where the frequency stands still or turns, because k is not known there.

    Examples
    --------
    >>> omega = np.linspace(40.0, 50.0, 21)
    >>> one = np.ones(21)
    >>> stored = stored_work(omega, 0.7 - 900.0 / omega**2, 0.01 * one, -1e-6 * one, 0 * one)
    >>> bool(np.allclose(stored.in_loop, 0.5 * 900.0 * -1e-6))
    True
    """
    stiffness = _local_stiffness(omega_rad_per_s, apparent_mass_kg)
    in_loop = 0.5 * stiffness * change_of_squared_amplitude_m2
    chirp = 0.25 * apparent_mass_kg * (omega_rad_per_s * amplitude_m) ** 2 * change_of_log_omega
    return StoredWork(in_loop=in_loop, in_phasors=in_loop - chirp)


def _local_stiffness(omega: FloatArray, apparent_mass_kg: FloatArray) -> FloatArray:
    """k from the slope of μ over 1/Ω² in the windows around each; 0 where Ω does not sweep on."""
    stiffness = np.zeros(omega.size)
    for at in range(omega.size):
        near = slice(max(0, at - _HALF_WIDTH), at + _HALF_WIDTH + 1)
        direction = np.sign(np.diff(omega[near]))
        sweeps_on = direction.size >= 2 and abs(direction.sum()) == direction.size
        if sweeps_on and np.ptp(omega[near]) > _SMALLEST_FREQUENCY_SPREAD * omega[at]:
            stiffness[at] = -np.polyfit(omega[near] ** -2.0, apparent_mass_kg[near], 1)[0]
    return stiffness
