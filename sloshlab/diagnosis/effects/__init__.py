"""The vocabulary of missing physics, one file per block; importing this package makes all of it known."""

from sloshlab.diagnosis.effects import excitation, external, sensors, structure, tank

__all__ = ["excitation", "external", "sensors", "structure", "tank"]
