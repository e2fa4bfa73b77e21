"""``python -m studies.liquid_motion FOLDER``: β by the liquid's centre, and superposition of two directions."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from pipelines.report.style import DISTINCT_COLOURS, drawing_style, new_figure, ordered_colours, png_bytes
from pipelines.report.terminal import say
from sloshlab import atomic_file
from sloshlab.errors import SloshlabError
from sloshlab.lateral_sloshing.box_tank import BoxTank, equivalent_model
from studies.liquid_motion.kept_runs import computed
from studies.liquid_motion.shaking import FILL_LEVEL, TANK, Shaken, Shaking

FREQUENCY_HZ: Final = 10.7
"""Of the first mode of the beam."""
LEVELS_G: Final = (1.0, 2.0, 3.0, 4.0, 5.0)
VERTICAL_G: Final = (1.0, 2.0, 3.0, 5.0)
SIDEWAYS_G: Final = (0.3, 0.6, 1.0)


def centre_runs() -> list[Shaking]:
    """Vertical motion at the levels of the picture."""
    return [Shaking(FREQUENCY_HZ, level) for level in LEVELS_G]


def plane_runs() -> list[Shaking]:
    """Each direction alone, both together, and the vertical one again with another start."""
    alone = [Shaking(FREQUENCY_HZ, vertical, 0.0, seed) for vertical in VERTICAL_G for seed in (0, 1)]
    sideways = [Shaking(FREQUENCY_HZ, 0.0, level) for level in SIDEWAYS_G]
    both = [Shaking(FREQUENCY_HZ, vertical, level) for vertical in VERTICAL_G for level in SIDEWAYS_G]
    return [*alone, *sideways, *both]


def centre_table(found: Mapping[Shaking, Shaken]) -> Iterator[str]:
    """β and W̄ by force and by centre, as Markdown."""
    yield "| level | β by the force | β by the centre | W̄ by the force | W̄ by the centre | u_l0/u₀ | φ |"
    yield "|---|---|---|---|---|---|---|"
    for shaking in centre_runs():
        run = found[shaking]
        (beta, w_bar), (own_beta, own_w_bar) = run.by_force, run.by_centre
        ratio = run.centre / run.u_over_height
        cells = [f"{value:.3f}" for value in (beta, own_beta, w_bar, own_w_bar, abs(ratio))]
        phase = f"{np.degrees(np.angle(ratio)):.0f}°"
        yield f"| {shaking.vertical_g:g} g | {' | '.join(cells)} | {phase} |".replace("-", "−")


def plane_table(found: Mapping[Shaking, Shaken]) -> Iterator[str]:
    """What the vertical force loses and the sideways force gains when both directions move."""
    yield (
        "| a_z | a_y | W̄, β alone | W̄, β with a_y | error of Δf_z | of another start | Δf_y/(m_l a_y) alone "
        "| with a_z | its error, linear model |"
    )
    yield "|---|---|---|---|---|---|---|---|---|"
    for vertical in VERTICAL_G:
        alone, other = (found[Shaking(FREQUENCY_HZ, vertical, 0.0, seed)] for seed in (0, 1))
        for level in SIDEWAYS_G:
            both, side = found[Shaking(FREQUENCY_HZ, vertical, level)], found[Shaking(FREQUENCY_HZ, 0.0, level)]
            pairs = [f"{run.by_force[1]:.2f}, {run.by_force[0]:+.2f}" for run in (alone, both)]
            errors = [f"{100 * vertical_error(run, alone):.0f} %" for run in (both, other)]
            ratios = [polar(run.sideways / level) for run in (side, both)]
            cells = [f"{vertical:g} g", f"{level:g} g", *pairs, *errors, *ratios]
            yield f"| {' | '.join(cells)} | {100 * sideways_error(both):.0f} % |".replace("-", "−")


def vertical_error(run: Shaken, alone: Shaken) -> float:
    """Difference of the vertical force from that of a run without sideways motion, over the latter."""
    return abs(run.vertical - alone.vertical) / abs(alone.vertical)


def sideways_error(run: Shaken) -> float:
    """Difference of the sideways force from that of the linear model, over the latter."""
    model = sideways_of_linear_model()
    return abs(run.sideways / run.shaking.sideways_g - model) / abs(model)


def sideways_of_linear_model() -> complex:
    """Δf_y over m_l a_y of the equivalent mechanical model (D.1–D.5) at the frequency of the study."""
    tank = BoxTank(TANK.length_m, TANK.depth_m, TANK.height_m, fill_level=FILL_LEVEL, density_kg_per_m3=1000.0)
    model = equivalent_model(tank, "x", n_modes=200)
    s = 2j * np.pi * FREQUENCY_HZ
    # force for a displacement Y of one: the acceleration is s²
    return complex(model.transfer_matrix(s)[0, 0] / (tank.liquid_mass_kg * s**2) + 1)


def superposition_figure(found: Mapping[Shaking, Shaken]) -> bytes:
    """Errors of both forces, added as if each direction were alone, over the vertical level, as PNG."""
    with drawing_style():
        figure = new_figure(3.0)
        left, right = figure.subplots(1, 2, sharex=True)
        for colour, level in zip(DISTINCT_COLOURS, SIDEWAYS_G, strict=False):
            both = [found[Shaking(FREQUENCY_HZ, vertical, level)] for vertical in VERTICAL_G]
            alone = [found[Shaking(FREQUENCY_HZ, vertical)] for vertical in VERTICAL_G]
            errors = [100 * vertical_error(*pair) for pair in zip(both, alone, strict=True)]
            left.plot(VERTICAL_G, errors, "o-", color=colour, label=f"{level:g} g sideways")
            right.plot(VERTICAL_G, [100 * sideways_error(run) for run in both], "o-", color=colour)
        starts = [
            100 * vertical_error(found[Shaking(FREQUENCY_HZ, v, 0.0, 1)], found[Shaking(FREQUENCY_HZ, v)])
            for v in VERTICAL_G
        ]
        left.plot(VERTICAL_G, starts, "k--", label="another start")
        left.set(xlabel="vertical level [g]", ylabel="vertical force [%]", ylim=(0, None))
        right.set(xlabel="vertical level [g]", ylabel="sideways force [%]", ylim=(0, None))
        figure.legend(loc="outside upper center", ncols=4)
        return png_bytes(figure)


def polar(value: complex) -> str:
    """Size and phase."""
    return f"{abs(value):.2f} ∠ {np.degrees(np.angle(value)):.0f}°"


def centre_figure(found: Mapping[Shaking, Shaken]) -> bytes:
    """Path of the centre over a cycle, and β by both ways, as PNG."""
    runs = [found[shaking] for shaking in centre_runs()]
    with drawing_style():
        figure = new_figure(3.3)
        left, right = figure.subplots(1, 2)
        for colour, run in zip(ordered_colours(len(runs)), runs, strict=True):
            phase = run.phase - np.floor(run.phase[0])
            left.plot(phase, run.centre_over_height, color=colour, label=f"{run.shaking.vertical_g:g} g")
        left.set(xlabel="cycles", ylabel="centre of the liquid, over h")
        for index, name in ((0, "β"), (1, "W̄")):
            own = DISTINCT_COLOURS[index]
            right.plot(LEVELS_G, [run.by_force[index] for run in runs], color=own, label=f"{name} by the force")
            right.plot(LEVELS_G, [run.by_centre[index] for run in runs], "o", color=own, mfc="white",
                       label=f"{name} by the centre")  # fmt: skip
        right.axhline(0, color="#888888", lw=0.6)
        right.set(xlabel="acceleration [g]")
        handles = [each.get_legend_handles_labels() for each in (left, right)]
        figure.legend(
            handles[0][0] + handles[1][0], handles[0][1] + handles[1][1], loc="outside upper center", ncols=5
        )
        return png_bytes(figure)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute and write both tables, the picture and all numbers.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(prog="python -m studies.liquid_motion", description=__doc__)
    parser.add_argument("folder", type=Path, help="of tables and picture")
    given = parser.parse_args(arguments)
    wanted = list(dict.fromkeys([*centre_runs(), *plane_runs()]))
    try:
        found = computed(given.folder / "runs", wanted)
        lines = [*centre_table(found), "", *plane_table(found)]
        atomic_file.write_bytes(given.folder / "tables.md", ("\n".join(lines) + "\n").encode())
        atomic_file.write_bytes(given.folder / "liquid_centre.png", centre_figure(found))
        atomic_file.write_bytes(given.folder / "superposition.png", superposition_figure(found))
    except SloshlabError as error:
        say(f"liquid_motion: {error}", error=True)
        return 1
    say(f"{given.folder / 'tables.md'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
