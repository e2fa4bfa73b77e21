"""The diagnosis of a case, and the blind trial that judges it.

`diagnose` goes from a folder to a verdict and its report: one sentence on top, then where, the evidence, and the
fit on held-out runs. `trial` seals, runs and scores cases whose truth is locked away.
"""
