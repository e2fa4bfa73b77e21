"""Sweeps: work per cycle, effective mass and maps, of a tank on the shaker or of any force and motion.

`shaker` and `work` are the two analyses, `stages` what every sweep goes through. `selection` computes what a
figure shows, `planes` arranges, the `figures_*` modules draw, `tables` and `summary` say the same in numbers and
words; `sections` puts them in order, and `outputs` writes everything.
"""
