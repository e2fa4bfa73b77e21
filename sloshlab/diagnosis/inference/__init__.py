"""Inference: models compete under one likelihood, and a decision is made of their posterior."""
