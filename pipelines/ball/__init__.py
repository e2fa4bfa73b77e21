"""The bouncing ball: identified from free decays of a guided tank, or from sweeps of a tank on the shaker.

`stages` go from recordings to a ball and what it predicts, `results` hold it, `outputs` writes it. Three modules
`figures_…` draw it; `sections` and `tables` put the report together.
"""
