"""The figure of the twin in the documentation: ``python -m studies.twin_figure [FOLDER]``.

Its blocks, and the release of the guided tank (Tables 2.1, 2.2) with three models of its liquid.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pipelines.report.style import (
    ACCELERATION_COLOUR,
    DISTINCT_COLOURS,
    NEUTRAL_COLOUR,
    drawing_style,
    new_figure,
    png_bytes,
)
from sloshlab.atomic_file import write_bytes
from sloshlab.twin.excitation import free
from sloshlab.twin.simulation import Simulation
from sloshlab.twin.structure import single_degree_of_freedom
from sloshlab.twin.structure_forces import COULOMB_FRICTION, VISCOUS_DAMPING
from sloshlab.twin.tank_forces import BOUNCING_BALL
from sloshlab.twin.twin import Twin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FILE_NAME: Final = "twin.png"
_RELEASE_M, _DURATION_S, _RATE_HZ = -0.064, 5.0, 20_000.0
_SHOWN: Final = slice(None, None, 20)
_HEIGHT, _WIDTH = 0.30, 0.17
_BLOCKS: Final = (
    (0.09, "excitation", "formula or\nrecording"),
    (0.37, "structure", "modes, friction,\nsprings"),
    (0.65, "tank", "frozen, viscous,\nmaps, ball"),
    (0.91, "sensors", "gain, delay,\nnoise, range"),
)


def rig_of_table_2_1() -> Twin:
    """The guided tank with frozen liquid."""
    rig = Twin(single_degree_of_freedom(2.061 + 0.18, 3808.8, 1.58))
    return rig.with_term(COULOMB_FRICTION(force_n=0.37))


def releases() -> dict[str, Simulation]:
    """The same release with three models of the liquid; the ball is that of Table 2.2, read as printed."""
    ball = BOUNCING_BALL(
        radius_m=0.0244, stiffness_n_per_m=1103.0, damping_kg_per_s=13.04, hardening_per_m=74.04, beta=0.0017,
        liquid_mass_kg=0.18, height_m=0.06, damping_in_flight=1.0,
    )  # fmt: skip
    rig = rig_of_table_2_1()
    twins = {
        "frozen": rig,
        "viscous, c = 3 kg/s": rig.with_term(VISCOUS_DAMPING(place="tank", damping_n_s_per_m=3.0)),
        "bouncing ball": rig.with_term(ball),
    }
    run = free(_DURATION_S, _RATE_HZ)
    return {
        name: twin.simulate(run, initial_displacement_m=_RELEASE_M).require_done() for name, twin in twins.items()
    }


def twin_figure() -> Figure:
    """Blocks above, decays below."""
    figure = new_figure(4.2)
    [above], [below] = figure.subfigures(2, 1, height_ratios=(1.0, 1.15), squeeze=False)
    _draw_blocks(above.subplots())
    for axes, colour, (name, result) in zip(
        below.subplots(1, 3, sharey=True), DISTINCT_COLOURS, releases().items(), strict=False
    ):
        axes.plot(result.time_s[_SHOWN], 1e3 * result.displacement_m[_SHOWN], color=colour, lw=0.9)
        axes.set(title=name, xlabel="time t [s]", xlim=(0, _DURATION_S), ylim=(-70, 70))
        axes.label_outer()
    below.axes[0].set_ylabel("tank's position x [mm]")
    return figure


def _draw_blocks(axes: Axes) -> None:
    """Four blocks; the force of the liquid closes the loop, and the cuts are where a recording may enter."""
    from matplotlib.patches import Rectangle

    axes.set(xlim=(-0.01, 1.01), ylim=(0, 0.97))
    axes.axis("off")
    middle = 0.80
    for x, name, below in _BLOCKS:
        corner = (x - _WIDTH / 2, middle - _HEIGHT / 2)
        axes.add_patch(Rectangle(corner, _WIDTH, _HEIGHT, fc="#eef2f6", ec=NEUTRAL_COLOUR, lw=1.0))
        axes.text(x, middle + 0.075, name, ha="center", va="center", weight="bold")
        axes.text(x, middle - 0.055, below, ha="center", va="center", fontsize=7.5)
    for (left, *_), (right, *_), label in zip(
        _BLOCKS[:-1], _BLOCKS[1:], ("motion,\nforce", "motion", ""), strict=True
    ):
        _arrow(axes, (left + _WIDTH / 2, middle), (right - _WIDTH / 2, middle))
        axes.text((left + right) / 2, middle + 0.03, label, ha="center", va="bottom", fontsize=7.5)
    tank, structure, low = _BLOCKS[2][0], _BLOCKS[1][0], 0.40
    axes.plot([tank, tank, structure], [middle - _HEIGHT / 2, low, low], color=ACCELERATION_COLOUR, lw=1.3)
    _arrow(axes, (structure, low), (structure, middle - _HEIGHT / 2), ACCELERATION_COLOUR)
    axes.text(
        (tank + structure) / 2, low - 0.05, "force of the liquid Δf closes the loop", ha="center", va="top",
        color=ACCELERATION_COLOUR, fontsize=8,
    )  # fmt: skip
    alone = "A block alone takes a measured motion or force in place of the arrow before it."
    axes.text(0.5, 0.02, alone, ha="center", va="bottom", fontsize=8)


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], colour: str = NEUTRAL_COLOUR) -> None:
    axes.annotate("", xy=end, xytext=start, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.3,
                                                        "shrinkA": 0, "shrinkB": 0})  # fmt: skip


def main(folder: Path = Path("docs/images")) -> Path:
    """Write the figure; returns its path."""
    with drawing_style():
        data = png_bytes(twin_figure())
    path = folder / FILE_NAME
    write_bytes(path, data)
    return path


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
