"""The vocabulary of missing physics, one file per block; importing this package makes all of it known."""

from sloshlab.diagnosis.effects import excitation, sensors, structure, tank

__all__ = ["excitation", "sensors", "structure", "tank"]
