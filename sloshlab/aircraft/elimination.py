"""Every component of a deck by independent ones: rigid elements, means and equations solved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from sloshlab.aircraft.deck import Deck
from sloshlab.aircraft.deck_constraints import Component, Equation, RigidElement, RigidRod, WeightedMean
from sloshlab.errors import AnalysisError, FileFormatError
from sloshlab.lateral_sloshing.coupling import rigid_motion

FloatArray = npt.NDArray[np.float64]
_LONGEST_CHAIN: Final = 1000
_LARGEST_CIRCLE: Final = 2000
_NEARLY_SINGULAR: Final = 1e-9
_ROUNDING: Final = 1e-13
"""Shares below this part of the largest are zero: axes that are turned and turned back leave such."""


@dataclass(frozen=True)
class _Rule:
    """A dependent component and the shares of others in it."""

    place: str
    dependent: Component
    shares: Mapping[Component, float]


def independent_motion(
    deck: Deck, row: Mapping[int, int], constraint_set: int | None, equation_set: int | None
) -> tuple[sparse.csr_matrix, tuple[Component, ...]]:
    """All components by the independent ones, in the axes of the nodes.

    Parameters
    ----------
    deck : Deck
    row : mapping of int to int
        First row of each node.
    constraint_set, equation_set : int or None
        Sets of SPC and of MPC cards that count.

    Returns
    -------
    motion : scipy.sparse matrix, shape (6 n_nodes, n)
    components : tuple of (int, int), length n
        The independent ones.

    Raises
    ------
    FileFormatError
        If a component is eliminated twice, or eliminated and held, or rules go round without solution.
    """
    held = _held(deck, constraint_set)
    rules = _rules(deck, equation_set)
    order: dict[Component, int] = {}
    for number, rule in enumerate(rules):
        name = f"node {rule.dependent[0]}, component {rule.dependent[1] + 1}"
        if rule.dependent in order:
            raise FileFormatError(
                rule.place, got=f"{name}, dependent twice", allowed="each component on one rigid element or MPC"
            )
        if rule.dependent in held:
            raise FileFormatError(rule.place, got=f"{name}, dependent and held", allowed="one of both")
        order[rule.dependent] = number
    free = [(node, c) for node in row for c in range(6) if (node, c) not in order and (node, c) not in held]
    column = {component: number for number, component in enumerate(free)}
    by_rules, by_free = _shares(rules, order, len(rules)), _shares(rules, column, len(column))
    solved = _substituted(*_without_circles(rules, by_rules, by_free)).tocoo()
    at = np.array([row[node] + component for node, component in order], dtype=np.int64)
    rows = np.concatenate([at[solved.row], [row[node] + component for node, component in free]])
    columns = np.concatenate([solved.col, np.arange(len(free))])
    values = np.concatenate([solved.data, np.ones(len(free))])
    shape = (6 * len(row), len(free))
    return sparse.csr_matrix((values, (rows.astype(int), columns.astype(int))), shape=shape), tuple(free)


def _held(deck: Deck, constraint_set: int | None) -> set[Component]:
    held = {(number, component) for number, grid in deck.grids.items() for component in grid.held}
    for part in _parts(constraint_set, deck.constraint_sums, deck.constraints, "constraint set"):
        for node, held_components in deck.constraints[part]:
            deck.grid(node, f"SPC {part}")
            held.update((node, component) for component in held_components)
    return held


def _parts(
    chosen: int | None, sums: Mapping[int, tuple[int, ...]], sets: Mapping[int, object], what: str
) -> tuple[int, ...]:
    """The sets that a number stands for, by SPCADD or MPCADD."""
    if chosen is None:
        return ()
    parts = sums.get(chosen, (chosen,))
    for part in parts:
        if part not in sets:
            raise AnalysisError(
                what, got=str(part), allowed=", ".join(map(str, sorted({*sets, *sums})))[:200] or "none"
            )
    return tuple(dict.fromkeys(parts))


def _rules(deck: Deck, equation_set: int | None) -> list[_Rule]:
    rules: list[_Rule] = []
    for element in deck.rigid.values():
        if isinstance(element, RigidElement):
            rules.extend(_of_rigid(deck, element))
        elif isinstance(element, RigidRod):
            rules.append(_of_rod(deck, element))
        else:
            rules.extend(_of_mean(deck, element))
    for part in _parts(equation_set, deck.equation_sums, deck.equations, "set of MPC"):
        rules.extend(_of_equation(deck, equation) for equation in deck.equations[part])
    return rules


def _rigid_rows(deck: Deck, components: tuple[Component, ...], about: FloatArray, place: str) -> FloatArray:
    """Components per displacement and rotation of a rigid body through a place, in basic axes, shape (n, 6)."""
    of_nodes: dict[int, FloatArray] = {}
    for node, _ in components:
        if node not in of_nodes:
            turned = np.zeros((6, 6))
            turned[:3, :3] = turned[3:, 3:] = deck.axes_of(node, place).T
            of_nodes[node] = turned @ rigid_motion(deck.grid(node, place).place - about)
    return np.array([of_nodes[node][component] for node, component in components])


def _length(rows: FloatArray) -> float:
    """Mean arm of displacements, by which rotations are made comparable."""
    arms = np.linalg.norm(rows[:, 3:], axis=1)[np.linalg.norm(rows[:, :3], axis=1) > 0.5]
    mean = float(arms.mean()) if arms.size else 0.0
    return mean if mean > 0 else 1.0


def _clean(shares: FloatArray) -> FloatArray:
    largest = np.abs(shares).max(axis=1, initial=0.0, keepdims=True)
    return np.where(np.abs(shares) <= _ROUNDING * largest, 0.0, shares)


def _named(
    place: str, dependent: tuple[Component, ...], others: tuple[Component, ...], shares: FloatArray
) -> list[_Rule]:
    return [
        _Rule(place, component, {other: float(v) for other, v in zip(others, values, strict=True) if v})
        for component, values in zip(dependent, _clean(shares), strict=True)
    ]


def _of_rigid(deck: Deck, element: RigidElement) -> list[_Rule]:
    about = deck.grid(element.independent[0][0], element.place).place
    leaders = _rigid_rows(deck, element.independent, about, element.place)
    followers = _rigid_rows(deck, element.dependent, about, element.place)
    scale = np.array([1.0] * 3 + [1.0 / _length(np.vstack([leaders, followers]))] * 3)
    strengths = np.linalg.svd(leaders * scale, compute_uv=False)
    if strengths[-1] <= _NEARLY_SINGULAR * strengths[0]:
        raise FileFormatError(
            element.place, got="independent components that leave a rigid body loose",
            allowed="six that describe any rigid motion",
        )  # fmt: skip
    shares = np.linalg.solve((leaders * scale).T, (followers * scale).T).T
    return _named(element.place, element.dependent, element.independent, shares)


def _of_rod(deck: Deck, rod: RigidRod) -> _Rule:
    a, b = (deck.grid(end, rod.place).place for end in rod.ends)
    length = float(np.linalg.norm(b - a))
    if length == 0:
        raise FileFormatError(rod.place, got="no length", allowed="two places")
    along = (b - a) / length
    terms: list[tuple[Component, float]] = []
    for sign, end in zip((-1.0, 1.0), rod.ends, strict=True):
        terms.extend(((end, c), sign * float(v)) for c, v in enumerate(deck.axes_of(end, rod.place).T @ along))
    terms.sort(key=lambda term: term[0] != rod.dependent)
    if abs(terms[0][1]) < 1e-6:
        raise FileFormatError(rod.place, got="a dependent component across the rod", allowed="one along it")
    return _of_equation(deck, Equation(rod.place, tuple(terms)))


def _of_mean(deck: Deck, mean: WeightedMean) -> list[_Rule]:
    """Motion of the rigid body that is nearest to the weighted components.

    Notes
    -----
    u = (Bᵀ W B)⁻¹ Bᵀ W uᵢ, B the components of a rigid body through the reference node. Weights of rotations are
    times the square of the mean distance of the nodes, so that the unit of length plays no part.
    """
    about = deck.grid(mean.reference[0][0], mean.place).place
    others = tuple(component for component, _ in mean.weights)
    rows = _rigid_rows(deck, others, about, mean.place)
    distances = [
        float(np.linalg.norm(deck.grids[node].place - about)) for node in dict.fromkeys(n for n, _ in others)
    ]
    length = float(np.mean(distances)) or 1.0
    weights = np.array([w * (length**2 if c > 2 else 1.0) for (_, c), w in mean.weights])
    scale = np.array([1.0] * 3 + [1.0 / length] * 3)
    scaled = rows * scale
    inverse = np.linalg.pinv(scaled.T @ (weights[:, None] * scaled), rcond=_NEARLY_SINGULAR, hermitian=True)
    found = _rigid_rows(deck, mean.reference, about, mean.place) * scale
    shares = found @ inverse @ (scaled * weights[:, None]).T
    missed = np.abs(shares @ scaled - found).max(axis=1) > 1e-6 * np.abs(found).max(axis=1)
    if missed.any():
        component = mean.reference[int(np.argmax(missed))][1] + 1
        raise FileFormatError(
            mean.place, got=f"component {component}, which its nodes leave open",
            allowed="components that their motion fixes", remedy="add nodes off their line, or rotations of some",
        )  # fmt: skip
    if set(mean.dependent) == set(mean.reference):
        return _named(mean.place, mean.reference, others, shares)
    return _solved_for(mean, others, shares)


def _solved_for(mean: WeightedMean, others: tuple[Component, ...], shares: FloatArray) -> list[_Rule]:
    """The equations of a mean, for the components that UM names."""
    columns = tuple(dict.fromkeys((*mean.reference, *others)))
    place = {component: number for number, component in enumerate(columns)}
    equations = np.zeros((len(mean.reference), len(columns)))
    for row, component in enumerate(mean.reference):
        equations[row, place[component]] += 1.0
        for other, share in zip(others, shares[row], strict=True):
            equations[row, place[other]] -= share
    if not set(mean.dependent) <= set(columns):
        raise FileFormatError(mean.place, got="UM with a component of no node here", allowed="its own components")
    chosen = [place[component] for component in mean.dependent]
    rest = [number for number in range(len(columns)) if number not in set(chosen)]
    block = equations[:, chosen]
    strengths = np.linalg.svd(block / np.abs(block).max(axis=0, initial=1e-300), compute_uv=False)
    if strengths[-1] <= _NEARLY_SINGULAR * strengths[0]:
        raise FileFormatError(mean.place, got="UM with components that it leaves open", allowed="other components")
    solved = np.asarray(-np.linalg.solve(block, equations[:, rest]), dtype=np.float64)
    return _named(mean.place, mean.dependent, tuple(columns[n] for n in rest), solved)


def _of_equation(deck: Deck, equation: Equation) -> _Rule:
    total: dict[Component, float] = {}
    for component, coefficient in equation.terms:
        deck.grid(component[0], equation.place)
        total[component] = total.get(component, 0.0) + coefficient
    dependent = equation.terms[0][0]
    first = total.pop(dependent)
    if abs(first) <= 1e-12 * max(map(abs, total.values()), default=0.0) or first == 0:
        raise FileFormatError(equation.place, got="no part of its first component", allowed="a coefficient")
    return _Rule(equation.place, dependent, {c: -value / first for c, value in total.items() if value})


def _shares(rules: list[_Rule], column: Mapping[Component, int], width: int) -> sparse.csr_matrix:
    entries = [
        (number, column[component], value)
        for number, rule in enumerate(rules)
        for component, value in rule.shares.items()
        if component in column
    ]
    rows, columns, values = zip(*entries, strict=True) if entries else ((), (), ())
    indices = (np.array(rows, dtype=np.int64), np.array(columns, dtype=np.int64))
    return sparse.csr_matrix((np.array(values, dtype=np.float64), indices), shape=(len(rules), width))


def _without_circles(
    rules: list[_Rule], by_rules: sparse.csr_matrix, by_free: sparse.csr_matrix
) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
    """Rules that depend on each other, solved together."""
    if not rules:
        return by_rules, by_free
    n_groups, group = connected_components(by_rules, directed=True, connection="strong")
    if n_groups == len(rules):
        return by_rules, by_free
    by_rules, by_free = by_rules.tolil(), by_free.tolil()
    for number in np.flatnonzero(np.bincount(group) > 1):
        members = np.flatnonzero(group == number)
        place = rules[int(members[0])].place
        if members.size > _LARGEST_CIRCLE:
            raise FileFormatError(place, got=f"{members.size} components in a circle", allowed="fewer")
        block = np.eye(members.size) - by_rules[np.ix_(members, members)].toarray()
        strengths = np.linalg.svd(block, compute_uv=False)
        if strengths[-1] <= _NEARLY_SINGULAR * strengths[0]:
            raise FileFormatError(
                place, got=f"node {rules[int(members[0])].dependent[0]}",
                allowed="no circle of rigid elements that leaves components open",
            )  # fmt: skip
        by_rules[np.ix_(members, members)] = 0.0
        for matrix in (by_rules, by_free):
            matrix[members] = np.linalg.solve(block, matrix[members].toarray())
    by_rules, by_free = by_rules.tocsr(), by_free.tocsr()
    by_rules.eliminate_zeros()
    by_free.eliminate_zeros()
    return by_rules, by_free


def _substituted(by_rules: sparse.csr_matrix, by_free: sparse.csr_matrix) -> sparse.csr_matrix:
    """Rules put into each other until only free components are left."""
    total = term = by_free
    for _ in range(_LONGEST_CHAIN):
        term = (by_rules @ term).tocsr()
        if term.nnz == 0:
            return total
        total = total + term
    raise FileFormatError("rigid elements", got=f"more than {_LONGEST_CHAIN} one after another", allowed="fewer")
