"""The study's numbers as lines of Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from studies.small_motion.errors import Measured
from studies.small_motion.networks import CANDIDATES, GALILEAN, SOURCE
from studies.small_motion.recorded import mean_of

NAMES: Final = {"two_phase": "liquid and gas", "recorded": "particles, recorded"}
Results = Mapping[str, Any]


def all_tables(results: Results) -> list[str]:
    """All tables, each with a line that names it before it."""
    lines = []
    for title, found in parts(results).items():
        lines += [f"Error by local amplitude, {title}:", "", *amplitude_table(found), ""]
        lines += [f"Change against the first network, {title}:", "", *gain_table(found), ""]
    lines += ["Work, network over liquid:", "", *work_table(results), ""]
    lines += ["Zero crossings in random motion:", "", *crossing_table(results), ""]
    lines += ["Small motion by what it was before:", "", *history_table(results), ""]
    lines += ["Designed motion:", "", *carried_table(results), ""]
    lines += ["Constant velocity:", "", *offset_table(results), ""]
    lines += ["Damping:", "", *damping_table(results), ""]
    lines += ["Tank's acceleration in closed loop:", "", *acceleration_table(results), ""]
    return lines


def amplitude_table(found: Results, what: str = "error") -> list[str]:
    """Error of the force in random motion by local amplitude, over the candidates; what is undecided last."""
    names = [name for name in _order(found) if name in found]
    classes = list(dict.fromkeys(key for name in names for key in found[name]["random"]))
    lines = _header("network", [f"{each} g" for each in classes])
    for name in names:
        cells = [per_cent(found[name]["random"].get(each, {}).get(what)) for each in classes]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    undecided = [found[names[0]]["random"].get(each, {}).get("floor") for each in classes]
    if any(cell and cell[0] > 0 for cell in undecided):
        lines.append(f"| *not decided by the motion* | {' | '.join(per_cent(cell) for cell in undecided)} |")
    return lines


def gain_table(found: Results) -> list[str]:
    """Change of the error against the source's network in the same samples, by local amplitude."""
    names = _order(found)
    classes = list(dict.fromkeys(key for name in names for key in found[name]["gain"]))
    lines = _header("network", [f"{each} g" for each in classes])
    for name in names[1:]:
        numbers = [found[name]["gain"].get(each) for each in classes]
        changes = [each and (np.expm1(each[0]), np.exp(each[0]) * each[1]) for each in numbers]
        lines.append(f"| {name} | {' | '.join(per_cent(change) for change in changes)} |")
    return lines


def work_table(results: Results) -> list[str]:
    """Work of the network over that of the liquid, by local amplitude."""
    lines: list[str] = []
    for title, found in parts(results).items():
        classes = list(dict.fromkeys(key for name in found for key in found[name]["random"]))
        if not lines:
            lines = _header("liquid, network", [f"{each} g" for each in classes])
        for name in _order(found):
            cells = [plain(found[name]["random"].get(each, {}).get("work")) for each in classes]
            lines.append(f"| {title}: {name} | {' | '.join(cells)} |")
    return lines


def crossing_table(results: Results) -> list[str]:
    """What a half wave without a zero crossing changes at the same local amplitude, of the source's network."""
    header = ["share", "error²", "force²", "not decided²"]
    lines = _header("liquid, half waves of", header)
    for title, found in parts(results).items():
        source = found[SOURCE.name]
        for signal in ("velocity", "acceleration"):
            cells = [f"{100 * source['share'][signal]:.1f} %", plain(source["crossing"][signal])]
            cells += [plain(source["force"][signal]), plain(source.get("undecided", {}).get(signal))]
            lines.append(f"| {title}: {signal} | {' | '.join(cells)} |")
    return lines


def history_table(results: Results) -> list[str]:
    """Damping coefficient at 0.5 … 1 g where the motion falls, stays and grows: of the liquid and of networks."""
    states = ("falling", "steady", "growing")
    lines = _header("c [N s/m]: liquid, network", states)
    for title, found in parts(results).items():
        rows = {"the liquid": (SOURCE.name, "liquid")} | {name: (name, "network") for name in _order(found)}
        for row, (name, what) in rows.items():
            cells = [plain(found[name]["history"][state][what]) for state in states]
            lines.append(f"| {title}: {row} | {' | '.join(cells)} |")
    return lines


