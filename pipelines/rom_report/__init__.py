"""The validation report of a reduced-order model.

`comparison` runs the model on the motion of every recording and puts what it says beside what was measured;
`results` hold that, `outputs` writes it. Modules `figures_…` draw, `tables` and `sections` put the page together.
"""
