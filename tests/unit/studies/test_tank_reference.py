"""The reference tank: cases as OpenFOAM reads them, readings of tables made by hand, results that were kept."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from sloshlab.errors import InputError
from studies.steady_state import MeanOverCycles, mean_over_cycles, standard_error_of_correlated
from studies.tank_reference import interfoam_run
from studies.tank_reference.__main__ import main
from studies.tank_reference.comparison import (
    PointValues,
    change_table,
    interfoam_liquid,
    laboratory_w_bar,
    particle_liquid,
    point_table,
    results_at_points,
)
from studies.tank_reference.diagnosis import CHOOSING, JUDGING, verdict
from studies.tank_reference.interfoam_case import InterfoamCase, case_files, filled_share, inputs_hash
from studies.tank_reference.interfoam_readings import read_case
from studies.tank_reference.kept_results import kept_result, read_results, write_results
from studies.tank_reference.particle_runs import ParticleCase, read_particles
from studies.tank_reference.planned_cases import CHANGES, planned_cases
from studies.tank_reference.points import BEAM_POINT, COMMON_POINTS, DrivenPoint
from studies.tank_reference.second_liquid import second_liquid

POINT = DrivenPoint(2.0, 10.0)
CASE = InterfoamCase(POINT, 12, n_cycles=24)
MASS = 998.2 * 0.1172 * 0.0136 * 0.078
AMPLITUDE = 2 * 9.81
OMEGA = 2 * math.pi * 10


def tables(folder, case=CASE, *, share=0.3, beta=-0.2, lost=0.0):
    """What OpenFOAM writes of a liquid whose force is −m_l (1 + β) ü − γ u̇, with W̄ = πγ/(m_l Ω) = `share`."""
    rng = np.random.default_rng(1)
    times = np.cumsum(rng.uniform(0.5, 1.5, 200 * case.n_cycles))
    times *= case.duration_s / times[-1]
    amplitude = AMPLITUDE * np.clip(times * 10 / 3, 0, 1)
    acceleration = amplitude * np.cos(OMEGA * times)
    speed = AMPLITUDE / OMEGA * np.sin(OMEGA * times)
    gamma = share * MASS * OMEGA / math.pi
    force = -MASS * 9.81 - MASS * (1 + beta) * acceleration - gamma * speed
    momentum = -share * MASS * AMPLITUDE / (math.pi * OMEGA) * np.cos(OMEGA * times) * OMEGA
    zeros = np.zeros_like(times)
    ones = np.ones_like(times)

    def written(function, name, *columns):
        place = folder / "postProcessing" / function / "0" / name
        place.parent.mkdir(parents=True)
        rows = "\n".join(" ".join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True))
        place.write_text(f"# Time\n{rows}\n")

    volume = MASS / 998.2 * ones
    volume[-1] *= 1 - lost
    written("wallForce", "force.dat", times, zeros, force, zeros, *[zeros] * 6)
    written("volume", "volFieldValue.dat", times, volume, MASS * ones)
    written("moments", "volFieldValue.dat", times, 0.0136 / 2 * MASS * ones, zeros, momentum, zeros, zeros)
    written("liquidMoments", "volFieldValue.dat", times, 1.5 * 0.0068 * volume[0] * ones, 3.0 * ones)
    written("gradients", "volFieldValue.dat", times, 5.0 * ones)


def test_work_and_mass_are_those_of_the_force(tmp_path) -> None:
    tables(tmp_path)
    reading = read_case(CASE, tmp_path)
    counted = slice(8, None)
    assert reading.w_bar[counted] == pytest.approx(0.3, abs=2e-3)
    assert reading.beta[counted] == pytest.approx(-0.2, abs=2e-3)
    assert reading.height_over_rest == pytest.approx(1.5)
    assert reading.largest_volume_change == pytest.approx(0.0, abs=1e-8)


def test_work_of_the_body_force_is_that_of_the_momentum(tmp_path) -> None:
    """−∮ p ü dt of p = −p₀ cos Ωt and ü = a cos Ωt is p₀ a T/2, over m_l (a/Ω)²."""
    tables(tmp_path)
    p0 = 0.3 * MASS * AMPLITUDE / math.pi
    expected = p0 * AMPLITUDE * 0.1 / 2 / (MASS * (AMPLITUDE / OMEGA) ** 2)
    assert read_case(CASE, tmp_path).body_force_w_bar[8:] == pytest.approx(expected, rel=2e-3)


def test_resolved_dissipation_is_that_of_both_fluids(tmp_path) -> None:
    """µ ∫|∇u|²: 3 m³/s² in the water, 2 in the gas."""
    tables(tmp_path)
    watts = 998.2e-6 * 3 + 1.8e-5 * 2
    expected = watts / 10 / (MASS * (AMPLITUDE / OMEGA) ** 2)
    assert read_case(CASE, tmp_path).viscous_w_bar == pytest.approx(expected, rel=1e-6)


def test_a_run_that_ended_early_is_refused(tmp_path) -> None:
    tables(tmp_path, replace(CASE, n_cycles=20))
    with pytest.raises(InputError, match=r"forces until 2 s; allowed: 2\.4 s"):
        read_case(CASE, tmp_path)


def test_a_damaged_table_is_refused(tmp_path) -> None:
    tables(tmp_path)
    (tmp_path / "postProcessing/moments/0/volFieldValue.dat").write_text("0.1 0.2\n0.05 0.3\n")
    with pytest.raises(InputError, match="no rising times"):
        read_case(CASE, tmp_path)


def test_water_of_a_case_fills_half_the_box() -> None:
    for dimensions in (2, 3):
        case = replace(CASE, dimensions=dimensions)
        share = filled_share(case)
        n_along, n_over, n_across = case.cells
        assert share.shape == (n_across, n_over, n_along)
        assert share.mean() == pytest.approx(0.5, abs=1e-12)
        # a hundredth of the height, root mean square over the surface
        assert share.sum(axis=1).std() / n_over == pytest.approx(0.01)


def test_acceleration_of_a_case_is_that_of_the_numerical_tank() -> None:
    rows = case_files(CASE)["constant/acceleration.dat"].replace("(", " ").replace(")", " ").split()
    numbers = np.array(rows, float).reshape(-1, 10)
    times = numbers[:, 0]
    expected = AMPLITUDE * np.clip(times * 10 / 3, 0, 1) * np.cos(OMEGA * times)
    assert numbers[:, 2] == pytest.approx(expected, abs=1e-5)
    assert times[-1] > CASE.duration_s
    assert not numbers[:, [1, 3, 4, 5, 6, 7, 8, 9]].any()


def test_every_change_changes_what_is_computed_from() -> None:
    hashes = {inputs_hash(replace(CASE, **change)) for change in CHANGES.values()}
    assert len(hashes | {inputs_hash(CASE)}) == len(CHANGES) + 1
    assert "@" not in "".join(case_files(CASE).values())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"cells_over_height": 3}, "cells_over_height: got 3; allowed: 4"),
        ({"cells_over_height": 2000, "dimensions": 3}, "cells: got .*; allowed: at most 2000000"),
        ({"gas_density_kg_per_m3": 0.0}, "gas_density_kg_per_m3"),
        ({"courant_number": math.nan}, "courant_number: got nan"),
    ],
)
def test_impossible_cases_are_refused(changes, message) -> None:
    with pytest.raises(InputError, match=message):
        replace(CASE, **changes)


def test_error_of_a_mean_of_cycles_that_stay_alike() -> None:
    """Runs of m equal cycles: a triangle of correlations of area m, so that the variance of the mean is m σ²/n.

    Blocks of four, as if those were independent, give half of that error at m = 16.
    """
    rng, m, n_levels = np.random.default_rng(3), 16, 40
    levels = rng.normal(size=(200, n_levels))
    errors = [mean_over_cycles(np.repeat(run, m)).standard_error for run in levels]
    assert math.sqrt(np.mean(np.square(errors))) == pytest.approx(1 / math.sqrt(n_levels), rel=0.1)
    assert mean_over_cycles(np.arange(12.0)).value == 5.5
    assert math.isnan(mean_over_cycles([1.0] * 11).standard_error)


@pytest.mark.parametrize("correlation", [-0.5, 0.0, 0.5, 0.8])
def test_error_of_correlated_cycles_is_that_of_the_process(correlation: float) -> None:
    """A first-order process has a mean of known variance: σ² (n + 2 Σ (n − k) φᵏ) / n²."""
    n, n_runs = 50, 400
    rng = np.random.default_rng(5)
    cycles = np.empty((n_runs, n))
    cycles[:, 0] = rng.normal(size=n_runs) / math.sqrt(1 - correlation**2)
    for k in range(1, n):
        cycles[:, k] = correlation * cycles[:, k - 1] + rng.normal(size=n_runs)
    lag = np.arange(1, n)
    expected = math.sqrt((n + 2 * np.sum((n - lag) * correlation**lag)) / (1 - correlation**2)) / n
    errors = np.array([standard_error_of_correlated(run) for run in cycles])
    # single cycles taken as independent give 0.32 at 0.8 and 1.7 at −0.5; fifty cycles do not tell more than this
    assert 0.85 < math.sqrt(np.mean(errors**2)) / expected < 1.35


def test_error_of_few_or_equal_cycles() -> None:
    assert math.isnan(standard_error_of_correlated([1.0, 2.0] * 5))
    assert standard_error_of_correlated([1.0, 2.0] * 10) == 0.0


def test_results_are_kept_and_belong_to_their_inputs(tmp_path) -> None:
    tables(tmp_path / "case")
    result = kept_result(CASE, read_case(CASE, tmp_path / "case"), "interFoam 1912")
    place = tmp_path / "kept.json"
    write_results({CASE: result}, place)
    assert read_results(place) == {CASE: result}
    entries = json.loads(place.read_text())
    entries[0]["case"]["n_cycles"] = 23
    place.write_text(json.dumps(entries))
    with pytest.raises(InputError, match="got a hash of other inputs; remedy: compute it again"):
        read_results(place)


@pytest.mark.parametrize("text", ["", "{", "[1]", '[{"case": {}}]'])
def test_a_file_of_no_results_is_refused_in_one_line(tmp_path, text) -> None:
    place = tmp_path / "kept.json"
    place.write_text(text)
    with pytest.raises(InputError, match="allowed: results of make tank-reference"):
        read_results(place)


def test_without_openfoam_one_line_says_so(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(interfoam_run.shutil, "which", lambda name: None)
    assert main([str(tmp_path), "--first", "1"]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "interFoam: got no such program on PATH; remedy: apt-get install openfoam" in error


def test_kept_results_are_of_todays_inputs() -> None:
    """Reading checks every hash; all of them are planned cases, and eight points and more are among them."""
    results = read_results()
    assert set(results) <= set(planned_cases())
    assert len([point for point in interfoam_liquid(results) if point in COMMON_POINTS]) == 8
    assert len(particle_liquid(read_particles())) >= 9


def test_both_ways_to_the_work_agree_in_kept_results() -> None:
    for result in read_results().values():
        walls, momentum = result.counted("w_bar").value, result.counted("body_force_w_bar").value
        assert walls == pytest.approx(momentum, abs=0.05)
        assert result.largest_volume_change < 1e-3


def test_tables_have_a_line_for_every_point() -> None:
    results = read_results()
    liquids = {"reference": interfoam_liquid(results), "none": {}}
    lines = list(point_table(liquids, "w_bar"))
    assert len(lines) == 2 + len(COMMON_POINTS) + 1
    assert len({line.count("|") for line in lines}) == 1
    assert any(line.startswith("| everything |") for line in change_table(results, "beta"))
    windows = results_at_points(liquids["reference"]).windows
    assert windows.sizes["window"] == len(liquids["reference"])
    # W = W̄ m_l (a₀/Ω)²
    work = windows.w_bar * MASS * (windows.acceleration_g * 9.81 / (2 * np.pi * windows.frequency_hz)) ** 2
    np.testing.assert_allclose(windows.work_j, work, rtol=1e-6)


def test_laboratory_tells_of_three_points() -> None:
    told = {point: laboratory_w_bar(point) for point in (*COMMON_POINTS, BEAM_POINT)}
    known = {point: value for point, value in told.items() if not math.isnan(value)}
    assert known == {DrivenPoint(0.5, 11.4): 0.0, DrivenPoint(4.0, 11.4): 1.65, BEAM_POINT: 1.38}


def test_a_particle_case_is_known_by_what_determines_it() -> None:
    case = ParticleCase(POINT, 24)
    assert (
        len({case.inputs_sha256, replace(case, seed=1).inputs_sha256, replace(case, n_cycles=23).inputs_sha256})
        == 3
    )


def liquid(quiet, largest, beam, error=0.02):
    values = dict(zip((*CHOOSING, *JUDGING), (quiet, largest, beam), strict=True))
    return {
        point: PointValues(MeanOverCycles(value, error), MeanOverCycles(-0.1, error))
        for point, value in values.items()
    }


def test_what_fits_where_it_chose_nothing_is_named() -> None:
    found = verdict(liquid(0.5, 1.0, 0.8), {"right": liquid(0.0, 1.6, 1.35), "wrong": liquid(0.5, 1.1, 0.9)})
    assert (found.answer, found.names) == ("named", ("right",))
    assert found.gain == pytest.approx(0.55)
    assert found.left == pytest.approx(0.03)


def test_two_that_fit_alike_cannot_be_told_apart() -> None:
    found = verdict(liquid(0.5, 1.0, 0.8), {"one": liquid(0.0, 1.6, 1.35), "other": liquid(0.0, 1.62, 1.36)})
    assert (found.answer, set(found.names)) == ("indistinguishable", {"one", "other"})


def test_what_fits_only_where_it_was_chosen_is_unknown() -> None:
    found = verdict(liquid(0.5, 1.0, 0.8), {"fitted": liquid(0.0, 1.65, 0.7)})
    assert (found.answer, found.names) == ("unknown", ("fitted",))
    assert found.gain == pytest.approx(-0.1)


def test_a_gain_within_chance_names_nothing() -> None:
    """The judging point is reached because its error is wide, and gained 0.3 with an error of 0.28."""
    found = verdict(liquid(0.5, 1.0, 0.8, 0.2), {"wide": liquid(0.0, 1.65, 1.1, 0.2)})
    assert found.answer == "unknown"


def test_a_liquid_that_agrees_lacks_nothing_and_one_without_runs_is_unknown() -> None:
    assert verdict(liquid(0.0, 1.6, 1.3), {}).answer == "nothing_missing"
    assert (
        verdict(liquid(0.0, 1.6, 0.3), {"half": {CHOOSING[0]: liquid(0, 0, 0)[CHOOSING[0]]}}).answer == "unknown"
    )


SECOND = {
    "acceleration_g": 4.0,
    "frequency_hz": 11.4,
    "n_cycles": 32,
    "cells_per_height": 24,
    "surface_tension_n_per_m": 0.0728,
    "layer_frequency_hz": 0.0,
    "hold": True,
    "seed": 0,
}


def test_second_liquid_is_read_where_it_is(tmp_path) -> None:
    assert second_liquid(tmp_path / "map.json") == {}
    result = {"w_bar": 0.8, "w_bar_error": 0.05, "beta": -0.1}
    cases = {
        "fine": {**result, "case": SECOND},
        "coarse": {**result, "w_bar": 0.7, "case": {**SECOND, "cells_per_height": 16}},
        "finest": {
            **result,
            "w_bar": 0.5,
            "case": {**SECOND, "cells_per_height": 32, "surface_tension_n_per_m": 0},
        },
    }
    (tmp_path / "map.json").write_text(json.dumps(cases))
    found = second_liquid(tmp_path / "map.json")
    assert list(found) == [DrivenPoint(4.0, 11.4)]
    values = found[DrivenPoint(4.0, 11.4)]
    # the finest between walls that hold
    assert (values.w_bar.value, values.w_bar.standard_error, values.beta.value) == (0.8, 0.05, -0.1)
    assert math.isnan(values.beta.standard_error)
    for seed, w_bar in ((1, 0.6), (2, 1.0)):
        cases[f"seed {seed}"] = {**result, "w_bar": w_bar, "case": {**SECOND, "seed": seed}}
    (tmp_path / "map.json").write_text(json.dumps(cases))
    over_starts = second_liquid(tmp_path / "map.json")[DrivenPoint(4.0, 11.4)].w_bar
    # 0.8, 0.6 and 1.0 have a standard deviation of 0.2
    assert (over_starts.value, over_starts.standard_error) == (
        pytest.approx(0.8),
        pytest.approx(0.2 / math.sqrt(3)),
    )
    (tmp_path / "map.json").write_text('{"4 g": {}}')
    with pytest.raises(InputError, match="allowed: results of the second liquid's study"):
        second_liquid(tmp_path / "map.json")
