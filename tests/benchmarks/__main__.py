"""Speed and memory: `python -m tests.benchmarks [GROUP…]`, all of `GROUPS` if none is named.

Each measurement runs in a process of its own, on one core. Times are processor times, the best of several
repeats after a warm-up that compiles the kernels; starts of commands are timed by the clock, and so are training
and diagnoses, which run once, on two cores. The parent prints the table, says where a figure misses its
aim, and keeps the figures with the name of the machine in results/bench.json. A group that fails is named with the
last line that it said, and the others are measured all the same.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from sloshlab.aircraft.flight_stability import LIQUIDS
from tests.benchmarks.campaigns import DASK_OVERHEAD_LABEL, OVERHEAD_LABEL, RATIO_LABEL, campaign_figures
from tests.benchmarks.command_start import (
    COMPLETION_LABEL,
    HELP_LABEL,
    IMPORT_LABEL,
    REFUSAL_LABEL,
    VIRTUAL_LABEL,
    start_figures,
)
from tests.benchmarks.diagnosis import LONGEST_LABEL, MEDIAN_LABEL, diagnosis_figures
from tests.benchmarks.diagnosis import MEMORY_LABEL as DIAGNOSIS_MEMORY_LABEL
from tests.benchmarks.flights import AIR_LABEL, FLIGHT_LABEL, FLUTTER_LABEL
from tests.benchmarks.flutter import FORCES_LABEL, KEPT_LABEL, LOCUS_LABEL
from tests.benchmarks.history import described, keep
from tests.benchmarks.numerical_tank import RESOLUTIONS, SIDE_BY_SIDE, label, tank_figures
from tests.benchmarks.own_process import last_line, measured_apart
from tests.benchmarks.own_twin import STEPS_LABEL
from tests.benchmarks.reduced_order_model import MEMORY_LABEL, TIME_LABEL, model_figures
from tests.benchmarks.reduced_order_model_in_the_twin import LOOP_LABEL
from tests.benchmarks.scaling import CHANNELS_LABEL, NETWORKS_LABEL, TANKS_LABEL
from tests.benchmarks.study import STUDY_LABEL, study_figures
from tests.benchmarks.tanks_in_flight import LABEL as GUST_LABEL
from tests.benchmarks.twin import FREE_LABEL, LANES_LABEL, METHODS, RANDOM_LABEL, RIVAL_LABEL

ANALYSIS_LABEL = "netCDF to windows.nc and maps.nc [s]"
READING_LABEL = "… over reading and decoding the file"
LONG_MEMORY_LABEL = "peak memory of ten times the recording over one"
TRANSPORTS = ("serial", "socketcand", "slcan")
AIMS = {
    ANALYSIS_LABEL: 1.5,
    READING_LABEL: 2.0,
    "peak memory over decoded recording": 4.0,
    "10 × longer recording costs": 10.0,
    # constant, to within what two runs of one recording differ by
    LONG_MEMORY_LABEL: 1.1,
    CHANNELS_LABEL: 2.2,
    NETWORKS_LABEL: 2.2,
    TANKS_LABEL: 2.2,
    FREE_LABEL: 0.1,
    RANDOM_LABEL: 1.0,
    LOOP_LABEL: 0.012,
    FORCES_LABEL: 60.0,
    KEPT_LABEL: 1.0,
    **{LOCUS_LABEL.format(liquids): 10.0 for liquids in LIQUIDS},
    # as forces and root locus of the wing of the flutter above; sixty flights of a trial in a minute
    AIR_LABEL: 60.0,
    FLUTTER_LABEL: 10.0,
    FLIGHT_LABEL: 1.0,
    **{GUST_LABEL.format(liquids): 10.0 for liquids in LIQUIDS},
    MEDIAN_LABEL: 60.0,
    LONGEST_LABEL: 180.0,
    DIAGNOSIS_MEMORY_LABEL: 2.0,
    OVERHEAD_LABEL: 50.0,
    DASK_OVERHEAD_LABEL: 50.0,
    HELP_LABEL: 0.4,
    COMPLETION_LABEL: 0.4,
    REFUSAL_LABEL: 0.4,
    IMPORT_LABEL: 0.3,
    VIRTUAL_LABEL: 2.0,
    TIME_LABEL: 120.0,
    MEMORY_LABEL: 1.5,
    STUDY_LABEL: 900.0,
    **{label(layers): aim for layers, aim in RESOLUTIONS.items()},
    **{f"{transport}: samples wrong or lost": 0.0 for transport in TRANSPORTS},
    **{f"{transport}: recorder, share of one core": 0.6 for transport in TRANSPORTS},
    "live page: samples wrong or lost": 0.0,
    "live page: recorder, share of one core": 0.6,
}
AT_LEAST = {
    LANES_LABEL: 4.0,
    STEPS_LABEL: 2e6,
    SIDE_BY_SIDE: 1.8,
    RATIO_LABEL: 1.8,
    **{RIVAL_LABEL.format(method): 50.0 for method in METHODS},
}
RECORDING_S = 20.0
ONE_CORE = {
    name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
}


def measured(what: str, *arguments: object) -> dict[str, float]:
    """Run one measurement of `tests.benchmarks.measurements` in a process of its own, on one core."""
    return measured_apart("tests.benchmarks.measurements", what, *arguments, environment=ONE_CORE)


def recording_figures() -> dict[str, float]:
    """Live recording in real time by each transport, device and recorder in two processes."""
    from tests.benchmarks.sustained import LOADS, sustained

    shown = (
        "samples wrong or lost",
        "recorder, share of one core",
        "sample to disk, median [s]",
        "sample to disk, 99 % [s]",
    )
    figures: dict[str, float] = {}
    for transport, load in LOADS.items():
        print(f"recording by {transport} for {RECORDING_S:g} s …", flush=True)
        found = sustained(load, RECORDING_S)
        figures[f"{transport}: counts [MB/s]"] = load.bytes_per_s / 1e6
        if load.frames_per_s:
            figures[f"{transport}: frames [1/s]"] = load.frames_per_s
        figures |= {f"{transport}: {name}": float(found[name]) for name in shown}
    print(f"recording by serial with the live page open for {RECORDING_S:g} s …", flush=True)
    found = sustained(LOADS["serial"], RECORDING_S, has_page=True)
    of_page = ("page, messages", "page, samples not shown", "page, share of one core")
    return figures | {f"live page: {name}": float(found[name]) for name in (*shown, *of_page)}


def recording_analysis_figures() -> dict[str, float]:
    """From a recording to windows and maps, beside reading it, plain SciPy and BLAS."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        measured("make", folder)
        standard = measured("analyse", folder / "standard.nc", folder)
        memory = measured("memory", folder / "standard.nc", folder)
        short_memory = measured("memory", folder / "chirp.nc", folder)
        long_memory = measured("memory", folder / "chirp_10.nc", folder)
        growth = measured("growth", folder / "chirp.nc", folder / "chirp_10.nc", folder)
        peer = measured("peer", folder / "standard.nc")
        blas = measured("blas")
    return {
        ANALYSIS_LABEL: standard["analysis_s"],
        READING_LABEL: standard["analysis_s"] / standard["read_s"],
        "peak memory over decoded recording": memory["peak_bytes"] / memory["decoded_bytes"],
        "… of ten times the recording": long_memory["peak_bytes"] / long_memory["decoded_bytes"],
        LONG_MEMORY_LABEL: long_memory["peak_bytes"] / short_memory["peak_bytes"],
        "peak memory of ten times the recording [MB]": long_memory["peak_bytes"] / 1e6,
        "10 × longer recording costs": growth["long_s"] / growth["short_s"],
        "reading and decoding [s]": standard["read_s"],
        "decoded recording [MB]": memory["decoded_bytes"] / 1e6,
        "plain SciPy: work per cycle, over ours with phasors": peer["plain_s"] / peer["ours_s"],
        "analysis over a 1000³ matrix product": standard["analysis_s"] / blas["product_s"],
    }


