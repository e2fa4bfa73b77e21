"""`sloshlab train` over several fills: runs of a tank whose force is a known damper that depends on the fill."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from acquisition.virtual_laboratory.campaign import rig_text
from acquisition.virtual_laboratory.shaker_run import virtual_shaker_run
from pipelines.command_line import run
from sloshlab.errors import InputError
from sloshlab.recording import read_recording, write_recording
from sloshlab.reduced_order_model.storage import load_model
from sloshlab.rig import Rig
from sloshlab.twin.excitation import recorded
from sloshlab.twin.reduced_order_model_force import term_of
from sloshlab.twin.twin import Twin

FILLS = (0.3, 0.5, 0.7)
SMALL = ("--delays", "4", "--neurons", "8", "--epochs", "12", "--rate-hz", "128")


def damping_kg_per_s(fill: float) -> float:
    """Of the damper in place of the liquid: it grows with the square of the fill."""
    return 8.0 * fill**2


def damped(rig: Rig, name: str, seed: int, level_g: float) -> xr.Dataset:
    """A run whose cells hold (M + m) ü + c u̇, half each: Δf = −c u̇."""
    made = virtual_shaker_run(
        rig, configuration="frozen", duration_s=16.0, acceleration_g=level_g, seed=seed, imperfect=False,
        rig_name=name, run_id=f"{name}_{seed}",
    )  # fmt: skip
    acceleration = made["acceleration_roof_1"].values
    step = float(np.diff(made["time"].values[:2])[0])
    velocity = np.concatenate([[0.0], np.cumsum((acceleration[1:] + acceleration[:-1]) / 2) * step])
    for cell in ("force_cell_1", "force_cell_2"):
        made[cell] = made[cell] + damping_kg_per_s(rig.liquid.fill_level) * (velocity - velocity.mean()) / 2
    return made.assign_attrs(configuration="sloshing")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Rigs, two runs each, and one of a fill between."""
    made = tmp_path_factory.mktemp("fills")
    for fill in (*FILLS, 0.6):
        name = f"rig_{fill:g}.toml"
        (made / name).write_text(rig_text(fill), encoding="utf-8")
        rig = Rig.from_toml(made / name)
        for seed, level_g in ((1, 2.0), (2, 1.6)):
            write_recording(damped(rig, name, seed, level_g), made / f"fill_{fill:g}_{seed}.nc")
    return made


def arguments(folder: Path, output: Path, fills: tuple[float, ...] = FILLS, *more: str) -> list[str]:
    runs = [str(folder / f"fill_{fill:g}_{seed}.nc") for fill in fills for seed in (1, 2)]
    rigs = [part for fill in fills for part in ("--rig", str(folder / f"rig_{fill:g}.toml"))]
    return ["train", *runs, *rigs, "-o", str(output), *SMALL, *more]


def test_a_fill_that_was_left_out_gets_the_force_of_its_damper(folder: Path, tmp_path: Path) -> None:
    output = tmp_path / "ROM.nc"
    assert run(arguments(folder, output)) in (0, 3)
    model = load_model(output)
    assert model.facts["fill_levels"] == list(FILLS)
    assert len(model.facts["training"]) == 3
    time = np.arange(128 * 6) / 128.0
    omega = 2 * np.pi * 10.0
    velocity = 1.5 * 9.81 / omega * np.sin(omega * time)
    motion = recorded(128.0, velocity=velocity)
    rig = Rig.from_toml(folder / "rig_0.6.toml")
    result = Twin(None, (term_of(model, rig),)).simulate(motion).require_done()
    late = time > 0.5
    force, velocity = result.tank_force_n[late], velocity[late]
    # in phase with the velocity: −c of a fill that no run had, in newtons of the liquid that is there
    assert force @ velocity / (velocity @ velocity) == pytest.approx(-damping_kg_per_s(0.6), rel=0.08)
    for fill in (0.2, 0.85):
        with pytest.raises(InputError, match=r"allowed: 0\.3 … 0\.7"):
            term_of(model, Rig.from_toml_text(rig_text(fill)))
    validation = ["validate", str(output), str(folder / "fill_0.6_1.nc"), "--rig", str(folder / "rig_0.6.toml")]
    assert run([*validation, "-o", str(tmp_path / "validation")]) in (0, 3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda words: [*words, "--sudden-start", words[1]], "--sudden-start"),
        (lambda words: [*words, "--test", words[1]], "--test"),
        (lambda words: [words[0], *words[2:]], "two at least"),
        (lambda words: [word.replace("rig_0.5", "rig_0.6") for word in words], "give its rig"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(folder, tmp_path, capsys, change, message) -> None:
    words = change(arguments(folder, tmp_path / "ROM.nc"))
    assert run(words) == 1
    assert message in capsys.readouterr().err
    assert not (tmp_path / "ROM.nc").exists()


def test_recordings_say_what_the_test_believes(folder: Path) -> None:
    made = read_recording(folder / "fill_0.5_1.nc")
    assert made.attrs["configuration"] == "sloshing"
    assert made.attrs["rig"] == "rig_0.5.toml"