def carried_table(results: Results) -> list[str]:
    """Error alone and on the slow motion by level, of the source's network and the Galilean one."""
    lines = _header(
        "liquid, level", ["alone", "on the slow motion", "Galilean, alone", "on it", "not decided, alone", "on it"]
    )
    for title, found in parts(results).items():
        source, galilean = (found[each.name]["carried"] for each in (SOURCE, GALILEAN))
        for level in source:
            cells = [
                per_cent(each[level][stage]["error"])
                for each in (source, galilean)
                for stage in ("alone", "carried")
            ]
            undecided = [per_cent(source[level][stage]["floor"]) for stage in ("alone", "carried")]
            lines.append(f"| {title}, {level} g | {' | '.join([*cells, *undecided])} |")
    return lines


def offset_table(results: Results) -> list[str]:
    """Error over a constant velocity that only the network sees, of the source's network."""
    lines: list[str] = []
    for title, found in parts(results).items():
        for candidate in (SOURCE, GALILEAN):
            for level, by_ratio in found[candidate.name]["offset"].items():
                if not lines:
                    lines = _header("liquid, level, network", list(by_ratio))
                cells = [per_cent(each) for each in by_ratio.values()]
                lines.append(f"| {title}, {level} g, {candidate.name} | {' | '.join(cells)} |")
    return lines


def damping_table(results: Results) -> list[str]:
    """ζ₁ in random motion (Table 2.5), mean and standard error over the starts of the training."""
    damping = results["recorded"]["closed loop"]["damping"]
    names = list(dict.fromkeys(name for at_level in damping.values() for name in at_level))
    lines = _header("ζ₁ [%]", list(damping))
    for name in names:
        cells = []
        for at_level in damping.values():
            mean = mean_of(at_level.get(name, []))
            cells.append(f"{mean.value:.2f}" + (f" ± {mean.error:.2f}" if np.isfinite(mean.error) else ""))
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return lines


def acceleration_table(results: Results) -> list[str]:
    """RMS error of the tank's acceleration in closed loop by local amplitude, over that of the recording."""
    found = results["recorded"]["closed loop"]["acceleration"]
    columns = [(run, each) for run, of_run in found.items() for each in of_run]
    names = list(
        dict.fromkeys(name for of_run in found.values() for by_name in of_run.values() for name in by_name)
    )
    lines = _header("twin", [f"{run.removeprefix('random_')}, {each} g" for run, each in columns])
    for name in names:
        cells = [per_cent(mean_of(found[run][each].get(name, [])).as_list()) for run, each in columns]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return lines


def per_cent(number: Sequence[float] | None) -> str:
    """A number and its error in per cent."""
    return _shown(number, 100.0, " %")


def plain(number: Sequence[float] | None) -> str:
    """A number and its error."""
    return _shown(number, 1.0, "")


def _shown(number: Sequence[float] | None, factor: float, unit: str) -> str:
    if number is None or not np.isfinite(number[0]):
        return "–"
    value = Measured(factor * number[0], factor * number[1])
    digits = 0 if unit else 2
    error = f" ± {value.error:.{digits}f}" if np.isfinite(value.error) and value.error > 0 else ""
    return f"{value.value:.{digits}f}{error}{unit}".replace("-", "−")


def parts(results: Results) -> dict[str, Results]:
    """Computed runs and recordings by their titles."""
    return {NAMES["two_phase"]: results["two_phase"], NAMES["recorded"]: results["recorded"]["force"]}


def _order(found: Results) -> list[str]:
    known = [candidate.name for candidate in CANDIDATES if candidate.name in found]
    return [*known, *(name for name in found if name not in known)]


def _header(first: str, others: Sequence[str]) -> list[str]:
    return [f"| {first} | {' | '.join(others)} |", "|---" * (1 + len(others)) + "|"]
