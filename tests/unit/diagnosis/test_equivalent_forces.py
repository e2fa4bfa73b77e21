"""Explanations that are the same force are named together, alone and beside other effects."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.diagnosis.inference.remainder import Remainder
from sloshlab.diagnosis.inference.scored_model import ScoredModel
from sloshlab.diagnosis.wording import equivalents_of
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, known_effects

assert effects.__all__


def explained_by(*keys: str) -> ScoredModel:
    pool = {f"{effect.block}.{effect.name}": effect for effect in known_effects()}
    chosen = tuple(Candidate(pool[key], None) for key in keys)  # type: ignore[arg-type]
    return ScoredModel(FreeRunFit(chosen, {}, 0.0, 0.0), {}, [], Remainder(np.zeros(1), {}), frozenset(), 0.0)


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        (("structure.asymmetric_friction",), [("constant_force", "coulomb_friction")]),
        (("structure.coulomb_friction", "structure.constant_force"), [("asymmetric_friction",)]),
        (
            ("structure.asymmetric_friction", "structure.stribeck_friction"),
            [("constant_force", "coulomb_friction", "stribeck_friction")],
        ),
        (("structure.coulomb_friction",), []),
        (("tank.coulomb_friction", "structure.constant_force"), []),
        (("structure.mass_error",), []),
    ],
)
def test_equals(keys: tuple[str, ...], expected: list[tuple[str, ...]]) -> None:
    assert equivalents_of(explained_by(*keys)) == expected
