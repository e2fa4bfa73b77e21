"""Physics and mathematics of shaken, partly filled tanks.

This package knows no hardware, no command line and no file but the recording format. Its
modules are imported on demand: ``import sloshlab`` alone loads none of the numerical stack.
"""

from sloshlab._version import __version__

__all__ = ["__version__"]
