"""An effect with several forms answers with one name; where forms are compared, each says which one it is."""

from __future__ import annotations

import pytest

from sloshlab.diagnosis import effects
from sloshlab.diagnosis.candidate import Candidate, known_effects
from sloshlab.diagnosis.wording import form_and_place, named_and_placed

assert effects.__all__


@pytest.mark.parametrize(
    ("key", "channel", "answer", "compared"),
    [
        ("tank.high_g_saturation", "", "high g saturation in the tank", "high g saturation in the tank"),
        (
            "tank.gradual_saturation",
            "",
            "high g saturation in the tank",
            "high g saturation (gradual saturation) in the tank",
        ),
        (
            "sensor.mains_hum_60",
            "force_1+force_2",
            "mains hum of force_1 and force_2",
            "mains hum (mains hum 60) of force_1 and force_2",
        ),
    ],
)
def test_a_form_is_said_where_forms_are_compared(key: str, channel: str, answer: str, compared: str) -> None:
    [effect] = [effect for effect in known_effects() if f"{effect.block}.{effect.name}" == key]
    candidate = Candidate(effect, None, channel)  # type: ignore[arg-type]
    assert named_and_placed(candidate) == answer
    assert form_and_place(candidate) == compared
