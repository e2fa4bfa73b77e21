"""Verdicts against truths, counted by rules that were fixed before any truth was opened."""
