"""Truths that nobody can read or change between the drawing of a trial and its scoring."""
