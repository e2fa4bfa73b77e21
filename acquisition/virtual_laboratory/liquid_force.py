"""The force of the virtual liquid on the tank.

F_S = −m_l ü + Δf (1.19). The fundamental of Δf is −β m_l ü₁ − γ u̇₁ (1.20) with γ = W̄ m_l Ω/π, both of the
`liquid_law` at the instantaneous Ω and u₀ and scattered from cycle to cycle. The rest depends on the
regime and does no net work: subharmonics in Faraday waves, a phase-locked comb of impacts, broad-band
content when chaotic. Upward positive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BSpline, make_interp_spline

from acquisition.virtual_laboratory.liquid_law import LiquidLaw, liquid_law
from acquisition.virtual_laboratory.shaker import IMPACT_PHASE_RAD, Kinematics, Motion
from sloshlab.rig import Rig

FloatArray = NDArray[np.float64]

REGIMES: Final = ("quiet", "faraday", "impacts", "chaotic")

_CHAOTIC_ABOVE_G = 2.6
_TRANSITION_WIDTH = 0.06
# from cycle to cycle, in the order of REGIMES; shares of the work, and parts of β
_SCATTER_OF_WORK = np.array([0.01, 0.03, 0.07, 0.12])
_SCATTER_OF_MASS = np.array([0.002, 0.005, 0.02, 0.04])
# what one cycle lacks the next mostly makes up, so that means over a window are far surer than a single cycle
_CYCLE_MEMORY = 0.7
_LARGEST_WORK = 1.65
_POINTS_PER_CYCLE = 24
_COMB_ORDERS = range(2, 9)


def regime_weights(omega_bar: ArrayLike, u_bar: ArrayLike, fill_level: float) -> FloatArray:
    """How much of each regime there is.

    Parameters
    ----------
    omega_bar, u_bar : array_like
        ω̄ and ū, broadcast to a shape S.
    fill_level : float
        α.

    Returns
    -------
    ndarray, shape (4, *S)
        In the order of `REGIMES`; they sum to 1.

    Notes
    -----
    Thresholds in g, after thesis 1.4.1: Faraday waves above 0.5 (ω̄/5)^1.5, since surface tension
    stabilises short waves; impacts above 1 + 0.5 (ω̄/4.8)⁶, at most 2.4, more where the roof is far;
    chaotic above 2.6 at any frequency.
    """
    omega, u = np.broadcast_arrays(np.asarray(omega_bar, dtype=float), np.asarray(u_bar, dtype=float))
    acceleration = np.maximum(u * omega**2, 1e-9)
    gap = 1.0 + 0.5 * (0.5 - fill_level)
    faraday_above = 0.5 * (np.maximum(omega, 1e-6) / 5.0) ** 1.5
    impacts_above = np.minimum(gap * (1.0 + 0.5 * (omega / 4.8) ** 6), 2.4)
    faraday, impacts = _beyond(acceleration / faraday_above), _beyond(acceleration / impacts_above)
    chaotic = _beyond(acceleration / _CHAOTIC_ABOVE_G)
    calm = (1 - chaotic) * (1 - impacts)
    return np.stack([calm * (1 - faraday), calm * faraday, (1 - chaotic) * impacts, chaotic])


def regime(omega_bar: ArrayLike, u_bar: ArrayLike, fill_level: float) -> NDArray[np.str_]:
    """The prevailing regime, one of `REGIMES` per point.

    Examples
    --------
    >>> regime([1.985, 1.985, 5.624], [0.5 / 1.985**2, 1.5 / 1.985**2, 0.5 / 5.624**2], 0.5).tolist()
    ['faraday', 'impacts', 'quiet']
    """
    return np.asarray(np.asarray(REGIMES)[regime_weights(omega_bar, u_bar, fill_level).argmax(axis=0)])


@dataclass(frozen=True)
class LiquidForce:
    """The true force of the liquid along one motion, at any time.

    Attributes
    ----------
    motion : Motion
        The true motion.
    rig : Rig
        Its tank and liquid; the fill level chooses the law.
    seed : int
        Of the scatter and of the broad-band content.
    frozen : bool
        If true the liquid moves with the tank: Δf = 0.
    """

    motion: Motion
    rig: Rig
    seed: int = 0
    frozen: bool = False
    _law: LiquidLaw = field(init=False, repr=False)
    _scatter: tuple[FloatArray, FloatArray, FloatArray, FloatArray] = field(init=False, repr=False)
    _broad_band: BSpline = field(init=False, repr=False)
    _angles: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        generator = np.random.default_rng(self.seed)
        first, last = np.sort(self.motion.phase(np.array([0.0, self.motion.duration_s]))) / (2 * np.pi)
        origin, n_cycles = int(np.floor(first)) - 1, int(np.ceil(last) - np.floor(first)) + 3
        # scatter follows the cycles of the motion and not time, so that the force is a function of any instant
        centres = origin + 0.5 + np.arange(n_cycles)
        draws = tuple(_cycle_scatter(n_cycles, generator) for _ in range(3))
        broad = _broad_band_noise(n_cycles, generator)
        grid = origin + np.arange(broad.size) / _POINTS_PER_CYCLE
        object.__setattr__(self, "_law", liquid_law(self.rig.liquid.fill_level))
        object.__setattr__(self, "_scatter", (centres, *draws))
        object.__setattr__(self, "_broad_band", make_interp_spline(grid, broad, k=3))
        object.__setattr__(self, "_angles", generator.uniform(0, 2 * np.pi, 4))

    def dynamic_force_n(self, time_s: FloatArray, kinematics: Kinematics | None = None) -> FloatArray:
        """Δf [N], upward positive.

        Parameters
        ----------
        time_s : ndarray
            Times within the run.
        kinematics : Kinematics, optional
            ``motion.at(time_s)`` where it is known already.
        """
        if self.frozen:
            return np.zeros(np.shape(time_s))
        moved = kinematics or self.motion.at(time_s)
        omega, u0 = moved.omega_rad_per_s, moved.amplitude_m
        omega_bar, u_bar = omega / self.rig.frequency_scale_rad_per_s, u0 / self.rig.tank.height_m
        weights = regime_weights(omega_bar, u_bar, self.rig.liquid.fill_level)
        cycle = moved.phase_rad / (2 * np.pi)
        centres, of_work, of_mass, of_impact = self._scatter
        work = self._law.dissipated_work(omega_bar, u_bar) * (
            1 + np.tensordot(_SCATTER_OF_WORK, weights, 1) * np.interp(cycle, centres, of_work)
        )
        mass = self._law.effective_mass(omega_bar, u_bar) + np.tensordot(_SCATTER_OF_MASS, weights, 1) * np.interp(
            cycle, centres, of_mass
        )
        # −β m_l ü₁ − γ u̇₁ with γ = W̄ m_l Ω/π; the fundamental alone, as the law says nothing of harmonics
        linear = -mass * moved.fundamental_acceleration - work * omega / np.pi * moved.fundamental_velocity
        impact = 1 + 0.15 * np.interp(cycle, centres, of_impact)
        workless = self._faraday(cycle, weights) + self._impacts(moved.rotor, omega_bar, impact, weights)
        violence = np.sqrt(self._law.work_peak / _LARGEST_WORK)
        workless += (0.004 + violence * (0.03 * weights[2] + 0.20 * weights[3])) * self._broad_band(cycle)
        return np.asarray(self.rig.liquid_mass_kg * (linear + u0 * omega**2 * workless))

    def force_n(self, time_s: FloatArray, kinematics: Kinematics | None = None) -> FloatArray:
        """F_S = −m_l ü + Δf [N], upward positive, without the weight; arguments as `dynamic_force_n`."""
        moved = kinematics or self.motion.at(time_s)
        return self.dynamic_force_n(time_s, moved) - self.rig.liquid_mass_kg * moved.acceleration

    def _faraday(self, cycle: FloatArray, weights: FloatArray) -> FloatArray:
        """Standing waves at 1/2 and 3/2 of the excitation, over m_l a₀."""
        turn, angles = 2 * np.pi * cycle, self._angles
        drift = 0.4 * np.sin(turn / 60 + angles[0])
        waves = 0.10 * np.cos(turn / 2 + angles[1] + drift) + 0.04 * np.cos(1.5 * turn + angles[2] - drift)
        return np.asarray((weights[1] + 0.4 * weights[2]) * waves)

    def _impacts(
        self, rotor: NDArray[np.complex128], omega_bar: FloatArray, scatter: FloatArray, weights: FloatArray
    ) -> FloatArray:
        """Blows to the roof on the way down, half as strong to the floor on the way up, over m_l a₀."""
        strength = (0.02 * weights[1] + weights[2] + 0.25 * weights[3]) * 1.1 / (1 + (omega_bar / 4) ** 2)
        comb, turned = np.zeros(rotor.shape), rotor
        for order in _COMB_ORDERS:
            turned = turned * rotor
            comb += (turned * _comb_line(order, self.motion.harmonics)).real
        return np.asarray(strength * scatter * comb)


def _comb_line(order: int, harmonics: Sequence[tuple[int, float, float]]) -> complex:
    """Complex amplitude of one line of the impact comb.

    Where the motion itself has that harmonic only the part in phase with its acceleration is
    kept, which does no work on it.
    """
    roof, floor = -order * IMPACT_PHASE_RAD, -order * (IMPACT_PHASE_RAD - np.pi)
    line = 0.35 * np.exp(-((order / 5.0) ** 2) / 2) * (np.exp(1j * roof) - 0.5 * np.exp(1j * floor))
    for its_order, _, angle in harmonics:
        if its_order == order:
            # the truth of the work must stay the law's, to the last harmonic
            line = (line * np.exp(-1j * angle)).real * np.exp(1j * angle)
    return complex(line)


def _cycle_scatter(n_cycles: int, generator: np.random.Generator) -> FloatArray:
    """Scatter of unit variance, one value per cycle; what one cycle lacks the next mostly makes up."""
    drawn = generator.standard_normal(n_cycles + 1)
    return np.asarray((drawn[1:] - _CYCLE_MEMORY * drawn[:-1]) / np.hypot(1, _CYCLE_MEMORY))


def _broad_band_noise(n_cycles: int, generator: np.random.Generator) -> FloatArray:
    """Noise of unit variance over the cycles, 0.2…6 orders, nothing at the order 1 that the law owns."""
    n_points = n_cycles * _POINTS_PER_CYCLE
    order = np.fft.rfftfreq(n_points, 1 / _POINTS_PER_CYCLE)
    shape = 1 / (1 + (order / 2.0) ** 2) * (order > 0.2) * (order < 6)
    # noise at the excitation would do work that the law does not know
    shape *= 1 - np.exp(-((np.abs(order - 1) / 0.33) ** 4))
    noise = np.fft.irfft(np.fft.rfft(generator.standard_normal(n_points)) * shape, n_points)
    return np.asarray(noise / noise.std())


def _beyond(ratio: FloatArray) -> FloatArray:
    return np.asarray(1 / (1 + np.maximum(ratio, 1e-9) ** (-1 / _TRANSITION_WIDTH)))
