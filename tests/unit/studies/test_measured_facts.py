"""The table of measured facts, on windows and maps made by hand whose answers are known."""

import numpy as np
import pytest
import xarray as xr

from studies.measured_facts.__main__ import main
from studies.measured_facts.table import Results, facts

OMEGA_BAR = np.linspace(2.0, 6.0, 81)
U_BAR = np.linspace(0.02, 0.46, 89)


def hill(omega_bar, u_bar, top, omega_at, u_at):
    return top * np.exp(-(((omega_bar - omega_at) / 1.5) ** 2) - ((u_bar - u_at) / 0.15) ** 2)


def maps(top=1.65, omega_at=3.8, u_at=0.25):
    w_bar = hill(OMEGA_BAR[:, None], U_BAR[None, :], top, omega_at, u_at)
    coords = {"omega_bar": OMEGA_BAR, "u_bar": U_BAR}
    dims = ("omega_bar", "u_bar")
    values = {"w_bar": w_bar, "beta": np.full(w_bar.shape, -0.1), "measured": np.ones(w_bar.shape, np.int8)}
    return xr.Dataset({name: (dims, value) for name, value in values.items()}, coords)


def windows(levels, beta=-0.154, runs=("sweep",)):
    """W̄ = level − 1 above 1 g, up to 3 g, falling beyond; the same in every run."""
    rows = [(run, level, omega) for run in runs for level in levels for omega in np.linspace(3.1, 4.9, 7)]
    run, level, omega = (np.array(column) for column in zip(*rows, strict=True))
    w_bar = np.where(level <= 3, np.clip(level - 1, 0, None), 5 - level)
    columns = {
        "run": run,
        "acceleration_g": level,
        "omega_bar": omega,
        "w_bar": w_bar,
        "beta": np.full(level.size, beta),
        "fill_level": np.full(level.size, 0.5),
        "frequency_hz": omega * 18.991 / (2 * np.pi),
        "work_j": w_bar * 1e-3,
    }
    return xr.Dataset({name: ("window", values) for name, values in columns.items()})


def found(results):
    return {fact.what: fact for fact in facts(results)}


def of(table, start):
    return next(fact for what, fact in table.items() if what.startswith(start))


def test_maximum_and_its_place_are_those_of_the_map():
    table = found(Results(windows([0.25, 1.0, 3.0]), maps(1.65, 3.8, 0.25)))
    assert of(table, "maximum of W̄").found == "1.65 at ω̄ = 3.80, ū = 0.25 (3.6 g)"
    assert of(table, "maximum of W̄").agrees is True
    assert of(table, "its place").agrees is True


def test_another_maximum_is_told():
    table = found(Results(windows([0.25, 1.0, 3.0]), maps(1.0, 5.5, 0.10)))
    assert of(table, "maximum of W̄").agrees is False
    assert of(table, "its place").agrees is False


def test_threshold_is_interpolated_between_levels():
    """W̄ = 0 at 1 g and 0.5 at 1.5 g: 0.2 at 1.2 g."""
    table = found(Results(windows([0.25, 1.0, 1.5, 3.0, 4.5]), maps()))
    assert of(table, "threshold").found == "1.20 g"
    assert of(table, "W̄ falls again").agrees is True


def test_reference_point_and_row_are_those_of_the_hill():
    table = found(Results(windows([0.25, 3.0]), maps()))
    expected = hill(3.55, 0.162, 1.65, 3.8, 0.25)
    assert float(of(table, "W̄ at ω̄ = 3.55").found) == pytest.approx(expected, abs=0.006)
    row = hill(3.55, U_BAR[U_BAR * 3.55**2 >= 1], 1.65, 3.8, 0.25).mean()
    assert float(of(table, "mean over ū").found) == pytest.approx(row, abs=0.006)


def test_effective_mass_of_the_quiet_sweep():
    assert of(found(Results(windows([0.25, 3.0], beta=-0.154), maps())), "mean β").agrees is True
    positive = found(Results(windows([0.25, 3.0], beta=0.05), maps()))
    assert of(positive, "mean β").agrees is False
    assert of(positive, "β < 0").found == "in 0 % of the windows"


def test_repeats_that_are_equal_do_not_spread():
    table = found(Results(windows([3.0], runs=("sweep_3.00g", "sweep_3.00g_repeat_2")), maps()))
    assert of(table, "spread of W̄ between 2 sweeps").found.startswith("0.000")


def test_a_folder_without_results_is_told_in_one_line(tmp_path, capsys):
    assert main([str(tmp_path)]) == 1
    assert capsys.readouterr().err.count("\n") == 1


def test_the_table_is_written(tmp_path, capsys):
    windows([0.25, 3.0]).to_netcdf(tmp_path / "windows.nc")
    maps().to_netcdf(tmp_path / "maps.nc")
    assert main([str(tmp_path), "--output", str(tmp_path / "facts.md")]) == 0
    assert (tmp_path / "facts.md").read_text(encoding="utf-8") == capsys.readouterr().out
