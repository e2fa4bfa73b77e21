"""The numerical tank: a virtual laboratory whose liquid nobody prescribed.

The cross-section of the tank is computed from the equations of motion of a liquid with a free
surface, by weakly compressible smoothed particle hydrodynamics (SPH). What comes out, force on the
tank for a given motion of the tank, is the synthetic truth against which reduced models and the
diagnosis are judged. Nothing here is shared with any analysis.
"""
