"""Recordings beside free-running simulations: one case in the same short-time spectra, and fits of its numbers.

`case` reads, `observations` compares in spectra weighted by the `noise_floor`, `rig_model` simulates a case by the
rules of `diagnosed_model`, and `free_run_fit` finds the numbers of a `free_run_problem` that describe all runs
together.
"""
