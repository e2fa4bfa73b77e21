"""The simulated twin: excitation → structure → tank → sensors, integrated together by one compiled engine.

`law` states the one form that every force has, `terms` names and describes forces, `engine` integrates them,
`twin` puts the blocks together, and `storage` keeps a twin as text and netCDF.
"""
