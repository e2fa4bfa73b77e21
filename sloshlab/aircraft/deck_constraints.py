"""What ties the components of a deck: rigid elements, weighted means and equations."""

from __future__ import annotations

from dataclasses import dataclass

Component = tuple[int, int]
"""A node and one of its six components, from 0."""


@dataclass(frozen=True)
class RigidElement:
    """Components that follow six others as parts of one rigid body."""

    place: str
    independent: tuple[Component, ...]
    dependent: tuple[Component, ...]


@dataclass(frozen=True)
class RigidRod:
    """Two nodes whose distance stays; one component along which it has a part follows."""

    place: str
    ends: tuple[int, int]
    dependent: Component


@dataclass(frozen=True)
class WeightedMean:
    """A node that moves as the weighted mean of others (RBE3).

    Attributes
    ----------
    place : str
    reference : tuple of (int, int)
        Components of the reference node that are means.
    weights : tuple of ((int, int), float)
        Components of the others, with their weights.
    dependent : tuple of (int, int)
        As many components as `reference`, those that are eliminated.
    """

    place: str
    reference: tuple[Component, ...]
    weights: tuple[tuple[Component, float], ...]
    dependent: tuple[Component, ...]


@dataclass(frozen=True)
class Equation:
    """A sum of components that is zero; the first of them is eliminated."""

    place: str
    terms: tuple[tuple[Component, float], ...]
