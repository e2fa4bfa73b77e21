"""Cases of other laboratories, made by integrators of their own; beside each a note of what is right to answer.

Nothing here simulates with `sloshlab`; only the writer of the recording format is taken from it, and the guided
decays come from the virtual laboratory on purpose.
"""
