"""Work, γ and apparent mass of forces whose closed form is known.

u = -u₀ cos φ, so u̇ = Ωu₀ sin φ and ü = Ω²u₀ cos φ. Over one cycle
  viscous  F = c u̇       W = π c Ω u₀²          γ = c
  cubic    F = c₃ u̇³     W = ¾ π c₃ Ω³ u₀⁴      γ = ¾ c₃ Ω² u₀²
  Coulomb  F = F_c sgn u̇ W = 4 F_c u₀           γ = 4 F_c/(π Ω u₀)
  mass, spring           W = 0                  Re F/ü = m - k/Ω²
"""

from __future__ import annotations

import motions
import numpy as np
import pytest
from motions import LAWS, sweep
from slow_cases import slow_but

from sloshlab.rig import Liquid, Rig, Tank
from sloshlab.sweep.cycles import evaluate_cycles
from sloshlab.sweep.motion_phase import measured_phase
from sloshlab.sweep.windows import WindowSettings, evaluate_windows

SETTINGS = WindowSettings(6, 24)
MASS, DAMPER, SPRING = 0.7, 6.0, 900.0
CUBIC, COULOMB = 12.0, 1.7


def windows_of(motion, force, *, rig=None, inertia=0.0, noise=0.0, seed=0, channel="acceleration"):
    rng = np.random.default_rng(seed)
    measured = getattr(motion, channel)
    measured = measured + noise * np.sqrt(2) * measured.std() * rng.standard_normal(measured.size)
    force = force + noise * np.sqrt(2) * force.std() * rng.standard_normal(force.size)
    rate, is_velocity = motion.sampling_rate_hz, channel == "velocity"
    phase = measured_phase(measured, None, rate, lead_rad=np.pi / 2 if is_velocity else 0.0)
    cycles = evaluate_cycles(
        force, measured, phase.cycle_boundaries_s(), sampling_rate_hz=rate, inertia_kg=inertia,
        motion_is_velocity=is_velocity,
    )  # fmt: skip
    return evaluate_windows(cycles, run_id="run", law=None, rig=rig, settings=SETTINGS)


def truth(motion, windows):
    """Exact Ω and u₀ at instants spread evenly over the cycles of each window; shape (n_windows, n_instants)."""
    frequency = windows.frequency_hz.values
    instants = (np.arange(48) + 0.5) / 48 - 0.5
    times = windows.time_s.values[:, None] + instants * (windows.n_cycles.values / frequency)[:, None]
    return np.interp(times, motion.time_s, motion.omega_rad_per_s), np.interp(
        times, motion.time_s, motion.amplitude_m
    )


def forces(motion, spring=SPRING, mass=MASS):
    v, a, u = motion.velocity, motion.acceleration, motion.displacement
    return {
        "viscous": mass * a + DAMPER * v + spring * u,
        "cubic": mass * a + CUBIC * v**3,
        "coulomb": mass * a + COULOMB * np.sign(v),
    }


def expected(kind, omega, u0):
    """Work, and γ weighted by the squared velocity as a least-squares fit over the window weights it."""
    work, gamma = {
        "viscous": (np.pi * DAMPER * omega * u0**2, DAMPER + 0 * omega),
        "cubic": (0.75 * np.pi * CUBIC * omega**3 * u0**4, 0.75 * CUBIC * omega**2 * u0**2),
        "coulomb": (4 * COULOMB * u0, 4 * COULOMB / (np.pi * omega * u0)),
    }[kind]
    return work.mean(axis=1), np.average(gamma, axis=1, weights=(omega * u0) ** 2)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("kind", ["viscous", "cubic", "coulomb"])
@pytest.mark.parametrize("channel", ["acceleration", "velocity"])
def test_work_and_gamma_within_half_a_percent_without_noise(law, kind, channel):
    motion = sweep(law)
    # where the frequency turns, the stiffness is not known and its stored energy cannot be taken out
    spring = 0.0 if law == "vfa" else SPRING
    windows = windows_of(motion, forces(motion, spring)[kind], channel=channel)
    omega, u0 = truth(motion, windows)
    work, gamma = expected(kind, omega, u0)
    np.testing.assert_allclose(windows.work_j, work, rtol=5e-3)
    np.testing.assert_allclose(windows.gamma_kg_per_s, gamma, rtol=5e-3)
    np.testing.assert_allclose(windows.amplitude_m, np.sqrt((u0**2).mean(axis=1)), rtol=5e-3)


