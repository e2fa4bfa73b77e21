"""A laboratory of its own: rigs as they really are, motions, sensors, files.

Everything here is written from the equations, not from the twin: an adaptive integrator with events in place of a
fixed step, hereditary damping by relaxation instead of by amplitude, wave numbers instead of beam elements.
"""
