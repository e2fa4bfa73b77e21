"""The centre of the computed liquid, and vertical with sideways motion: what the two forces tell of each other."""