@pytest.mark.parametrize("kind", ["viscous", "cubic", "coulomb"])
@pytest.mark.parametrize("seed", slow_but([0], range(3)))
def test_work_and_gamma_within_one_percent_with_one_percent_noise(kind, seed):
    """At 0.5 m/s everywhere, so that inertia and damping are of one size at all frequencies.

    Noise of 1 % of the whole force cannot leave 1 % of a work that is a thousandth of the reactive power.
    """
    frequency = 5.0 * 4.0 ** np.linspace(0, 1, 241)
    motion = motions.motion(np.linspace(0, 240, 241), frequency, 0.5 * 2 * np.pi * frequency)
    windows = windows_of(motion, forces(motion, spring=0.0, mass=0.05)[kind], noise=0.01, seed=seed)
    work, gamma = expected(kind, *truth(motion, windows))
    for measured, exact in ((windows.work_j.values, work), (windows.gamma_kg_per_s.values, gamma)):
        assert np.abs(measured / exact - 1).max() < 0.01


@pytest.mark.parametrize("law", LAWS)
def test_mass_and_spring_do_no_work(law):
    motion = sweep(law)
    spring = 0.0 if law == "vfa" else SPRING
    windows = windows_of(motion, MASS * motion.acceleration + spring * motion.displacement)
    omega, u0 = truth(motion, windows)
    kinetic = 0.5 * MASS * ((omega * u0) ** 2).mean(axis=1)
    assert np.abs(windows.work_j / kinetic).max() < 1e-3
    mass = np.average(MASS - spring / omega**2, axis=1, weights=(omega**2 * u0) ** 2)
    np.testing.assert_allclose(windows.apparent_mass_kg, mass, atol=1e-3 * MASS)


def test_a_spring_alone_seems_to_feed_energy_until_its_stored_energy_is_taken_out():
    """In an octave sweep at constant acceleration ½ k u₀² falls by the part 4 R ln2/f of itself per cycle."""
    motion = sweep("octave_up", duration_s=240.0)
    windows = windows_of(motion, SPRING * motion.displacement)
    fall = 0.5 * SPRING * windows.amplitude_m**2 * 4 * np.log(2) / 120 / windows.frequency_hz
    np.testing.assert_allclose(windows.stored_work_j, -fall, rtol=1e-2)
    assert np.abs(windows.work_j / fall).max() < 0.02


@pytest.mark.parametrize("phase_from", ["acceleration", "velocity", "between"])
@pytest.mark.parametrize("kind", slow_but(["coulomb"], ["viscous", "cubic", "coulomb"]))
@pytest.mark.parametrize("channel", ["acceleration", "velocity"])
def test_work_does_not_depend_on_where_a_cycle_begins(phase_from, kind, channel):
    """Cycles may be counted by another signal, as the shaker's voltage; then other energies are stored."""
    motion = sweep("octave_up")
    sin, cos = np.sin(motion.phase_rad), np.cos(motion.phase_rad)
    counted = {"acceleration": cos, "velocity": sin, "between": np.cos(motion.phase_rad + 0.6)}[phase_from]
    phase = measured_phase(counted, None, 2000.0)
    cycles = evaluate_cycles(
        forces(motion)[kind], getattr(motion, channel), phase.cycle_boundaries_s(), sampling_rate_hz=2000.0,
        motion_is_velocity=channel == "velocity",
    )  # fmt: skip
    windows = evaluate_windows(cycles, run_id="run", law=None, settings=SETTINGS)
    work, gamma = expected(kind, *truth(motion, windows))
    np.testing.assert_allclose(windows.work_j, work, rtol=5e-3)
    np.testing.assert_allclose(windows.gamma_kg_per_s, gamma, rtol=5e-3)


def test_mass_with_noise_does_no_work_within_its_scatter():
    motion = sweep("octave_up")
    windows = windows_of(motion, MASS * motion.acceleration, noise=0.01, seed=5)
    standard_error = windows.work_j_std / np.sqrt(windows.n_cycles)
    ratio = (windows.work_j / standard_error).values
    assert np.abs(ratio.mean()) < 3 / np.sqrt(ratio.size)
    assert 0.7 < np.sqrt(np.mean(ratio**2)) < 1.4


