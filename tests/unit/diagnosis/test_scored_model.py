"""The size of an effect in noise floors."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from recorded_oscillators import decays, effect, rig, surroundings

from sloshlab.diagnosis.inference.known_runs import KnownRun
from sloshlab.diagnosis.inference.scored_model import scored, strength
from sloshlab.diagnosis.inference.whitened import WhitenedRun
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate

assert effects.__all__  # importing the vocabulary makes it known

SHAPE = (40, 30)


def left_by(*channels: np.ndarray) -> Any:
    """A model that leaves these residuals in the channels of one run; the first half of it is informative."""
    informative = np.zeros(SHAPE, bool)
    informative[: SHAPE[0] // 2] = True
    observed = [SimpleNamespace(informative=informative, variance=np.ones(SHAPE)) for _ in channels]
    run = WhitenedRun(KnownRun(cast(Any, observed), cast(Any, None)), np.stack(channels))
    return cast(Any, SimpleNamespace(runs=[run]))


def test_a_size_is_that_of_what_is_added_where_recordings_stand_out() -> None:
    noise = np.random.default_rng(1).normal(size=(2, *SHAPE))
    added = np.zeros((2, *SHAPE))
    added[0, : SHAPE[0] // 2], added[1, SHAPE[0] // 2 :] = 0.6, 5.0
    # The floor is three times the noise here; what is added is as large as it is.
    before, after = left_by(*(noise / 3 + added)), left_by(*(noise / 3))
    assert strength(before, after) == pytest.approx(0.6)


@pytest.mark.parametrize(("creep_decades", "n_numbers"), [(0.3, 1), (0.31, 2), (4.0, 1)])
def test_a_number_at_an_end_of_its_range_is_not_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, creep_decades: float, n_numbers: int
) -> None:
    known = Candidate(
        effect("structure.linear_structural_damping"), surroundings(RigModel(rig(tmp_path), tmp_path, decays()))
    )
    # a size at an end of its range is no simpler effect
    for loss in (0.01, known.bounds(known.effect.parameters[0])[1]):
        values = {f"{known.key}.loss_factor": loss, f"{known.key}.creep_decades": creep_decades}
        monkeypatch.setattr("sloshlab.diagnosis.inference.scored_model.remainder", lambda *others: None)
        assert scored(FreeRunFit((known,), values, 0.0, 0.0), values, []).n_numbers == n_numbers
