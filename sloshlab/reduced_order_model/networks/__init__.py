"""Static networks: a vector of regressors in, one number out, with the Jacobian of their parameters."""
