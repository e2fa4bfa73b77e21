"""Public benchmarks of nonlinear system identification: free-run errors of named models beside published ones."""
