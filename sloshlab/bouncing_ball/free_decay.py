"""Free decays of a structure with a ball in its tank, and what each damping adds (Figs. 2.9, 2.14, 2.15)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.bouncing_ball.harmonic_response import HarmonicRun, w_bar_at
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import AnalysisError, RigError
from sloshlab.modal.free_decay import analyse_free_decay
from sloshlab.modal.local_sine_fit import DecayNoise
from sloshlab.modal.log_decrement import log_decrement
from sloshlab.rig import Rig
from sloshlab.twin.excitation import free
from sloshlab.twin.twin import Simulation, Twin

FloatArray = npt.NDArray[np.float64]

_DIED_OUT_SHARE = 2e-3
"""A decay is read down to this share of its largest value."""
_FEWEST_VALUES = 8
_LONGEST_COULOMB_DECAY_S = 200.0
# A simulation has no noise, but the errors of the reading still need a number.
_NO_NOISE = DecayNoise(np.zeros(1), np.full(1, 1e-12), 1e6)


@dataclass(frozen=True, eq=False)
class DampingCurve:
    """Damping ratio against amplitude along one decay, by the logarithmic decrement (2.13).

    Attributes
    ----------
    acceleration_m_per_s2 : ndarray, shape (n,)
        Amplitudes, falling.
    damping_ratio : ndarray, shape (n,)
    frequency_hz : float
        Of the mode.
    """

    acceleration_m_per_s2: FloatArray
    damping_ratio: FloatArray
    frequency_hz: float

    @property
    def acceleration_g(self) -> FloatArray:
        """Amplitudes in g."""
        return self.acceleration_m_per_s2 / GRAVITY_M_PER_S2

    def at(self, acceleration_m_per_s2: FloatArray) -> FloatArray:
        """ζ at other amplitudes, linear in ln a; held beyond the ends."""
        order = np.argsort(self.acceleration_m_per_s2)
        # a decay passes amplitudes at a constant ratio
        known = np.log(self.acceleration_m_per_s2[order])
        return np.interp(np.log(acceleration_m_per_s2), known, self.damping_ratio[order])

    def within(self, low_m_per_s2: float, high_m_per_s2: float) -> DampingCurve:
        """The part between two amplitudes."""
        used = (self.acceleration_m_per_s2 >= low_m_per_s2) & (self.acceleration_m_per_s2 <= high_m_per_s2)
        return DampingCurve(self.acceleration_m_per_s2[used], self.damping_ratio[used], self.frequency_hz)


def measured_curve(
    acceleration: FloatArray, sampling_rate_hz: float, *, lowest_acceleration_g: float = 0.3
) -> DampingCurve:
    """ζ(a) of a recorded decay: the values of the decrement that may be used.

    Parameters
    ----------
    acceleration : ndarray, shape (n,)
        Of the tank [m/s²].
    sampling_rate_hz : float
    lowest_acceleration_g : float
        Below it the guide's friction rules, and ζ tells nothing of the liquid.

    Raises
    ------
    AnalysisError
        If nothing decays, or too few values are left.
    """
    decay = analyse_free_decay(_until_died_out(acceleration), sampling_rate_hz)
    reading = decay.log_decrement
    amplitude = reading.acceleration_amplitude_m_per_s2
    used = reading.used & (amplitude >= lowest_acceleration_g * GRAVITY_M_PER_S2) & (reading.damping_ratio > 0)
    if used.sum() < _FEWEST_VALUES:
        raise AnalysisError(
            "ζ(a) of the decay",
            got=f"{int(used.sum())} values above {lowest_acceleration_g:g} g that may be used, of {used.size}",
            allowed=f"at least {_FEWEST_VALUES}",
            remedy="release from further away, record less noise, or lower the smallest acceleration",
        )
    return DampingCurve(amplitude[used], reading.damping_ratio[used], decay.release.frequency_hz)


def pooled_curve(curves: Sequence[DampingCurve]) -> DampingCurve:
    """The values of several decays in one curve, amplitudes falling; the frequency is the mean of theirs."""
    amplitude = np.concatenate([curve.acceleration_m_per_s2 for curve in curves])
    order = np.argsort(-amplitude, kind="stable")
    damping = np.concatenate([curve.damping_ratio for curve in curves])
    frequency = float(np.mean([curve.frequency_hz for curve in curves]))
    return DampingCurve(amplitude[order], damping[order], frequency)


def simulated_decay(
    ball: BouncingBall | None,
    rig: Rig,
    initial_displacement_m: float,
    duration_s: float,
    *,
    sampling_rate_hz: float = 1000.0,
    without: tuple[str, ...] = (),
) -> Simulation:
    """Release of the structure with the ball (None: with the liquid frozen) in its tank.

    Parameters
    ----------
    ball : BouncingBall or None
    rig : Rig
        With a structure of one degree of freedom.
    initial_displacement_m, duration_s, sampling_rate_hz : float
    without : tuple of str
        ``"coulomb"`` and ``"viscous"`` leave out the friction of the guide or the structure's own damper.
    """
    if rig.structure is None or rig.structure.kind != "sdof":
        raise RigError("rig: structure.kind", got="none or beam", allowed="sdof", remedy="give the sdof rig")
    removed = {{"coulomb": "coulomb_force_n", "viscous": "damping_kg_per_s"}[name]: None for name in without}
    bare = rig.model_copy(update={"structure": rig.structure.model_copy(update=removed), "twin": None})
    twin = Twin.from_rig(bare) if ball is None else ball.on_structure(bare)
    motion = free(duration_s, sampling_rate_hz)
    return twin.simulate(motion, initial_displacement_m=initial_displacement_m).require_done()


def simulated_curve(decay: Simulation, frequency_hz: float) -> DampingCurve:
    """ζ(a) of a simulated decay, down to where it has died out, read as the measured one is.

    Parameters
    ----------
    decay : Simulation
    frequency_hz : float
        Of the mode.

    Raises
    ------
    AnalysisError
        If it has died out within five cycles.
    """
    signal = _until_died_out(decay.acceleration_m_per_s2)
    n_cycles = signal.size / decay.sampling_rate_hz * frequency_hz
    if n_cycles < 5:
        raise AnalysisError("simulated decay", got=f"{n_cycles:.1f} cycles", allowed="at least 5")
    # friction may hold the tank still for a while: extrema without curvature, which have no errors
    with np.errstate(divide="ignore", invalid="ignore"):
        # by the same function as the recording: an error of the reading is then in both
        reading = log_decrement(signal, decay.sampling_rate_hz, frequency_hz=frequency_hz, noise=_NO_NOISE)
    used = reading.used & np.isfinite(reading.damping_ratio)
    if not used.any():
        raise AnalysisError("simulated decay", got="no value of ζ", allowed="a decay that can be read")
    return DampingCurve(reading.acceleration_amplitude_m_per_s2[used], reading.damping_ratio[used], frequency_hz)


def _until_died_out(signal: FloatArray) -> FloatArray:
    """The signal without an end that has died out; what cannot be compared is left as it is."""
    size = np.abs(signal)
    above = np.flatnonzero(size > _DIED_OUT_SHARE * size.max(initial=0.0))
    return signal[: above[-1] + 1] if above.size else signal


def damping_shares(
    ball: BouncingBall, rig: Rig, initial_displacement_m: float, duration_s: float
) -> dict[str, DampingCurve]:
    """ζ(a) with all dampings, and with each alone: ``all``, ``ball``, ``coulomb``, ``viscous`` (Fig. 2.14)."""
    frequency, longest = natural_frequency_hz(rig), _coulomb_duration_s(rig, initial_displacement_m)
    runs = {
        "all": (ball, ()),
        "ball": (ball, ("coulomb", "viscous")),
        "coulomb": (None, ("viscous",)),
        "viscous": (None, ("coulomb",)),
    }
    return {
        name: simulated_curve(
            simulated_decay(
                who,
                rig,
                initial_displacement_m,
                max(duration_s, longest if name == "coulomb" else 0.0),
                without=without,
            ),
            frequency,
        )
        for name, (who, without) in runs.items()
    }


def _coulomb_duration_s(rig: Rig, initial_displacement_m: float) -> float:
    """How long dry friction alone needs to stop the structure: it takes 4F/K of the amplitude per cycle."""
    structure = rig.structure
    if structure is None or not structure.coulomb_force_n or structure.stiffness_n_per_m is None:
        return 0.0
    n_cycles = abs(initial_displacement_m) * structure.stiffness_n_per_m / (4 * structure.coulomb_force_n)
    return min(n_cycles / natural_frequency_hz(rig), _LONGEST_COULOMB_DECAY_S)


def natural_frequency_hz(rig: Rig) -> float:
    """f₀ of the structure with the liquid frozen."""
    structure = Twin.from_rig(rig.model_copy(update={"twin": None})).structure
    if structure is None:
        raise RigError("rig", got="no [structure]", remedy="give the rig on which the decay was measured")
    return float(structure.frequencies_hz[0])


def steady_loss_factor(
    ball: BouncingBall, rig: Rig, acceleration_m_per_s2: FloatArray, run: HarmonicRun | None = None
) -> FloatArray:
    """η_sh = m_l/(m_l + m_s) η(a, ω₀) (2.17), to be compared with η_tr = 2ζ of the ball alone.

    NaN where the ball leaves its tank.
    """
    omega = 2 * np.pi * natural_frequency_hz(rig)
    u_bar = acceleration_m_per_s2 / omega**2 / rig.tank.height_m
    if rig.structure is None or rig.structure.mass_kg is None:
        raise RigError("rig", got="no mass of one degree of freedom", remedy="give the sdof rig")
    # (2.17): the loss is the ball's, the energy that of liquid and structure together
    share = rig.liquid_mass_kg / (rig.liquid_mass_kg + rig.structure.mass_kg)
    omega_bar = np.full(u_bar.shape, omega / rig.frequency_scale_rad_per_s)
    return np.asarray(share / np.pi * w_bar_at(ball, rig, omega_bar, u_bar, run))
