"""Cross-sections by their dimensions (TYPE of PBARL and PBEAML) whose numbers have closed forms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import pi
from typing import Final


@dataclass(frozen=True)
class ShapeNumbers:
    """Area, moments of area about z and y, torsion, and areas in shear over the area along y and z."""

    area: float
    inertia_1: float
    inertia_2: float
    torsion: float
    shear_1: float
    shear_2: float


def _rectangle(width: float, height: float) -> ShapeNumbers:
    """Torsion of a rectangle (Roark)."""
    a, b = max(width, height), min(width, height)
    torsion = a * b**3 * (1 / 3 - 0.21 * b / a * (1 - b**4 / (12 * a**4)))
    return ShapeNumbers(width * height, width * height**3 / 12, height * width**3 / 12, torsion, 5 / 6, 5 / 6)


def _rod(radius: float) -> ShapeNumbers:
    inertia = pi * radius**4 / 4
    return ShapeNumbers(pi * radius**2, inertia, inertia, 2 * inertia, 0.9, 0.9)


def _tube(outer: float, inner: float) -> ShapeNumbers:
    if inner >= outer:
        raise ValueError("an inner radius below the outer one")
    inertia = pi * (outer**4 - inner**4) / 4
    return ShapeNumbers(pi * (outer**2 - inner**2), inertia, inertia, 2 * inertia, 0.5, 0.5)


def _tube_by_thickness(outer: float, thickness: float) -> ShapeNumbers:
    if not 0 < thickness <= outer:
        raise ValueError("a thickness up to the outer radius")
    return _tube(outer, outer - thickness)


def _box(width: float, height: float, flange: float, web: float) -> ShapeNumbers:
    """A closed box; torsion of thin walls (Bredt), shear in the walls along it."""
    if 2 * flange >= height or 2 * web >= width or min(flange, web) <= 0:
        raise ValueError("walls within the box")
    within = (width - 2 * web), (height - 2 * flange)
    area = width * height - within[0] * within[1]
    b, h = width - web, height - flange
    torsion = 2 * flange * web * (b * h) ** 2 / (b * web + h * flange)
    return ShapeNumbers(
        area,
        (width * height**3 - within[0] * within[1] ** 3) / 12,
        (height * width**3 - within[1] * within[0] ** 3) / 12,
        torsion,
        2 * web * height / area,
        2 * flange * width / area,
    )


def _i(height: float, bottom: float, top: float, web: float, t_bottom: float, t_top: float) -> ShapeNumbers:
    """Two equal flanges and a web; torsion of thin open sections, shear in the web and in the flanges."""
    if bottom != top or t_bottom != t_top:
        raise ValueError("two equal flanges, whose centre of shear is that of the section")
    if min(web, t_top) <= 0 or web > top or 2 * t_top >= height:
        raise ValueError("flanges and web within the height")
    between = height - 2 * t_top
    area = 2 * top * t_top + web * between
    inertia_1 = (top * height**3 - (top - web) * between**3) / 12
    inertia_2 = (2 * t_top * top**3 + between * web**3) / 12
    torsion = (2 * top * t_top**3 + (height - t_top) * web**3) / 3
    return ShapeNumbers(area, inertia_1, inertia_2, torsion, web * height / area, 5 / 6 * 2 * top * t_top / area)


SHAPES: Final[dict[str, tuple[int, Callable[..., ShapeNumbers]]]] = {
    "BAR": (2, _rectangle),
    "ROD": (1, _rod),
    "TUBE": (2, _tube),
    "TUBE2": (2, _tube_by_thickness),
    "BOX": (4, _box),
    "I": (6, _i),
}
"""By TYPE: number of dimensions, and the numbers; unusable dimensions raise ValueError with what is allowed."""
