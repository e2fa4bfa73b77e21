"""What a set of runs can decide: each answer from runs that are made to hold, or to lack, just what it needs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from sloshlab.identification.case import Case, CaseRun
from sloshlab.informative_runs import Decision, InformativeRuns, informative_runs
from sloshlab.recording import run_attributes
from sloshlab.rig import Rig

RATE_HZ = 100.0
TANK = "[tank]\nheight_m = 0.05\nlength_m = 0.1\nwidth_m = 0.06\ndry_mass_kg = 2.0\n"
LIQUID = "[liquid]\ndensity_kg_per_m3 = 1000.0\nfill_level = 0.5\n"
GUIDE = '[structure]\nkind = "sdof"\nmass_kg = 2.0\nstiffness_n_per_m = 3800.0\ndamping_kg_per_s = 0.9\n'
BEAM = """[structure]
kind = "beam"
length_m = 0.7
width_m = 0.1
thickness_m = 0.01
frequencies_hz = [7.5, 60.0]
damping_ratios = [0.005, 0.01]
modal_masses_kg = [1.0, 0.9]
tip_mode_shape = [1.0, 1.0]
"""


def a_run(
    name: str, experiment: str, channels: dict[str, Any], noise_std: float | None = 0.01, **attributes: Any
) -> CaseRun:
    n = len(next(iter(channels.values())))
    variables = {}
    for channel, values in channels.items():
        quantity = channel.partition("_")[0]
        described = {"quantity": quantity, "units": {"force": "N", "displacement": "m"}.get(quantity, "m s-2")}
        variables[channel] = ("time", values, described | ({"noise_std": noise_std} if noise_std else {}))
    recording = xr.Dataset(
        variables,
        {"time": ("time", np.arange(n) / RATE_HZ, {"units": "s"})},
        {
            "sloshlab_format": "1",
            "run_id": name,
            "experiment": experiment,
            "configuration": "sloshing",
            "rig": "rig.toml",
            "sampling_rate_hz": RATE_HZ,
            "start_time_utc": "2026-01-01T00:00:00Z",
            **attributes,
        },
    )
    return CaseRun(name, recording, run_attributes(recording))


def time_s(duration_s: float = 8.0) -> np.ndarray:
    return np.arange(round(duration_s * RATE_HZ)) / RATE_HZ


def decay(name: str, start: float = 10.0, rate_per_s: float = 0.5, **attributes: Any) -> CaseRun:
    t = time_s()
    motion = start * np.exp(-rate_per_s * t) * np.cos(2 * np.pi * 7.0 * t)
    return a_run(name, "sdof_free", {"acceleration_tip": motion, "force_interface": 2 * motion}, **attributes)


def tone(name: str, amplitude: float, frequency_hz: float = 9.0, **more: Any) -> CaseRun:
    motion = amplitude * np.sin(2 * np.pi * frequency_hz * time_s())
    channels = {"acceleration_control": motion, "force_cell_1": 0.3 * motion}
    return a_run(name, "other", channels, **more)


def case_of(*runs: CaseRun, structure: str = GUIDE) -> Case:
    return Case("case", Path("case"), Rig.from_toml_text(TANK + LIQUID + structure), runs)


def decision(found: InformativeRuns, begins: str) -> Decision:
    [one] = [each for each in found.decisions if each.question.startswith(begins)]
    return one


def test_one_run_decides_nothing_for_sure_and_lacks_a_repeat() -> None:
    found = informative_runs(case_of(decay("lone")))
    assert not decision(found, "whether anything is missing").is_possible
    assert not decision(found, "how far the rig repeats itself").is_possible
    assert "lone once more, nothing changed" in found.lacking


def test_a_repeat_is_seen_and_named() -> None:
    found = informative_runs(case_of(decay("a", repeat=1), decay("b", repeat=2)))
    repeats = decision(found, "how far the rig repeats itself")
    assert repeats.is_possible
    assert repeats.because == "a 2 times"
    assert "at no other level" in decision(found, "whether anything is missing").because


def test_three_levels_hold_out_the_one_between() -> None:
    runs = [decay(name, start=start) for name, start in (("large", 9.0), ("middle", 4.0), ("small", 1.0))]
    held_out = decision(informative_runs(case_of(*runs)), "whether anything is missing")
    assert held_out.because == "middle judged without being fitted"


@pytest.mark.parametrize(("rate_per_s", "is_possible"), [(0.5, True), (0.01, False)])
def test_a_decay_passes_through_levels_only_where_it_decays(rate_per_s: float, is_possible: bool) -> None:
    # over the 7 s between the middles of the first and the last second: e^3.5 = 33 and e^0.07 = 1.07
    found = informative_runs(case_of(decay("a", rate_per_s=rate_per_s)))
    assert decision(found, "laws over the level").is_possible == is_possible


@pytest.mark.parametrize(("second", "is_possible"), [(2.0, True), (1.3, False)])
def test_two_levels_tell_laws_over_the_level_from_a_factor_of_one_and_a_half(
    second: float, is_possible: bool
) -> None:
    found = informative_runs(case_of(tone("a", 1.0), tone("b", second), structure=""))
    level = decision(found, "laws over the level")
    assert level.is_possible == is_possible
    assert level.is_possible or level.lacking == "b at a third of its level, and at one in between"


def test_one_tone_tells_no_law_over_the_frequency_and_a_sweep_does() -> None:
    t = time_s()
    sweep = np.sin(2 * np.pi * (5.0 * t + 0.5 * t**2))  # 5 … 13 Hz in 8 s
    swept = a_run("sweep", "shaker_sweep", {"acceleration_control": sweep, "force_cell_1": 0.3 * sweep})
    lone = decision(informative_runs(case_of(tone("a", 1.0), structure="")), "laws over the frequency")
    assert not lone.is_possible
    assert lone.lacking == "a sweep, or steps of frequency"
    assert decision(informative_runs(case_of(swept, structure="")), "laws over the frequency").is_possible


def test_decays_tell_laws_over_the_frequency_where_the_structure_has_several_modes() -> None:
    t = time_s()
    motion = np.exp(-0.5 * t) * np.cos(2 * np.pi * 7.5 * t)
    on_a_beam = a_run("a", "beam_free", {"acceleration_tip": motion})
    assert decision(informative_runs(case_of(on_a_beam, structure=BEAM)), "laws over the frequency").is_possible
    guided = decision(informative_runs(case_of(decay("a"))), "laws over the frequency")
    assert not guided.is_possible
    assert "acceleration_root" in guided.lacking


def test_structure_and_liquid_are_told_apart_by_the_force_between_them_or_by_a_still_liquid() -> None:
    t = time_s()
    motion = np.exp(-0.5 * t) * np.cos(2 * np.pi * 7.0 * t)
    without = [
        a_run(name, "sdof_free", {"acceleration_tip": motion}, configuration=configuration)
        for name, configuration in (("a", "sloshing"), ("b", "frozen"))
    ]
    question = "whether structure or liquid"
    assert decision(informative_runs(case_of(decay("a"))), question).is_possible
    assert decision(informative_runs(case_of(*without)), question).is_possible
    lone = decision(informative_runs(case_of(without[0])), question)
    assert not lone.is_possible
    assert lone.lacking.startswith("force_interface")
    # on a shaker there is no structure to ask of
    shaken = informative_runs(case_of(tone("a", 1.0), structure=""))
    assert [each for each in shaken.decisions if each.question.startswith(question)] == []


def test_one_channel_tells_no_sensor_from_a_force() -> None:
    t = time_s()
    motion = np.exp(-0.5 * t) * np.cos(2 * np.pi * 7.0 * t)
    lone = informative_runs(case_of(a_run("a", "sdof_free", {"acceleration_tip": motion})))
    assert not decision(lone, "whether a sensor").is_possible
    assert decision(informative_runs(case_of(decay("a"))), "whether a sensor").is_possible


def test_noise_is_known_where_it_is_stated_or_heard_in_a_rest() -> None:
    question = "what is noise"
    t = time_s()
    loud = np.sin(2 * np.pi * 7.0 * t)
    rested = np.where(t < 2.0, 1e-3 * np.cos(2 * np.pi * 31.0 * t), loud)

    def of(values: np.ndarray, noise_std: float | None) -> Decision:
        run = a_run("a", "other", {"acceleration_tip": values, "force_interface": values}, noise_std)
        return decision(informative_runs(case_of(run)), question)

    assert of(loud, 0.01).is_possible
    assert of(rested, None).is_possible
    assert not of(loud, None).is_possible
    assert "noise_std" in of(loud, None).lacking


def test_lines_say_what_was_recorded_what_it_decides_and_what_it_does_not() -> None:
    run = decay("a", initial_displacement_m=0.0584)
    lines = informative_runs(case_of(run)).lines
    assert lines[0] == "1 run of sdof_free, sloshing: 58.4 mm"
    assert lines.index("these runs can decide:") < lines.index("these runs cannot decide:")
    assert max(map(len, lines)) <= 120


def test_samples_that_were_lost_and_short_runs_are_no_reason_to_fail() -> None:
    values = np.full(30, np.nan)
    run = a_run("a", "other", {"acceleration_tip": values})
    assert informative_runs(case_of(run)).decisions
