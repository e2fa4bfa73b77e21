"""Root loci: eigenvalues over the speed, joined to branches that are named by the mode they start at.

Between two speeds every root goes to the one that resembles it most: product of left and right eigenvectors
across the step (a modal assurance criterion that no scaling of the states changes), and distance from where the
root was heading. Where a branch changes its shape within a step, or two come near each other, the step is halved.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eig
from scipy.optimize import linear_sum_assignment

from sloshlab.aeroelastic.arrays import ComplexArray, FloatArray, require_positive
from sloshlab.errors import AnalysisError

System = Callable[[float], FloatArray]

_LEAST_LIKENESS = 0.6
_LARGEST_MISS = 0.2
"""Of where a root was heading, as a share of its size."""
_MOST_HALVINGS = 10
_HALVINGS_OF_A_MEETING = 6
_NEAR = 0.25
"""Of the way that two roots go towards each other in a step."""
_REAL_SHARE = 1e-9
_LEAST_SHARE = 0.2
"""Of a coordinate in a root that is named by it; of a mode without flow it is 1."""
_LEAST_ELASTIC_SHARE = 0.05
"""Of modes and liquids in a root that is flutter or divergence of them; below it the body flies as a whole."""
_LAG = "lag"


@dataclass(frozen=True)
class Roots:
    """Eigenvalues of one speed, with their right vectors and the left ones that are 1 on them."""

    pole: ComplexArray
    right: ComplexArray
    left: ComplexArray

    def taken(self, order: np.ndarray) -> Roots:
        """The same roots in another order."""
        return Roots(self.pole[order], self.right[:, order], self.left[:, order])


@dataclass(frozen=True)
class Crossing:
    """A root that begins to grow.

    Attributes
    ----------
    speed_m_per_s, frequency_rad_per_s : float
        Where; frequency 0 is divergence.
    origin : str
        Mode at which the branch starts, or the number of a lag.
    elastic_share : float
        Of coordinates that are not those of a rigid body, in the root.
    """

    speed_m_per_s: float
    frequency_rad_per_s: float
    origin: str
    elastic_share: float = 1.0

    @property
    def kind(self) -> str:
        """``flutter``, ``divergence``, or ``flight`` of a body that hardly deforms."""
        if self.elastic_share < _LEAST_ELASTIC_SHARE:
            return "flight"
        return "flutter" if self.frequency_rad_per_s > 0 else "divergence"


@dataclass(frozen=True)
class RootLocus:
    """Branches over the speed.

    Attributes
    ----------
    speed_m_per_s : ndarray, shape (n_speeds,)
        Speeds.
    pole_rad_per_s : ndarray of complex, shape (n_speeds, n_branches)
        Roots; of conjugate pairs the one above the real axis at the start.
    origin : tuple of str
        What each branch starts at.
    crossings : tuple of Crossing
        Where roots begin to grow, by speed.
    lost : dict
        Origin of each branch that could not be followed with certainty, and the first speed of that.
    """

    speed_m_per_s: FloatArray
    pole_rad_per_s: ComplexArray
    origin: tuple[str, ...]
    crossings: tuple[Crossing, ...]
    lost: dict[str, float]

    @property
    def flags(self) -> tuple[str, ...]:
        """What must be read with the branches."""
        return tuple(f"branch {name} was lost at {speed:.5g} m/s" for name, speed in self.lost.items())

    @property
    def flutter(self) -> Crossing | None:
        """The lowest speed of flutter, None if there is none in the range."""
        return next((crossing for crossing in self.crossings if crossing.kind == "flutter"), None)

    @property
    def divergence(self) -> Crossing | None:
        """The lowest speed of divergence, None if there is none in the range."""
        return next((crossing for crossing in self.crossings if crossing.kind == "divergence"), None)


def root_locus(
    system: System,
    speeds: FloatArray,
    names: tuple[str, ...],
    *,
    rigid: Collection[str] = (),
    start_m_per_s: float | None = None,
    tolerance_m_per_s: float = 1e-3,
) -> RootLocus:
    """Follow all roots over the speed.

    Parameters
    ----------
    system : callable
        State matrix at a speed; its first states are the coordinates, then their rates, then the rest.
    speeds : ndarray
        Ascending, > 0, two at least.
    names : tuple of str
        Of the coordinates.
    rigid : collection of str
        Those of them that move the body as a whole.
    start_m_per_s : float, optional
        Where branches are named, low enough for modes without flow; a twentieth of the first speed if not given.
    tolerance_m_per_s : float
        Of the bisection of crossings.

    Returns
    -------
    RootLocus

    Raises
    ------
    AnalysisError
        If speeds are not as asked.
    """
    speeds = np.asarray(speeds, dtype=float)
    if speeds.size < 2 or np.any(np.diff(speeds) <= 0):
        raise AnalysisError("speeds", got=f"{speeds.size} of them", allowed="two or more, ascending")
    start = speeds[0] / 20 if start_m_per_s is None else start_m_per_s
    require_positive(first_speed_m_per_s=float(speeds[0]), start_m_per_s=float(start))
    first = roots_of(system(start))
    origin = _origins(first, names)
    is_elastic = np.array([name not in rigid for name in names])
    walk = _Walk(system, float(start), first, np.array([not name.startswith(_LAG) for name in origin]))
    # from the start to the first speed in steps that grow, because lags grow with the speed
    for between in np.geomspace(start, speeds[0], 12)[1:-1]:
        walk.go(float(between))
    kept, crossings = [], []
    for index, speed in enumerate(speeds):
        before = (walk.speed, walk.roots)
        walk.go(float(speed))
        kept.append(walk.roots.pole)
        if index:
            crossings += _crossings(walk, before, (origin, is_elastic), tolerance_m_per_s)
    poles = np.array(kept)
    shown = np.array([pole.imag >= 0 for pole in first.pole])
    lost = {origin[branch]: speed for branch, speed in sorted(walk.lost.items()) if shown[branch]}
    return RootLocus(
        speeds,
        poles[:, shown],
        tuple(name for name, is_shown in zip(origin, shown, strict=True) if is_shown),
        tuple(sorted(crossings, key=lambda crossing: crossing.speed_m_per_s)),
        lost,
    )


def first_flutter(system: System, speeds: FloatArray, *, tolerance_m_per_s: float = 1e-3) -> Crossing | None:
    """Lowest speed at which any oscillation begins to grow, by eigenvalues alone: no branch is followed.

    Parameters
    ----------
    system : callable
        State matrix at a speed.
    speeds : ndarray
        Ascending; one growing oscillation at one of them is enough to be found.
    tolerance_m_per_s : float
        Of the bisection.

    Returns
    -------
    Crossing or None
        Without an origin; None if nothing grows, or something does at the first speed already.
    """
    low = float(speeds[0])
    if _fastest_growth(system(low)).real > 0:
        return None
    for speed in speeds[1:].tolist():
        root = _fastest_growth(system(speed))
        if root.real <= 0:
            low = speed
            continue
        high = speed
        while high - low > tolerance_m_per_s:
            middle = 0.5 * (low + high)
            here = _fastest_growth(system(middle))
            low, high, root = (low, middle, here) if here.real > 0 else (middle, high, root)
        return Crossing(0.5 * (low + high), root.imag, "")
    return None


def _fastest_growth(matrix: FloatArray) -> complex:
    """Of the roots that oscillate, the one that grows fastest; growth below rounding errors is none."""
    poles = np.linalg.eigvals(matrix)
    largest = float(np.abs(poles).max())
    oscillating = poles[poles.imag > _REAL_SHARE * largest]
    if not oscillating.size:
        return complex(-1.0)
    root = complex(oscillating[np.argmax(oscillating.real)])
    return root if abs(root.real) > 1e-9 * largest else complex(0.0, root.imag)


def roots_of(matrix: FloatArray) -> Roots:
    """Eigenvalues and vectors, left vectors scaled so that left·right = 1.

    Parameters
    ----------
    matrix : ndarray, shape (n, n)
        State matrix.

    Returns
    -------
    Roots
        By imaginary part.
    """
    pole, left, right = eig(matrix, left=True, right=True)
    scale = np.einsum("ij,ij->j", left.conj(), right)
    # defective roots have no scale; they resemble nothing, which is what tracking has to know
    scale = np.where(np.abs(scale) > np.finfo(float).eps, scale, np.inf)
    return Roots(pole, right, left / scale.conj()).taken(np.argsort(pole.imag, kind="stable"))


class _Walk:
    """Goes from speed to speed and keeps the order of the roots."""

    def __init__(self, system: System, speed: float, roots: Roots, followed: np.ndarray) -> None:
        self.system, self.speed, self.roots, self.followed = system, speed, roots, followed
        self.slope = np.zeros_like(roots.pole)
        self.lost: dict[int, float] = {}

    def go(self, target: float, halvings: int = 0) -> None:
        """Follow all roots to another speed."""
        new = roots_of(self.system(target))
        heading = self.roots.pole + self.slope * (target - self.speed)
        new, likeness = _joined(self.roots, new, heading)
        missed = np.abs(new.pole - heading) / self._size(heading)
        unsure = self.followed & ((likeness < _LEAST_LIKENESS) | (missed > _LARGEST_MISS))
        is_coarse = bool(unsure.any()) or (halvings < _HALVINGS_OF_A_MEETING and self._meet(new))
        if is_coarse and halvings < _MOST_HALVINGS:
            self.go(0.5 * (self.speed + target), halvings + 1)
            self.go(target, halvings + 1)
            return
        # where two roots meet their vectors become one; one that goes where it was heading is not lost
        for branch in np.flatnonzero(unsure & (missed > _LARGEST_MISS)):
            self.lost.setdefault(int(branch), target)
        self.slope = (new.pole - self.roots.pole) / (target - self.speed)
        self.speed, self.roots = target, new

    def _size(self, pole: ComplexArray) -> FloatArray:
        # roots near zero, as of rigid bodies, wander by the rounding error of the large ones
        return np.asarray(np.abs(pole) + 1e-3 * np.abs(pole[self.followed]).max(initial=1e-12), dtype=float)

    def _meet(self, new: Roots) -> bool:
        """Whether two branches pass so close to each other that shapes may have changed places within the step."""
        chosen = self.followed & (self.roots.pole.imag > 0)
        start, way = self.roots.pole[chosen], (new.pole - self.roots.pole)[chosen]
        apart, closing = start[:, None] - start[None, :], way[:, None] - way[None, :]
        pace = np.abs(closing) ** 2
        # nearest point of two that move evenly, within the step
        share = -(apart * closing.conj()).real / np.maximum(pace, np.finfo(float).tiny)
        nearest = np.abs(apart + np.clip(share, 0.0, 1.0) * closing)
        is_within = (share > 0) & (share < 1) & ~np.eye(start.size, dtype=bool)
        return bool(np.any(is_within & (nearest < _NEAR * np.sqrt(pace))))


def _joined(old: Roots, new: Roots, heading: ComplexArray) -> tuple[Roots, FloatArray]:
    """New roots in the order of the old ones, and how much each resembles its predecessor, 0 … 1."""
    with np.errstate(over="ignore"):
        likeness = np.abs(old.left.conj().T @ new.right) * np.abs(new.left.conj().T @ old.right).T
    # a product above 1 is no better than one below it: roots of another size, or nearly defective ones
    likeness = np.nan_to_num(likeness, nan=0.0, posinf=0.0)
    likeness = np.minimum(likeness, 1 / np.maximum(likeness, 1.0))
    size = np.abs(heading)[:, None] + np.abs(new.pole)[None, :] + 1e-12
    distance = np.abs(heading[:, None] - new.pole[None, :]) / size
    _, order = linear_sum_assignment((1 - likeness) + 4 * distance)
    return new.taken(order), likeness[np.arange(order.size), order]


def _origins(roots: Roots, names: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the coordinates that take part most in oscillations, each once; all other roots are lags."""
    share = _shares(roots, len(names))
    oscillating = np.flatnonzero(roots.pole.imag > _REAL_SHARE * np.abs(roots.pole).max())
    coordinate, chosen = linear_sum_assignment(-share[:, oscillating])
    result, lags = [""] * roots.pole.size, 0
    for row, column in zip(coordinate, chosen, strict=True):
        if share[row, oscillating[column]] >= _LEAST_SHARE:
            result[oscillating[column]] = names[row]
    for branch, name in enumerate(result):
        if not name:
            lags += 1
            result[branch] = f"{_LAG} {lags}"
    return tuple(result)


