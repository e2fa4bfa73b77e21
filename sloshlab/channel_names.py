"""Usual names of channels, ``<quantity>_<place>``; several sensors at one place are numbered from 1."""

from __future__ import annotations

from typing import Final

FORCE_CELL: Final = "force_cell"
"""Beginning of the names of force cells between shaker and tank; their sum is the force on the tank."""
FORCE_INTERFACE: Final = "force_interface"
"""Force of the structure on the tank."""
ACCELERATION_ROOF: Final = "acceleration_roof"
"""Beginning of the names of accelerometers on the roof of the tank."""
ACCELERATION_CONTROL: Final = "acceleration_control"
"""The accelerometer by which the shaker is controlled."""
ACCELERATION_ROOT: Final = "acceleration_root"
"""At the root of the beam, which moves with the base."""
ACCELERATION_TIP: Final = "acceleration_tip"
"""At the tip of the beam, which moves with the tank."""
ACCELERATION_BEAM: Final = "acceleration_beam"
"""Beginning of the names of accelerometers along the beam."""
DISPLACEMENT_TANK: Final = "displacement_tank"


def numbered(start: str, n: int) -> tuple[str, ...]:
    """Names of n sensors at one place.

    Examples
    --------
    >>> numbered(FORCE_CELL, 2)
    ('force_cell_1', 'force_cell_2')
    """
    return tuple(f"{start}_{k}" for k in range(1, n + 1))
