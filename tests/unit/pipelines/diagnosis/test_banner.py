"""The colour of an answer means its kind, and its gain is said in numbers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from pipelines.diagnosis.banner import banner_of


def diagnosis(kind: str, *, law: bool = False, after: float | None = 3.3, held_out: bool = True) -> Any:
    model = None if after is None else SimpleNamespace(held_out_rms=after, fitted_rms=2 * after)
    return SimpleNamespace(
        verdict=SimpleNamespace(kind=kind, has_law=law),
        findings=SimpleNamespace(
            split=SimpleNamespace(has_held_out=held_out),
            retuned=SimpleNamespace(held_out_rms=45.0, fitted_rms=90.0),
        ),
        after=model,
    )


@pytest.mark.parametrize(
    ("kind", "law", "tone"),
    [("named", False, "found"), ("indistinguishable", False, "open"), ("nothing_missing", False, "clear"),
     ("unknown", False, "unknown"), ("unknown", True, "open")],
)  # fmt: skip
def test_only_a_simulation_that_lacks_nothing_is_green(kind: str, law: bool, tone: str) -> None:
    assert banner_of(diagnosis(kind, law=law)).tone == tone


def test_the_gain_is_said() -> None:
    assert banner_of(diagnosis("named")).words == "Error on unseen runs: 45 → 3.3 times the noise."
    said = banner_of(diagnosis("unknown")).words
    assert said.startswith("Error on unseen runs: 45 → 3.3 times the noise with the nearest known effect")
    assert banner_of(diagnosis("unknown", after=None)).words == "Error on unseen runs: 45 times the noise."
    assert "the fitted run" in banner_of(diagnosis("unknown", held_out=False)).words
    assert "90 → 6.6" in banner_of(diagnosis("unknown", held_out=False)).words
