"""A reference that nobody here wrote: OpenFOAM's two-phase solvers in the same box, beside the numerical tank."""
