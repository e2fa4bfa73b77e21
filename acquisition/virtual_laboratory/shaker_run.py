"""One run of the virtual shaker, from the rig description to a recording."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from acquisition.virtual_laboratory.liquid_force import LiquidForce
from acquisition.virtual_laboratory.sensors import LOST_COUNT, Laboratory
from acquisition.virtual_laboratory.shaker import (
    STROKE_LIMIT_M,
    Imperfections,
    Kinematics,
    Law,
    Motion,
    SweepPlan,
    shaken,
)
from acquisition.virtual_laboratory.shaker_channels import readings_of, recording_of
from acquisition.virtual_laboratory.tone_motion import Accelerated, TankMotion, random_motion, two_tone_motion
from sloshlab.configurations import CONFIGURATIONS, EMPTY, FROZEN
from sloshlab.errors import InputError
from sloshlab.experiments import EXPERIMENTS, experiment_names
from sloshlab.recording import write_recording
from sloshlab.rig import Rig

if TYPE_CHECKING:  # its compiled loops take a second to load; a liquid that follows its law needs none of them
    from acquisition.virtual_laboratory.numerical_liquid import NumericalLiquid

FloatArray = NDArray[np.float64]
TONES: Final = {"shaker_random": random_motion, "shaker_two_tone": two_tone_motion}
SWEEP_LAWS: Final = ("octave", "linear", "stepped")
LAW_OF_EXPERIMENT: Final[dict[str, Law]] = {"shaker_vfa": "vfa", "sudden_start": "constant"}
"""Experiments whose law cannot be chosen."""
START_TIME_UTC = "2026-01-12T09:00:00Z"
_LARGEST_SAMPLES = 50_000_000


@dataclass(frozen=True)
class VirtualShaker:
    """The truth behind one run: what no recording holds.

    Attributes
    ----------
    motion : Motion
        True motion of the tank.
    liquid : LiquidForce or None
        True force of the liquid; None for an empty tank.
    dry_mass_kg : float
        True M_dry.
    """

    motion: Motion
    liquid: LiquidForce | None
    dry_mass_kg: float

    def external_force_n(self, time_s: FloatArray, kinematics: Kinematics | None = None) -> FloatArray:
        """F_ext = M_dry ü − F_S (1.6) [N], upward positive, without the weight.

        `kinematics` is ``motion.at(time_s)`` where it is known already.
        """
        moved = kinematics or self.motion.at(time_s)
        inertia = self.dry_mass_kg * moved.acceleration
        return inertia if self.liquid is None else inertia - self.liquid.force_n(time_s, moved)


def virtual_shaker(
    rig: Rig,
    plan: SweepPlan,
    *,
    configuration: str = "sloshing",
    seed: int = 0,
    imperfect: bool = True,
    laboratory: Laboratory | None = None,
) -> VirtualShaker:
    """The truth of the run that `virtual_shaker_run` records for the same arguments."""
    truth = laboratory or Laboratory.perfect()
    # numbered streams of one seed: motion 1, sensors 2, so that noise does not change with what the motion draws
    generator = np.random.default_rng([seed, 1])
    motion = shaken(plan, Imperfections.drawn(generator) if imperfect else None)
    liquid = None
    if configuration != EMPTY:
        liquid = LiquidForce(motion, rig, seed=int(generator.integers(2**31)), frozen=configuration == FROZEN)
    return VirtualShaker(motion, liquid, rig.tank.dry_mass_kg * truth.dry_mass_factor)


def virtual_shaker_run(
    rig: Rig,
    *,
    experiment: str = "shaker_sweep",
    configuration: str = "sloshing",
    acceleration_g: float = 3.0,
    direction: Literal["up", "down"] = "up",
    law: Law = "octave",
    start_hz: float = 5.0,
    stop_hz: float = 20.0,
    duration_s: float = 240.0,
    n_steps: int = 24,
    stroke_limit_m: float = STROKE_LIMIT_M,
    sampling_rate_hz: float = 512.0,
    seed: int = 0,
    laboratory: Laboratory | None = None,
    imperfect: bool = True,
    lost: tuple[float, int] | None = None,
    n_clipped: int = 0,
    run_id: str | None = None,
    rig_name: str = "rig.toml",
    repeat: int = 1,
    start_time_utc: str = START_TIME_UTC,
    numerical: NumericalLiquid | None = None,
) -> xr.Dataset:
    """Record one run of the virtual shaker.

    Parameters
    ----------
    rig : Rig
        Tank and liquid as believed; the fill level chooses the liquid's law.
    experiment : {'shaker_sweep', 'shaker_vfa', 'sudden_start', 'shaker_random', 'shaker_two_tone'}
        A VFA run (frequency and amplitude both vary) ignores `law` and `direction`; a sudden start, from
        rest to `acceleration_g` at `start_hz` at once, also ignores `stop_hz`. Random motion has its band
        between `start_hz` and `stop_hz` and an RMS of `acceleration_g`; two tones have these frequencies,
        each with this amplitude. Both need a computed liquid.
    configuration : {'sloshing', 'frozen', 'empty'}
        What the tank holds.
    acceleration_g : float
        Amplitude in g where the stroke limit allows it; of a VFA run the largest.
    direction : {'up', 'down'}
        From `start_hz` to `stop_hz` or back.
    law : {'octave', 'linear', 'stepped'}
        How the frequency goes.
    start_hz, stop_hz, duration_s, n_steps, sampling_rate_hz : float
        Of the sweep and of the recorder; `n_steps` of a stepped run.
    stroke_limit_m : float
        Largest displacement of the shaker; by default that of the source's, 12.5 mm.
    seed : int
        Of everything that differs between repeats.
    laboratory : Laboratory, optional
        Gains and true dry mass; by default the rig is as told.
    imperfect : bool
        If false the shaker keeps its law and the sensors have no noise; the liquid still scatters.
    lost : (float, int), optional
        Time in s and number of samples lost on all channels.
    n_clipped : int
        About so many samples of ``force_cell_1`` clipped.
    run_id, rig_name, repeat, start_time_utc
        Global attributes.
    numerical : NumericalLiquid, optional
        The liquid is computed instead of following its law.

    Returns
    -------
    xarray.Dataset
        In the recording format, values as the converter gives them, upward positive. It is shorter than
        asked for, and its attribute `numerical_tank_stopped` says why, if the computation became unstable.

    Raises
    ------
    InputError
        If an argument is out of range.
    ComputationInterruptedError
        At Ctrl-C while the liquid is computed with a checkpoint.

    Examples
    --------
    >>> tank = "[tank]\\nheight_m=0.0272\\nlength_m=0.1172\\nwidth_m=0.078\\ndry_mass_kg=0.61\\n"
    >>> rig = Rig.from_toml_text(tank + "[liquid]\\ndensity_kg_per_m3=1000.0\\nfill_level=0.5\\n")
    >>> run = virtual_shaker_run(rig, acceleration_g=1.0, duration_s=5.0)
    >>> run.sizes["time"], run.attrs["experiment"]
    (2560, 'shaker_sweep')
    """
    _check_choices(experiment, configuration, direction, law)
    _check_numbers(seed, n_clipped)
    if experiment in TONES and numerical is None:
        raise InputError("experiment", got=experiment, remedy="its liquid has no law; take a computed one")
    # one frequency only; the attributes of the recording tell it by equal ends of the sweep
    if experiment == "sudden_start":
        stop_hz = start_hz
    first, last = (start_hz, stop_hz) if direction == "up" else (stop_hz, start_hz)
    plan = SweepPlan(
        acceleration_g=acceleration_g,
        law=LAW_OF_EXPERIMENT.get(experiment, law),
        start_hz=first,
        stop_hz=last,
        duration_s=duration_s,
        n_steps=n_steps,
        stroke_limit_m=stroke_limit_m,
    )
    time_s = _sample_times(duration_s, sampling_rate_hz, max(start_hz, stop_hz))
    flags = _lost_samples(time_s, lost)
    truth = laboratory or Laboratory.perfect()
    if numerical is None:
        shaker = virtual_shaker(
            rig, plan, configuration=configuration, seed=seed, imperfect=imperfect, laboratory=truth
        )
        run = _run_by_law(shaker, time_s)
    else:
        motion = _numerical_motion(experiment, plan, seed, imperfect)
        liquid_force_n, method = numerical.force_n(
            rig, motion, configuration, sampling_rate_hz=sampling_rate_hz, seed=seed
        )
        dry_mass_kg = rig.tank.dry_mass_kg * truth.dry_mass_factor
        run = _computed_run(motion, time_s, liquid_force_n, dry_mass_kg, method)
        flags = flags[: run.time_s.size]
    readings = readings_of(
        run.external_force_n, run.motion, run.time_s, truth, seed=seed, noisy=imperfect, n_clipped=n_clipped
    )
    for its_reading in readings.values():
        its_reading.counts[flags] = LOST_COUNT
    attributes = {
        "sloshlab_format": "1",
        "run_id": run_id or f"virtual_{experiment}_{configuration}_{acceleration_g:.2f}g_seed{seed}",
        "experiment": EXPERIMENTS[experiment].recorded_as,
        "configuration": configuration,
        "rig": rig_name,
        "sampling_rate_hz": float(sampling_rate_hz),
        "start_time_utc": start_time_utc,
        "acceleration_g": float(acceleration_g),
        "repeat": int(repeat),
        **_plan_attributes(plan, experiment),
        **run.method,
    }
    return recording_of(run.time_s, readings, flags, attributes)


@dataclass(frozen=True)
class _Run:
    """Motion of the tank and force on it, at the samples."""

    time_s: FloatArray
    motion: Accelerated
    external_force_n: FloatArray
    method: dict[str, Any]


def _run_by_law(shaker: VirtualShaker, time_s: FloatArray) -> _Run:
    motion = shaker.motion.at(time_s)
    return _Run(time_s, motion, shaker.external_force_n(time_s, motion), {})


def _computed_run(
    motion: TankMotion, time_s: FloatArray, liquid_force_n: FloatArray, dry_mass_kg: float, method: dict[str, Any]
) -> _Run:
    # a computation that became unstable gives the samples that are valid
    valid_s = time_s[: liquid_force_n.size]
    moved = motion.at(valid_s)
    return _Run(valid_s, moved, dry_mass_kg * moved.acceleration - liquid_force_n, method)


def _check_choices(experiment: str, configuration: str, direction: str, law: str) -> None:
    for what, got, allowed in (
        ("experiment", experiment, experiment_names(lambda known: known.moves == "shaker")),
        ("configuration", configuration, CONFIGURATIONS),
        ("direction", direction, ("up", "down")),
        ("law", law, SWEEP_LAWS),
    ):
        if got not in allowed:
            raise InputError(what, got=repr(got), allowed=", ".join(allowed))


def _check_numbers(seed: int, n_clipped: int) -> None:
    if seed < 0:
        raise InputError("seed", got=str(seed), allowed="≥ 0")
    if not 0 <= n_clipped <= 1000:
        raise InputError("n_clipped", got=str(n_clipped), allowed="0 … 1000")


def write_virtual_run(run: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write a virtual run as scaled int16, compressed as far as zlib can.

    The same run gives the same bytes.

    Parameters
    ----------
    run : xarray.Dataset
        From `virtual_shaker_run` or `virtual_structure_run`.
    path : path-like
        The recording to write.
    """
    # in one chunk and at the highest level: the recordings are part of the repository
    squeeze = {"zlib": True, "complevel": 9, "shuffle": True, "chunksizes": (run.sizes["time"],)}
    encoding: dict[str, dict[str, Any]] = {str(name): dict(squeeze) for name in run.variables}
    for name, channel in run.data_vars.items():
        if "scale_factor" in channel.encoding:
            encoding[str(name)].update(
                dtype="int16", scale_factor=channel.encoding["scale_factor"], _FillValue=np.int16(LOST_COUNT)
            )
    # no time and no flag is ever missing
    encoding["time"]["_FillValue"] = None
    if "quality" in run:
        encoding["quality"]["_FillValue"] = None
    write_recording(run, path, encoding=encoding)


