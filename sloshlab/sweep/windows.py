"""Averages over windows of 2P cycles whose centres are M cycles apart."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.order_statistics import median
from sloshlab.quantities import described
from sloshlab.rig import Rig
from sloshlab.sweep.cycles import N_HARMONICS, Cycles
from sloshlab.sweep.law import SweepLaw
from sloshlab.sweep.regime import classify
from sloshlab.sweep.stored_energy import Changes, stored_work

FloatArray = npt.NDArray[np.float64]

_LARGEST_CHANGE_PER_CYCLE = 0.02
"""A frequency that changes by more than this from one cycle to the next starts a new step."""
_CHANGES = ("elastic_change_m2", "kinetic_change_m2_per_s2", "chirp_m2_per_s2")
_SETTLING_CYCLES = 4
"""Cycles left out at both ends of a sweep and of each step: the phase is smoothed over two cycles and a spline."""
_OUTLIER_SIGMA, _SMALLEST_OUTLIER = 10.0, 2e-3
"""Cycles whose frequency leaves the trend of their window by more than ten times its scatter, and by more
than this part, are a transition between steps."""
_LARGEST_GROWTH_PER_CYCLE = 0.03
"""Windows whose acceleration grows or falls by more than this part per cycle are a start or a stop."""
_SMALLEST_AMPLITUDE_RATIO = 0.5
"""Cycles below this part of the median amplitude of their window are a start, a stop or a pause."""


@dataclass(frozen=True)
class WindowSettings:
    """How cycles are put into windows.

    Attributes
    ----------
    half_width_cycles : int
        P: a window covers 2P cycles, t_{n-P} … t_{n+P} (1.15).
    spacing_cycles : int
        M: cycles between the centres of windows; M ≥ 2P means no overlap.
    smallest_n_cycles : int
        Windows with fewer usable cycles are left out.
    """

    # 12 cycles averaged and 24 between centres, as in the source: no overlap
    half_width_cycles: int = 6
    spacing_cycles: int = 24
    smallest_n_cycles: int = 3


@dataclass(frozen=True)
class _Column:
    """One quantity of the table of windows; some have a second dimension, some need the tank."""

    dtype: type = np.float64
    along: str = ""
    width: int = 1
    needs_rig: bool = False


_NUMBER, _OF_TANK = _Column(), _Column(needs_rig=True)
_COLUMNS: Final[dict[str, _Column]] = {
    "time_s": _NUMBER,
    "frequency_hz": _NUMBER,
    "amplitude_m": _NUMBER,
    "acceleration_g": _NUMBER,
    "n_cycles": _Column(np.int32),
    "work_j": _NUMBER,
    "work_j_std": _NUMBER,
    "work_harmonic_j": _NUMBER,
    "phase_error_rad": _NUMBER,
    "gamma_kg_per_s": _NUMBER,
    "apparent_mass_kg": _NUMBER,
    "dissipated_mass_kg": _NUMBER,
    "dissipated_mass_kg_std": _NUMBER,
    "harmonic_amplitude_n": _Column(along="harmonic", width=5),
    "elastic_change_m2": _NUMBER,
    "kinetic_change_m2_per_s2": _NUMBER,
    "chirp_m2_per_s2": _NUMBER,
    "growth_per_cycle": _NUMBER,
    "stored_work_j": _NUMBER,
    "subharmonic_amplitude_n": _Column(along="subharmonic", width=2),
    "regime": _Column(object),
    "force_ratio": _NUMBER,
    "subharmonic_share": _NUMBER,
    "harmonic_share": _NUMBER,
    "unrepeated_share": _NUMBER,
    "crest_factor": _NUMBER,
    "beta_std": _OF_TANK,
    "w_bar": _OF_TANK,
    "w_bar_std": _OF_TANK,
    "beta": _OF_TANK,
    "loss_factor": _OF_TANK,
    "omega_bar": _OF_TANK,
    "u_bar": _OF_TANK,
    "v_bar": _OF_TANK,
    "fill_level": _OF_TANK,
}
"""All quantities of a window in the order of the table, with windows or without."""


def window_slices(cycles: Cycles, settings: WindowSettings) -> Iterator[slice]:
    """Slices of cycles, one per window; none crosses a step of the frequency.

    Examples
    --------
    With P = 6 and M = 24, a sweep of 68 cycles has windows 4–16, 28–40 and 52–64.
    """
    frequency = cycles.omega_rad_per_s
    # a stepped sweep: no window may average two frequencies
    # An octave sweep of 1/120 octave/s changes by 0.12 % per cycle at 5 Hz, less above.
    jumps = np.flatnonzero(np.abs(np.diff(frequency)) > _LARGEST_CHANGE_PER_CYCLE * frequency[:-1]) + 1
    edges = np.concatenate([[0], jumps, [frequency.size]])
    width = 2 * settings.half_width_cycles
    for left, right in itertools.pairwise(edges):
        start, stop = left + _SETTLING_CYCLES, right - _SETTLING_CYCLES
        # a dwell shorter than a window is averaged as it is, rather than lost
        if settings.smallest_n_cycles <= stop - start < width:
            yield slice(int(start), int(stop))
        for first in range(int(start), int(stop) - width + 1, settings.spacing_cycles):
            yield slice(first, first + width)


def evaluate_windows(
    cycles: Cycles,
    *,
    run_id: str,
    law: SweepLaw | None,
    start_time_s: float = 0.0,
    rig: Rig | None = None,
    settings: WindowSettings | None = None,
    noise_power: float = 0.0,
) -> xr.Dataset:
    """Average the cycles of one run in windows.

    Parameters
    ----------
    cycles : Cycles
        Of one run; `inertia_kg` must be M_dry + m_l if `rig` is given.
    run_id : str
        Written to `run`.
    law : SweepLaw, optional
        For `phase_error_rad`; NaN without one.
    start_time_s : float
        Time of the first sample from the trigger [s].
    rig : Rig, optional
        With it, W̄, β, η and the non-dimensional coordinates are given.
    settings : WindowSettings, optional
        P, M and the smallest number of cycles.
    noise_power : float
        Mean square of the dynamic force that sensor noise alone gives [N²].

    Returns
    -------
    xarray.Dataset
        Dimension ``window``; variables as in `sloshlab.quantities`. Work is positive when dissipated. The
        attribute `n_unsteady_windows` counts those left out because the amplitude changes too quickly.
    """
    chosen = settings or WindowSettings()
    rows, n_unsteady = [], 0
    for window in window_slices(cycles, chosen):
        # cycles that touch a lost or clipped sample go first, so that they do not enter the medians
        at = _steady(cycles, np.arange(window.start, window.stop)[cycles.usable[window]])
        if at.size >= chosen.smallest_n_cycles:
            row = _row(cycles, at, law, start_time_s, rig=rig, noise_power=noise_power)
            if abs(_number(row, "growth_per_cycle")) < _LARGEST_GROWTH_PER_CYCLE:
                rows.append(row)
            else:
                n_unsteady += 1
    # After all windows are there, because the stiffness at one follows from its neighbours; before anything is
    # scaled, because W̄ is made of the dissipated work only.
    _take_out_stored_energy(rows, velocity_is_measured=cycles.velocity_is_measured)
    if rig is not None:
        for row in rows:
            row.update(_scaled(row, cycles.inertia_kg, rig))
    table = _table(rows, run_id, rig).assign_attrs(n_unsteady_windows=n_unsteady)
    return described(table if rig is not None else table.drop_vars("regime"))


def _take_out_stored_energy(rows: list[dict[str, object]], *, velocity_is_measured: bool) -> None:
    """Turn the work of the force into the dissipated work, in place."""

    def column(name: str) -> FloatArray:
        return np.array([_number(row, name) for row in rows])

    changes = Changes(*(column(name) for name in _CHANGES))
    stored = stored_work(
        2 * np.pi * column("frequency_hz"),
        column("apparent_mass_kg"),
        changes,
        velocity_is_measured=velocity_is_measured,
    )
    for row, in_loop, in_phasors in zip(rows, stored.in_loop, stored.in_phasors, strict=True):
        omega = 2 * np.pi * _number(row, "frequency_hz")
        # loop and phasors contain different shares of the stored energy, see `stored_work`
        speed2 = (omega * _number(row, "amplitude_m")) ** 2
        row["stored_work_j"] = float(in_loop)
        row["work_j"] = _number(row, "work_j") - float(in_loop)
        row["dissipated_mass_kg"] = _number(row, "dissipated_mass_kg") - float(in_loop) / speed2
        row["work_harmonic_j"] = _number(row, "work_harmonic_j") - float(in_phasors)
        # W = πγΩu₀² = πγ(Ωu₀)²/Ω, solved for γ
        row["gamma_kg_per_s"] = _number(row, "gamma_kg_per_s") - float(in_phasors) * omega / (np.pi * speed2)


def _steady(cycles: Cycles, at: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
    """Those cycles of a window that belong to one sweep: no pause, no transition between steps."""
    # too few for a median to know what is normal
    if at.size < 3:
        return at
    amplitude = np.abs(cycles.acceleration_phasor[at, 0])
    frequency = np.log(cycles.omega_rad_per_s[at])
    trend = median(np.diff(frequency) / np.diff(at)) * (at - at.mean())
    # medians throughout: the transition that is sought must not shift the trend it is measured against
    deviation = np.abs(frequency - trend - median(frequency - trend))
    moving = amplitude > _SMALLEST_AMPLITUDE_RATIO * median(amplitude)
    # 1.4826 times the median deviation is the standard deviation of normal scatter
    limit = max(_SMALLEST_OUTLIER, _OUTLIER_SIGMA * 1.4826 * median(deviation))
    transition = ~moving | (deviation >= limit)
    # the phase is smoothed over two cycles, so that a neighbour has part of the transition
    beside = np.convolve(transition, np.ones(3), mode="same") > 0
    return np.asarray(at[~beside])


def _row(
    cycles: Cycles,
    at: npt.NDArray[np.intp],
    law: SweepLaw | None,
    start_time_s: float,
    *,
    rig: Rig | None,
    noise_power: float,
) -> dict[str, object]:
    omega = cycles.omega_rad_per_s[at]
    middle = 0.5 * (cycles.start_s[at] + cycles.stop_s[at])
    # Powers are averaged over cycles before any ratio is taken: the mean of ratios would be biased by noise, and
    # would count weak cycles as much as strong ones.
    work, force, velocity = cycles.work_j[at], cycles.force_phasor[at, 0], cycles.velocity_phasor[at]
    acceleration = cycles.acceleration_phasor[at, 0]
    speed2, accel2 = np.abs(velocity) ** 2, np.abs(acceleration) ** 2
    # θ, the phase of ü at which the cycle begins, is zero where cycles are counted by the motion itself
    cos2 = acceleration.real**2 / accel2
    # F = μ ü + γ u̇ (1.20) by least squares; u̇ and ü are a quarter of a turn apart, so that each has its own
    # quotient
    gamma = float((force * velocity.conj()).real.mean() / speed2.mean())
    mass = float((force * acceleration.conj()).real.mean() / accel2.mean())
    row: dict[str, object] = {
        "time_s": start_time_s + float(middle.mean()),
        "frequency_hz": float(omega.mean() / (2 * np.pi)),
        # (1.9), from the velocity whose constants are set already: u₀ = |u̇|/Ω
        "amplitude_m": float(np.sqrt((speed2 / omega**2).mean())),
        "acceleration_g": float(np.sqrt(accel2.mean()) / GRAVITY_M_PER_S2),
        "n_cycles": at.size,
        "work_j": float(work.mean()),
        "work_j_std": float(work.std(ddof=1)),
        "work_harmonic_j": float(cycles.harmonic_work_j[at].mean()),
        "phase_error_rad": _phase_error(cycles.start_s[at] + start_time_s, law),
        "gamma_kg_per_s": gamma,
        "apparent_mass_kg": mass,
        # smooth where W spans decades; this is what maps interpolate
        "dissipated_mass_kg": float(work.mean() / speed2.mean()),
        "dissipated_mass_kg_std": _standard_error(work, at) / float(speed2.mean()),
        "harmonic_amplitude_n": np.abs(cycles.dynamic_phasor[at].mean(axis=0)),
        "elastic_change_m2": _slope(at, speed2 / omega**2 * cos2),
        "kinetic_change_m2_per_s2": _slope(at, speed2 * (1 - cos2)),
        "chirp_m2_per_s2": float((speed2 * (2 * cos2 - 1)).mean()) * _slope(at, np.log(omega)),
        # logarithmic, so that it is the same part per cycle at every level
        "growth_per_cycle": _slope(at, 0.5 * np.log(accel2)),
        "stored_work_j": 0.0,
    }
    row.update(_regime(cycles, at, row, rig, noise_power))
    if rig is not None:
        # residual of Re(F ü*) = μ |ü|²: the scatter of the amplitude itself is no error of μ
        scatter = (force * acceleration.conj()).real - mass * accel2
        row["beta_std"] = _standard_error(scatter, at) / float(accel2.mean()) / rig.liquid_mass_kg
    return row


def _slope(at: npt.NDArray[np.intp], values: FloatArray) -> float:
    """Slope of the straight line through values at cycles, per cycle."""
    # `at` has holes where cycles were left out, which the slope must know
    from_middle = at - at.mean()
    return float(from_middle @ values / (from_middle @ from_middle))


def _pair_starts(at: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
    """Positions in `at` of the first of disjoint pairs of consecutive cycles."""
    starts, position = [], 0
    while position + 1 < at.size:
        # across a hole the parity of the cycles need not differ, and the pair would not cancel what alternates
        consecutive = at[position + 1] == at[position] + 1
        if consecutive:
            starts.append(position)
        position += 2 if consecutive else 1
    return np.array(starts, dtype=np.intp)


def _pair_means(values: npt.NDArray[np.complex128], first: npt.NDArray[np.intp]) -> npt.NDArray[np.complex128]:
    """Means over pairs of consecutive cycles, in which harmonics and subharmonics do not mix."""
    return np.asarray(0.5 * (values[first] + values[first + 1]))


def _standard_error(values: FloatArray, at: npt.NDArray[np.intp]) -> float:
    """Standard error of the mean from the means of consecutive pairs of cycles.

    What alternates from one cycle to the next, as a subharmonic does, cancels in a pair and in the mean.
    """
    first = _pair_starts(at)
    # without pairs the scatter of single cycles stands in, too large where something alternates
    if first.size < 2:
        return float(values.std(ddof=1) / np.sqrt(values.size))
    pairs = 0.5 * (values[first] + values[first + 1])
    return float(pairs.std(ddof=1) / np.sqrt(pairs.size))


def _scaled(row: dict[str, object], inertia_kg: float, rig: Rig) -> dict[str, object]:
    """The quantities that need the tank (1.16–1.18, 1.24); W̄ = W/(m_l u₀² Ω²)."""
    liquid = rig.liquid_mass_kg
    omega, amplitude = 2 * np.pi * _number(row, "frequency_hz"), _number(row, "amplitude_m")
    # positive = dissipated; (1.18)
    w_bar = _number(row, "dissipated_mass_kg") / liquid
    return {
        "w_bar": w_bar,
        "w_bar_std": _number(row, "dissipated_mass_kg_std") / liquid,
        # F = (M_dry + m_l) ü − Δf and Δf = −β m_l ü − γ u̇: the mass beyond M_dry + m_l is β m_l
        "beta": (_number(row, "apparent_mass_kg") - inertia_kg) / liquid,
        # App. A: η = W/(2π U_max), U_max = ½ m_l (Ωu₀)²; at resonance η = 2ζ
        "loss_factor": w_bar / np.pi,
        "omega_bar": omega / rig.frequency_scale_rad_per_s,
        "u_bar": amplitude / rig.tank.height_m,
        "v_bar": omega * amplitude / rig.velocity_scale_m_per_s,
        "fill_level": rig.liquid.fill_level,
    }


def _number(row: dict[str, object], name: str) -> float:
    value = row[name]
    assert isinstance(value, float)
    return value


def _regime(
    cycles: Cycles, at: npt.NDArray[np.intp], row: dict[str, object], rig: Rig | None, noise_power: float
) -> dict[str, object]:
    first = _pair_starts(at)
    # without a tank the whole force is what the parts are compared with
    mass = rig.liquid_mass_kg if rig is not None else abs(_number(row, "apparent_mass_kg"))
    lead = np.angle(cycles.acceleration_phasor[at, 0])
    # relative to the acceleration's phase, in which the part at Ω that is inertia is the real one
    dynamic = cycles.dynamic_phasor[at] * np.exp(-1j * np.outer(lead, np.arange(1, N_HARMONICS + 1)))
    subharmonic = _pair_means(cycles.subharmonic_phasor[at], first)
    regime = classify(
        _pair_means(dynamic, first) if first.size else dynamic,
        subharmonic,
        *cycles.dynamic_power_and_peak(at),
        reference_force_n=mass * _number(row, "acceleration_g") * GRAVITY_M_PER_S2,
        noise_power=noise_power,
    )
    return {
        # complex mean first: a wave at Ω/2 keeps its phase from pair to pair, chaos does not
        "subharmonic_amplitude_n": np.abs(subharmonic.mean(axis=0)) if first.size else np.full(2, np.nan),
        "regime": regime.label,
        "force_ratio": regime.force_ratio,
        "subharmonic_share": regime.subharmonic_share,
        "harmonic_share": regime.harmonic_share,
        "unrepeated_share": regime.unrepeated_share,
        "crest_factor": regime.crest_factor,
    }


def _phase_error(starts_s: FloatArray, law: SweepLaw | None) -> float:
    """Measured minus law phase, wrapped to (-π, π]; the measured phase is a multiple of 2π at t_n."""
    if law is None:
        return float("nan")
    turns = law.phase_rad(starts_s)
    # the circular mean, because phases near ±π must not average to zero
    return float(np.angle(np.exp(-1j * turns).mean())) if np.isfinite(turns).all() else float("nan")


def _table(rows: list[dict[str, object]], run_id: str, rig: Rig | None) -> xr.Dataset:
    variables: dict[str, tuple[object, ...]] = {"run": ("window", np.array([run_id] * len(rows), dtype=object))}
    for name, column in _COLUMNS.items():
        if column.needs_rig and rig is None:
            continue
        values: npt.NDArray[Any] = np.array([row[name] for row in rows], dtype=column.dtype)
        if column.along:
            variables[name] = (("window", column.along), values.reshape(len(rows), column.width))
        else:
            variables[name] = ("window", values)
    table = xr.Dataset(variables)
    table["phase_error_rad"] = ("window", _continuous(table["phase_error_rad"].values))
    return table.assign_coords(harmonic=np.arange(1, 6), subharmonic=np.array([0.5, 1.5]))


def _continuous(phase_error_rad: FloatArray) -> FloatArray:
    # wrapped window by window, the error of a shaker off its law would jump
    return np.unwrap(phase_error_rad) if np.isfinite(phase_error_rad).all() else phase_error_rad
