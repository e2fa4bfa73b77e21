"""The twin of a rig, driven by the motion or the release of a recording."""