def _numerical_motion(experiment: str, plan: SweepPlan, seed: int, imperfect: bool) -> TankMotion:
    if experiment in TONES:
        make = TONES[experiment]
        return make(
            plan.acceleration_g,
            plan.start_hz,
            plan.stop_hz,
            plan.duration_s,
            seed=seed,
            stroke_limit_m=plan.stroke_limit_m,
        )
    generator = np.random.default_rng([seed, 1])
    return shaken(plan, Imperfections.drawn(generator, impact_phase_rad=None) if imperfect else None)


def _plan_attributes(plan: SweepPlan, experiment: str) -> dict[str, Any]:
    attributes: dict[str, Any] = {
        "sweep_start_hz": float(plan.start_hz),
        "sweep_stop_hz": float(plan.stop_hz),
        "sweep_law": plan.law,
        "sweep_duration_s": float(plan.duration_s),
    }
    if experiment in TONES:
        return {**attributes, "sweep_law": experiment.removeprefix("shaker_")}
    if plan.law == "octave":
        attributes["sweep_rate_octave_per_s"] = plan.rate_octave_per_s
    if plan.law == "linear":
        attributes["sweep_rate_hz_per_s"] = (float(plan.stop_hz) - float(plan.start_hz)) / float(plan.duration_s)
    return attributes


