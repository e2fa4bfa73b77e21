"""One module per experiment: which stages, in which order; the command line; reports."""
