"""Flight tests of a wing with tanks and a flap whose truth is known.

Own code, from the beam to the sensors: nothing of the analysis but its recording format, so that an error in one
cannot hide in the other.
"""
