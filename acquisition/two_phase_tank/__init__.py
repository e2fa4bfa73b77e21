"""A second numerical tank: liquid and gas on a grid, with surface tension and walls that hold.

Incompressible flow of two phases in the cross-section of the tank by a volume-of-fluid method. What comes out, the
force on the tank for a given motion of the tank, is what the particles of `acquisition.numerical_tank` compute by
another method; nothing but the description of box and column is shared with it.
"""
