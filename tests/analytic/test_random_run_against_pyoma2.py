"""A random run read by this package and by stochastic subspace identification of pyOMA2 (skips without it)."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from scipy import signal as signals

from sloshlab.modal.modal_fit import modal_fit_of_spectra
from sloshlab.modal.output_only_fit import fit_density
from sloshlab.modal.spectra import random_spectra

try:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        before = np.geterr()
        from pyoma2.algorithms import SSI
        from pyoma2.setup import SingleSetup

        np.seterr(**before)
except ImportError:
    pytest.skip("pyOMA2 is not installed: no other modal analysis to compare with", allow_module_level=True)

RATE_HZ = 50.0
FREQUENCIES_HZ, DAMPING_RATIOS = (10.87, 17.0), (0.015, 0.02)
SHAPES = np.array([[1.0, 1.0], [0.65, -0.9], [0.33, -1.5]])


def responses(excitation: np.ndarray) -> np.ndarray:
    """Two modes as sampled poles, seen by three sensors, shape (3, n)."""
    modal = []
    for frequency, damping in zip(FREQUENCIES_HZ, DAMPING_RATIOS, strict=True):
        omega = 2 * np.pi * frequency
        pole = np.exp((-damping * omega + 1j * omega * np.sqrt(1 - damping**2)) / RATE_HZ)
        numerator = [0.0, -2 * (0.7j * np.conj(pole)).real]
        modal.append(signals.lfilter(numerator, [1.0, -2 * pole.real, abs(pole) ** 2], excitation))
    return np.asarray(SHAPES @ np.array(modal))


def test_frequencies_and_damping_agree_with_pyoma2() -> None:
    generator = np.random.default_rng(21)
    excitation = generator.normal(size=30_000)
    clean = responses(excitation)
    measured = clean + 0.05 * clean.std() * generator.normal(size=clean.shape)
    spectra = random_spectra(excitation, measured, RATE_HZ, segment_length=1500)
    own = modal_fit_of_spectra(spectra, n_modes=2, frequency_range_hz=(7.0, 22.0))
    alone = fit_density(
        spectra.frequency_hz,
        spectra.output_psd[0],
        frequency_range_hz=(8.0, 13.5),
        n_effective_averages=spectra.normalisation.n_effective_averages,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        setup = SingleSetup(measured.T, RATE_HZ)
        peer = SSI(name="ssi", br=40, ordmax=12, calc_unc=False)
        setup.add_algorithms(peer)
        setup.run_by_name("ssi")
        setup.mpe("ssi", sel_freq=list(FREQUENCIES_HZ), order_in=8)
    frequencies, damping = np.ravel(peer.result.Fn), np.ravel(peer.result.Xi)
    assert own.frequency_hz == pytest.approx(frequencies, rel=2e-3)
    # output-only damping of 600 s scatters by √(1/(2π f ζ T)) = 4 % (mode 1); three of those
    assert own.damping_ratio == pytest.approx(damping, rel=0.13)
    assert alone.damping_ratio == pytest.approx(damping[0], abs=3 * alone.damping_ratio_std)
    # both against the truth, so that they are not wrong together
    assert own.frequency_hz == pytest.approx(FREQUENCIES_HZ, rel=1e-3)
    assert own.damping_ratio == pytest.approx(DAMPING_RATIOS, rel=0.03)
    assert damping == pytest.approx(DAMPING_RATIOS, rel=0.15)
