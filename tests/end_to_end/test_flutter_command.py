"""`sloshlab flutter` on good and bad model files."""

from __future__ import annotations

import json
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from progress_lines import without_progress

from pipelines.command_line import run


@pytest.fixture
def goland(repository: Path) -> Path:
    return repository / "docs" / "examples" / "goland_wing.toml"


def test_the_wing_of_goland_flutters_where_it_should(
    goland: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code = run(
        ["flutter", str(goland), "-o", str(tmp_path), "--from", "60", "--to", "280", "--speeds", "40", "--json"]
    )
    assert code == 0
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    wing = summary["models"]["wing"]
    flutter, divergence = wing["crossings"]
    assert [flutter["kind"], divergence["kind"]] == ["flutter", "divergence"]
    # an independent script with assumed modes: 136.96 m/s, 70.01 rad/s; divergence in closed form: 251.8 m/s
    assert flutter["speed_m_per_s"] == pytest.approx(136.96, rel=2e-3)
    assert flutter["frequency_rad_per_s"] == pytest.approx(70.01, rel=2e-3)
    assert flutter["origin"] == "mode 2"
    pressure = (np.pi / 2 / 6.096) ** 2 * 0.987e6 / (2 * np.pi * 1.8288 * 0.9144 * 0.16)
    assert divergence["speed_m_per_s"] == pytest.approx(np.sqrt(2 * pressure / 1.225), rel=4e-3)
    assert wing["p_k_flutter_m_per_s"] == pytest.approx(136.96, rel=2e-3)
    with xr.open_dataset(tmp_path / "stability.nc") as stability:
        assert stability.attrs["name"] == "Goland wing"
        of_wing = stability.sel(model="wing")
        assert float(of_wing["flutter_speed"]) == flutter["speed_m_per_s"]
        assert float(stability["crossing_speed"][1]) == divergence["speed_m_per_s"]
        branch = [str(name) for name in of_wing["origin"].values.astype(str)].index("mode 2")
        grows = of_wing["pole_real"].values[:, branch] > 0
        speed = stability["speed"].values
        assert speed[~grows].max() < 137.1 < speed[grows].min() + 6
    assert "Flutter" in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert {path.name for path in (tmp_path / "figures").iterdir()} == {
        "root_locus.png",
        "damping_and_frequency.png",
        "mode_shapes.png",
        "fit_of_forces.png",
    }


def test_a_range_without_flutter_says_so(goland: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["flutter", str(goland), "-o", str(tmp_path), "--from", "60", "--to", "90", "--speeds", "5"]
    assert run([*arguments, "--no-report"]) == 0
    assert "no root grows from 60 to 90 m/s" in capsys.readouterr().out
    assert not (tmp_path / "report.html").exists()


def test_flutter_beyond_the_aerodynamics_is_flagged(
    goland: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "model.toml"
    text = goland.read_text(encoding="utf-8")
    model.write_text(text.replace("largest_reduced_frequency = 2.0", "largest_reduced_frequency = 0.4"))
    arguments = [
        "flutter",
        str(model),
        "-o",
        str(tmp_path / "out"),
        "--from",
        "90",
        "--to",
        "160",
        "--speeds",
        "8",
    ]
    assert run([*arguments, "--no-report"]) == 3
    assert "beyond 0.4 of the aerodynamics" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "chord_m = 1.8288",
            "chord_m = -1.0",
            "station.0.chord_m: got -1.0; allowed: Input should be greater than 0",
        ),
        ("y_m = 6.096", "y_m = 0.0", "stations: got y = [0.0, 0.0]; allowed: two or more, ascending from 0"),
        ("n_span = 30", "n_strips = 30", "aerodynamics.n_strips: got 30; allowed: a key of the documentation"),
        ("pitch_inertia_kg_m = 8.64", "pitch_inertia_kg_m = 0.5", "pitch_inertia_kg_m: got less than mass times"),
        ("[flow]", "[flow", "model model.toml"),
    ],
)
def test_bad_models_are_one_line(
    goland: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, message: str
) -> None:
    model = tmp_path / "model.toml"
    model.write_text(goland.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    assert run(["flutter", str(model), "-o", str(tmp_path / "out"), "--from", "60", "--to", "90"]) == 1
    error = without_progress(capsys.readouterr().err)
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("speeds", [["--from", "90", "--to", "60"], ["--from", "-1", "--to", "60"]])
def test_speeds_that_do_not_ascend_are_refused(
    goland: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], speeds: list[str]
) -> None:
    assert run(["flutter", str(goland), "-o", str(tmp_path / "out"), *speeds]) == 1
    assert "--from and --to" in capsys.readouterr().err


def test_a_wing_has_no_models_of_liquids(goland: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["flutter", str(goland), "-o", str(tmp_path / "out"), "--models", "frozen"]) == 1
    assert "--models: got frozen; allowed: an aircraft" in capsys.readouterr().err


@pytest.fixture
def flying_wing(repository: Path, tmp_path: Path) -> Path:
    """mAEWing1 with the tank of case 1, fewer modes and reduced frequencies."""
    folder = repository / "raw_data" / "aircraft" / "maewing1"
    text = (folder / "case_1.toml").read_text(encoding="utf-8")
    text = text.replace('"maewing1.nc"', f'"{folder / "maewing1.nc"}"').replace("n_modes = 10", "n_modes = 8")
    model = tmp_path / "model.toml"
    model.write_text(text + "\n[aerodynamics]\nn_reduced_frequencies = 8\n", encoding="utf-8")
    return model


