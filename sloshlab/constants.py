"""Constants of nature and of the source, in SI units."""

GRAVITY_M_PER_S2 = 9.81
"""Gravity as the source uses it; sweep levels given in g are multiples of this value."""
