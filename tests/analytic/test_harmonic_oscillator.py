"""Appendix A: the response by complex numbers, the work by quadrature of the loop, the loss factor of a damper."""

import numpy as np
import pytest

from sloshlab.modal.harmonic_oscillator import dynamic_amplification, phase_rad, work_per_cycle

RATIOS = np.array([0.05, 0.5, 0.97, 1.0, 1.03, 1.8])


@pytest.mark.parametrize("damping", [0.003, 0.033, 0.4])
def test_response_is_that_of_complex_numbers(damping):
    """(−r² + 2iζr + 1) x = 1."""
    expected = 1 / (1 - RATIOS**2 + 2j * damping * RATIOS)
    assert dynamic_amplification(RATIOS, damping) == pytest.approx(np.abs(expected))
    assert phase_rad(RATIOS, damping) == pytest.approx(np.angle(expected))


@pytest.mark.parametrize("damping", [0.003, 0.033, 0.4])
def test_work_is_the_area_of_the_loop_and_what_the_damper_takes(damping):
    turn = np.linspace(0, 2 * np.pi, 20001)
    for ratio in RATIOS:
        size, phase = dynamic_amplification(ratio, damping), phase_rad(ratio, damping)
        force, displacement = np.sin(turn), size * np.sin(turn + phase)
        area = np.sum((force[1:] + force[:-1]) / 2 * np.diff(displacement))
        work = float(work_per_cycle(ratio, damping))
        assert work == pytest.approx(area, rel=1e-6)
        # (A.22): L_d/(2π U_max) = 2ζ Ω/ω_n with U_max = k |B|²/2
        assert work / (2 * np.pi * size**2 / 2) == pytest.approx(2 * damping * ratio)


def test_work_is_largest_at_resonance():
    near = np.linspace(0.8, 1.2, 4001)
    work = work_per_cycle(near, 0.033)
    assert near[work.argmax()] == pytest.approx(1.0, abs=1e-3)
    assert work_per_cycle(1.0, 0.033) == pytest.approx(np.pi / (2 * 0.033))
    # (A.10) over a cycle, whose length changes: the maximum is ζ²/2 below resonance, where the source says "at"
    assert 1 - near[work.argmax()] == pytest.approx(0.033**2 / 2, abs=1.01e-4)
