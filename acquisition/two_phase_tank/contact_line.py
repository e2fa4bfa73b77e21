"""Where the interface meets a wall: the slope there, by the contact angles, and lines that stick.

A line that sticks stays where it is while the angle is between the receding and the advancing one; beyond, it
slides as far as keeps the angle at that limit. With the height H in the column at the wall and Z at the wall
itself, half a column away, the slope is 2 (Z − H)/Δ; its limits are the cotangents of the angles.
"""

from __future__ import annotations

from typing import Final

from numba import njit

NO_LINE: Final = 1e9
"""Where no line sticks."""
FLOOR, ROOF, LEFT, RIGHT = range(4)
N_WALLS: Final = 4
_SEARCHED = 3
"""Cells up and down in which a line of the step before is looked for."""


@njit(cache=True, error_model="numpy")
def _nearest_line(lines, wall, way, at, middle, reach):  # type: ignore[no-untyped-def]
    """Place of the nearest line of that wall and way within reach of a place, or `NO_LINE`."""
    found, least = NO_LINE, reach
    for j in range(max(at - _SEARCHED, 0), min(at + _SEARCHED + 1, lines.shape[2])):
        distance = abs(lines[wall, way, j] - middle)
        if distance <= least:
            found, least = lines[wall, way, j], distance
    return found


@njit(cache=True, error_model="numpy")
def slope_at_wall(k_, before, after, wall, at, sign, middle, beside, ratio):  # type: ignore[no-untyped-def]
    """Slope with which the interface reaches a wall; where lines stick, `after` gets the line's new place.

    `middle` and `beside` are heights in the columns at the wall and beside it, in cells from the middle of cell
    `at` along `sign`; `ratio` is the width of a column over the height of a cell. Places: in cells along it.
    """
    slope = (middle - beside) / ratio
    if k_.sticks == 0.0:
        # free between the angles, the line goes on as it is
        return min(max(slope, k_.cot_advancing), k_.cot_receding)
    way = 0 if sign > 0 else 1
    steepest = max(abs(k_.cot_advancing), abs(k_.cot_receding))
    line = _nearest_line(before, wall, way, at, at + sign * middle, 0.5 * steepest * ratio + 1.0)
    if line < NO_LINE:
        slope = 2.0 * (sign * (line - at) - middle) / ratio
    slope = min(max(slope, k_.cot_advancing), k_.cot_receding)
    after[wall, way, at] = at + sign * (middle + 0.5 * slope * ratio)
    return slope
