"""Twin of a wing in flight, which a model file describes: structure, air, tanks, flap.

Depends on: `sloshlab.aeroelastic`, `sloshlab.user_twin`, `sloshlab.missing_physics`.
"""
