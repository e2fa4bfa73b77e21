"""One measurement per process: `python -m tests.benchmarks.measurements WHAT ARGUMENTS…` prints JSON."""

from __future__ import annotations

import gc
import itertools
import json
import resource
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import xarray as xr

RATE_HZ, DURATION_S = 10_000.0, 240.0
RIG = """
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.61
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
"""


def best_of(action: Callable[[], object], n: int) -> float:
    """Shortest processor time of `n` calls [s], with that of the processes which read untrusted files."""
    return min(processor_s(action) for _ in range(n))


def processor_s(action: Callable[[], object]) -> float:
    """Processor time of a call [s], of this process and of those that it waited for."""
    before = _used_s()
    action()
    return _used_s() - before


def _used_s() -> float:
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def best_in_turn(actions: Mapping[str, Callable[[], object]], n: int) -> dict[str, float]:
    """The shortest of `n` processor times of each action [s], taken in turn: what else runs disturbs all alike."""
    taken = [{name: processor_s(action) for name, action in actions.items()} for _ in range(n)]
    return {name: min(times[name] for times in taken) for name in actions}


def make(folder: str) -> dict[str, float]:
    """A run of the virtual rig, and a plain chirp in two lengths."""
    from acquisition.virtual_laboratory.shaker_run import virtual_shaker_run, write_virtual_run
    from sloshlab.rig import Rig

    rig_file = Path(folder, "rig.toml")
    rig_file.write_text(RIG)
    run = virtual_shaker_run(
        Rig.from_toml(rig_file), acceleration_g=3.0, sampling_rate_hz=RATE_HZ, duration_s=DURATION_S
    )
    write_virtual_run(run, Path(folder, "standard.nc"))
    write_chirp(Path(folder, "chirp.nc"), DURATION_S)
    write_chirp(Path(folder, "chirp_10.nc"), 10 * DURATION_S)
    return {}


def write_chirp(path: Path, duration_s: float, n_copies: int = 1) -> None:
    """Octave sweep from 5 to 20 Hz of a damped mass, five channels of 16-bit counts, or so many times five."""
    from sloshlab.recording import write_recording

    t = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
    octaves_per_s = 2.0 / duration_s
    omega = 2 * np.pi * 5.0 * np.exp2(octaves_per_s * t)
    phase = omega / (octaves_per_s * np.log(2))
    acceleration = 30.0 * np.cos(phase)
    force = 0.35 * acceleration + 1.5 * np.sin(phase)
    rng = np.random.default_rng(0)
    variables, encoding = {}, {}
    cells = [(f"force_cell_{k + 1}", force / n_copies, "N") for k in range(2 * n_copies)]
    roof = [(f"acceleration_roof_{k + 1}", acceleration, "m s-2") for k in range(3 * n_copies - 1)]
    for name, values, units in (*cells, *roof, ("acceleration_control", acceleration, "m s-2")):
        noisy = values + 0.002 * rng.standard_normal(t.size)
        variables[name] = ("time", noisy, {"units": units, "quantity": name.partition("_")[0]})
        encoding[name] = {"dtype": "int16", "scale_factor": 0.002, "_FillValue": np.int16(-32768), "complevel": 1}
    attributes = {
        "sloshlab_format": "1", "run_id": path.stem, "experiment": "shaker_sweep", "configuration": "sloshing",
        "rig": "rig.toml", "sampling_rate_hz": RATE_HZ, "start_time_utc": "2026-01-01T00:00:00Z",
    }  # fmt: skip
    recording = xr.Dataset(variables, {"time": ("time", t, {"units": "s"})}, attributes)
    write_recording(recording, path, encoding=encoding | {"time": {"complevel": 1}})


def sweep_analysis(recording: str, folder: str) -> Callable[[], object]:
    """A call that takes a recording to windows and maps."""
    from pipelines.sweep.outputs import write_experiment
    from pipelines.sweep.shaker import ShakerSettings, analyse_shaker

    settings = ShakerSettings.checked(p=6, m=24, boundaries="measured", allow_incomplete=False, has_report=False)

    def analyse() -> None:
        experiment = analyse_shaker([Path(recording)], [Path(folder, "rig.toml")], settings)
        write_experiment(experiment, Path(folder, "out"), command="benchmark", report=False)

    return analyse


def analyse(recording: str, folder: str) -> dict[str, float]:
    """Time of the whole analysis and of reading alone."""
    from sloshlab.recording import read_recording

    action = sweep_analysis(recording, folder)
    action()
    n = 5 if Path(recording).stat().st_size < 30e6 else 3
    return best_in_turn({"analysis_s": action, "read_s": lambda: read_recording(recording)}, n)


