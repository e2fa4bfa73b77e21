"""The vocabulary of missing physics, one file per block; importing this package makes all of it known."""

from sloshlab.missing_physics.effects import excitation, external, sensors, structure, tank

__all__ = ["excitation", "external", "sensors", "structure", "tank"]
