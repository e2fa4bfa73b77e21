"""`sloshlab aircraft` on a flying wing with few boxes and modes, and what it refuses."""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from progress_lines import without_progress

from pipelines.command_line import run
from sloshlab.reduced_order_model.ensemble import PROBABILITIES, Ensemble, ResidualSpread
from sloshlab.reduced_order_model.ensemble_storage import save_ensemble
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis
from sloshlab.reduced_order_model.regressors import Delays
from sloshlab.reduced_order_model.storage import save_model
from sloshlab.reduced_order_model.validity_domain import MotionCycles, ValidityDomain

pytestmark = pytest.mark.skipif(
    find_spec("panelaero") is None, reason="PanelAero is not installed: extra aircraft"
)
FEW = "\n[aerodynamics]\nn_boxes = 90\nn_reduced_frequencies = 8\n"
RANGE = ["--from", "25", "--to", "45", "--speeds", "6"]


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("forces")


@pytest.fixture
def model_of(repository: Path, tmp_path: Path) -> object:
    def made(case: str, *changes: tuple[str, str]) -> Path:
        folder = repository / "raw_data" / "aircraft" / "maewing1"
        text = (folder / f"{case}.toml").read_text(encoding="utf-8") + FEW
        for old, new in (
            ('"maewing1.nc"', f'"{folder / "maewing1.nc"}"'),
            ("n_modes = 10", "n_modes = 6"),
            *changes,
        ):
            assert old in text
            text = text.replace(old, new)
        (tmp_path / f"{case}.toml").write_text(text, encoding="utf-8")
        return tmp_path / f"{case}.toml"

    return made


def damper(seed: int) -> ReducedOrderModel:
    """Δf against the velocity: two neurons whose shares slope with it; the more the larger the number."""
    delays = Delays.tapped(2)
    domain = ValidityDomain.of([MotionCycles(np.zeros(90), np.linspace(4.6, 20.0, 90), np.tile([1e-5, 2.0], 45))])
    facts = {"fill_level": 0.5, "tank_height_m": 0.0272, "liquid_mass_kg": 0.1243, "domain": domain.facts()}
    weight = (1.0 + 0.1 * seed) * 1.5
    # of centres ±1 the normalised output is −w tanh(2v) of the last velocity
    theta = np.array([1.0, 0.0, -1.0, 0.0, -weight, weight])
    return ReducedOrderModel(NormalisedRadialBasis(2, 2), theta, delays, Scaling(), 512.0, facts)


@pytest.fixture
def rom(tmp_path: Path) -> Path:
    save_model(damper(0), tmp_path / "rom.nc")
    return tmp_path / "rom.nc"


def summary_of(capsys: pytest.CaptureFixture[str]) -> dict:
    return json.loads(capsys.readouterr().out.splitlines()[-1])


