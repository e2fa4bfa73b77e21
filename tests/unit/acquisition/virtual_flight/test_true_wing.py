"""The wing of the flight laboratory against closed forms of beams, rods and thin aerofoils."""

from __future__ import annotations

import dataclasses
from math import acos, pi, sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh

from acquisition.virtual_flight.described_wing import DescribedWing, read_wing
from acquisition.virtual_flight.flap_chain import flap_motion
from acquisition.virtual_flight.hidden_physics import HiddenFlight, Oscillator
from acquisition.virtual_flight.thin_aerofoil import flap_of_aerofoil
from acquisition.virtual_flight.true_wing import N_BENDING, true_wing

MODEL = Path(__file__).parents[4] / "docs/examples/flight_wing.toml"
EXACT = {"bending": 1.0, "torsion": 1.0, "damping": 1.0}


@pytest.fixture
def bare() -> DescribedWing:
    """Without tanks and offsets: bending and torsion do not know each other."""
    wing = read_wing(MODEL)
    light = tuple(dataclasses.replace(tank, dry_mass_kg=0.0, density_kg_per_m3=1e-9) for tank in wing.tanks)
    return dataclasses.replace(wing, mass_offset_m=0.0, tanks=light)


def test_frequencies_of_a_clamped_beam_and_rod(bare: DescribedWing) -> None:
    found = true_wing(bare, HiddenFlight(), EXACT)
    omega = np.sqrt(eigh(found.stiffness, found.mass, eigvals_only=True))
    length = bare.semi_span_m
    # cos βL cosh βL = −1: 1.875104, 4.694091, 7.854757
    bending = np.array([1.875104, 4.694091, 7.854757]) ** 2 / length**2
    bending = bending * sqrt(bare.bending_stiffness_n_m2 / bare.mass_kg_per_m)
    torsion = np.array([0.5, 1.5]) * pi / length * sqrt(bare.torsion_stiffness_n_m2 / bare.pitch_inertia_kg_m)
    for expected in (*bending, *torsion):
        assert np.abs(omega / expected - 1).min() < 2e-6


def test_a_tip_mass_lowers_the_frequency_as_dunkerley_says(bare: DescribedWing) -> None:
    """1/ω² ≈ 1/ω_beam² + m L³/(3EI), to 2 % for a mass at the tip."""
    heavy = dataclasses.replace(bare.tanks[0], y_m=bare.semi_span_m, behind_axis_m=0.0, dry_mass_kg=2.0)
    loaded = true_wing(dataclasses.replace(bare, tanks=(heavy,)), HiddenFlight(), EXACT)
    n = N_BENDING
    omega = sqrt(eigh(loaded.stiffness[:n, :n], loaded.mass[:n, :n], eigvals_only=True)[0])
    alone = 1.875104**2 / bare.semi_span_m**2 * sqrt(bare.bending_stiffness_n_m2 / bare.mass_kg_per_m)
    flexibility = bare.semi_span_m**3 / (3 * bare.bending_stiffness_n_m2)
    assert omega == pytest.approx(1 / sqrt(1 / alone**2 + 2.0 * flexibility), rel=0.02)


def test_damping_of_every_mode_is_its_ratio_and_half_the_loss_factor(bare: DescribedWing) -> None:
    found = true_wing(bare, HiddenFlight(loss_factor=0.06), EXACT)
    squares, modes = eigh(found.stiffness, found.mass)
    damping = np.diag(modes.T @ found.damping @ modes) / (2 * np.sqrt(squares))
    np.testing.assert_allclose(damping, bare.damping_ratio + 0.03, rtol=1e-9)


def test_a_hidden_mass_on_a_hard_spring_changes_nothing(bare: DescribedWing) -> None:
    """Its mass is part of the wing: held tight, the frequencies stay those of the wing that is believed."""
    # counted twice where it moves with the wing: the wing carries it, and so does its own coordinate
    tight = Oscillator(bare.semi_span_m, 0.0, 400.0, 0.01, 0.05, 0.05)
    omega = [
        np.sqrt(eigh(found.stiffness, found.mass, eigvals_only=True)[0])
        for found in (
            true_wing(bare, HiddenFlight(), EXACT),
            true_wing(bare, HiddenFlight(oscillators=(tight,)), EXACT),
        )
    ]
    assert omega[1] == pytest.approx(omega[0], rel=1e-4)


