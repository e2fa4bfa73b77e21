"""Pictures of the numerical tank: snapshots, a film, and its maps beside the measured facts.

`snapshots` computes the liquid, `tank_drawing` draws one tank, `plates`, `film` and `maps` put the
pictures together, and ``python -m studies.numerical_tank_figures`` writes them.
"""