def _shares(roots: Roots, n: int) -> FloatArray:
    """How much each coordinate and its rate take part in each root, shape (n, n_roots)."""
    share = np.abs(roots.left.conj() * roots.right)
    return np.asarray(share[:n] + share[n : 2 * n], dtype=float)


def _crossings(
    walk: _Walk,
    before: tuple[float, Roots],
    origin_and_elastic: tuple[tuple[str, ...], np.ndarray],
    tolerance: float,
) -> list[Crossing]:
    """Crossings of the imaginary axis upwards between the last two speeds, by bisection."""
    (low, roots), (origin, is_elastic) = before, origin_and_elastic
    noise = 1e-9 * float(np.abs(walk.roots.pole).max())
    grows = (roots.pole.real <= noise) & (walk.roots.pole.real > noise) & (walk.roots.pole.imag >= 0)
    found = []
    # a pair that meets on the real axis leaves by either branch
    for branch in np.flatnonzero(grows).tolist():
        speed, root, at_crossing = _bisected(
            walk.system, (low, roots), (walk.speed, walk.roots), branch, tolerance
        )
        share = _shares(at_crossing, is_elastic.size)[:, branch]
        elastic = float(share[is_elastic].sum() / max(share.sum(), np.finfo(float).tiny))
        is_real = abs(at_crossing.pole[branch].imag) <= _REAL_SHARE * max(abs(at_crossing.pole[branch]), 1e-30)
        found.append(Crossing(speed, 0.0 if is_real else root.imag, origin[branch], elastic))
    return found


def _bisected(
    system: System, low: tuple[float, Roots], high: tuple[float, Roots], branch: int, tolerance: float
) -> tuple[float, complex, Roots]:
    """Speed and root of a crossing, and all roots just above it."""
    while high[0] - low[0] > tolerance:
        middle = 0.5 * (low[0] + high[0])
        heading = 0.5 * (low[1].pole + high[1].pole)
        joined, _ = _joined(low[1], roots_of(system(middle)), heading)
        if joined.pole[branch].real > 0:
            high = (middle, joined)
        else:
            low = (middle, joined)
    start, end = complex(low[1].pole[branch]), complex(high[1].pole[branch])
    growth = end.real - start.real
    weight = -start.real / growth if growth > 0 else 0.5
    return low[0] + weight * (high[0] - low[0]), start + weight * (end - start), high[1]
