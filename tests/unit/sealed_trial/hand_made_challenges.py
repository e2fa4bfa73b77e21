"""Challenges without a laboratory: tiny readable cases, and a stand-in that answers them from a table."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

RIG = """
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 2.0
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
[structure]
kind = "sdof"
mass_kg = 2.0
stiffness_n_per_m = 3800.0
damping_kg_per_s = 0.9
[twin]
tank_model = "frozen"
"""
TWIN = "raise SystemExit('this code was run')\n"
TRUTHS = """
[quiet]
hidden = "nothing"

[cart]
hidden = "effects"
[[cart.effects]]
block = "structure"
name = "cubic_stiffness"
parameters = { stiffness_n_per_m3 = "0.3 N cm-3" }
"""


def written_run(path: Path, seed: int = 0) -> None:
    """A recording of one channel, noise of a tenth of a second."""
    values = np.random.default_rng(seed).normal(size=20)
    described = {"units": "m s-2", "quantity": "acceleration"}
    attributes = {
        "sloshlab_format": "1",
        "run_id": "r",
        "experiment": "sdof_free",
        "configuration": "sloshing",
        "rig": "rig.toml",
        "sampling_rate_hz": 200.0,
        "start_time_utc": "2026-01-01T00:00:00Z",
        "initial_displacement_m": 0.01,
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    time = {"time": np.arange(20) / 200.0}
    xr.Dataset({"acceleration_tip": ("time", values, described)}, time, attributes).to_netcdf(path)


def written_challenge(folder: Path) -> Path:
    """A case `quiet` with a rig, and a case `cart` with a twin of its own that must not be run."""
    for seed, (name, file, text) in enumerate((("quiet", "rig.toml", RIG), ("cart", "twin.py", TWIN))):
        written_run(folder / "cases" / name / "recordings" / "run_1.nc", seed)
        (folder / "cases" / name / file).write_text(text)
    return folder


def verdict(kind: str, *names: str, block: str = "structure", **parameters: list[float]) -> dict[str, Any]:
    """What a diagnosis would say; parameters as low and high."""
    numbers = {
        name: {"estimate": (low + high) / 2, "low": low, "high": high} for name, (low, high) in parameters.items()
    }
    effects = [{"name": name, "block": block, "parameters": numbers} for name in names]
    return {"verdict": kind, "effects": effects, "probabilities": {"+".join(names) or "none": 1.0}}


def answering(folder: Path, answers: dict[str, Any]) -> tuple[str, ...]:
    """A command that answers in the place of `sloshlab diagnose`, and notes how it was called."""
    script = folder / "answers.py"
    script.write_text(
        "import json, pathlib, sys\n"
        f"answers = json.loads({json.dumps(answers)!r})\n"
        "at = sys.argv.index('-o')\n"
        "case, output = pathlib.Path(sys.argv[at - 1]), pathlib.Path(sys.argv[at + 1])\n"
        "(output / 'called.txt').write_text(' '.join(sys.argv[at + 2:]))\n"
        "(output / 'verdict.json').write_text(json.dumps(answers[case.name]))\n"
    )
    return sys.executable, str(script)