def test_beta_is_the_mass_beyond_tank_and_liquid():
    """A force (M + (1 + β) m_l) ü gives that β; its γ part gives W̄ = πγ/(m_l Ω)."""
    rig = Rig(
        tank=Tank(height_m=0.0272, length_m=0.1172, width_m=0.078, dry_mass_kg=0.61),
        liquid=Liquid(density_kg_per_m3=1000.0, fill_level=0.5),
    )
    liquid, beta, gamma = rig.liquid_mass_kg, -0.3, 4.0
    motion = sweep("octave_up")
    force = (0.61 + (1 + beta) * liquid) * motion.acceleration + gamma * motion.velocity
    windows = windows_of(motion, force, rig=rig, inertia=0.61 + liquid)
    omega, u0 = truth(motion, windows)
    np.testing.assert_allclose(windows.beta, beta, rtol=5e-3)
    omega, u0 = omega.mean(axis=1), u0.mean(axis=1)
    np.testing.assert_allclose(windows.w_bar, np.pi * gamma / (liquid * omega), rtol=5e-3)
    np.testing.assert_allclose(windows.loss_factor, gamma / (liquid * omega), rtol=5e-3)
    np.testing.assert_allclose(windows.omega_bar * windows.u_bar, windows.v_bar, rtol=1e-3)
    np.testing.assert_allclose(windows.u_bar * windows.omega_bar**2, omega**2 * u0 / 9.81, rtol=1e-3)


def test_loop_and_fundamental_agree_for_a_force_without_harmonics():
    motion = sweep("octave_up")
    windows = windows_of(motion, forces(motion)["viscous"])
    reactive = 0.5 * MASS * (2 * np.pi * windows.frequency_hz * windows.amplitude_m) ** 2
    assert (np.abs(windows.work_j - windows.work_harmonic_j) / reactive).max() < 1e-5


def test_loop_and_fundamental_differ_by_the_work_of_the_harmonics():
    """Third harmonics F₃ sin 3φ and u̇₃ sin 3φ do the additional work ½ F₃ u̇₃ T."""
    motion = sweep("octave_up")
    v3, phi, omega = 0.05, motion.phase_rad, motion.omega_rad_per_s
    acceleration = motion.acceleration + 3 * omega * v3 * np.cos(3 * phi)
    force = DAMPER * motion.velocity + 0.8 * np.sin(3 * phi)
    phase = measured_phase(acceleration, None, 2000.0)
    cycles = evaluate_cycles(force, acceleration, phase.cycle_boundaries_s(), sampling_rate_hz=2000.0)
    windows = evaluate_windows(cycles, run_id="run", law=None, settings=SETTINGS)
    extra = 0.5 * v3 * 0.8 / windows.frequency_hz
    np.testing.assert_allclose(windows.work_j - windows.work_harmonic_j, extra, rtol=5e-3)
    np.testing.assert_allclose(windows.harmonic_amplitude_n[:, 2], 0.8, rtol=5e-3)


def test_subharmonics_are_found_and_do_no_work():
    motion = sweep("octave_up")
    force = DAMPER * motion.velocity + 0.5 * np.cos(0.5 * motion.phase_rad + 0.3)
    force += 0.2 * np.sin(1.5 * motion.phase_rad)
    windows = windows_of(motion, force)
    np.testing.assert_allclose(windows.subharmonic_amplitude_n[:, 0], 0.5, rtol=1e-2)
    np.testing.assert_allclose(windows.subharmonic_amplitude_n[:, 1], 0.2, rtol=1e-2)
    work, _ = expected("viscous", *truth(motion, windows))
    np.testing.assert_allclose(windows.work_j, work, rtol=5e-3)


def test_bias_and_drift_of_the_accelerometer_do_not_change_the_work():
    motion = sweep("octave_up")
    drifting = motion.acceleration + 0.3 + 0.02 * motion.time_s
    phase = measured_phase(drifting, None, 2000.0)
    cycles = evaluate_cycles(
        forces(motion)["viscous"] + 5.0, drifting, phase.cycle_boundaries_s(), sampling_rate_hz=2000.0
    )
    windows = evaluate_windows(cycles, run_id="run", law=None, settings=SETTINGS)
    work, _ = expected("viscous", *truth(motion, windows))
    np.testing.assert_allclose(windows.work_j, work, rtol=5e-3)
