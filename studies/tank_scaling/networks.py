"""A model of the training tank in the other tanks, scaled by the law, beside what is computed there."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from acquisition.virtual_laboratory.shaker import STROKE_LIMIT_M
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.tank_scaling import model_for_tank
from sloshlab.rig import Liquid, Rig, Tank
from studies.tank_scaling.campaign import Run
from studies.tank_scaling.changes import measured
from studies.tank_scaling.harmonic_runs import Point
from studies.tank_scaling.similarity import (
    FILL_LEVEL,
    SURFACE_TENSION_N_PER_M,
    TRAINING_TANK,
    WATER,
    SimilarTank,
)
from studies.tank_scaling.varied_motion import SAMPLES_PER_TIME_SCALE, VariedRun, u_bar, velocity_and_acceleration

FloatArray = NDArray[np.float64]

BAND_OMEGA_BAR: Final = 10.0
"""Of the comparison in time: beyond the motion's frequencies, below the splashes, which no motion decides."""
LARGEST_U_BAR: Final = STROKE_LIMIT_M / TRAINING_TANK.height_m
"""Beyond the stroke of the shaker no model was trained."""
_STEADY_CYCLES: Final = 20


@dataclass(frozen=True)
class ModelError:
    """A scaled model beside the computed force of a tank of that size.

    Only motion within the stroke of the shaker that the model was trained on counts.

    Attributes
    ----------
    size : float
    force_rms : float
        Of model − computed over the rms of the computed force, in the varied motion, up to `BAND_OMEGA_BAR`.
    other_seed_rms : float
        The same of another computation of the motion: what the motion does not decide; NaN where there is none.
    energy : float
        Energy of the whole varied motion, model over computed, less one.
    w_bar_rms, beta_rms : float
        Root mean square of model − computed over the points: of W̄ over the rms of the computed one, of β.
    """

    size: float
    force_rms: float
    other_seed_rms: float
    energy: float
    w_bar_rms: float
    beta_rms: float


def rig_of_size(size: float) -> Rig:
    """The rig of a tank of the study, as `sloshlab simulate` would have it.

    Parameters
    ----------
    size : float
        λ.
    """
    # the mass of the empty tank does not enter the scaling
    sides = (TRAINING_TANK.height_m, TRAINING_TANK.length_m, TRAINING_TANK.depth_m)
    height, length, width = (side * size for side in sides)
    liquid = Liquid(
        density_kg_per_m3=WATER.density_kg_per_m3,
        fill_level=FILL_LEVEL,
        kinematic_viscosity_m2_per_s=WATER.viscosity_m2_per_s,
        surface_tension_n_per_m=SURFACE_TENSION_N_PER_M,
    )
    return Rig(tank=Tank(height_m=height, length_m=length, width_m=width, dry_mass_kg=1.0), liquid=liquid)


def model_for(model: ReducedOrderModel, size: float) -> ReducedOrderModel:
    """The model by the law; the training tank's is the model itself.

    Parameters
    ----------
    model : ReducedOrderModel
        Whose facts tell the tank of its training.
    size : float
    """
    return model_for_tank(model, rig_of_size(size))[0]


def model_errors(
    model: ReducedOrderModel,
    results: Mapping[Run, Mapping[str, Any]],
    points: Sequence[Point],
    sizes: Sequence[float],
) -> list[ModelError]:
    """Compare a model with what was computed.

    Parameters
    ----------
    model : ReducedOrderModel
    results : mapping
        Of `campaign.compute`.
    points : sequence of Point
    sizes : sequence of float
        With varied motion of one seed at least.
    """
    return [_of_size(model_for(model, size), results, points, size) for size in sizes]


