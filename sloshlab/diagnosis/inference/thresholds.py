"""The six numbers by which it is decided what is said."""

from __future__ import annotations

from typing import Final

NAMED: Final = 0.9
"""Posterior probability that a name, or a set of names, needs: a wrong name costs nine times as much as none."""
LOCATED: Final = 0.8
"""Probability of a block, given that something is missing."""
TOLD_APART: Final = 3.0
"""Expected log-likelihood ratio from which recordings tell two models apart: twenty to one."""
LEAST_STRENGTH: Final = 0.5
"""Noise floors of the channel that shows it most, below which an effect, or a remainder, is not worth a word."""
LAW: Final = 0.1
"""Of the amplitude that lacks where nothing is added, which a law may leave: a formula is not the physics."""
PRIOR_OF_REMAINDER: Final = 0.1
"""Probability that something is left that no effect of a model explains."""