def _sample_times(duration_s: float, sampling_rate_hz: float, highest_hz: float) -> FloatArray:
    if not 10 * highest_hz <= sampling_rate_hz <= 1e6:
        raise InputError(
            "sampling_rate_hz",
            got=f"{sampling_rate_hz:g}",
            allowed=f"{10 * highest_hz:g} … 1e6",
            remedy="at least 10 samples per cycle are needed",
        )
    n_samples = round(duration_s * sampling_rate_hz)
    if n_samples > _LARGEST_SAMPLES:
        raise InputError("length of the run", got=f"{n_samples} samples", allowed=f"≤ {_LARGEST_SAMPLES}")
    return np.arange(n_samples) / sampling_rate_hz


def _lost_samples(time_s: FloatArray, lost: tuple[float, int] | None) -> NDArray[np.bool_]:
    flags = np.zeros(time_s.size, dtype=bool)
    if lost is not None:
        if not (0 <= lost[0] <= time_s[-1] and lost[1] >= 0):
            raise InputError(
                "lost", got=f"{lost[1]} samples from {lost[0]:g} s", allowed=f"within 0 … {time_s[-1]:g} s"
            )
        start = int(np.searchsorted(time_s, lost[0]))
        flags[start : start + int(lost[1])] = True
    return flags
