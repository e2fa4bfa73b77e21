"""`sloshlab wing` on a small wing, a network of no training and made-up maps; and on bad input."""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from short_runs import INPUT_IS_BAD, assert_one_line

from pipelines.command_line import run
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis
from sloshlab.reduced_order_model.regressors import Delays
from sloshlab.reduced_order_model.storage import save_model

WING = """
[wing]
name = "small"
leading_edge_sweep_deg = 15.0
elastic_axis = 0.4
mass_centre_behind_axis = 0.12
pitch_radius_of_gyration = 0.25
root_mass_kg_per_m = 40.0
tip_mass_kg_per_m = 40.0
root_bending_stiffness_n_m2 = 4.0e7
torsion_over_bending = 0.3
n_elements = 8
n_modes = 3
extra_damping_ratio = 0.01
extra_damping_above = 0.0
chords = [{ y_m = 0.0, chord_m = 2.0 }, { y_m = 10.0, chord_m = 2.0 }]
[flow]
density_kg_per_m3 = 1.0
mach = 0.3
[aerodynamics]
n_span = 4
n_chord = 2
semi_chord_m = 1.0
n_reduced_frequencies = 6
lags = [0.2]
[calibration]
flutter_speed_m_per_s = 319.3
frequency_ratio = 3.0
[[tanks]]
name = "outer"
y_m = 8.2
length_m = 0.6
width_m = 0.5
height_m = 0.3
"""

SHORT = ["--speeds", "2", "--duration", "2", "--patience", "10"]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("wing.toml").write_text(WING)
    network = NormalisedRadialBasis(10, 3)
    theta = 0.1 * np.random.default_rng(4).normal(size=network.n_parameters)
    facts = {"fill_level": 0.5, "tank_height_m": 0.06, "liquid_mass_kg": 1.0}
    save_model(
        ReducedOrderModel(network, theta, Delays.tapped(10), Scaling(0.0, 0.5, 0.0, 0.3), 100.0, facts),
        "ROM.nc",
    )
    omega_bar, u_bar = np.linspace(1.6, 6.6, 30), np.linspace(0.01, 0.5, 40)
    level = u_bar * omega_bar[:, None] ** 2
    maps = {"w_bar": np.minimum(level, 1.5), "beta": np.full(level.shape, -0.1)}
    along = ("omega_bar", "u_bar")
    xr.Dataset(
        {name: (along, values) for name, values in maps.items()}, {"omega_bar": omega_bar, "u_bar": u_bar}
    ).to_netcdf("maps.nc")
    return tmp_path


@pytest.mark.skipif(find_spec("panelaero") is None, reason="needs PanelAero")
def test_a_small_wing_gives_all_results(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["wing", "wing.toml", "--rom", "ROM.nc", "--maps", "maps.nc", "-o", "OUT", "--json"]
    code = run([*arguments, *SHORT, "--no-report"])
    # a network without a domain of validity is flagged
    assert code == 3
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    wing = summary["wings"]["wing"]
    assert any("does not tell where it was trained" in flag for flag in summary["flags"])
    # the stiffness was not solved for the targets, and that is said
    assert any(flag.startswith("calibration") for flag in summary["flags"])
    # the tank flutters faster than any map was measured
    assert any("no dampers: w_bar at omega_bar" in flag for flag in summary["flags"])
    with xr.open_dataset(folder / "OUT" / "stability.nc") as stability:
        assert stability.sizes["fill_level"] == 11
        half = float(stability["fill_flutter_speed"].sel(fill_level=0.5))
        if wing["flutter_speed_m_per_s"] is not None:
            assert half == pytest.approx(wing["flutter_speed_m_per_s"], abs=0.02)
    with xr.open_dataset(folder / "OUT" / "response.nc") as response:
        assert {"frozen", "sloshing"} <= {str(name) for name in response["model"].values.astype(str)}
        assert response["tip_acceleration"].attrs["units"] == "m s-2"
        assert float(np.abs(response["tip_acceleration"].sel(model="frozen")).max()) > 0.1
    with xr.open_dataset(folder / "OUT" / "bifurcation.nc") as bifurcation:
        assert bifurcation["cycle_amplitude"].shape == (3, 2)
    assert not (folder / "OUT" / "report.html").exists()


@pytest.mark.slow
@pytest.mark.skipif(find_spec("panelaero") is None, reason="needs PanelAero")
def test_the_report_draws_every_figure_of_a_small_wing(folder: Path) -> None:
    assert run(["wing", "wing.toml", "--rom", "ROM.nc", "--maps", "maps.nc", "-o", "OUT", *SHORT]) == 3
    assert "asked and reached" in (folder / "OUT" / "report.html").read_text(encoding="utf-8")
    drawn = {path.stem for path in (folder / "OUT" / "figures").iterdir()}
    assert {"layout", "root_locus", "fill_level", "gust_1", "two_gusts", "bifurcation", "energy"} <= drawn


def test_bad_input_is_one_line(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    heavy = WING.replace("length_m = 0.6\nwidth_m = 0.5", "length_m = 5.0\nwidth_m = 5.0")
    Path("heavy.toml").write_text(heavy)
    without = WING[: WING.index("[calibration]")] + WING[WING.index("[[tanks]]") :]
    Path("without.toml").write_text(without)
    cases = [
        (["wing.toml", "--rom", "absent.nc"], "absent.nc"),
        (["absent.toml", "--rom", "ROM.nc"], "absent.toml"),
        (["without.toml", "--rom", "ROM.nc", "--calibrate"], "without [calibration]"),
        (["wing.toml", "--rom", "ROM.nc", "--match-fold", "323"], "no --maps"),
        (["heavy.toml", "--rom", "ROM.nc"], "liquid of tank outer"),
        (["wing.toml", "--rom", "ROM.nc", "--from", "340", "--to", "320"], "--from and --to"),
    ]
    for arguments, fragment in cases:
        assert run(["wing", *arguments, "-o", "OUT"]) == INPUT_IS_BAD, arguments
        error = capsys.readouterr().err
        assert fragment in error
        assert_one_line(error)
    assert not (folder / "OUT").exists()
