"""Work of a trained model in steady harmonic motion, as the maps of a ball have it (2.14–2.16)."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from sloshlab.errors import AnalysisError
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.rig import Rig

FloatArray = npt.NDArray[np.float64]

_N_CYCLES = 4


def model_work_j(model: ReducedOrderModel, amplitude_m: float, frequency_hz: float) -> float:
    """Work per cycle [J] of a model without feedback, positive = dissipated.

    Parameters
    ----------
    model : ReducedOrderModel
        Velocity [m/s] in, force on the tank [N] out.
    amplitude_m, frequency_hz : float
        Of the tank's motion.

    Raises
    ------
    AnalysisError
        If the model has feedback: it may never settle.

    Notes
    -----
    A cycle is no whole number of the model's samples. The model is asked at as many phases as a cycle has samples,
    each with its own delay line at the model's rate, which makes the mean one over equal steps of the phase.
    """
    if model.has_feedback or model.agitation is not None:
        raise AnalysisError("work of a model in harmonic motion", got="one with feedback", allowed="NFIR")
    speed = 2 * math.pi * frequency_hz * amplitude_m
    n = max(_N_CYCLES * math.ceil(model.sampling_rate_hz / frequency_hz), 64)
    phase = 2 * math.pi * np.arange(n) / n
    delays = np.array(model.delays.inputs) * (2 * math.pi * frequency_hz / model.sampling_rate_hz)
    lines = speed * np.cos(phase[None, :] - delays[:, None])
    scaled = (lines - model.scaling.input_offset) / model.scaling.input_scale
    force = model.scaling.output_of(model.network.output(np, model.theta, scaled))
    return float(-np.mean(force * speed * np.cos(phase)) / frequency_hz)


def model_loss_factor(
    model: ReducedOrderModel, rig: Rig, amplitudes_m: FloatArray, frequencies_hz: FloatArray
) -> FloatArray:
    """η = L_D/(π m_l A² Ω²) (2.16) over (frequency, amplitude), shape (n_frequencies, n_amplitudes).

    Parameters
    ----------
    model : ReducedOrderModel
    rig : Rig
        Of its tank.
    amplitudes_m, frequencies_hz : ndarray
    """
    work = np.array([[model_work_j(model, float(a), float(f)) for a in amplitudes_m] for f in frequencies_hz])
    energy = rig.liquid_mass_kg * (2 * math.pi * frequencies_hz[:, None] * amplitudes_m[None, :]) ** 2
    return np.asarray(work / (math.pi * energy))
