"""From a recording as measured to signals that an analysis may rest on.

Gaps and clipping found, redundant sensors compared, signs checked, acceleration integrated, the
dry mass identified and its inertia removed. Nothing here changes the recording it is given.
"""
