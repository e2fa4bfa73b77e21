"""Pictures and table of what the examination finds, for the documentation."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

from studies.consistency_sensitivity.damages import DAMAGES

MOVED = 0.03
"""Change of W̄ or β that counts."""
_COLOURS = ("#d9d9d9", "#9ecae1", "#31a354", "#fd8d3c", "#de2d26")
_MEANINGS = ("harmless, silent", "harmless, told", "all found", "some found", "none found")


def read_outcomes(path: Path) -> list[dict[str, Any]]:
    """Outcomes as `measurement.write_outcomes` has written them."""
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def moves(outcome: dict[str, Any]) -> bool:
    """Whether a damage changed W̄ or β by more than counts; a refused one did."""
    return bool(max(outcome["w_bar_change"], outcome["beta_change"]) > MOVED)


def draw_matrix(outcomes: Sequence[dict[str, Any]], path: Path) -> None:
    """Damages by size: which were found, over all cases."""
    classes = np.array([[_class(outcomes, damage.name, size) for size in damage.sizes] for damage in DAMAGES])
    figure, axes = plt.subplots(1, 2, figsize=(12, 8.2), layout="constrained")
    half = (len(DAMAGES) + 1) // 2
    for axis, rows in zip(axes, (slice(0, half), slice(half, None)), strict=True):
        shown = DAMAGES[rows]
        axis.imshow(classes[rows], cmap=ListedColormap(_COLOURS), vmin=-0.5, vmax=4.5, aspect="auto")
        axis.set_yticks(
            range(len(shown)), [f"{damage.name} [{damage.unit or '–'}]" for damage in shown], fontsize=8
        )
        axis.set_xticks([])
        axis.set_xlabel("size →")
        for row, damage in enumerate(shown):
            for column, size in enumerate(damage.sizes):
                axis.text(column, row, f"{size:.4g}", ha="center", va="center", fontsize=7)
        axis.set_xticks(np.arange(-0.5, 4), minor=True)
        axis.set_yticks(np.arange(-0.5, len(shown)), minor=True)
        axis.grid(which="minor", color="white", linewidth=1.5)
        axis.tick_params(which="both", length=0)
    patches = [Patch(color=colour, label=meaning) for colour, meaning in zip(_COLOURS, _MEANINGS, strict=True)]
    figure.legend(handles=patches, loc="outside lower center", ncols=5, frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _class(outcomes: Sequence[dict[str, Any]], damage: str, size: float) -> int:
    own = [outcome for outcome in outcomes if (outcome["damage"], outcome["size"]) == (damage, size)]
    moved = [outcome for outcome in own if moves(outcome)]
    if not moved:
        return 1 if any(outcome["answer"] != "silent" for outcome in own) else 0
    found = [outcome["answer"] != "silent" for outcome in moved]
    return 2 if all(found) else 3 if any(found) else 4


def draw_operating_points(points: Sequence[dict[str, float]], path: Path) -> None:
    """Found share over false alarms, one point per factor on all thresholds."""
    figure, axis = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
    alarms = [100 * point["false_alarms"] for point in points]
    found = [100 * point["found"] for point in points]
    axis.plot(alarms, found, "o-", color="#08519c")
    for point, x, y in zip(points, alarms, found, strict=True):
        axis.annotate(f"× {point['factor']:g}", (x, y), xytext=(6, -12), textcoords="offset points", fontsize=9)
    axis.set_xlabel("undamaged recordings flagged [%]")
    axis.set_ylabel("damages found that move W̄ or β by > 3 % [%]")
    axis.grid(alpha=0.4)
    axis.margins(0.1)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def summary(outcomes: Sequence[dict[str, Any]]) -> str:
    """Counts, and what stays silent, as lines of Markdown."""
    moved = [outcome for outcome in outcomes if moves(outcome)]
    found = [outcome for outcome in moved if outcome["answer"] != "silent"]
    lines = [
        f"{len(outcomes)} cases, {len(moved)} move, {len(found)} found: {100 * len(found) / len(moved):.1f} %"
    ]
    for damage in DAMAGES:
        own = [outcome for outcome in moved if outcome["damage"] == damage.name and outcome["answer"] == "silent"]
        if own:
            sizes = sorted({outcome["size"] for outcome in own})
            worst = max(max(outcome["w_bar_change"], outcome["beta_change"]) for outcome in own)
            at = ", ".join(f"{size:g}" for size in sizes)
            lines.append(f"| {damage.name} | {at} {damage.unit} | {len(own)} | {worst:.2g} |")
    return "\n".join(lines)
