"""What the numerical tank is worth: flows with known outcome, what its numbers depend on, what they leave out."""
