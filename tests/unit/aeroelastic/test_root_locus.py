"""Branches of root loci of systems whose roots are known."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.aeroelastic.modal_structure import ModalStructure, of_modes
from sloshlab.aeroelastic.root_locus import root_locus, roots_of
from sloshlab.errors import AnalysisError


def first_order(damping: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """ẋ = Ax of q̈ + D q̇ + K q = 0."""
    n = len(stiffness)
    return np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])


def test_branches_that_cross_go_straight_on() -> None:
    """Two oscillators that do not know each other, ω = 1 + U and 4 − U, in seven steps."""

    def system(speed: float) -> np.ndarray:
        omega = np.array([1 + speed, 4 - speed])
        return first_order(np.diag(0.02 * omega), np.diag(omega**2))

    speeds = np.linspace(0.5, 3.5, 7)
    locus = root_locus(system, speeds, ("rising", "falling"))
    assert locus.flags == ()
    for name, omega in (("rising", 1 + speeds), ("falling", 4 - speeds)):
        branch = locus.origin.index(name)
        np.testing.assert_allclose(np.abs(locus.pole_rad_per_s[:, branch]), omega, rtol=1e-12)


def test_branches_that_veer_change_their_shape_and_keep_their_name() -> None:
    """A weak spring between them: frequencies never meet, the lower branch stays the lower one."""

    def system(speed: float) -> np.ndarray:
        omega = np.array([1 + speed, 4 - speed])
        coupling = 0.4
        return first_order(0.02 * np.eye(2), np.diag(omega**2) + coupling * np.array([[1, -1], [-1, 1]]))

    locus = root_locus(system, np.linspace(0.5, 3.5, 9), ("low", "high"))
    assert locus.flags == ()
    low, high = (locus.pole_rad_per_s[:, locus.origin.index(name)].imag for name in ("low", "high"))
    assert np.all(low < high)


def test_flutter_is_found_by_bisection() -> None:
    """s² + (1 − U³/8) s + 25: the root begins to grow at U = 2 with 5 rad/s."""
    locus = root_locus(
        lambda speed: first_order(np.array([[1 - speed**3 / 8]]), np.array([[25.0]])),
        np.array([0.5, 1.7, 3.1]),
        ("a",),
    )
    [crossing] = locus.crossings
    assert (crossing.kind, crossing.origin) == ("flutter", "a")
    assert crossing.speed_m_per_s == pytest.approx(2.0, abs=1e-3)
    assert crossing.frequency_rad_per_s == pytest.approx(5.0, abs=1e-3)
    assert locus.divergence is None


def test_divergence_of_a_pair_that_meets_on_the_real_axis() -> None:
    """s² + 0.4 s + 1 − U²: a pair becomes two real roots, one of which grows from U = 1 on."""
    locus = root_locus(
        lambda speed: first_order(np.array([[0.4]]), np.array([[1 - speed**2]])), np.linspace(0.1, 1.5, 15), ("a",)
    )
    assert locus.flutter is None
    assert locus.divergence is not None
    assert locus.divergence.speed_m_per_s == pytest.approx(1.0, abs=1e-3)


def test_a_branch_that_jumps_is_flagged_as_lost() -> None:
    def system(speed: float) -> np.ndarray:
        omega = np.array([1.0, 2.0]) if speed < 2 else np.array([5.0, 9.0])
        turned = np.array([[1.0, 1.0], [-1.0, 1.0]]) / np.sqrt(2) if speed >= 2 else np.eye(2)
        return first_order(0.01 * np.eye(2), turned @ np.diag(omega**2) @ turned.T)

    locus = root_locus(system, np.array([1.0, 1.5, 2.5, 3.0]), ("a", "b"))
    assert set(locus.lost) == {"a", "b"}
    assert all(speed == pytest.approx(2.0, abs=1e-2) for speed in locus.lost.values())
    assert "branch a was lost at 2" in locus.flags[0]


def test_left_vectors_are_one_on_right_vectors() -> None:
    matrix = np.random.default_rng(1).standard_normal((6, 6))
    roots = roots_of(matrix)
    np.testing.assert_allclose(roots.left.conj().T @ roots.right, np.eye(6), atol=1e-10)
    assert np.all(np.diff(roots.pole.imag) >= 0)


@pytest.mark.parametrize("speeds", [[1.0], [2.0, 1.0], [0.0, 1.0]])
def test_bad_speeds_are_refused(speeds: list[float]) -> None:
    with pytest.raises(AnalysisError, match="speed"):
        root_locus(lambda _: first_order(np.eye(1), np.eye(1)), np.array(speeds), ("a",))


def test_a_mass_that_is_not_positive_is_refused() -> None:
    with pytest.raises(AnalysisError, match="mass: got a matrix that is not positive definite"):
        ModalStructure(np.diag([1.0, -1.0]), np.zeros((2, 2)), np.eye(2))
    with pytest.raises(AnalysisError, match="names of modes: got 1; allowed: 2"):
        of_modes(np.array([1.0, 2.0]), names=("a",))
