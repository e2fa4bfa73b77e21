"""A tank on a beam or a guide: modes, damping over amplitude, spectra, and the twin beside them.

`analysis` goes through the `stages` of free runs and those of `random_runs`; `twins` simulates the same runs.
`results` hold what was found and `outputs` writes it. The `figures_*` modules compute and draw, `tables` and
`summary` say the same in numbers and words, `sections` puts them in order.
"""
