"""Errors over the local amplitude, and over a constant velocity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from pipelines.report.style import DISTINCT_COLOURS, DISTINCT_MARKERS, drawing_style, new_figure, png_bytes
from studies.small_motion.networks import GALILEAN, SOURCE
from studies.small_motion.tables import parts

Results = Mapping[str, Any]
SHOWN: Final = (
    SOURCE.name,
    "slow run, weighted",
    "Galilean, slow and random runs, weighted",
    "slow and random runs, scaled by their amplitude",
)


_TICKS_PER_CENT: Final = (30, 50, 100, 200, 500, 1000)


def amplitude_figure(results: Results) -> bytes:
    """Error of the force in random motion by local amplitude, and what the motion does not decide, as PNG."""
    with drawing_style():
        figure = new_figure(3.5)
        shown = parts(results)
        both = figure.subplots(1, len(shown), sharey=True)
        for axes, (title, found) in zip(both, shown.items(), strict=True):
            for number, name in enumerate(SHOWN):
                classes = found[name]["random"]
                places, values, errors = _points(classes, "error")
                # a little apart, so that bars do not lie on each other
                axes.errorbar(
                    places * 1.03 ** (number - 1.5), values, errors, color=DISTINCT_COLOURS[number],
                    marker=DISTINCT_MARKERS[number], lw=1.1, capsize=2, label=name,
                )  # fmt: skip
            places, values, errors = _points(found[SOURCE.name]["random"], "floor")
            if values.any():
                axes.errorbar(places, values, errors, color="#777777", ls="--", lw=1.0, capsize=2,
                          label="not decided by the motion")  # fmt: skip
            axes.set(xscale="log", xlabel="local amplitude of the acceleration [g]", title=title)
            axes.set_xticks([0.25, 0.5, 1, 2, 4], ["0.25", "0.5", "1", "2", "4"], minor=False)
            axes.minorticks_off()
            axes.axhline(100, color="#aaaaaa", lw=0.6)
        both[0].set(ylabel="error of the force [%]", ylim=(0, None))
        figure.legend(*both[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
        return png_bytes(figure)


def offset_figure(results: Results) -> bytes:
    """Error over a constant velocity at each level, and on a computed slow motion, as PNG."""
    with drawing_style():
        figure = new_figure(3.9)
        left, right = figure.subplots(1, 2, sharey=True)
        source, galilean = (results["two_phase"][each.name] for each in (SOURCE, GALILEAN))
        for number, (level, by_ratio) in enumerate(source["offset"].items()):
            ratios, values, errors = _along(by_ratio)
            colour, marker = DISTINCT_COLOURS[number], DISTINCT_MARKERS[number]
            left.errorbar(
                ratios, values, errors, color=colour, marker=marker, lw=1.1, capsize=2, label=f"{level} g"
            )
            ratios, values, _ = _along(galilean["offset"][level])
            left.plot(ratios, values, color=colour, ls="--", lw=0.9)
        left.axvspan(1, max(map(float, by_ratio)), color="#eeeeee", zorder=0)
        left.text(1.05, 0.02, "no zero crossing", transform=left.get_xaxis_transform(), va="bottom", fontsize=8)
        left.set(xlabel="constant velocity over its amplitude", ylabel="error of the force [%]", yscale="log")
        # mathematical text is not parsed in the style of reports
        left.set_yticks(_TICKS_PER_CENT, [f"{tick:g}" for tick in _TICKS_PER_CENT], minor=False)
        left.minorticks_off()
        left.legend(loc="lower left", bbox_to_anchor=(-0.15, 1.0), ncols=4, columnspacing=0.8, handlelength=1.2)
        for number, (part, name) in enumerate(((source, SOURCE.name), (galilean, GALILEAN.name))):
            for stage, style, shown in (("alone", "-", "alone"), ("carried", "--", "on a slow one")):
                levels = np.array([float(level) for level in part["carried"]])
                numbers = 100 * np.array([part["carried"][level][stage]["error"] for level in part["carried"]])
                right.errorbar(
                    levels * 1.03 ** (number - 0.5), numbers[:, 0], numbers[:, 1], color=DISTINCT_COLOURS[number],
                    marker=DISTINCT_MARKERS[number], ls=style, lw=1.1, capsize=2, label=f"{name}, {shown}",
                )  # fmt: skip
        floors = 100 * np.array([source["carried"][level]["alone"]["floor"] for level in source["carried"]])
        right.plot(levels, floors[:, 0], color="#777777", ls=":", lw=1.2, label="not decided by the motion")
        right.set(xscale="log", xlabel="level of the fast motion [g]")
        right.set_xticks(levels, [f"{level:g}" for level in levels], minor=False)
        right.minorticks_off()
        right.legend(loc="lower left", bbox_to_anchor=(-0.05, 1.0))
        return png_bytes(figure)


def _points(classes: Results, what: str) -> tuple[Any, Any, Any]:
    ends = [[float(end) for end in name.split("–")] for name in classes]
    places = np.array([np.sqrt(max(low, high / 2) * min(high, 1.8 * max(low, high / 2))) for low, high in ends])
    numbers = 100 * np.array([each[what] for each in classes.values()])
    return places, numbers[:, 0], numbers[:, 1]


def _along(by_ratio: Mapping[str, Sequence[float]]) -> tuple[Any, Any, Any]:
    numbers = 100 * np.array(list(by_ratio.values()))
    return np.array([float(ratio) for ratio in by_ratio]), numbers[:, 0], numbers[:, 1]
