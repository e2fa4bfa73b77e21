"""Transfers of a force in a twin of which only the simulation is known: what a short pulse changes.

    H_c(f) = FFT(y_c with the pulse − y_c without) / (FFT of the pulse)

Over a series that begins with the pulse and is padded with zeros this is exact within the run where the twin is
linear, whatever its damping; where it is not, it is the transfer of small forces early in the run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.identification.case import CaseRun
from sloshlab.identification.diagnosed_model import DiagnosedModel
from sloshlab.missing_force.force_inversion import frequencies_hz, in_frequency
from sloshlab.missing_physics.extension import Extension
from sloshlab.twin.external_forces import PULSE_TRAIN

ComplexArray = NDArray[np.complex128]
_PULSE_SAMPLES: Final = 4
"""Width of the pulse: its spectrum has no zero below half the sampling rate, and little beyond to alias."""
_SIZE: Final = 1e-3
"""Of the largest velocity, that the pulse adds: far from bending the motion, far above rounding."""


@dataclass(frozen=True, eq=False)
class ProbedTransfers:
    """What a force does to a twin, at the frequencies of the padded run.

    Attributes
    ----------
    readings : dict of channel to ndarray, shape (n_samples + 1,)
        In the unit of the channel per newton.
    motion : tuple of ndarray, shape (n_samples + 1,)
        Of displacement, velocity and acceleration where the force acts.
    frequency_hz : ndarray, shape (n_samples + 1,)
    """

    readings: dict[str, ComplexArray]
    motion: tuple[ComplexArray, ...]
    frequency_hz: NDArray[np.float64]


def probed_transfers(
    model: DiagnosedModel, run: CaseRun, values: Mapping[str, float], extension: Extension
) -> ProbedTransfers:
    """Transfers about a run, by two simulations of it.

    Parameters
    ----------
    model : DiagnosedModel
    run : CaseRun
    values : mapping
        Of the baseline.
    extension : Extension
        Of effects beside it; faults of its sensors are left out.

    Raises
    ------
    AnalysisError
        If a simulation does not reach its end.
    """
    rate, n = run.attributes.sampling_rate_hz, int(run.recording.sizes["time"])
    width = _PULSE_SAMPLES / rate
    without = replace(extension, faults=(), key=())
    motion = model.motion(run, values, without)
    speed = max(float(np.abs(motion[:, 1]).max()), 1e-12)
    # a haversine has the impulse F w / 2
    size = 2 * _SIZE * model.moving_mass_kg * speed / width
    pulse = PULSE_TRAIN(place="structure", size_n=size, start_s=0.0, period_s=1e6, width_s=width)
    struck = replace(
        without, run_terms={**without.run_terms, run.name: (*without.run_terms.get(run.name, ()), pulse)}, key=()
    )
    before, after = (model.simulate(run, values, each) for each in (without, struck))
    moved = model.motion(run, values, struck) - motion
    frequency = frequencies_hz(n, rate)
    spectrum = _spectrum_of_pulse(size, width, frequency) * rate
    return ProbedTransfers(
        {name: in_frequency(after[name] - before[name]) / spectrum for name in before},
        tuple(in_frequency(moved[:, order]) / spectrum for order in range(3)),
        frequency,
    )


def _spectrum_of_pulse(size_n: float, width_s: float, frequency_hz: NDArray[np.float64]) -> ComplexArray:
    """Fourier transform of a haversine that begins at zero [N s]: F w/2 sinc(f w)/(1 − (f w)²) e^(−iπ f w)."""
    share = frequency_hz * width_s
    # sinc(z)/(1 − z²) is 1/2 where z is one
    at_one = np.abs(share - 1.0) < 1e-9
    envelope = np.where(at_one, 0.5, np.sinc(share) / np.where(at_one, 1.0, 1 - share**2))
    return np.asarray(0.5 * size_n * width_s * envelope * np.exp(-1j * np.pi * share), np.complex128)
