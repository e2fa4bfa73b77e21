"""What the tank holds in a run: the attribute `configuration` of a recording."""

from __future__ import annotations

from typing import Final

SLOSHING: Final = "sloshing"
"""Liquid that is free to move."""
FROZEN: Final = "frozen"
"""The liquid's mass, fixed to the tank."""
EMPTY: Final = "empty"
"""The tank alone."""

CONFIGURATIONS: Final = (SLOSHING, FROZEN, EMPTY)
STILL_CONFIGURATIONS: Final = (EMPTY, FROZEN)
"""Nothing moves in the tank: such runs tell its dry mass."""
