"""Sideways sloshing in a box tank: the equivalent mechanical model, and its coupling to any structure."""
