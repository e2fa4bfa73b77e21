"""Studies that only make documentation: run from a checkout, not installed."""
