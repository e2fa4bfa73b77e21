"""Speed of the numerical tank: computing time per simulated second on one core, and two runs side by side.

The tank is half full and shaken with 3 g at 11.4 Hz; what is measured begins when the liquid is already
broken up. Every run is a process of its own, which computes a stretch of time whenever it is sent a line.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from typing import Final

from tests.benchmarks.own_process import MeasurementError

LEVEL_G, FREQUENCY_HZ = 3.0, 11.4
RUN_UP_S, STRETCH_S = 0.6, 0.25
N_REPEATS: Final = 4
RESOLUTIONS: Final = {16: 3.0, 24: 8.0}
"""Layers of particles over the height of the tank, and the aim in seconds per simulated second."""
SIDE_BY_SIDE: Final = "numerical tank: two processes over one, throughput"


def label(layers: int) -> str:
    """Name of a resolution's figure."""
    return f"numerical tank, h/{layers}: processor time per simulated second [s]"


def tank_figures(environment: Mapping[str, str]) -> dict[str, float]:
    """Speed at every resolution, and how much more two processes do than one.

    Parameters
    ----------
    environment : mapping
        Variables of the environment that keep a process on one core.
    """
    figures = {}
    for layers in RESOLUTIONS:
        print(f"numerical tank, h/{layers} …", flush=True)
        with _shaken(layers, environment) as run:
            figures[label(layers)] = min(_stretch(run)["processor_s"] for _ in range(N_REPEATS)) / STRETCH_S
    print("numerical tank, two side by side …", flush=True)
    with _shaken(16, environment) as first, _shaken(16, environment) as second:
        alone = max(_throughput(first) for _ in range(N_REPEATS))
        together = max(_throughput(first, second) for _ in range(N_REPEATS))
    return figures | {SIDE_BY_SIDE: together / alone}


def _throughput(*runs: subprocess.Popen[str]) -> float:
    """Simulated seconds per second of the clock, of runs that begin a stretch together."""
    for run in runs:
        _ask(run)
    return sum(STRETCH_S / _answer(run)["clock_s"] for run in runs)


def _stretch(run: subprocess.Popen[str]) -> dict[str, float]:
    _ask(run)
    return _answer(run)


def _ask(run: subprocess.Popen[str]) -> None:
    assert run.stdin is not None
    run.stdin.write("on\n")
    run.stdin.flush()


def _answer(run: subprocess.Popen[str]) -> dict[str, float]:
    assert run.stdout is not None
    line = run.stdout.readline()
    if not line:
        raise MeasurementError("the measured process ended before its time")
    return json.loads(line)


@contextlib.contextmanager
def _shaken(layers: int, environment: Mapping[str, str]) -> Iterator[subprocess.Popen[str]]:
    """A process with a liquid that is broken up, waiting."""
    command = [sys.executable, "-m", "tests.benchmarks.numerical_tank", str(layers)]
    with subprocess.Popen(
        command, env=os.environ | environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            _answer(process)
            yield process
        finally:
            process.kill()


def compute_stretches(layers: int) -> None:
    """Shake a tank; then compute a stretch for every line that comes, and print what it took."""
    from acquisition.numerical_tank.forced_motion import HarmonicMotion
    from acquisition.numerical_tank.simulation import NumericalTank
    from acquisition.numerical_tank.tank import Box, filled_tank

    tank = NumericalTank(filled_tank(Box(0.1172, 0.0272, 0.078), 0.5, layers))
    motion = HarmonicMotion(LEVEL_G * 9.81, FREQUENCY_HZ, rise_s=0.2)
    tank.advance(motion(tank.times_s(round(RUN_UP_S / tank.setup.step_s))))
    n_steps = round(STRETCH_S / tank.setup.step_s)
    print(json.dumps({"ready": True}), flush=True)
    for _ in sys.stdin:
        clock_s, processor_s = time.perf_counter(), time.process_time()
        tank.advance(motion(tank.times_s(n_steps)))
        took = {"clock_s": time.perf_counter() - clock_s, "processor_s": time.process_time() - processor_s}
        print(json.dumps(took), flush=True)


if __name__ == "__main__":
    compute_stretches(int(sys.argv[1]))