def _of_size(
    model: ReducedOrderModel, results: Mapping[Run, Mapping[str, Any]], points: Sequence[Point], size: float
) -> ModelError:
    tank = SimilarTank(size)
    computed = [
        np.array(result["dynamic_force"])
        for run, result in results.items()
        if isinstance(run, VariedRun) and run.tank == tank
    ]
    times = np.arange(min(force.size for force in computed)) / SAMPLES_PER_TIME_SCALE
    computed = [force[: times.size] for force in computed]
    own = simulated(model, tank, times)
    own_of_band = in_band(np.nan_to_num(own))
    known = np.isfinite(own) & (u_bar(times) <= LARGEST_U_BAR)
    of_band, own_of_band = [in_band(force)[known] for force in computed], own_of_band[known]
    velocity = velocity_and_acceleration(times)[0][known]
    size_of_force = _rms(np.concatenate(of_band))
    within = [point for point in points if point.u_bar <= LARGEST_U_BAR]
    steady = [(measured(results, point, size), steady_state(model, tank, point)) for point in within]
    return ModelError(
        size,
        _rms(np.concatenate([own_of_band - force for force in of_band])) / size_of_force,
        _rms(of_band[0] - of_band[1]) / size_of_force if len(of_band) > 1 else math.nan,
        float(own[known] @ velocity / np.mean([force[known] @ velocity for force in computed])) - 1,
        _rms(np.array([w_bar - found.w_bar.value for found, (w_bar, _) in steady]))
        / _rms(np.array([found.w_bar.value for found, _ in steady])),
        _rms(np.array([beta - found.beta.value for found, (_, beta) in steady])),
    )


def simulated(model: ReducedOrderModel, tank: SimilarTank, times: FloatArray) -> FloatArray:
    """Δf over m_l g of a model of that tank in the varied motion, at times over √(h/g); NaN where not known.

    Parameters
    ----------
    model : ReducedOrderModel
        In the units of the tank.
    tank : SimilarTank
    times : ndarray
    """
    own_times = np.arange(int(times[-1] * tank.time_scale_s * model.sampling_rate_hz) + 2) / model.sampling_rate_hz
    velocity = velocity_and_acceleration(own_times / tank.time_scale_s)[0] * tank.velocity_scale_m_per_s
    force = model.simulate(velocity) / (rig_of_size(tank.size).liquid_mass_kg * GRAVITY_M_PER_S2)
    return np.interp(times, own_times / tank.time_scale_s, force)


def steady_state(model: ReducedOrderModel, tank: SimilarTank, point: Point) -> tuple[float, float]:
    """W̄ and β of a model in harmonic motion, by whole cycles.

    Parameters
    ----------
    model : ReducedOrderModel
        In the units of the tank.
    tank : SimilarTank
    point : Point
    """
    omega = point.omega_bar / tank.time_scale_s
    speed = point.level_g * GRAVITY_M_PER_S2 / omega
    waiting = model.delays.longest + 1
    # a rate at which cycles are whole numbers of samples would resample the delays: the last sample counts in part
    # instead
    n_cycle = 2 * math.pi / omega * model.sampling_rate_hz
    phase = omega * (np.arange(waiting + math.ceil(_STEADY_CYCLES * n_cycle)) / model.sampling_rate_hz)
    force = model.simulate(speed * np.sin(phase))[waiting:]
    phase = phase[waiting:]
    weights = np.ones(phase.size)
    weights[-1] = _STEADY_CYCLES * n_cycle - (phase.size - 1)
    mass = rig_of_size(tank.size).liquid_mass_kg
    mean = float(np.average(force * np.sin(phase), weights=weights)) * speed
    in_phase = 2 * float(np.average(force * np.cos(phase), weights=weights))
    return -mean * 2 * math.pi / omega / (mass * speed**2), -in_phase / (mass * speed * omega)


def in_band(force: FloatArray) -> FloatArray:
    """A force of the varied motion up to `BAND_OMEGA_BAR`, without delay.

    Parameters
    ----------
    force : ndarray
        `SAMPLES_PER_TIME_SCALE` samples in √(h/g).
    """
    low_pass = butter(4, BAND_OMEGA_BAR / (2 * math.pi), fs=SAMPLES_PER_TIME_SCALE, output="sos")
    return np.asarray(sosfiltfilt(low_pass, force), np.float64)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
