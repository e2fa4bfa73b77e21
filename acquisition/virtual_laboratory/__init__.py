"""The virtual laboratory: recordings whose truth is known.

Nothing here is shared with the analysis except the recording format and the rig description, so
that an error in one cannot hide in the other.
"""
