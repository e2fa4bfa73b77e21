"""Virtual experiments in which a structure carries the tank: sloshing beam and guided tank.

The liquid is that of the numerical tank, as particles or with its gas; structure and liquid move each other. A
free run starts when the deflected structure is let go; a random run is moved at the root of the beam.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from acquisition.numerical_tank.carried_tank import FrozenTank
from acquisition.numerical_tank.computed_force import ComputedForce
from acquisition.numerical_tank.coupled_checkpoint import CARRIED_PARTICLES
from acquisition.numerical_tank.instability import STOPPED
from acquisition.numerical_tank.sampling import LEAST_OVERSAMPLING
from acquisition.numerical_tank.structures import Structure
from acquisition.numerical_tank.tank import TankSetup
from acquisition.two_phase_tank.method import CARRIED_LIQUID_AND_GAS
from acquisition.two_phase_tank.setup import GridNumerics, TwoPhaseSetup
from acquisition.virtual_laboratory.base_motion import RandomBaseMotion
from acquisition.virtual_laboratory.numerical_liquid import (
    NumericalLiquid,
    method_attributes,
    numerical_setup,
    two_phase_attributes,
    two_phase_setup,
)
from acquisition.virtual_laboratory.shaker_run import START_TIME_UTC
from acquisition.virtual_laboratory.structure_channels import readings_of, recording_of, true_values
from acquisition.virtual_laboratory.structure_computation import (
    StructureTask,
    computed_structure,
    n_steps_of,
    sampled_from_release,
)
from acquisition.virtual_laboratory.structure_rig import (
    StructureLaboratory,
    StructureRig,
    described_structure,
    structure_rig,
)
from sloshlab.configurations import CONFIGURATIONS, SLOSHING
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import InputError
from sloshlab.experiments import EXPERIMENTS, experiment_names
from sloshlab.rig import Rig

FloatArray = NDArray[np.float64]
SPECTRUM_WIDTH_HZ: Final = 10.0
"""σ of (2.30), which the source does not tell."""

_SOUND_OVER_SPEED: Final = 10.0
_COLUMN_OVER_STRUCTURE: Final = 2.0
"""Quarter-wave resonance c₀/4h of the liquid column over the highest natural frequency of the structure."""
_LARGEST_SPEED_M_PER_S: Final = 10.0
_LEAST_DAMPING_RATIO: Final = 0.02  # as a sloshing liquid gives
_LARGEST_PHASE_PER_STEP: Final = 0.4
"""ω Δt of the fastest mode with liquid and gas, whose own steps are longer: the leapfrog is 0.7 % too fast."""
_LARGEST_SAMPLES: Final = 500_000
"""So that a checkpoint, which holds all that was computed, stays below 200 MB."""


@dataclass(frozen=True)
class _Plan:
    """The experiment before the liquid is known."""

    rig: StructureRig
    initial_displacement_m: float
    base: RandomBaseMotion | None

    def base_in_steps(self, n_steps: int) -> tuple[FloatArray, FloatArray]:
        """Acceleration and displacement of the base in the middle of so many steps of the whole run."""
        if self.base is None:
            return np.zeros(n_steps), np.zeros(n_steps)
        return self.base.in_middle_of_steps(n_steps)


def virtual_structure_run(
    rig: Rig,
    *,
    experiment: str,
    configuration: str = "sloshing",
    numerical: NumericalLiquid | None = None,
    duration_s: float | None = None,
    initial_displacement_m: float | None = None,
    rms_g: float = 0.2,
    spectrum_width_hz: float = SPECTRUM_WIDTH_HZ,
    sampling_rate_hz: float = 1024.0,
    speed_of_sound_m_per_s: float | None = None,
    seed: int = 0,
    laboratory: StructureLaboratory | None = None,
    imperfect: bool = True,
    run_id: str | None = None,
    rig_name: str = "rig.toml",
    repeat: int = 1,
    start_time_utc: str = START_TIME_UTC,
) -> xr.Dataset:
    """Record one run of the virtual beam or guided tank.

    Parameters
    ----------
    rig : Rig
        Tank, liquid and structure as believed.
    experiment : {'beam_free', 'beam_random', 'sdof_free'}
        Free decay of the beam, its response to random motion of the root, free decay of the guided tank.
    configuration : {'sloshing', 'frozen', 'empty'}
        What the tank holds.
    numerical : NumericalLiquid, optional
        Resolution, checkpoint and progress of the computed liquid.
    duration_s : float, optional
        By default 8 s, 90 s and 6 s.
    initial_displacement_m : float, optional
        Static deflection of the tank, upward positive, let go at t = 0; by default −14.6 mm (the beam) and
        64 mm. Free runs only.
    rms_g, spectrum_width_hz : float
        Root mean square of the acceleration of the root over g, and σ of its spectrum (2.30) about the first
        mode. Random runs only.
    sampling_rate_hz : float
        A whole number of steps makes a sample; all channels pass one filter of zero phase.
    speed_of_sound_m_per_s : float, optional
        Of the liquid as particles; by default what the Notes say, 25 m/s for the beam, and not less than 12 m/s.
    seed : int
        Of everything that differs between repeats.
    laboratory : StructureLaboratory, optional
        Gains and true values; by default the rig is as told.
    imperfect : bool
        If false the sensors have no noise.
    run_id, rig_name, repeat, start_time_utc
        Global attributes.

    Returns
    -------
    xarray.Dataset
        In the recording format, upward positive, without static weight. It is shorter than asked for, and its
        attribute `numerical_tank_stopped` says why, if the computation became unstable.

    Raises
    ------
    InputError
        If an argument is out of range or does not fit the rig.
    ComputationInterruptedError
        At Ctrl-C or SIGTERM while the liquid is computed with a checkpoint.

    Notes
    -----
    `force_interface` is the force of the structure on the tank, M_dry ü − F_S; `displacement_tank` that of the
    tank in the laboratory.

    The speed of sound is at least ten times the largest speed of the tank, foretold without sloshing and in
    random runs with damping ratios of 2 % at least. Besides, the liquid column must not resonate with the
    structure as no real one does: its c₀/4h is twice the highest natural frequency. At 12 m/s it meets the
    third mode of the beam, shatters the liquid at the release and takes a quarter of the first cycles'
    amplitude; from 18 m/s on they no longer depend on c₀. Liquid and gas on a grid are not compressed.

    Examples
    --------
    >>> text = "[tank]\\nheight_m=0.06\\nlength_m=0.1\\nwidth_m=0.06\\ndry_mass_kg=2.061\\n"
    >>> text += "[liquid]\\ndensity_kg_per_m3=1000.0\\nfill_level=0.5\\n"
    >>> text += "[structure]\\nkind='sdof'\\nmass_kg=2.061\\nstiffness_n_per_m=3808.8\\n"
    >>> run = virtual_structure_run(
    ...     Rig.from_toml_text(text), experiment="sdof_free", configuration="frozen", duration_s=0.5
    ... )
    >>> sorted(str(name) for name in run.data_vars)
    ['acceleration_tip', 'displacement_tank', 'force_interface']
    """
    _check(experiment, configuration, seed, rig)
    duration_s = EXPERIMENTS[experiment].virtual_defaults["duration_s"] if duration_s is None else duration_s
    numerical = numerical or NumericalLiquid()
    truth = laboratory or StructureLaboratory.perfect(rig)
    n_samples = _n_samples(duration_s, sampling_rate_hz)
    setup = _setup(rig, truth, numerical, seed=seed, sampling_rate_hz=sampling_rate_hz)
    plan = _plan(
        rig,
        truth,
        experiment,
        initial_displacement_m=initial_displacement_m,
        rms_g=rms_g,
        width_hz=spectrum_width_hz,
        # of the steps beyond the last sample as well, which the filter needs
        period_s=n_steps_of(setup, n_samples) * setup.step_s,
        seed=seed,
    )
    setup = _for_speed(setup, plan, _largest_speed_m_per_s(plan, setup, duration_s), speed_of_sound_m_per_s)
    base_m_per_s2, base_m = plan.base_in_steps(n_steps_of(setup, n_samples))
    task = StructureTask(
        setup,
        plan.rig.structure,
        base_m_per_s2,
        plan.initial_displacement_m,
        configuration,
        n_samples,
        CARRIED_LIQUID_AND_GAS if numerical.with_gas else CARRIED_PARTICLES,
    )
    computed = computed_structure(task, checkpoint=numerical.checkpoint, progress=numerical.progress)
    if numerical.finished is not None:
        numerical.finished(ComputedForce(computed.liquid_force_n, computed.computing_s, computed.stopped))
    if not computed.liquid_force_n.size:
        raise InputError("numerical tank: not one sample", got=computed.stopped)
    n_valid = computed.liquid_force_n.size
    base = [sampled_from_release(values, setup, n_samples)[:n_valid] for values in (base_m_per_s2, base_m)]
    truths = true_values(plan.rig, computed, base[0], base[1])
    readings = readings_of(truths, truth, seed=seed, noisy=imperfect)
    is_free = EXPERIMENTS[experiment].moves == "release"
    amplitude = f"{1000 * plan.initial_displacement_m:.1f}mm" if is_free else f"{rms_g:.2f}g"
    attributes: dict[str, Any] = {
        "sloshlab_format": "1",
        "run_id": run_id or f"virtual_{experiment}_{configuration}_{amplitude}_seed{seed}",
        "experiment": experiment,
        "configuration": configuration,
        "rig": rig_name,
        "sampling_rate_hz": float(sampling_rate_hz),
        "start_time_utc": start_time_utc,
        "repeat": int(repeat),
        **_experiment_attributes(plan, rms_g),
        **(_method_attributes(setup) if configuration == SLOSHING else {"liquid": configuration, "seed": seed}),
        **({STOPPED: computed.stopped} if computed.stopped else {}),
    }
    return recording_of(readings, plan.rig, sampling_rate_hz, attributes)


def _check(experiment: str, configuration: str, seed: int, rig: Rig) -> None:
    for what, got, allowed in (
        ("experiment", experiment, experiment_names(lambda known: bool(known.structure))),
        ("configuration", configuration, CONFIGURATIONS),
    ):
        if got not in allowed:
            raise InputError(what, got=repr(got), allowed=", ".join(allowed))
    kind, wanted = described_structure(rig).kind, EXPERIMENTS[experiment].structure
    if kind != wanted:
        raise InputError("rig: structure.kind", got=repr(kind), allowed=f"{wanted!r} for {experiment}")
    if seed < 0:
        raise InputError("seed", got=str(seed), allowed="≥ 0")


def _n_samples(duration_s: float, sampling_rate_hz: float) -> int:
    if not 100 <= sampling_rate_hz <= 1e5:
        raise InputError("sampling_rate_hz", got=f"{sampling_rate_hz:g}", allowed="100 … 1e5")
    if not 0.1 <= duration_s <= 3600:
        raise InputError("duration_s", got=f"{duration_s:g}", allowed="0.1 … 3600")
    n_samples = round(duration_s * sampling_rate_hz)
    if n_samples > _LARGEST_SAMPLES:
        raise InputError("length of the run", got=f"{n_samples} samples", allowed=f"≤ {_LARGEST_SAMPLES}")
    return n_samples


def _setup(
    rig: Rig, truth: StructureLaboratory, numerical: NumericalLiquid, *, seed: int, sampling_rate_hz: float
) -> TankSetup | TwoPhaseSetup:
    """The tank as it is computed, but for the speed of sound of particles."""
    finely = numerical.layers_per_height
    if not numerical.with_gas:
        return numerical_setup(rig, layers_per_height=finely, seed=seed, sampling_rate_hz=sampling_rate_hz)
    fastest_hz = float(structure_rig(rig, truth).structure.natural_frequencies_hz()[-1])
    # no fewer steps in a sample than the filter wants that makes samples of them
    longest_s = min(
        _LARGEST_PHASE_PER_STEP / (2 * math.pi * fastest_hz),
        1 / (LEAST_OVERSAMPLING * sampling_rate_hz),
        GridNumerics().longest_step_s,
    )
    return two_phase_setup(
        rig,
        cells_per_height=finely,
        seed=seed,
        sampling_rate_hz=sampling_rate_hz,
        longest_step_s=longest_s,
        walls=numerical.walls,
    )


def _method_attributes(setup: TankSetup | TwoPhaseSetup) -> dict[str, Any]:
    """Global attributes that tell how the liquid was computed."""
    return two_phase_attributes(setup) if isinstance(setup, TwoPhaseSetup) else method_attributes(setup)


def _plan(
    rig: Rig,
    truth: StructureLaboratory,
    experiment: str,
    *,
    initial_displacement_m: float | None,
    rms_g: float,
    width_hz: float,
    period_s: float,
    seed: int,
) -> _Plan:
    true_rig = structure_rig(rig, truth)
    if EXPERIMENTS[experiment].moves == "root":
        if initial_displacement_m:
            raise InputError(
                "initial_displacement_m", got=f"{initial_displacement_m:g}", allowed="0 in a random run"
            )
        centre_hz = described_structure(rig).frequencies_hz[0]
        return _Plan(
            true_rig, 0.0, RandomBaseMotion(period_s, rms_g * GRAVITY_M_PER_S2, centre_hz, width_hz, seed)
        )
    default_m = EXPERIMENTS[experiment].virtual_defaults["initial_displacement_m"]
    wanted = default_m if initial_displacement_m is None else initial_displacement_m
    if not (math.isfinite(wanted) and wanted != 0):
        raise InputError("initial_displacement_m", got=f"{wanted}", allowed="a finite number other than 0")
    return _Plan(true_rig, float(wanted), None)


def _largest_speed_m_per_s(plan: _Plan, setup: TankSetup | TwoPhaseSetup, duration_s: float) -> float:
    """Largest speed of the tank relative to the root, without sloshing."""
    # damped as little as a beam without sloshing is, a random run would ask for far too fast a sound
    structure = plan.rig.structure if plan.base is None else _damped(plan.rig.structure)
    frozen_mass_kg = setup.liquid_mass_kg
    fastest_hz = structure.with_mass_at_tank(frozen_mass_kg).natural_frequencies_hz()[-1]
    # after a release the first cycles are the fastest
    period_s = min(duration_s, 1.0) if plan.base is None else plan.base.duration_s
    # twenty steps in a cycle of the fastest mode, far from where the leapfrog becomes unstable
    n_steps = math.ceil(period_s * 20 * fastest_hz)
    carried = FrozenTank(frozen_mass_kg, structure, period_s / n_steps)
    carried.deflect(plan.initial_displacement_m)
    history = carried.advance(plan.base_in_steps(n_steps)[0])
    return float(np.abs(history.tank_velocity_m_per_s).max())


def _damped(structure: Structure) -> Structure:
    """The structure with damping ratios of 2 % at least, as a sloshing liquid gives them."""
    modes = tuple(
        replace(
            mode,
            damping_kg_per_s=max(
                mode.damping_kg_per_s, 2 * _LEAST_DAMPING_RATIO * math.sqrt(mode.stiffness_n_per_m * mode.mass_kg)
            ),
        )
        for mode in structure.modes
    )
    return replace(structure, modes=modes)


def _for_speed(
    setup: TankSetup | TwoPhaseSetup, plan: _Plan, speed_m_per_s: float, wanted_m_per_s: float | None
) -> TankSetup | TwoPhaseSetup:
    """The tank for the largest speed of the experiment: particles with a sound that suits it."""
    if not speed_m_per_s <= _LARGEST_SPEED_M_PER_S:
        raise InputError(
            "speed of the tank",
            got=f"{speed_m_per_s:.3g} m/s",
            allowed=f"at most {_LARGEST_SPEED_M_PER_S:g} m/s",
            remedy="deflect or shake it less",
        )
    if isinstance(setup, TwoPhaseSetup):
        if wanted_m_per_s is not None:
            raise InputError(
                "speed_of_sound_m_per_s",
                got=f"{wanted_m_per_s:g} for liquid and gas on a grid",
                allowed="none: they are not compressed",
            )
        return setup
    return _with_sound(setup, plan, speed_m_per_s, wanted_m_per_s)


def _with_sound(setup: TankSetup, plan: _Plan, speed_m_per_s: float, wanted_m_per_s: float | None) -> TankSetup:
    """The tank with a speed of sound that suits the experiment."""
    least = _SOUND_OVER_SPEED * speed_m_per_s
    if wanted_m_per_s is not None and not wanted_m_per_s >= least:
        raise InputError(
            "speed_of_sound_m_per_s",
            got=f"{wanted_m_per_s:g}",
            allowed=f"at least {least:.3g}, ten times the largest speed of the tank",
        )
    depth_m = setup.column.height_m
    frozen = plan.rig.structure.with_mass_at_tank(setup.liquid_mass_kg)
    # a column of liquid whose quarter wave meets a mode shatters at the release: at 12 m/s, 220 Hz, it met the
    # third mode of the beam
    stiff = 4 * depth_m * _COLUMN_OVER_STRUCTURE * float(frozen.natural_frequencies_hz()[-1])
    still = _SOUND_OVER_SPEED * math.sqrt(setup.gravity_m_per_s2 * depth_m)
    chosen = float(math.ceil(max(setup.liquid.speed_of_sound_m_per_s, least, still, stiff)))
    sound = chosen if wanted_m_per_s is None else float(wanted_m_per_s)
    return replace(setup, liquid=replace(setup.liquid, speed_of_sound_m_per_s=sound))


def _experiment_attributes(plan: _Plan, rms_g: float) -> dict[str, Any]:
    if plan.base is None:
        return {"initial_displacement_m": plan.initial_displacement_m}
    return {
        "acceleration_rms_g": float(rms_g),
        "spectrum_centre_hz": float(plan.base.centre_hz),
        "spectrum_width_hz": float(plan.base.width_hz),
    }
