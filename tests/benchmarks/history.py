"""What was measured on which machine at which revision, and a figure of it.

``results/bench.json`` holds every figure of the last run, with its machine. ``history.json`` beside this module is
the part that is kept in the repository: one entry per revision and machine, three digits per figure.
`python -m tests.benchmarks.history` puts the last run into it and draws it; runs of some groups only go into the
entry of their revision and machine.
"""

from __future__ import annotations

import json
import math
import os
import platform
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

RESULTS: Final = Path("results") / "bench.json"
HISTORY: Final = Path(__file__).with_name("history.json")
FIGURE: Final = Path("docs") / "images" / "benchmarks_over_revisions.png"
_DIGITS: Final = 3


def described() -> dict[str, str]:
    """Revision, its date and the machine: asked when a run begins, whatever is committed while it goes on."""
    revision, date = _of_git("log", "-1", "--abbrev=8", "--format=%h %cs").split(" ")
    return {"revision": revision, "date": date, "machine": machine()}


def keep(figures: Mapping[str, float], about: Mapping[str, str], path: Path = RESULTS) -> None:
    """Write the figures of a run, beside those of other groups at the same revision on the same machine."""
    known = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    before = (
        known.get("figures", {}) if all(known.get(key) == about[key] for key in ("revision", "machine")) else {}
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps({**about, "figures": {**before, **figures}}, indent=1, ensure_ascii=False)
    path.write_text(text + "\n", encoding="utf-8")


def machine() -> str:
    """Processor, number of cores and versions."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.is_file():
        models = [line for line in info.read_text(encoding="utf-8").splitlines() if line.startswith("model name")]
        name = models[0].partition(":")[2].strip() if models else name
    return f"{name}, {os.cpu_count()} cores, Python {platform.python_version()}, NumPy {np.__version__}"


def _of_git(*words: str) -> str:
    done = subprocess.run(["git", *words], capture_output=True, text=True, check=False)
    return done.stdout.strip() or "unknown unknown"


def with_entry(history: list[dict[str, Any]], run: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The history with a run at its end, or in the entry of its revision and machine.

    Examples
    --------
    >>> run = {"revision": "a", "date": "2026-01-01", "machine": "m", "figures": {"x": 1.23456}}
    >>> with_entry([], run)[0]["figures"]
    {'x': 1.23}
    """
    figures = {name: _rounded(value) for name, value in run["figures"].items() if math.isfinite(value)}
    kept = []
    for entry in history:
        if (entry["revision"], entry["machine"]) == (run["revision"], run["machine"]):
            figures = {**entry["figures"], **figures}
        else:
            kept.append(entry)
    return [*kept, {**{key: run[key] for key in ("revision", "date", "machine")}, "figures": figures}]


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")


def over_aims(
    history: list[dict[str, Any]], at_most: Mapping[str, float], at_least: Mapping[str, float]
) -> dict[str, list[float]]:
    """Per figure with an aim, how much of it was used at each revision: above 1 it is missed; NaN if not measured.

    Examples
    --------
    >>> over_aims([{"figures": {"x": 3.0}}, {"figures": {"y": 8.0}}], {"x": 2.0}, {"y": 16.0})
    {'x': [1.5, nan], 'y': [nan, 2.0]}
    """
    aims = {name: (aim, 1) for name, aim in at_most.items()} | {name: (aim, -1) for name, aim in at_least.items()}
    found = {}
    for name, (aim, power) in aims.items():
        values = [entry["figures"].get(name, math.nan) for entry in history]
        if aim > 0 and any(value > 0 for value in values):
            found[name] = [(value / aim) ** power if value > 0 else math.nan for value in values]
    return found


def draw(history: list[dict[str, Any]], path: Path = FIGURE) -> None:
    """Every figure over its aim, one row each, revisions from left to right."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    from tests.benchmarks.__main__ import AIMS, AT_LEAST

    used = over_aims(history, AIMS, AT_LEAST)
    values = np.log2(np.array(list(used.values())))
    figure, axes = plt.subplots(figsize=(9.0, 1.6 + 0.24 * len(used)), layout="constrained")
    shown = axes.imshow(values, aspect="auto", cmap="RdYlGn_r", vmin=-3, vmax=3)
    axes.set_yticks(range(len(used)), list(used), fontsize=7)
    axes.set_xticks(range(len(history)), [f"{e['date']}\n{e['revision']}" for e in history], fontsize=7)
    axes.grid(False)
    for row, column in zip(*np.nonzero(np.isfinite(values)), strict=True):
        dark = abs(values[row, column]) > 2
        used_up = f"{2 ** values[row, column]:.2g}"
        axes.text(column, row, used_up, ha="center", va="center", fontsize=6, color="w" if dark else "k")
    bar = figure.colorbar(shown, ax=axes, shrink=0.5, ticks=[-3, -1, 0, 1, 3])
    bar.ax.set_yticklabels(["⅛", "½", "1, the aim", "2", "8"], fontsize=7)
    bar.set_label("share of the aim that is used; above 1 missed", fontsize=7)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    """Put the last run into the history and draw it."""
    history = json.loads(HISTORY.read_text(encoding="utf-8")) if HISTORY.is_file() else []
    if RESULTS.is_file():
        history = with_entry(history, json.loads(RESULTS.read_text(encoding="utf-8")))
    lines = ",\n".join(json.dumps(entry, ensure_ascii=False) for entry in history)
    HISTORY.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
    draw(history)


if __name__ == "__main__":
    main()
