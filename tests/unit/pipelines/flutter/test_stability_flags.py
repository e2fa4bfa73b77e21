"""Root locus and p-k contradict each other, or agree: what is said."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.flutter.analysis import Stability
from pipelines.flutter.problem import Variant
from sloshlab.aeroelastic.modal_structure import of_modes
from sloshlab.aeroelastic.p_k import PkRoots
from sloshlab.aeroelastic.root_locus import Crossing, RootLocus

SPEED = np.array([10.0, 20.0, 30.0])


def stability(growth: list[float], *crossings: Crossing, rigid: tuple[str, ...] = ()) -> Stability:
    """One p-k root of 5 rad/s with the given growth at 10, 20 and 30 m/s."""
    variant = Variant(
        "wing", of_modes(np.array([5.0])), lambda k: np.zeros((1, 1)), lambda u: np.zeros((2, 2)), rigid
    )
    pole = (np.array(growth) + 5j)[:, None]
    locus = RootLocus(SPEED, pole, ("mode 1",), crossings, {})
    return Stability(variant, locus, PkRoots(SPEED, pole, np.ones((3, 1), dtype=bool)), 1.0, 10.0)


def test_agreement_is_no_flag() -> None:
    found = stability([-1.0, -1.0, 3.0], Crossing(22.5, 5.0, "mode 1"))
    # linear from -1 at 20 to 3 at 30 m/s
    assert found.p_k_flutter_m_per_s == pytest.approx(22.5)
    assert found.flags == ()


@pytest.mark.parametrize(
    ("growth", "crossings", "flag"),
    [
        ([-1.0, -1.0, 3.0], (), "p-k finds flutter at 22.5 m/s, the root locus none"),
        ([-1.0, -1.0, -1.0], (Crossing(22.5, 5.0, "mode 1"),), "p-k does not find the flutter at 22.5 m/s"),
        ([-1.0, 1.0, 3.0], (Crossing(22.5, 5.0, "mode 1"),), "flutter by p-k is -33.3 % off"),
    ],
)
def test_contradictions_are_flagged(growth: list[float], crossings: tuple[Crossing, ...], flag: str) -> None:
    [found] = stability(growth, *crossings).flags
    assert found.startswith(flag)


def test_the_body_as_a_whole_is_no_flutter() -> None:
    """Neither in p-k, where its roots come first, nor as a crossing whose root has no part of modes."""
    assert stability([-1.0, -1.0, 3.0], rigid=("heave",)).flags == ()
    spiral = Crossing(22.5, 0.0, "lag 1", elastic_share=0.01)
    assert spiral.kind == "flight"
    assert stability([-1.0, -1.0, -1.0], spiral).locus.flutter is None
