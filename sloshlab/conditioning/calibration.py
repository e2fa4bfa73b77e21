"""The dry mass on the force cells, the cells' gain against the accelerometers, and wrong signs.

Without liquid motion F_ext = g M ü(t − τ): g is the gain of the force channels over that of the
accelerometers (1 for perfect sensors), τ the delay of force behind acceleration, M the dry mass (`empty`
run) or dry mass and liquid (`frozen` run). Both runs together tell g from M, because the liquid's mass is
known by weighing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import xarray as xr

from sloshlab.conditioning.block_spectra import block_spectra, delay_s
from sloshlab.conditioning.combined_channels import (
    acceleration_channels,
    force_channels,
    force_sign,
    mean_acceleration,
    total_force,
)
from sloshlab.conditioning.redundancy import agreement, redundant_accelerometers, require_equal_signs
from sloshlab.errors import AnalysisError
from sloshlab.rig import Rig


@dataclass(frozen=True)
class ApparentMass:
    """In-phase force per acceleration in one run.

    Attributes
    ----------
    mass_kg, mass_std_kg : float
        g M, negative when force and acceleration have opposite signs; standard deviation from the
        scatter of one-second blocks.
    delay_s, delay_std_s : float
        τ, positive: force comes later than acceleration.
    run_id : str
        The run it comes from.
    """

    mass_kg: float
    mass_std_kg: float
    delay_s: float
    delay_std_s: float
    run_id: str


@dataclass(frozen=True)
class DryMass:
    """What rests on the force cells without liquid.

    Attributes
    ----------
    mass_kg, mass_std_kg : float
        Dry mass M_dry. With both `empty` and `frozen` runs it is free of the sensors' gains, else it contains g.
    apparent_mass_kg : float
        g M_dry: force channels per accelerometers as they read; subtract this times the measured ü.
    delay_s, delay_std_s : float
        Delay of force behind acceleration; negative: force comes first.
    gain_ratio, gain_ratio_std : float
        g = gain of force over gain of acceleration; 1 and NaN where only one kind of run is there.
        True W̄ is the measured one divided by g (ü taken as true).
    source_runs : tuple of str
        Run identifiers, `empty` ones first.
    """

    mass_kg: float
    mass_std_kg: float
    apparent_mass_kg: float
    delay_s: float
    delay_std_s: float
    gain_ratio: float
    gain_ratio_std: float
    source_runs: tuple[str, ...]

    @property
    def gain_is_identified(self) -> bool:
        """Whether g was measured, rather than taken as 1."""
        return math.isfinite(self.gain_ratio_std)


def apparent_mass(
    recording: xr.Dataset,
    force_names: Sequence[str] | None = None,
    acceleration_names: Sequence[str] | None = None,
) -> ApparentMass:
    """Apparent mass g M and delay of one run, by least squares around the dominant frequency.

    Parameters
    ----------
    recording : xarray.Dataset
        Any run in which the tank moves.
    force_names, acceleration_names : sequence of str, optional
        Channels to add and to average; by default those of `total_force` and `mean_acceleration`.

    Returns
    -------
    ApparentMass

    Notes
    -----
    Least squares of the force's lines on the acceleration's. Noise of the accelerometers biases it by
    its share of the power in five lines of a second's spectrum: 10⁻⁷ for 1 % white noise at 10 kHz.
    """
    force = total_force(recording, force_names)
    acceleration = mean_acceleration(recording, acceleration_names)
    run_id = str(recording.attrs.get("run_id", "unnamed"))
    # over the lines of the motion only: static weight, hum and most of the noise are elsewhere
    spectra = block_spectra(force.to_dataset(), [str(force.name)], acceleration.values)
    delay, delay_std = delay_s(spectra, 0)
    # in phase after the delay is turned back, else a delay would look like less mass
    mass = spectra.ratio(0, delay)
    if not math.isfinite(mass):
        raise AnalysisError(
            f"run {run_id}: acceleration", got="no motion", allowed="a moving tank", remedy="record it again"
        )
    return ApparentMass(mass, spectra.ratio_std(0, delay), delay, delay_std, run_id)


def identify_dry_mass(
    empty: Sequence[xr.Dataset],
    frozen: Sequence[xr.Dataset],
    *,
    liquid_mass_kg: float,
    force_names: Sequence[str] | None = None,
    acceleration_names: Sequence[str] | None = None,
) -> DryMass:
    """Dry mass, delay and, from both kinds of run, the gain of force over acceleration.

    Parameters
    ----------
    empty, frozen : sequence of xarray.Dataset
        Runs with `configuration` "empty" (no liquid) and "frozen" (the liquid's mass, not sloshing); at least
        one run altogether.
    liquid_mass_kg : float
        m_l of the frozen runs.
    force_names, acceleration_names : sequence of str, optional
        As for `apparent_mass`.

    Returns
    -------
    DryMass
        Empty alone: M = M_empty with g taken as 1. Frozen alone: M = M_frozen − m_l. Both:
        g = (M_frozen − M_empty)/m_l and M = M_empty/g.

    Raises
    ------
    AnalysisError
        If there is no run, a run is of another configuration, or a mass comes out ≤ 0.
    """
    if not (math.isfinite(liquid_mass_kg) and liquid_mass_kg > 0):
        raise AnalysisError("liquid_mass_kg", got=str(liquid_mass_kg), allowed="> 0")
    masses_empty = _apparent_masses(empty, "empty", force_names, acceleration_names)
    masses_frozen = _apparent_masses(frozen, "frozen", force_names, acceleration_names)
    everything = [*masses_empty, *masses_frozen]
    if not everything:
        raise AnalysisError(
            "dry mass",
            got="neither an empty nor a frozen run",
            allowed="at least one of them",
            remedy="record one, or state tank.dry_mass_kg in the rig",
        )
    # g and M cannot be told apart from one kind of run
    gain, gain_std = 1.0, math.nan
    if masses_empty and masses_frozen:
        apparent, apparent_std = _combined(masses_empty)
        loaded, loaded_std = _combined(masses_frozen)
        # the liquid was weighed: the only mass that is known without the sensors
        gain = (loaded - apparent) / liquid_mass_kg
        gain_std = math.hypot(loaded_std, apparent_std) / liquid_mass_kg
        _require_positive("gain of force over acceleration", gain)
        # M = M_e m_l/(M_f − M_e): ∂M/∂M_e = M_f m_l/(M_f − M_e)², ∂M/∂M_f = −M_e m_l/(M_f − M_e)²
        mass_std = math.hypot(loaded * apparent_std, apparent * loaded_std) / (gain**2 * liquid_mass_kg)
    elif masses_empty:
        apparent, mass_std = _combined(masses_empty)
    else:
        loaded, mass_std = _combined(masses_frozen)
        apparent = loaded - liquid_mass_kg
    _require_positive("dry mass", apparent)
    delay, delay_std = _combined_delay(everything)
    return DryMass(
        mass_kg=apparent / gain,
        mass_std_kg=mass_std,
        apparent_mass_kg=apparent,
        delay_s=delay,
        delay_std_s=delay_std,
        gain_ratio=gain,
        gain_ratio_std=gain_std,
        source_runs=tuple(identification.run_id for identification in everything),
    )


def check_signs(recording: xr.Dataset, rig: Rig | None = None) -> None:
    """Refuse a recording in which a force cell or an accelerometer is connected the wrong way round.

    Accelerometers of one rigid tank must move together. Every force cell must then push upward while the tank
    accelerates upward, because it moves a mass: its apparent mass is positive.

    Parameters
    ----------
    recording : xarray.Dataset
        Any run in which the tank moves.
    rig : Rig, optional
        States the expected total in the message.

    Raises
    ------
    AnalysisError
        Naming the channel, what it shows and the remedy. When all force channels are against the
        acceleration, the acceleration is named as the likelier culprit.
    """
    # accelerometers first: a force can only be judged against an acceleration whose sign is right
    redundant = redundant_accelerometers(recording)
    if len(redundant) > 1:
        require_equal_signs(agreement(recording, redundant))
    forces = force_channels(recording)
    masses = _apparent_mass_per_channel(recording, forces)
    negative = [name for name, mass in masses.items() if mass < 0]
    if not negative:
        return
    found = ", ".join(f"apparent mass {masses[name]:+.3g} kg on {name}" for name in forces)
    expected = "" if rig is None else f", {rig.tank.dry_mass_kg + rig.liquid_mass_kg:.3g} kg in all"
    # all cells wrong at once is less likely than one acceleration
    if len(negative) == len(forces):
        accelerometers = ", ".join(redundant or acceleration_channels(recording))
        what = f"{accelerometers} (or {', '.join(forces)})"
        remedy = f"set sign = -1 for {accelerometers} in the channel map; for the forces if those are wrong"
    else:
        what = ", ".join(negative)
        remedy = f"set sign = -1 for {what} in the channel map"
    raise AnalysisError(
        f"{what}: sign",
        got=found.replace("-", "−"),
        allowed=f"positive apparent masses (upward positive){expected}",
        remedy=remedy,
    )


def _apparent_mass_per_channel(recording: xr.Dataset, forces: Sequence[str]) -> dict[str, float]:
    """In-phase force per acceleration of each force channel [kg], as a force on the tank."""
    spectra = block_spectra(recording, forces, mean_acceleration(recording).values)
    return {
        name: force_sign(recording[name]) * spectra.ratio(i, delay_s(spectra, i)[0])
        for i, name in enumerate(forces)
    }


def _apparent_masses(
    recordings: Sequence[xr.Dataset],
    configuration: Literal["empty", "frozen"],
    force_names: Sequence[str] | None,
    acceleration_names: Sequence[str] | None,
) -> list[ApparentMass]:
    for recording in recordings:
        got = recording.attrs.get("configuration")
        if got != configuration:
            run_id = recording.attrs.get("run_id", "unnamed")
            raise AnalysisError(f"run {run_id}: configuration", got=repr(got), allowed=repr(configuration))
    return [apparent_mass(recording, force_names, acceleration_names) for recording in recordings]


def w_bar_bias_of_delay(dry: DryMass, rig: Rig, *, frequency_hz: float) -> float:
    """W̄ that a delay of force behind acceleration feigns.

    Parameters
    ----------
    dry : DryMass
        With the delay τ.
    rig : Rig
        With the liquid.
    frequency_hz : float
        Ω/2π.

    Returns
    -------
    float
        Positive for a force that comes late: then the inertia force seems to take work from the tank.

    Notes
    -----
    The force (M_dry + m_l) ü of a mass, later by τ, has W = π (M_dry + m_l) (Ωu₀)² sin Ωτ in a cycle, so that
    W̄ = π Ωτ (M_dry + m_l)/m_l to first order in Ωτ.
    """
    # the whole inertia on the cells, not the liquid's: a small delay of a heavy tank feigns much work
    total = dry.mass_kg + rig.liquid_mass_kg
    return math.pi * 2 * math.pi * frequency_hz * dry.delay_s * total / rig.liquid_mass_kg


def _combined(masses: Sequence[ApparentMass]) -> tuple[float, float]:
    """Mean over runs; its standard deviation from the runs' own or their scatter, whichever is larger."""
    values = np.array([mass.mass_kg for mass in masses])
    # the blocks of one run do not know what differs from run to run
    within = math.sqrt(sum(mass.mass_std_kg**2 for mass in masses)) / len(masses)
    between = float(values.std(ddof=1)) / math.sqrt(values.size) if values.size > 1 else 0.0
    return float(values.mean()), max(within, between)


def _combined_delay(masses: Sequence[ApparentMass]) -> tuple[float, float]:
    values = np.array([mass.delay_s for mass in masses])
    within = math.sqrt(sum(mass.delay_std_s**2 for mass in masses)) / len(masses)
    between = float(values.std(ddof=1)) / math.sqrt(values.size) if values.size > 1 else 0.0
    return float(values.mean()), max(within, between)


def _require_positive(what: str, value: float) -> None:
    if value <= 0:
        raise AnalysisError(
            what,
            got=f"{value:.3g}",
            allowed="> 0",
            remedy="check the signs of forces and accelerations, and that the runs are of this rig",
        )
