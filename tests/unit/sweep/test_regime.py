"""Regimes of forces that are built to be one of the four."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.sweep.cycles import evaluate_cycles
from sloshlab.sweep.regime import CHAOTIC, FARADAY, IMPACTS, QUIET, classify

F_HZ, RATE_HZ, N = 8.0, 2000.0, 40
T = np.arange(int((N + 4) / F_HZ * RATE_HZ)) / RATE_HZ
PHI = 2 * np.pi * F_HZ * (T - 2 / F_HZ)
A0, MASS = 20.0, 0.12
REFERENCE_N = MASS * A0


def regime_of(dynamic, noise_power=0.0):
    """`dynamic` is d, the force beyond the inertia; here everything is massless, so F = −d."""
    boundaries = 2 / F_HZ + np.arange(13) / F_HZ
    cycles = evaluate_cycles(-dynamic, A0 * np.cos(PHI), boundaries, sampling_rate_hz=RATE_HZ)
    pairs = 0.5 * (cycles.subharmonic_phasor[0::2] + cycles.subharmonic_phasor[1::2])
    dynamic_pairs = 0.5 * (cycles.dynamic_phasor[0::2] + cycles.dynamic_phasor[1::2])
    return classify(dynamic_pairs, pairs, *cycles.dynamic_power_and_peak(slice(None)),
                    reference_force_n=REFERENCE_N, noise_power=noise_power)  # fmt: skip


INERTIAL = 0.15 * REFERENCE_N * np.cos(PHI)
FARADAY_WAVES = 0.2 * REFERENCE_N * np.cos(PHI / 2 + 0.4) + 0.1 * REFERENCE_N * np.cos(1.5 * PHI)
COMB = sum(0.1 * REFERENCE_N * np.cos(k * PHI + 0.3 * k) for k in (2, 3, 4, 5))
BROAD = (
    0.3
    * REFERENCE_N
    * np.convolve(np.random.default_rng(8).standard_normal(T.size), np.ones(24) / 24**0.5, "same")
)


@pytest.mark.parametrize(
    ("dynamic", "label"),
    [
        (INERTIAL, QUIET),
        (INERTIAL + 0.2 * REFERENCE_N * np.sin(PHI), FARADAY),
        (INERTIAL + 0.2 * REFERENCE_N * np.sin(PHI) + 0.01 * COMB, FARADAY),
        (0 * INERTIAL, QUIET),
        (INERTIAL + 0.04 * REFERENCE_N * np.sin(PHI), QUIET),
        (INERTIAL + FARADAY_WAVES, FARADAY),
        (INERTIAL + COMB + 0.5 * FARADAY_WAVES, IMPACTS),
        (INERTIAL + COMB, IMPACTS),
        (INERTIAL + BROAD + 0.3 * COMB, CHAOTIC),
        (INERTIAL + BROAD + 0.3 * FARADAY_WAVES, CHAOTIC),
    ],
)
def test_constructed_regimes(dynamic, label):
    assert regime_of(dynamic).label == label


def test_shares_are_those_of_the_powers():
    """Powers: subharmonics (0.2² + 0.1²)/2, harmonics 4·0.1²/2: shares 5/9 and 4/9."""
    regime = regime_of(INERTIAL + FARADAY_WAVES + COMB)
    assert regime.subharmonic_share == pytest.approx(5 / 9, abs=0.02)
    assert regime.harmonic_share == pytest.approx(4 / 9, abs=0.02)
    assert regime.unrepeated_share == pytest.approx(0.0, abs=5e-3)
    assert regime.label == FARADAY


@pytest.mark.parametrize(
    "phase",
    [
        0.0,
        np.pi / 2,
    ],
)
def test_force_ratio_counts_the_whole_subharmonic(phase):
    """d without its inertial part has the RMS 0.2/√2, the reference 1/√2."""
    waves = 0.2 * REFERENCE_N * np.cos(PHI / 2 + phase)
    assert regime_of(INERTIAL + waves).force_ratio == pytest.approx(0.2, abs=2e-3)


def test_known_noise_is_taken_out():
    noise = 0.05 * REFERENCE_N * np.random.default_rng(9).standard_normal(T.size)
    assert regime_of(INERTIAL + noise).label == CHAOTIC
    assert regime_of(INERTIAL + noise, noise_power=1.02 * noise.var()).label == QUIET


def test_crest_factor_of_a_sine():
    assert regime_of(REFERENCE_N * np.sin(PHI)).crest_factor == pytest.approx(np.sqrt(2), rel=1e-3)
