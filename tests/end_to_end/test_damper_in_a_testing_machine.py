"""A damper in a testing machine, whose loop yields within a hundredth of its stroke, diagnosed with an own twin.

The recordings are made by SciPy: c v + k x + F₀ + z, ż = (z_y/x_y) v (1 − (c sgn(v z) + 1 − c) |z|/z_y).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

from pipelines.diagnosis.diagnose import diagnose_case
from sloshlab.recording import write_recording

TWIN = Path(__file__).resolve().parents[2] / "docs" / "examples" / "mr_damper_twin.py"
RATE_HZ, N = 100.0, 1500
LIMIT_N, YIELDING_M, CLOSING = 180.0, 1.2e-4, 0.8
STROKES = {"stroke_20mm": (0.020, 0.5), "stroke_13mm": (0.013, 0.6), "stroke_9mm": (0.009, 0.75)}


def stroke(name: str, size_m: float, frequency_hz: float, random: np.random.Generator) -> xr.Dataset:
    time, omega = np.arange(N) / RATE_HZ, 2 * np.pi * frequency_hz

    def speed(t: np.ndarray | float) -> np.ndarray:
        return np.asarray(size_m * omega * (np.cos(omega * t) + 0.345 * np.cos(2.3 * omega * t + 0.4)))

    def rate(t: float, z: np.ndarray) -> np.ndarray:
        v = float(speed(t))
        loading = (CLOSING * np.sign(v * z) + 1 - CLOSING) * np.abs(z) / LIMIT_N
        return np.asarray(LIMIT_N / YIELDING_M * v * (1 - loading))

    x = size_m * (np.sin(omega * time) + 0.15 * np.sin(2.3 * omega * time + 0.4))
    z = solve_ivp(rate, (0.0, time[-1]), [0.0], t_eval=time, max_step=5e-4, rtol=1e-7).y[0]
    force = 1500.0 * speed(time) + 1800.0 * x - 6.0 + z + random.normal(0.0, 4.0, N)
    read = {"displacement_table": (x + random.normal(0.0, 3e-6, N), "m", "displacement"),
            "force_damper": (force, "N", "force")}  # fmt: skip
    channels = {
        channel: ("time", values, {"units": units, "quantity": quantity, "zero_is_known": 1})
        for channel, (values, units, quantity) in read.items()
    }
    attributes = {
        "sloshlab_format": "1",
        "run_id": name,
        "test": name,
        "experiment": "other",
        "configuration": "frozen",
        "rig": "damper",
        "sampling_rate_hz": RATE_HZ,
        "start_time_utc": "2026-01-01T00:00:00Z",
    }
    return xr.Dataset(channels, coords={"time": time}, attrs=attributes)


@pytest.mark.slow
def test_a_loop_that_yields_at_once_is_named_with_its_numbers(tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    (tmp_path / "case" / "recordings").mkdir(parents=True)
    for name, (size, frequency) in STROKES.items():
        recorded = stroke(name, size, frequency, random)
        write_recording(recorded, tmp_path / "case" / "recordings" / f"{name}.nc")
    found = diagnose_case(tmp_path / "case", None, command="test", report=False, twin=TWIN)
    assert found["verdict"] == "named"
    [loop] = found["effects"]
    assert loop["name"] == "hysteresis"
    stiffness, exponent = (loop["parameters"][name] for name in ("stiffness_n_per_m", "exponent"))
    assert stiffness["low"] < LIMIT_N / YIELDING_M < stiffness["high"]
    assert stiffness["high"] < 1.2 * stiffness["low"]
    assert exponent["low"] <= 1.0 < exponent["high"] < 1.4
    assert found["fit"]["heldout_after"] < 1.3 < 0.2 * found["fit"]["heldout_retuned"]
