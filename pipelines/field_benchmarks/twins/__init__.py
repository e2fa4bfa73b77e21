"""Twins of the benchmarks, each a module that ``sloshlab diagnose --twin`` takes."""
