"""The facts of the source as data: complete, told apart, and evaluated on any liquid."""

import numpy as np
import pytest
import xarray as xr

from sloshlab.errors import InputError
from studies.measured_facts.laboratory import BEAM, FACTS, LARGEST, laboratory_facts
from studies.measured_facts.table import NOT_COMPUTED, Results, facts
from studies.tank_reference.dry_mass import balance_table, shifted_balance

ENTRY = {"name": "a", "where": "1.4", "half": "judges", "what": "W̄", "published": "1", "value": 1.0, "share": 0.1}


def windows(level, frequency_hz, w_bar, beta):
    level, frequency_hz, w_bar, beta = np.broadcast_arrays(level, frequency_hz, w_bar, beta)
    omega_bar = 2 * np.pi * frequency_hz / 18.991  # √(g/h) of the source
    columns = {
        "run": np.full(level.size, "points"),
        "acceleration_g": level,
        "frequency_hz": frequency_hz,
        "omega_bar": omega_bar,
        "fill_level": np.full(level.size, 0.5),
        "w_bar": w_bar,
        "beta": beta,
        "work_j": w_bar,
    }
    return xr.Dataset({name: ("window", values) for name, values in columns.items()})


def test_there_are_twenty_facts_half_of_which_judge() -> None:
    assert len(FACTS) == 20
    assert sum(fact.half == "judges" for fact in FACTS.values()) == 10
    assert all(fact.where for fact in FACTS.values())
    assert FACTS["threshold"].half == FACTS["place"].half == "judges"


def test_printed_dampers_are_those_of_the_facts() -> None:
    """c = (m_l/π) √(g/h) ω̄ Φ (E.4) of the printed c₂ = 4.69, c_rand = 3.686 and c₁ = 3.40 kg/s."""
    unit = 0.12433 / np.pi * 18.991
    assert unit * LARGEST.omega_bar * LARGEST.w_bar == pytest.approx(4.69, rel=2e-3)
    assert unit * BEAM.omega_bar * BEAM.w_bar == pytest.approx(3.686, rel=2e-3)
    row = FACTS["row"].numbers
    assert unit * row["omega_bar"] * row["value"] == pytest.approx(3.40, rel=2e-3)
    assert LARGEST.u_bar * LARGEST.omega_bar**2 == pytest.approx(4.0)


def test_spread_decides_what_agrees() -> None:
    fact = laboratory_facts({"fact": [ENTRY]})["a"]
    assert [fact.agrees(value) for value in (0.89, 0.91, 1.09, 1.11)] == [False, True, True, False]
    ranged = laboratory_facts({"fact": [{**ENTRY, "range": [0.0, 0.5]}]})["a"]
    assert [ranged.agrees(value) for value in (-0.01, 0.0, 0.5, 0.51)] == [False, True, True, False]


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ([{**ENTRY, "half": "both"}], "half: got both; allowed: chooses, judges"),
        ([{key: value for key, value in ENTRY.items() if key != "where"}], "fact 1: got no where"),
        ([ENTRY, ENTRY], "two of the name a"),
    ],
)
def test_a_fact_that_is_incomplete_is_refused(entries, message) -> None:
    with pytest.raises(InputError, match=message):
        laboratory_facts({"fact": entries})


def test_a_liquid_of_single_points_is_judged_by_what_it_tells() -> None:
    """W̄ = 0 at 0.5 g, 1 at 2 g and 4 g, 0.5 at 6 g: half a W̄ per 0.75 g, so that 0.2 is passed at 0.8 g."""
    level = np.array([0.5, 2.0, 4.0, 6.0])
    found = {
        fact.name: fact
        for fact in facts(
            Results(windows(level, 11.4, np.array([0.0, 1.0, 1.0, 0.5]), np.array([-0.1, -0.1, -0.1, 0.1])))
        )
    }
    assert list(found) == list(FACTS)
    assert found["threshold"].found == "0.80 g"
    assert found["quiet"].agrees is True
    assert found["falls"].agrees is True
    assert found["effective_mass"].found == "in 75 % of the windows"
    assert found["effective_mass"].agrees is False
    for name in ("largest", "place", "row", "beam", "weakest", "region_0.5", "work_3_9"):
        assert (found[name].found, found[name].agrees) == (NOT_COMPUTED, None)


def test_beam_is_judged_at_its_own_point() -> None:
    found = {
        fact.name: fact
        for fact in facts(
            Results(windows(np.array([2.04, 2.04]), np.array([10.73, 14.0]), np.array([1.4, 0.1]), -0.1))
        )
    }
    assert found["beam"].found == "1.40"
    assert found["beam"].agrees is True


def test_a_shift_is_chosen_by_one_fact_and_judged_by_another() -> None:
    """Mean β at 0.25 g is −0.1, so that −0.054 is added: of 0.03 and 0.08 at 2 g the first becomes negative."""
    level = np.array([0.25, 0.25, 2.0, 2.0])
    found = shifted_balance(Results(windows(level, 11.4, 1.0, np.array([-0.15, -0.05, 0.03, 0.08]))))
    assert found.shift == pytest.approx(-0.054)
    assert (found.before.found, found.after.found) == ("in 50 % of the windows", "in 75 % of the windows")
    assert next(iter(balance_table(found))).endswith("shifted by −0.054 |")
