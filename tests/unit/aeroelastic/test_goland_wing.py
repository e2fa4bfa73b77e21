"""The wing of Goland: strip theory, beam, p-k and root locus.

Numbers of the wing as they are usually quoted: chord 1.8288 m, semi-span 6.096 m, 35.72 kg/m, 8.64 kg m about the
elastic axis, EI 9.77e6 and GJ 0.987e6 N m², axis at 33 % and mass centre at 43 % chord, air of 1.225 kg/m³.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest
from scipy.linalg import expm

from sloshlab.aeroelastic.bending_torsion_beam import WingModes, uniform_beam, wing_modes
from sloshlab.aeroelastic.p_k import p_k_flutter, p_k_roots
from sloshlab.aeroelastic.root_locus import RootLocus, root_locus
from sloshlab.aeroelastic.section_forces import Section
from sloshlab.aeroelastic.state_space import state_matrix, system_over_speed
from sloshlab.aeroelastic.strip import Strips, strip_gust, strip_rational, strip_table, strips_of
from sloshlab.errors import AnalysisError

SEMI_CHORD, SPAN, DENSITY = 0.9144, 6.096, 1.225
# bars: frequencies by an independent script with closed-form assumed modes, 4 in bending and 4 in torsion
ASSUMED_MODES_RAD_PER_S = (48.15, 95.70)


@functools.cache
def wing(n_elements: int = 20) -> WingModes:
    beam = uniform_beam(
        SPAN,
        n_elements=n_elements,
        bending_stiffness_n_m2=9.77e6,
        torsion_stiffness_n_m2=0.987e6,
        mass_kg_per_m=35.72,
        mass_offset_m=0.1 * 2 * SEMI_CHORD,
        pitch_inertia_kg_m=8.64,
    )
    return wing_modes(beam, 6)


@functools.cache
def strips() -> Strips:
    return strips_of(wing(), lambda _: Section(SEMI_CHORD, -0.34), n_strips=30)


@functools.cache
def locus() -> RootLocus:
    system = system_over_speed(wing().structure, strip_rational(strips()), density_kg_per_m3=DENSITY)
    return root_locus(system, np.linspace(20, 300, 29), wing().structure.names)


def test_frequencies_are_those_of_assumed_modes() -> None:
    np.testing.assert_allclose(
        wing().structure.natural_frequency_rad_per_s[:2], ASSUMED_MODES_RAD_PER_S, rtol=1e-3
    )


def test_beam_without_offset_has_closed_form_frequencies() -> None:
    modes = wing_modes(
        uniform_beam(
            2.0,
            n_elements=40,
            bending_stiffness_n_m2=50.0,
            torsion_stiffness_n_m2=3.0,
            mass_kg_per_m=1.5,
            mass_offset_m=0.0,
            pitch_inertia_kg_m=0.02,
        ),
        3,
    )
    bending = np.array([1.8751040687, 4.6940911330]) ** 2 * np.sqrt(50.0 / 1.5) / 2.0**2
    torsion = np.array([1, 3]) * np.pi / 2 * np.sqrt(3.0 / 0.02) / 2.0
    # linear elements are above the truth by (3π/2n)²/24 in the second mode of torsion
    expected = sorted([*bending, *torsion])[:3]
    np.testing.assert_allclose(modes.structure.natural_frequency_rad_per_s, expected, rtol=7e-4)


def test_p_k_reaches_the_flutter_point() -> None:
    speed, omega, mode = p_k_flutter(
        wing().structure,
        strip_table(strips(), semi_chord_m=SEMI_CHORD),
        semi_chord_m=SEMI_CHORD,
        density_kg_per_m3=DENSITY,
        speeds=np.arange(60.0, 160.0, 20.0),
    )
    # as usually quoted of Goland and Luke: 137.25 m/s, 70.69 rad/s; the independent script: 136.96, 70.01
    assert speed == pytest.approx(137.25, rel=0.005)
    assert omega == pytest.approx(70.69, rel=0.012)
    assert (speed, omega) == pytest.approx((136.96, 70.01), rel=1e-3)
    assert mode == 1


def test_root_locus_with_jones_lags_agrees() -> None:
    assert locus().flags == ()
    assert locus().flutter is not None
    assert locus().flutter.origin == "mode 2"
    # Jones' function instead of Theodorsen's
    assert locus().flutter.speed_m_per_s == pytest.approx(136.96, rel=0.011)


def test_divergence_is_that_of_the_uniform_wing() -> None:
    """tan λL has its first pole: q 2π c e L²/GJ = (π/2)², e from the quarter chord to the axis."""
    stiffness_per_pressure = 2 * np.pi * (2 * SEMI_CHORD) * (SEMI_CHORD * (0.5 - 0.34))
    pressure = (np.pi / 2 / SPAN) ** 2 * 0.987e6 / stiffness_per_pressure
    assert locus().divergence is not None
    # six modes and 30 strips
    assert locus().divergence.speed_m_per_s == pytest.approx(np.sqrt(2 * pressure / DENSITY), rel=3e-3)


# far below flutter a lag outlives the oscillation
@pytest.mark.parametrize("speed", [130.0, 145.0])
def test_simulated_motion_grows_as_the_pole_says(speed: float) -> None:
    """V5: free motion in time steps, its growth from one swing to the next."""
    matrix = state_matrix(
        wing().structure, strip_rational(strips()), density_kg_per_m3=DENSITY, speed_m_per_s=speed
    )
    step = 1e-3
    advance = expm(matrix * step)
    state = np.zeros(matrix.shape[0])
    state[0] = 1.0
    motion = []
    for _ in range(4000):
        state = advance @ state
        motion.append(state[1])
    tail = np.array(motion[2500:])
    peaks = [i for i in range(1, tail.size - 1) if tail[i] > tail[i - 1] and tail[i] >= tail[i + 1]]
    growth = np.log(tail[peaks[-1]] / tail[peaks[0]]) / (step * (peaks[-1] - peaks[0]))
    pole = np.array([locus_pole(speed)])
    assert growth == pytest.approx(float(pole[0].real), rel=0.01)


def locus_pole(speed: float) -> complex:
    """The least stable oscillatory root by the characteristic determinant, not by eigenvalues."""
    form, structure = strip_rational(strips()), wing().structure
    pressure = 0.5 * DENSITY * speed**2

    def value(s: complex) -> complex:
        matrix = s**2 * structure.mass + structure.stiffness - pressure * form.at(s * SEMI_CHORD / speed)
        scale = structure.natural_frequency_rad_per_s
        return complex(np.linalg.det(matrix / np.outer(scale, scale)))

    root = -1.0 + 71j if speed < 137 else 2.0 + 69j
    for _ in range(60):
        # Newton with a complex difference
        slope = (value(root + 1e-5) - value(root - 1e-5)) / 2e-5
        root -= value(root) / slope
    return root


def test_p_k_follows_every_mode_without_a_lost_one() -> None:
    roots = p_k_roots(
        wing().structure,
        strip_table(strips(), semi_chord_m=SEMI_CHORD),
        semi_chord_m=SEMI_CHORD,
        density_kg_per_m3=DENSITY,
        speeds=np.array([20.0, 60.0, 100.0]),
    )
    assert roots.converged.all()
    assert np.all(roots.pole_rad_per_s.real < 0)


def test_gust_on_strips_is_rigid_plunge_over_the_frequency() -> None:
    """V16 on a wing whose first coordinate moves it up as a whole."""
    n = 4
    up = Strips(
        tuple(Section(0.5 + 0.1 * i, -0.2) for i in range(n)),
        np.full(n, 0.4),
        np.column_stack([np.ones(n), np.linspace(0, 1, n)]),
        np.zeros((n, 2)),
    )
    for k in (0.1, 0.9):
        plunge = strip_table(up, semi_chord_m=0.7)(k)[:, 0]
        np.testing.assert_allclose(strip_gust(up, semi_chord_m=0.7)(k), -0.7 / (1j * k) * plunge, rtol=1e-10)


def test_strips_of_different_chords_have_no_common_lags() -> None:
    mixed = Strips((Section(0.5, 0), Section(0.6, 0)), np.ones(2), np.ones((2, 1)), np.zeros((2, 1)))
    with pytest.raises(AnalysisError, match="different chords; allowed: one chord; remedy: fit"):
        strip_rational(mixed)