@pytest.mark.slow
@pytest.mark.skipif(find_spec("panelaero") is None, reason="PanelAero is not installed: extra aircraft")
def test_a_flying_wing_with_a_tank_flutters_as_it_should(
    flying_wing: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    code = run(
        ["flutter", str(flying_wing), "-o", str(out), "--from", "25", "--to", "35", "--speeds", "21", "--json"]
    )
    assert code == 0
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    frozen, lateral = summary["models"]["frozen"], summary["models"]["lateral"]
    # an independent script with 424 boxes and 14 modes: 32.02 m/s and 29.17 rad/s
    assert frozen["flutter_speed_m_per_s"] == pytest.approx(32.02, rel=0.025)
    assert frozen["flutter_frequency_rad_per_s"] == pytest.approx(29.17, rel=0.01)
    # … of the same script with sideways sloshing: −1.3 % and +0.9 %
    speed = lateral["flutter_speed_m_per_s"] / frozen["flutter_speed_m_per_s"] - 1
    frequency = lateral["flutter_frequency_rad_per_s"] / frozen["flutter_frequency_rad_per_s"] - 1
    assert speed == pytest.approx(-0.013, abs=0.002)
    assert frequency == pytest.approx(0.009, abs=0.002)
    for model in (frozen, lateral):
        assert model["p_k_flutter_m_per_s"] == pytest.approx(model["flutter_speed_m_per_s"], rel=0.01)
        assert model["crossings"][0]["origin"] == "mode 1"
    with xr.open_dataset(out / "stability.nc") as stability:
        assert stability["model"].values.astype(str).tolist() == ["frozen", "lateral"]
        names = stability["origin"].sel(model="lateral").values.astype(str).tolist()
        poles = stability["pole_imag"].sel(model="lateral", speed=25).values
        found = sorted(poles[[n for n, name in enumerate(names) if name.startswith("centre")]])
        # of the same script at 25 m/s, in inertial axes, without the weight of what tilts
        assert found == pytest.approx([12.42, 12.43, 22.70, 22.70, 29.27, 29.27], abs=0.06)
    assert len(summary["checks"]) == 5
    assert all(check["reached"] <= check["asked"] for check in summary["checks"])
    assert "Checks of this model" in (out / "report.html").read_text(encoding="utf-8")
    figures = {path.name for path in (out / "figures").iterdir()}
    assert {"root_locus_frozen.png", "root_locus_lateral.png", "models.png", "mode_shapes.png"} <= figures


@pytest.mark.parametrize(
    ("models", "extra", "message"),
    [
        ("frozen,full", "", "--models: got frozen,full; allowed: frozen, lateral, each once"),
        ("frozen,frozen", "", "--models: got frozen,frozen"),
        ("frozen", "[flow]\nmach = 1.2", "flow.mach: got 1.2"),
        ("frozen", "[wind]\nspeed = 1.0", "wind: got an unknown key"),
    ],
)
def test_bad_aircraft_are_one_line(
    flying_wing: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], models: str, extra: str, message: str
) -> None:
    flying_wing.write_text(flying_wing.read_text(encoding="utf-8") + extra + "\n", encoding="utf-8")
    assert run(["flutter", str(flying_wing), "-o", str(tmp_path / "out"), "--models", models]) == 1
    error = without_progress(capsys.readouterr().err)
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_dry_aircraft_has_nothing_that_sloshes(
    flying_wing: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = flying_wing.read_text(encoding="utf-8")
    flying_wing.write_text(text[: text.index("[[tanks]]")], encoding="utf-8")
    assert run(["flutter", str(flying_wing), "-o", str(tmp_path / "out"), "--models", "lateral"]) == 1
    assert "--models: got lateral; allowed: frozen; the model has no [[tanks]]" in capsys.readouterr().err


@pytest.fixture
def lattice_model(goland: Path, tmp_path: Path) -> Path:
    model = tmp_path / "lattice.toml"
    text = goland.read_text(encoding="utf-8").replace('"strips"', '"lattice"')
    text = text.replace("n_span = 30", "n_span = 8\nn_chord = 3").replace("frequencies = 25", "frequencies = 10")
    model.write_text(text, encoding="utf-8")
    return model


@pytest.mark.skipif(find_spec("panelaero") is None, reason="PanelAero is not installed: extra aircraft")
def test_forces_of_the_lattice_are_kept_and_made_anew_when_damaged(
    lattice_model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["flutter", str(lattice_model), "--from", "100", "--to", "220", "--speeds", "9", "--no-report"]
    arguments += ["--json", "--cache", str(tmp_path / "cache")]

    def flutter_speed(output: str, code: int) -> float:
        assert run([*arguments, "-o", str(tmp_path / output)]) == code
        summary = json.loads(capsys.readouterr().out.splitlines()[-1])
        assert bool(summary["flags"]) == (code == 3)
        return float(summary["models"]["wing"]["flutter_speed_m_per_s"])

    made = flutter_speed("made", 0)
    # a finite wing has less lift than strips: it flutters later
    assert 137 < made < 200
    assert flutter_speed("read", 0) == made
    [kept] = (tmp_path / "cache").glob("*.nc")
    kept.write_bytes(kept.read_bytes()[:-100])
    assert flutter_speed("damaged", 3) == made
    assert flutter_speed("read again", 0) == made


def test_a_missing_panelaero_is_one_line(
    lattice_model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "panelaero", None)
    monkeypatch.delitem(sys.modules, "panelaero.VLM", raising=False)
    monkeypatch.delitem(sys.modules, "panelaero.DLM", raising=False)
    code = run(["flutter", str(lattice_model), "-o", str(tmp_path / "out"), "--from", "100", "--to", "150"])
    error = without_progress(capsys.readouterr().err)
    assert code == 1
    assert error.count("\n") == 1
    assert "pip install 'sloshlab[aircraft]'" in error
