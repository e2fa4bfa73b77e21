"""The whole command with a twin of one's own: closed forms of decays with friction that the twin does not have."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from pipelines.command_line import run as command
from sloshlab.recording import write_recording
from sloshlab.user_twin import load_extended

pytestmark = pytest.mark.slow

RATE_HZ, N = 250.0, 500
MASS_KG, STIFFNESS, FRICTION_N = 2.0, 3000.0, 0.6
LEVELS_M = (0.004, 0.006, 0.009)

MODULE = """
from sloshlab.user_twin import Compared, Mechanism, MechanicalTwin, Parameter, Reading


def cart(run, values):
    return Mechanism(
        2.0, values["stiffness"], values["damping"], {"displacement_cart": Reading(1.0)},
        initial_displacement_m=run.attributes["initial_displacement_m"],
    )


TWIN = MechanicalTwin(
    [Parameter("stiffness", 3030.0, 30.0, "N m-1"), Parameter("damping", 0.5, 0.3, "N s m-1")],
    [],
    {"displacement_cart": Compared("m", gain_tolerance=0.005)},
    cart,
)
"""


def decay(start_m: float) -> np.ndarray:
    """x = (x₀ − (2n+1) F/k) cos ωt + (−1)ⁿ F/k in the n-th half cycle, until |x| ≤ F/k at a turn."""
    time, omega, offset = np.arange(N) / RATE_HZ, np.sqrt(STIFFNESS / MASS_KG), FRICTION_N / STIFFNESS
    last = np.ceil((start_m / offset - 1) / 2)
    half = np.floor(omega * time / np.pi)
    phase = np.where(half < last, omega * time, last * np.pi)
    half = np.minimum(half, last - 1)
    return np.asarray((start_m - (2 * half + 1) * offset) * np.cos(phase) + (-1) ** half * offset)


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("own") / "case"
    (folder / "recordings").mkdir(parents=True)
    generator = np.random.default_rng(11)
    for start in LEVELS_M:
        for repeat in range(2):
            name = f"decay_{1e6 * start:.0f}_{repeat}"
            values = decay(start) + generator.normal(0, 1e-5, N)
            attributes = {
                "sloshlab_format": "1",
                "run_id": name,
                "experiment": "other",
                "configuration": "frozen",
                "rig": "own",
                "sampling_rate_hz": RATE_HZ,
                "start_time_utc": "2026-01-01T00:00:00Z",
                "initial_displacement_m": start,
                "repeat": repeat,
            }
            channels = {"displacement_cart": ("time", values, {"units": "m", "quantity": "displacement"})}
            run = xr.Dataset(channels, coords={"time": np.arange(N) / RATE_HZ}, attrs=attributes)
            write_recording(run, folder / "recordings" / f"{name}.nc")
    (folder.parent / "cart_twin.py").write_text(MODULE)
    return folder


def test_friction_is_named_and_the_extended_twin_follows_the_closed_form(case: Path) -> None:
    assert command(["diagnose", str(case), "--twin", str(case.parent / "cart_twin.py"), "--no-report"]) in (0, 3)
    found = json.loads((case / "diagnosis" / "verdict.json").read_text())
    names = [effect["name"] for effect in found["effects"]]
    assert found["verdict"] == "named"
    assert names == ["coulomb_friction"]
    force = found["effects"][0]["parameters"]["force_n"]
    assert force["estimate"] == pytest.approx(FRICTION_N, rel=0.03)
    values, extension = load_extended(case / "diagnosis" / "extended_twin.toml")
    assert values["stiffness"] == pytest.approx(STIFFNESS, rel=2e-3)
    assert [term.name for term in extension.terms] == ["coulomb_friction"]


def test_the_interval_of_the_friction_holds(case: Path) -> None:
    if not (case / "diagnosis" / "verdict.json").exists():
        command(["diagnose", str(case), "--twin", str(case.parent / "cart_twin.py"), "--no-report"])
    found = json.loads((case / "diagnosis" / "verdict.json").read_text())
    force = found["effects"][0]["parameters"]["force_n"]
    assert force["low"] < FRICTION_N < force["high"]