def growth(short: str, long: str, folder: str) -> dict[str, float]:
    """Times of the analysis of a recording and of one that is ten times as long, in turn in one process."""
    actions = {"short_s": sweep_analysis(short, folder), "long_s": sweep_analysis(long, folder)}
    actions["short_s"]()
    return best_in_turn(actions, 3)


def memory(recording: str, folder: str) -> dict[str, float]:
    """Peak memory of one analysis above that of the idle interpreter, and the size of the decoded recording.

    The peak is that of this process or of the one that reads the file, which begins as a copy of it, whichever is
    larger. The chirp of another process has compiled the kernels, so that no compiler is counted.
    """
    from sloshlab.recording import read_recording

    action = sweep_analysis(recording, folder)
    short = Path(folder, "short.nc")
    write_chirp(short, 20.0)
    sweep_analysis(str(short), folder)()
    gc.collect()
    before = _memory_bytes("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")  # from now on VmHWM is the peak of what comes
    action()
    peak = _memory_bytes("VmHWM")
    of_readers = 1024.0 * resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    return {
        "peak_bytes": max(peak, of_readers) - before,
        "decoded_bytes": float(read_recording(recording).nbytes),
    }


def _memory_bytes(what: str) -> float:
    """Memory of this process by its name in /proc/self/status."""
    return 1024.0 * int(Path("/proc/self/status").read_text().split(f"{what}:")[1].split()[0])


def peer(recording: str) -> dict[str, float]:
    """Work per cycle the usual way: Hilbert phase, cumulative trapezoid, high-pass, a loop over cycles.

    Ours from the same arrays: phase, boundaries between samples, work, phasors and subharmonics of each cycle.
    """
    from scipy import integrate, signal

    from sloshlab.recording import read_recording
    from sloshlab.sweep.cycles import evaluate_cycles
    from sloshlab.sweep.motion_phase import measured_phase

    run = read_recording(recording)
    force = (run["force_cell_1"] + run["force_cell_2"]).values
    acceleration = (0.5 * (run["acceleration_roof_1"] + run["acceleration_roof_2"])).values

    def ours() -> None:
        boundaries_s = measured_phase(acceleration, None, RATE_HZ).cycle_boundaries_s()
        evaluate_cycles(force, acceleration, boundaries_s, sampling_rate_hz=RATE_HZ)

    def plain() -> None:
        phase = np.unwrap(np.angle(signal.hilbert(acceleration)))
        velocity = integrate.cumulative_trapezoid(acceleration, dx=1 / RATE_HZ, initial=0.0)
        sos = signal.butter(2, 0.5, "highpass", fs=RATE_HZ, output="sos")
        velocity = signal.sosfiltfilt(sos, velocity)
        edges = np.searchsorted(phase, 2 * np.pi * np.arange(np.ceil(phase[0] / 6.2832), phase[-1] / 6.2832))
        [integrate.trapezoid(force[i:j] * velocity[i:j], dx=1 / RATE_HZ) for i, j in itertools.pairwise(edges)]

    plain()
    ours()
    return {"plain_s": best_of(plain, 5), "ours_s": best_of(ours, 5)}


def blas() -> dict[str, float]:
    """Time of a 1000³ matrix product."""
    matrix = np.random.default_rng(0).standard_normal((1000, 1000))
    return {"product_s": best_of(lambda: matrix @ matrix, 5)}


def twin() -> dict[str, float]:
    """Speed of the twin, alone and against `solve_ivp`, and with a trained model in its tank."""
    from tests.benchmarks.own_twin import own_twin_figures
    from tests.benchmarks.reduced_order_model_in_the_twin import loop_figures
    from tests.benchmarks.twin import twin_figures

    return twin_figures() | loop_figures() | own_twin_figures()


def flutter() -> dict[str, float]:
    """Speed of the doublet lattice and of root loci."""
    from tests.benchmarks.flutter import flutter_figures

    return flutter_figures()


def flights() -> dict[str, float]:
    """Speed of wings and of an aircraft in flight."""
    from tests.benchmarks.flights import flight_figures

    return flight_figures()


def scaling() -> dict[str, float]:
    """How cost grows."""
    from tests.benchmarks.scaling import scaling_figures

    return scaling_figures()


def modal() -> dict[str, float]:
    """Speed and error of modal fits."""
    from tests.benchmarks.modal_fit import modal_figures

    return modal_figures()


def formats() -> dict[str, float]:
    """Speed of reading every format."""
    from tests.benchmarks.file_formats import format_figures

    return format_figures()


if __name__ == "__main__":
    measurements = (make, analyse, growth, memory, peer, blas, twin, flutter, flights, scaling, modal, formats)
    chosen = {measurement.__name__: measurement for measurement in measurements}[sys.argv[1]]
    print(json.dumps(chosen(*sys.argv[2:])))