def in_a_folder(action: Callable[[Path], dict[str, float]]) -> dict[str, float]:
    """Figures of what needs a place for its files."""
    with tempfile.TemporaryDirectory() as name:
        return action(Path(name))


GROUPS: dict[str, Callable[[], dict[str, float]]] = {
    "analysis": recording_analysis_figures,
    "twin": lambda: measured("twin"),
    "flutter": lambda: measured("flutter"),
    "flights": lambda: measured("flights"),
    "scaling": lambda: measured("scaling"),
    "modal": lambda: measured("modal"),
    "formats": lambda: measured("formats"),
    "model": model_figures,
    "study": lambda: in_a_folder(study_figures),
    "tank": lambda: tank_figures(ONE_CORE),
    "recording": recording_figures,
    "campaigns": campaign_figures,
    "start": lambda: in_a_folder(start_figures),
    "diagnosis": lambda: in_a_folder(diagnosis_figures),
}
"""What is measured together, in the order of the table."""


def main() -> None:
    """Measure the groups that are named, or all; print, keep; end with 1 if an aim is missed or a group failed."""
    asked = sys.argv[1:] or list(GROUPS)
    if unknown := set(asked) - set(GROUPS):
        sys.exit(f"benchmarks: got {', '.join(sorted(unknown))}; allowed: {', '.join(GROUPS)}")
    about, figures, failed = described(), dict[str, float](), []
    for name in asked:
        print(f"{name} …", flush=True)
        began = time.monotonic()
        try:
            own = GROUPS[name]()
        except (Exception, SystemExit) as error:  # noqa: BLE001 – whatever it was, the others are measured
            failed.append(f"{name}: FAILED: {last_line(str(error)) or type(error).__name__}")
            print(failed[-1], flush=True)
            continue
        print(f"{name}: {time.monotonic() - began:.0f} s by the clock", flush=True)
        keep(own, about)  # after each: an interrupted run leaves what it has measured
        figures |= own
    n_missed = printed(figures)
    print(*failed, sep="\n", end="\n" if failed else "")
    sys.exit(1 if n_missed or failed else 0)


def printed(figures: dict[str, float]) -> int:
    """Print figures beside their aims; return how many miss theirs."""
    missed = 0
    for name, value in figures.items():
        aim, sign = AIMS.get(name, AT_LEAST.get(name)), "≥" if name in AT_LEAST else "≤"
        is_met = aim is None or (value >= aim if name in AT_LEAST else value <= aim)
        verdict = "" if aim is None else f"   aim {sign} {aim:g}   {'met' if is_met else 'MISSED'}"
        missed += not is_met
        print(f"{name:<62}{value:>10.3g}{verdict}")
    return missed


if __name__ == "__main__":
    main()