def test_a_flap_of_the_whole_chord_turns_as_the_aerofoil() -> None:
    """Theodorsen's M by θ about the leading edge, a = −1, against that of a flap with its hinge there."""
    found = flap_of_aerofoil(-1.0, -1.0)
    assert found.downwash == pytest.approx(1.0)
    # w at three quarters of the chord by a rotation about the leading edge: 3/2 b θ̇
    assert found.downwash_rate == pytest.approx(1.5)
    # lift π ρ b² U θ̇, moment −π ρ b³ (½ − a) U θ̇ without circulation
    assert found.lift_rate == pytest.approx(pi)
    assert found.moment == pytest.approx(0.0, abs=1e-12)
    assert found.moment_rate == pytest.approx(-1.5 * pi)


def test_lift_of_a_plain_flap_is_that_of_glauert() -> None:
    """dC_L/dβ over 2π of a thin aerofoil in steady flow: (acos(c) + √(1 − c²))/π (Glauert 1927)."""
    assert flap_of_aerofoil(0.5, -0.2).downwash == pytest.approx((acos(0.5) + sqrt(0.75)) / pi)


def test_the_actuator_follows_as_its_transfer_says(bare: DescribedWing) -> None:
    rate, frequency = 2048.0, 4.0
    time = np.arange(int(6 * rate)) / rate
    angle, behind = flap_motion(bare, HiddenFlight(), 0.1 * np.sin(2 * pi * frequency * time), rate, 1.0)
    ratio = frequency / bare.flap.actuator_frequency_hz
    transfer = 1 / (1 - ratio**2 + 2j * bare.flap.actuator_damping_ratio * ratio)
    late = time > 4
    expected = 0.1 * np.imag(transfer * np.exp(2j * pi * frequency * time))
    np.testing.assert_allclose(angle[late], expected[late], atol=1e-4)
    stiff = dataclasses.replace(bare, flap=dataclasses.replace(bare.flap, linkage_time_s=0.0))
    angle, behind = flap_motion(stiff, HiddenFlight(), 0.1 * np.sin(2 * pi * frequency * time), rate, 1.0)
    np.testing.assert_allclose(angle, behind, rtol=1e-12)


def test_the_linkage_is_a_lag_of_the_first_order(bare: DescribedWing) -> None:
    """1/(1 + iωτ), and half the play behind what turns steadily, both in front of and behind the lag."""
    rate, frequency, lag_s = 2048.0, 4.0, 0.008
    time = np.arange(int(6 * rate)) / rate
    soft = dataclasses.replace(bare, flap=dataclasses.replace(bare.flap, linkage_time_s=lag_s))
    angle, behind = flap_motion(soft, HiddenFlight(), 0.1 * np.sin(2 * pi * frequency * time), rate, 1.0)
    ratio = frequency / bare.flap.actuator_frequency_hz
    transfer = 1 / (1 - ratio**2 + 2j * bare.flap.actuator_damping_ratio * ratio)
    transfer /= 1 + 2j * pi * frequency * lag_s
    late = time > 4
    expected = 0.1 * np.imag(transfer * np.exp(2j * pi * frequency * time))
    np.testing.assert_allclose(behind[late], expected[late], atol=1e-4)
    angle, behind = flap_motion(soft, HiddenFlight(play_rad=0.04), 0.1 * time, rate, 1.0)
    assert (angle - behind)[-1] == pytest.approx(0.02 + 0.1 * lag_s, rel=1e-3)


def test_limits_and_play_of_the_flap(bare: DescribedWing) -> None:
    rate = 2048.0
    time = np.arange(int(2 * rate)) / rate
    command = 0.3 * np.clip(np.sin(2 * pi * time), -1, 1)
    held = np.full(time.size, 0.3)
    limited, _ = flap_motion(bare, HiddenFlight(flap_limit_rad=0.1), held, rate, 1.0)
    assert limited[-1] == pytest.approx(0.1)
    # second order: it overshoots by exp(−πζ/√(1 − ζ²))
    ratio = bare.flap.actuator_damping_ratio
    assert limited.max() == pytest.approx(0.1 * (1 + np.exp(-pi * ratio / sqrt(1 - ratio**2))), rel=1e-3)
    slow, _ = flap_motion(bare, HiddenFlight(flap_rate_rad_per_s=0.5), command, rate, 1.0)
    assert np.abs(np.gradient(slow) * rate).max() == pytest.approx(0.5, rel=1e-3)
    stiff = dataclasses.replace(bare, flap=dataclasses.replace(bare.flap, linkage_time_s=0.0))
    angle, behind = flap_motion(stiff, HiddenFlight(play_rad=0.04), command, rate, 1.0)
    # it follows half the play behind, in both directions
    rising = np.gradient(angle) > 1e-4
    assert np.median((angle - behind)[rising & (time > 1)]) == pytest.approx(0.02, rel=1e-3)
