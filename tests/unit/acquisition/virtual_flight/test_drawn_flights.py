"""Flights that a seed draws: classes, strengths and truths."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from acquisition.virtual_flight.described_wing import read_wing
from acquisition.virtual_flight.drawn_flights import SINGLES, FlightDrawing, _in_proportion
from acquisition.virtual_flight.hidden_physics import HiddenFlight
from pipelines.diagnosis.challenge_truths import known_vocabulary, marked_truth
from sealed_trial.challenge.stated_truth import stated_truth

WING = read_wing(Path(__file__).parents[4] / "docs/examples/flight_wing.toml")


@pytest.fixture(scope="module")
def drawing() -> FlightDrawing:
    return FlightDrawing(WING, 3)


def test_classes_of_sixty_flights() -> None:
    assert Counter(_in_proportion(60)) == {"nothing": 15, "effects": 33, "look_alikes": 6, "outside": 6}
    assert len(_in_proportion(7)) == 7


def test_truths_are_what_a_challenge_takes(drawing: FlightDrawing) -> None:
    flights = drawing.flights(4)
    vocabulary = known_vocabulary()
    for flight in flights:
        truth = marked_truth(flight.name, stated_truth(flight.truth, flight.name), vocabulary)
        assert (flight.hidden == HiddenFlight()) == (truth["kind"] == "nothing")
        for effect in truth["effects"]:
            assert effect["strength"] >= 4.0


def test_the_same_seed_draws_the_same_and_another_another(drawing: FlightDrawing) -> None:
    first, again = (each.flights(2)[1] for each in (drawing, FlightDrawing(WING, 3)))
    assert (first.truth, first.laboratory, first.card) == (again.truth, again.laboratory, again.card)
    assert FlightDrawing(WING, 4).flights(2)[1].laboratory != first.laboratory


def test_what_retuning_takes_is_no_strength(drawing: FlightDrawing) -> None:
    """A loss factor of 0.004 is damping off by a tenth, a gain of a hundredth is the tolerance of a sensor."""
    assert drawing.strength(HiddenFlight(loss_factor=0.004)) < 0.2
    assert drawing.strength(HiddenFlight(sensor=(("acceleration_tank_1", "gain", 0.01),))) < 1e-6
    assert drawing.strength(HiddenFlight(sensor=(("acceleration_tank_1", "gain", 0.1),))) > 1.0


def test_every_single_effect_is_of_the_vocabulary() -> None:
    vocabulary = known_vocabulary()
    for draw in SINGLES:
        effect = draw(WING, np.random.default_rng(0), 1.0)
        assert set(effect.parameters) <= vocabulary[effect.block, effect.name]
