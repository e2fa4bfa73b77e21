"""What physics a simulation left out: where it misses recordings, what explains it, and whether that is unique.

The order is that of the four questions: `case` reads, `observations` compares in short-time spectra weighted by
what repeats, `free_run_fit` retunes the baseline, `search` selects among all `effects` by free-running fits,
`verdict` judges on held-out runs, and `examination` tells where and how the baseline misses the recordings.
"""
