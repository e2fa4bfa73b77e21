"""Structures in motion: modal filter, free decays, random runs and the beam's own modes."""
