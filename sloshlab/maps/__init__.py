"""From windows to continuous maps over frequency and amplitude.

``interpolation`` radial basis functions with their uncertainty · ``measured_region`` where a map
may be drawn · ``energy_maps`` the maps of W, W̄ and β on their grids.
"""