def test_four_models_beyond_flutter(
    model_of: object, rom: Path, cache: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Frozen and sideways liquids diverge; a force against the tank's velocity holds the flutter back."""
    members = tuple(damper(seed) for seed in (1, 2))
    spread = ResidualSpread(0.1, 0.1, (1.0,) * len(PROBABILITIES))
    save_ensemble(Ensemble(members, spread, members[0].facts), tmp_path / "ensemble.nc")
    out = tmp_path / "out"
    arguments = [
        "aircraft",
        str(model_of("case_1")),
        "--rom",
        str(rom),
        "--ensemble",
        str(tmp_path / "ensemble.nc"),
    ]
    gust = ["--gust-speed", "34", "--gust", "0.3", "--duration", "6", "--cache", str(cache), "--json"]
    code = run([*arguments, *gust, *RANGE, "-o", str(out)])
    summary = summary_of(capsys)
    assert code == (3 if summary["flags"] else 0)
    frozen, lateral = summary["flutter"]["frozen"], summary["flutter"]["lateral"]
    # sideways sloshing: −1.4 % and +1.0 % with 450 boxes and ten modes
    assert lateral["speed_m_per_s"] / frozen["speed_m_per_s"] - 1 == pytest.approx(-0.014, abs=0.004)
    assert frozen["speed_m_per_s"] < 34
    [one] = summary["gusts"]
    damping = {name: found["damping_ratio"] for name, found in one["models"].items()}
    assert damping["vertical"] > damping["frozen"] + 0.01
    assert damping["full"] > damping["lateral"] + 0.01
    # a member that damps more leaves more damping
    assert damping["vertical"] < one["models"]["vertical"]["members_damping_ratio"][0]
    assert np.diff(one["models"]["vertical"]["members_damping_ratio"]) > 0
    with xr.open_dataset(out / "response.nc") as found:
        assert found["model"].values.astype(str).tolist() == ["frozen", "lateral", "vertical", "full"]
        first = found.isel(case=0)
        assert float(first["w_gust"].max()) == pytest.approx(0.3, rel=1e-3)
        assert float(abs(first["sloshing_force"].sel(model="frozen")).max()) == 0.0
        force = first["sloshing_force"].sel(model="vertical").values[:, 0]
        assert np.nanmax(abs(force)) > 0.01
        # a hundredth more of damping at 29 rad/s over 1.5 s is a factor of 1.5
        later = abs(first["angle_of_attack"]).sel(time=slice(1.5, 2.0)).max("time")
        assert float(later.sel(model="frozen")) > 1.3 * float(later.sel(model="vertical"))
    assert {"stability.nc", "response.nc", "report.html"} <= {path.name for path in out.iterdir()}
    figures = {path.stem for path in (out / "figures").iterdir()}
    assert {"layout", "root_loci", "models", "mode_shapes"} <= figures
    assert sum(name.startswith(("response_", "force_", "liquids_")) for name in figures) == 3


def test_without_a_trained_model_nothing_sloshes_vertically(
    model_of: object, cache: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The gusts of the source at its distance from flutter, and the map of places."""
    scan = tmp_path / "scan.toml"
    scan.write_text("left = [1020, 1050]\nright = [2020, 2050]\nx_offset_m = [-0.3]\n", encoding="utf-8")
    out = tmp_path / "out"
    code = run(
        ["aircraft", str(model_of("case_2")), "--scan", str(scan), "--duration", "2", "--cache", str(cache),
         "--from", "25", "--to", "48", "--speeds", "4", "-o", str(out), "--no-report"]
    )  # fmt: skip
    said = capsys.readouterr().out
    assert code in (0, 3)
    assert "no --rom" in said
    with xr.open_dataset(out / "response.nc") as found:
        assert found["model"].values.astype(str).tolist() == ["frozen", "lateral"]
        assert found["case"].size == 6
        speed = found["gust_speed"].values
    with xr.open_dataset(out / "scan.nc") as found:
        frozen, lateral = (found[f"{name}_flutter_speed"].values.ravel() for name in ("frozen", "lateral"))
        # inboard sideways sloshing lowers the flutter, outboard it raises it, as with more boxes and modes
        assert lateral[0] < frozen[0]
        assert lateral[1] > frozen[1]
        np.testing.assert_allclose(found["tank_y"].values.ravel(), [0.372, 0.922], atol=1e-3)
    # the tanks of case 2 are at the second place: 18/20.86, 28 % of the way, 22.5/21.71
    assert speed[0] == pytest.approx(18 / 20.86 * frozen[1], rel=1e-4)
    assert speed[2] == pytest.approx(frozen[1] + 0.24 / 0.85 * (lateral[1] - frozen[1]), rel=1e-4)
    assert speed[4] == pytest.approx(22.5 / 21.71 * lateral[1], rel=1e-4)
    assert not (out / "report.html").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--gust", "1"], "--gust: got one of --gust and --gust-speed"),
        (["--gust", "1", "--gust-speed", "-3"], "--gust-speed: got -3"),
        (["--duration", "0"], "--duration: got 0 s"),
        (["--ensemble", "absent.nc"], "--ensemble: got no --rom"),
        (["--rom", "absent.nc"], "absent.nc"),
        (["--scan", "absent.toml"], "absent.toml"),
    ],
)
def test_what_cannot_be_done_is_one_line(
    model_of: object, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert run(["aircraft", str(model_of("case_1")), *arguments, "-o", str(tmp_path / "out")]) == 1
    error = without_progress(capsys.readouterr().err)
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            ("density_kg_per_m3 = 650.0", "density_kg_per_m3 = 4000.0"),
            "kg of liquid; allowed: less than the 6.687 kg",
        ),
        (
            ("fill_level = 0.5", "fill_level = 0.8"),
            "tank centre: fill level of the other tank: got 0.8; allowed: 0.5",
        ),
    ],
)
def test_tanks_that_cannot_be_are_one_line(
    model_of: object,
    rom: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    change: tuple[str, str],
    message: str,
) -> None:
    model = model_of("case_1", change)
    assert run(["aircraft", str(model), "--rom", str(rom), "-o", str(tmp_path / "out")]) == 1
    error = without_progress(capsys.readouterr().err)
    assert message in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("left = [1020]\nright = [2020, 2030]\nx_offset_m = [0.0]\n", "as many nodes on both sides"),
        ("left = [1020]\nright = [2020]\nx_offset_m = [0.1, 0.0]\n", "x_offset_m: ascending"),
        ("left = [1020]\nright = [2020]\n", "x_offset_m: got nothing"),
        (
            "left = [1020]\nright = [2020]\nx_offset_m = [0.0]\n",
            "--scan: got 1 tanks; allowed: a free aircraft with two",
        ),
    ],
)
def test_bad_scans_are_one_line(
    model_of: object, tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, message: str
) -> None:
    (tmp_path / "scan.toml").write_text(text, encoding="utf-8")
    arguments = ["--scan", str(tmp_path / "scan.toml"), "-o", str(tmp_path / "out")]
    assert run(["aircraft", str(model_of("case_1")), *arguments]) == 1
    error = without_progress(capsys.readouterr().err)
    assert message in error
    assert error.count("\n") == 1
