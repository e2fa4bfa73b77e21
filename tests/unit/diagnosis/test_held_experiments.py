"""A recommended experiment is never one that the case holds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sloshlab.diagnosis.held_experiments import NEEDS, lacking_of, unheld_level
from sloshlab.identification.case import Case, read_case
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import known_effects

LEVELS = "decays or sweeps at two or more amplitudes"
FREQUENCY = "the same amplitude at two frequencies"
SENSOR = "the channel beside a second sensor at the same place"

assert effects.__all__


@pytest.fixture(scope="module")
def friction() -> Case:
    """Four decays of a guided tank from three heights, sloshing."""
    return read_case(Path(__file__).parents[3] / "raw_data" / "cases" / "friction" / "case")


def test_every_recommendation_that_is_judged_is_one_of_an_effect() -> None:
    said = {effect.separated_by for effect in known_effects()}
    assert set(NEEDS) <= said


def test_what_the_case_holds_is_not_recommended_and_the_rest_is(friction: Case) -> None:
    assert lacking_of([LEVELS, LEVELS + ", down to rest"], friction) == []
    # every decay is of one mode: one frequency
    assert lacking_of([LEVELS, FREQUENCY, SENSOR, FREQUENCY], friction) == [FREQUENCY, SENSOR]
    assert lacking_of([LEVELS + ", and at two frequencies"], friction) == [LEVELS + ", and at two frequencies"]
    assert lacking_of(["runs with frozen and moving liquid, at several amplitudes"], friction) != []


def test_the_level_that_is_proposed_is_of_no_run(friction: Case) -> None:
    highest = {run.name: float(np.nanstd(run.recording["displacement_tank"].values)) for run in friction.runs}
    words = unheld_level(friction)
    assert words == (
        f"a level below that of {min(highest, key=highest.__getitem__)}, "
        f"or above that of {max(highest, key=highest.__getitem__)}"
    )
