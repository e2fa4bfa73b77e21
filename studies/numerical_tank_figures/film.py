"""The film: some cycles of the moving tank in slow motion, its acceleration below, as an animated GIF."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from pipelines.report.style import ACCELERATION_COLOUR, NEUTRAL_COLOUR, drawing_style
from sloshlab.rig import Tank
from studies.numerical_tank_figures.snapshots import FRAMES_PER_CYCLE, Shaking, Snapshot
from studies.numerical_tank_figures.tank_drawing import (
    SPEED_COLOURS,
    arrange_scene,
    centres_mm,
    condition_text,
    cut_by_walls,
    draw_outline,
    draw_particles,
    outline_mm,
    speed_m_per_s,
    top_speed_m_per_s,
)  # fmt: skip

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL.Image import Image

FRAME_MS: Final = 40
"""How long a frame is shown; GIF counts in 10 ms."""
_DOTS_PER_INCH: Final = 100
_WIDTH_INCH: Final = 6.4
_TITLE_INCH: Final = 0.3
_TRACE_INCH: Final = 1.05
_N_GREYS: Final = 16
_N_SPEEDS: Final = 44


@dataclass(frozen=True)
class _Scene:
    """What changes from frame to frame."""

    figure: Figure
    scene: Any
    tank: Tank
    discs: Any
    outline: Any
    words: Any
    dot: Any


def film(snapshots: Sequence[Snapshot], tank: Tank) -> bytes:
    """The snapshots one after another, as a GIF that repeats.

    Parameters
    ----------
    snapshots : sequence of Snapshot
        Of one motion, one frame apart.
    tank : Tank
    """
    from PIL import Image

    with drawing_style():
        images = list(_images(snapshots, tank))
    palette = _palette()
    reduced = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    buffer = io.BytesIO()
    reduced[0].save(
        buffer, format="GIF", save_all=True, append_images=reduced[1:], duration=FRAME_MS, loop=0, optimize=False
    )
    return buffer.getvalue()


def slowdown(shaking: Shaking) -> float:
    """How many times slower than reality the film is.

    Examples
    --------
    >>> round(slowdown(Shaking(4.0, 11.4)), 2)
    10.94
    """
    return FRAME_MS / 1e3 * FRAMES_PER_CYCLE * shaking.frequency_hz


def _palette() -> Image:
    """Greys of lines and letters, the colours of the bar, and those of the trace."""
    import matplotlib
    from matplotlib.colors import to_rgb
    from PIL import Image

    greys = np.repeat(np.linspace(0, 1, _N_GREYS)[:, np.newaxis], 3, axis=1)
    speeds = matplotlib.colormaps[SPEED_COLOURS](np.linspace(0, 1, _N_SPEEDS))[:, :3]
    marks = [np.array(to_rgb(colour)) for colour in (ACCELERATION_COLOUR, NEUTRAL_COLOUR)]
    tints = [share * mark + 1 - share for mark in marks for share in (1.0, 0.5)]
    colours = np.round(255 * np.vstack([greys, speeds, *tints])).astype(np.uint8)
    image = Image.new("P", (1, 1))
    image.putpalette(colours.tobytes())
    return image


def _images(snapshots: Sequence[Snapshot], tank: Tank) -> Iterator[Image]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    scene = _arranged(snapshots, tank)
    canvas = FigureCanvasAgg(scene.figure)
    for snapshot in snapshots:
        _show(scene, snapshot, snapshots[0].frame)
        canvas.draw()
        yield Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())


def _show(scene: _Scene, snapshot: Snapshot, first_frame: int) -> None:
    lift_m = snapshot.shaking.displacement_m(snapshot.phase_deg)
    scene.discs.set_offsets(centres_mm(snapshot, lift_m))
    scene.discs.set_array(speed_m_per_s(snapshot))
    cut_by_walls(scene.discs, scene.scene, scene.tank, lift_m)
    scene.outline.set_data(*outline_mm(scene.tank, lift_m))
    scene.words.set_text(condition_text(snapshot))
    time_ms = _time_ms(snapshot.shaking, np.array([snapshot.frame - first_frame]))
    scene.dot.set_data(time_ms, [snapshot.shaking.acceleration_g(snapshot.phase_deg)])


def _time_ms(shaking: Shaking, frames: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    return np.asarray(1e3 * frames / (FRAMES_PER_CYCLE * shaking.frequency_hz), float)


def _arranged(snapshots: Sequence[Snapshot], tank: Tank) -> _Scene:
    from matplotlib.figure import Figure

    shaking = snapshots[0].shaking
    swing_m = shaking.displacement_amplitude_m
    scene_inch = _WIDTH_INCH * (tank.height_m + 2 * swing_m) / tank.length_m
    height_inch = _TITLE_INCH + scene_inch + _TRACE_INCH
    figure = Figure(figsize=(_WIDTH_INCH, height_inch), dpi=_DOTS_PER_INCH)
    scene = figure.add_axes((0.01, _TRACE_INCH / height_inch, 0.98, scene_inch / height_inch))
    arrange_scene(scene, tank, swing_m)
    scene.axhline(0.0, color="#999999", lw=0.8, ls=(0, (4, 4)), zorder=1)
    top = top_speed_m_per_s(snapshots)
    discs, outline = draw_particles(scene, snapshots[0], tank, top), draw_outline(scene, tank)
    discs.set_antialiased(False)
    level = f"{shaking.amplitude_g:g} g, {shaking.frequency_hz:g} Hz, {slowdown(shaking):.0f} times slower"
    baseline = 1 - 0.7 * _TITLE_INCH / height_inch
    figure.text(0.02, baseline, level, fontsize=10)
    words = figure.text(0.98, baseline, "", fontsize=10, ha="right", family="DejaVu Sans Mono")
    dot = _draw_trace(figure, snapshots, height_inch)
    _draw_bar(figure, discs, height_inch)
    return _Scene(figure, scene, tank, discs, outline, words, dot)


def _draw_trace(figure: Figure, snapshots: Sequence[Snapshot], height_inch: float) -> Any:
    """The acceleration over the time of the film, and a dot that will move along it."""
    axes = figure.add_axes((0.1, 0.42 / height_inch, 0.58, 0.55 / height_inch))
    shaking, frames = snapshots[0].shaking, np.array([snapshot.frame for snapshot in snapshots])
    time_ms = _time_ms(shaking, frames - frames[0])
    fine_ms = np.linspace(0, time_ms[-1] or 1.0, 400)
    phase_deg = snapshots[0].phase_deg + 0.36 * shaking.frequency_hz * fine_ms
    axes.plot(fine_ms, [shaking.acceleration_g(phase) for phase in phase_deg], color=NEUTRAL_COLOUR, lw=1.2)
    top = shaking.amplitude_g
    axes.set(
        xlabel="time [ms]",
        ylabel="ü [g]",
        xlim=(0, fine_ms[-1]),
        yticks=[-top, 0, top],
        ylim=(-1.2 * top, 1.2 * top),
    )
    return axes.plot([], [], "o", color=ACCELERATION_COLOUR, ms=7, clip_on=False, zorder=5)[0]


def _draw_bar(figure: Figure, discs: Any, height_inch: float) -> None:
    place = figure.add_axes((0.76, 0.42 / height_inch, 0.2, 0.12 / height_inch))
    bar = figure.colorbar(discs, cax=place, orientation="horizontal", extend="max")
    bar.set_label("speed in the tank [m/s]")
    bar.outline.set_linewidth(0.6)
