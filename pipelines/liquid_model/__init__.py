"""Reduced-order models of the liquid: training, validation, and the study of many of them.

`train` and `study` go from `training_runs` to models; `comparison` runs a model on the motion of every recording
and puts what it says beside what was measured. `results` hold that, `outputs` writes it. The `figures_*` modules
draw, `tables` and `sections` put the page together.
"""
