"""Aeroelastic stability and gusts: unsteady aerodynamics of sections and lifting surfaces, flutter, turbulence.

Nodes, modes and masses come as NumPy arrays. Axes: x aft, y to starboard, z up; rotations are right-handed,
so that a positive rotation about y is nose up. Reduced frequency k = ωb/U with the semi-chord b.
"""
