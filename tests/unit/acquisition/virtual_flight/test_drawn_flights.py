"""Flights that a seed draws: classes, strengths and truths."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from acquisition.virtual_flight.described_wing import read_wing, with_spanwise_tanks
from acquisition.virtual_flight.drawn_effects import LOOK_ALIKES, SINGLES
from acquisition.virtual_flight.drawn_flights import Flight, FlightDrawing, _in_proportion
from acquisition.virtual_flight.flight_test import CARD
from acquisition.virtual_flight.hidden_physics import HiddenFlight
from acquisition.virtual_flight.recorded_flight import Laboratory
from acquisition.virtual_flight.shown_change import ShownChange
from pipelines.diagnosis.challenge_truths import known_vocabulary, marked_truth
from sealed_trial.challenge.stated_truth import stated_truth

WING = read_wing(Path(__file__).parents[4] / "docs/examples/flight_wing.toml")
SEED = 1
"""One of those whose effects are found in a few tries; others take up to ten times as many."""


@pytest.fixture(scope="module")
def flights() -> list[Flight]:
    """One that hides nothing, one with an effect, one look-alike."""
    drawing = FlightDrawing(WING, SEED)
    draws = {"nothing": (), "effects": SINGLES[:1], "look_alikes": LOOK_ALIKES}
    return [drawing._flight(number, kind, draws[kind]) for number, kind in enumerate(draws)]


def test_classes_of_sixty_flights() -> None:
    assert Counter(_in_proportion(60)) == {"nothing": 15, "effects": 33, "look_alikes": 6, "outside": 6}
    assert len(_in_proportion(7)) == 7


def test_truths_are_what_a_challenge_takes(flights: list[Flight]) -> None:
    vocabulary = known_vocabulary()
    for flight in flights:
        truth = marked_truth(flight.name, stated_truth(flight.truth, flight.name), vocabulary)
        assert (flight.hidden == HiddenFlight()) == (truth["kind"] == "nothing")


def test_strengths_are_those_of_the_case(flights: list[Flight]) -> None:
    for flight in flights:
        for effect in flight.truth.get("effects", ()):
            found = ShownChange(flight.wing, flight.laboratory, flight.card, [*flight.seed, 0])
            assert found.strength(flight.hidden) == pytest.approx(effect["strength"])
            assert effect["strength"] > (2.0 if flight.truth["hidden"] == "look_alikes" else 3.3)


def test_the_same_seed_draws_the_same_and_another_another(flights: list[Flight]) -> None:
    first = flights[1]
    again = FlightDrawing(WING, SEED)._flight(1, "effects", SINGLES[:1])
    assert first.truth["effects"]
    assert (first.truth, first.laboratory, first.card) == (again.truth, again.laboratory, again.card)
    other = FlightDrawing(WING, SEED + 1)._flight(0, "nothing", [])
    assert other.laboratory != flights[0].laboratory


@pytest.fixture(scope="module")
def shown() -> ShownChange:
    return ShownChange(WING, Laboratory(), CARD, [5])


def test_what_retuning_takes_is_no_strength(shown: ShownChange) -> None:
    """A loss factor of 0.004 is damping off by a tenth, a gain of a hundredth is the tolerance of a sensor."""
    assert shown.strength(HiddenFlight(loss_factor=0.004)) < 0.2
    assert shown.strength(HiddenFlight(sensor=(("acceleration_tank_1", "gain", 0.01),))) < 1e-6
    assert shown.strength(HiddenFlight(sensor=(("acceleration_tank_1", "gain", 0.1),))) > 1.0


def test_retuning_goes_no_further_than_from_the_belief() -> None:
    """A gain that the laboratory has spent already is no more to be had."""
    fault = HiddenFlight(sensor=(("acceleration_tip_rear", "gain", 0.012),))
    spent = ShownChange(WING, Laboratory({"acceleration_tip_rear": 1.0125}), CARD[:1], [5])
    assert ShownChange(WING, Laboratory(), CARD[:1], [5]).strength(fault) < 1e-6 < 0.1 < spent.strength(fault)


def test_a_large_retuning_is_found(shown: ShownChange) -> None:
    """A wing a tenth stiffer: linear about the belief it would show far beyond."""
    assert ShownChange(WING, Laboratory({"bending": 0.92}), CARD, [5])._left(shown._plain.runs).std() < 0.05


def test_a_liquid_shows_its_inertia_in_pitch_but_in_slender_tanks(shown: ShownChange) -> None:
    def heavier(change: float) -> HiddenFlight:
        return HiddenFlight(effective_mass={1: 0.2 * (1 + change)})

    fuller = HiddenFlight(fill_levels={1: 1.2 * WING.tanks[1].fill_level})
    slender = with_spanwise_tanks(WING)
    for one, other in zip(slender.tanks, WING.tanks, strict=True):
        assert one.liquid_kg() == pytest.approx(other.liquid_kg())
        assert one.pitch_inertia_kg_m2() < 0.11 * other.pitch_inertia_kg_m2()
    apart = ShownChange(slender, Laboratory(), CARD, [5]).told_apart(fuller, heavier)
    assert 20 * apart < shown.told_apart(fuller, heavier)
    # itself is found exactly where the change is small enough to be linear
    assert shown.told_apart(heavier(0.001), heavier) < 1e-3


def test_look_alikes_are_of_slender_tanks(flights: list[Flight]) -> None:
    of_class = {flight.truth["hidden"]: flight for flight in flights}
    flight = of_class["look_alikes"]
    assert flight.wing.tanks[0].width_m > 0.5 > of_class["effects"].wing.tanks[0].width_m
    assert {flight.truth["effects"][0]["name"], *flight.truth["equals"][0]} == {"effective_mass", "fuel_state"}


def test_every_single_effect_is_of_the_vocabulary() -> None:
    vocabulary = known_vocabulary()
    for draw in SINGLES:
        effect = draw(WING, np.random.default_rng(0), 1.0)
        assert set(effect.parameters) <= vocabulary[effect.block, effect.name]
