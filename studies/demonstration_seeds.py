"""How often the demonstrations are right, and how long they take: several seeds of each, and the ready-made one.

    python -m studies.demonstration_seeds FOLDER [--seeds 5]

goes on where it was stopped and prints the tables of docs/demo.md.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from sealed_trial.demonstrations import DEMONSTRATIONS
from sloshlab.atomic_file import write_bytes

_DEMO: Final = (sys.executable, "-m", "pipelines.command_line", "demo")
_ANSWERED: Final = (0, 3)


def outcome(folder: Path, name: str, seed: int) -> dict[str, Any]:
    """What `sloshlab demo NAME --seed SEED --json` says, with the processor time that it took.

    Parameters
    ----------
    folder : Path
        Keeps what was found before.
    name : str
    seed : int
    """
    place = folder / f"{name}_{seed}"
    kept = folder / f"{name}_{seed}.json"
    if kept.is_file():
        known: dict[str, Any] = json.loads(kept.read_bytes())
        return known
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    words = [*_DEMO, name, "--seed", str(seed), "--no-open", "--json", "-o", str(place)]
    ended = subprocess.run(words, stdout=subprocess.PIPE, check=False)
    used_s = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    told: dict[str, Any] = {"demo": name, "seed": seed, "right": False, "judgement": "no answer"}
    if ended.returncode in _ANSWERED:
        told = json.loads(ended.stdout.decode().splitlines()[-1])
    told["processor_s"] = round(used_s, 1)
    write_bytes(kept, (json.dumps(told, indent=1, sort_keys=True) + "\n").encode())
    return told


def summary_rows(outcomes: Sequence[dict[str, Any]]) -> list[str]:
    """Rows of a Markdown table: of every demonstration how many are right, errors, and processor time."""
    rows = []
    for name in DEMONSTRATIONS:
        own = [each for each in outcomes if each["demo"] == name]
        if not own:
            continue
        answered = [each for each in own if "heldout_before" in each]
        n_right = sum(bool(each["right"]) for each in own)
        before, after = (_range(answered, key) for key in ("heldout_before", "heldout_after"))
        time_s = _range(own, "processor_s", digits=0)
        wrong = "; ".join(f"seed {each['seed']}: {each['judgement']}" for each in own if not each["right"])
        rows.append(f"| `{name}` | {n_right} of {len(own)} | {before} | {after} | {time_s} | {wrong or '–'} |")
    return rows


def _range(outcomes: Sequence[dict[str, Any]], key: str, digits: int = 1) -> str:
    values = [float(each[key]) for each in outcomes]
    if not values:
        return "–"
    return f"{min(values):.{digits}f} … {max(values):.{digits}f}"


def main() -> None:
    """Run what is missing, print the table."""
    parser = argparse.ArgumentParser(prog="python -m studies.demonstration_seeds", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seeds", type=int, default=5)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    outcomes = []
    for name, known in DEMONSTRATIONS.items():
        for seed in sorted({*range(1, given.seeds + 1), known.seed}):
            outcomes.append(outcome(given.folder, name, seed))
            told = outcomes[-1]
            print(f"{name} {seed}: {told['judgement']}, {told['processor_s']:.0f} s of processor", flush=True)
    print("\n".join(summary_rows(outcomes)))


if __name__ == "__main__":
    main()
