"""Models of the liquid learnt from recordings: velocity of the tank in, dynamic sloshing force out.

Regressors are past inputs (NFIR), or past inputs and outputs (NARX, NOE); a static network maps them to the
output. Training is Levenberg–Marquardt with analytic Jacobians. `predict` is one step ahead and may look at
measured outputs; `simulate` runs free and sees only the input.
"""
