"""Root locus, p-k and flutter points of a wing or an aircraft."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits

from pipelines.flutter.checks import ModelCheck
from pipelines.flutter.model_file import read_model
from pipelines.flutter.problem import FlutterProblem, Variant, problem_of
from pipelines.report.progress import progress
from sloshlab.aeroelastic.generalised_force_cache import CacheStatus
from sloshlab.aeroelastic.p_k import PkRoots, p_k_roots
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aeroelastic.root_locus import Crossing, RootLocus, root_locus
from sloshlab.errors import InputError

FloatArray = npt.NDArray[np.float64]

_LARGEST_DISAGREEMENT = 0.05


@dataclass(frozen=True)
class FlutterSettings:
    """What was asked for.

    Attributes
    ----------
    first_m_per_s, last_m_per_s : float
        Range of speeds.
    n_speeds : int
        How many, evenly.
    models : tuple of str
        Liquids of an aircraft, ``frozen`` or ``lateral``; empty for all that it can have.
    """

    first_m_per_s: float
    last_m_per_s: float
    n_speeds: int
    models: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not 0 < self.first_m_per_s < self.last_m_per_s < np.inf:
            raise InputError(
                "--from and --to", got=f"{self.first_m_per_s:g} and {self.last_m_per_s:g}", allowed="0 < from < to"
            )
        if not 2 <= self.n_speeds <= 10_000:
            raise InputError("--speeds", got=f"{self.n_speeds}", allowed="2 … 10000")


@dataclass(frozen=True, eq=False)
class Stability:
    """Roots of one variant.

    Attributes
    ----------
    variant : Variant
    locus : RootLocus
        By rational functions.
    p_k : PkRoots
        By the table.
    semi_chord_m, largest_reduced_frequency : float
        b, and how far the forces are known.
    """

    variant: Variant
    locus: RootLocus
    p_k: PkRoots
    semi_chord_m: float
    largest_reduced_frequency: float

    @property
    def name(self) -> str:
        """Of the variant."""
        return self.variant.name

    @property
    def p_k_flutter_m_per_s(self) -> float:
        """The p-k crossing nearest to the first flutter of the root locus, else the lowest; NaN if none."""
        found, flutter = self._p_k_crossings(), self.locus.flutter
        if flutter is None:
            # roots of the body as a whole come first; without weight they cross without meaning
            return min(
                (speed for speed, _, mode in found if mode >= len(self.variant.rigid)), default=float("nan")
            )

        def distance(crossing: tuple[float, float, int]) -> float:
            speed, frequency, _ = crossing
            return abs(speed / flutter.speed_m_per_s - 1) + abs(frequency / flutter.frequency_rad_per_s - 1)

        return min(found, key=distance, default=(float("nan"), 0.0, 0))[0]

    def _p_k_crossings(self) -> list[tuple[float, float, int]]:
        """Speed, frequency and mode where p-k roots begin to grow, linear between computed speeds."""
        pole, speed = self.p_k.pole_rad_per_s, self.p_k.speed_m_per_s
        grows = (pole.real[:-1] <= 0) & (pole.real[1:] > 0) & (pole.imag[1:] > 0)
        found = []
        for row, column in zip(*np.nonzero(grows), strict=True):
            low, high = pole[row, column], pole[row + 1, column]
            weight = float(-low.real / (high.real - low.real))
            at_m_per_s = float(speed[row] + weight * (speed[row + 1] - speed[row]))
            found.append((at_m_per_s, float(high.imag), int(column)))
        return found

    @property
    def flags(self) -> tuple[str, ...]:
        """What must be read before the result."""
        found = list(self.locus.flags)
        found += [text for crossing in self.locus.crossings for text in self._beyond(crossing)]
        flutter = self.locus.flutter
        if flutter is None and np.isfinite(self.p_k_flutter_m_per_s):
            found.append(f"p-k finds flutter at {self.p_k_flutter_m_per_s:.5g} m/s, the root locus none")
        if flutter is not None:
            difference = self.p_k_flutter_m_per_s / flutter.speed_m_per_s - 1
            if np.isnan(difference):
                found.append(f"p-k does not find the flutter at {flutter.speed_m_per_s:.5g} m/s of the root locus")
            elif abs(difference) > _LARGEST_DISAGREEMENT:
                found.append(f"flutter by p-k is {100 * difference:.1f} % off that of the root locus")
        return tuple(found)

    def _beyond(self, crossing: Crossing) -> list[str]:
        k = crossing.frequency_rad_per_s * self.semi_chord_m / crossing.speed_m_per_s
        if k <= self.largest_reduced_frequency:
            return []
        return [
            f"flutter at {crossing.speed_m_per_s:.5g} m/s has k = {k:.3g}, beyond"
            f" {self.largest_reduced_frequency:.3g} of the aerodynamics"
        ]


@dataclass(frozen=True, eq=False)
class FlutterExperiment:
    """A wing or an aircraft, what was computed of it, and from what."""

    problem: FlutterProblem
    settings: FlutterSettings
    inputs: tuple[Path, ...]
    results: tuple[Stability, ...]
    checks: tuple[ModelCheck, ...] = ()
    provenance: dict[str, object] = field(default_factory=dict)

    @property
    def flags(self) -> tuple[str, ...]:
        """What must be read before the results, with the variant's name where there are several."""
        several = len(self.results) > 1
        found = [f"{result.name}: {flag}" if several else flag for result in self.results for flag in result.flags]
        found += [
            f"{check.what}: {check.reached:.2g} apart, asked {check.largest:.2g}"
            for check in self.checks
            if not check.is_met
        ]
        if self.problem.cache is CacheStatus.DAMAGED:
            found.append(f"generalised forces were {self.problem.cache.value}")
        return tuple(found)


def analyse_flutter(path: Path, settings: FlutterSettings, *, cache: Path | None = None) -> FlutterExperiment:
    """Compute root locus and p-k roots of a model file.

    Parameters
    ----------
    path : Path
        The model.
    settings : FlutterSettings
        Speeds, and models of an aircraft's liquids.
    cache : Path, optional
        Folder that keeps generalised forces of the doublet lattice.

    Returns
    -------
    FlutterExperiment
    """
    return flutter_of(problem_of(read_model(path), settings.models, cache), settings, (path,))


def flutter_of(problem: FlutterProblem, settings: FlutterSettings, inputs: tuple[Path, ...]) -> FlutterExperiment:
    """Compute root locus and p-k roots of a model that is read already.

    Parameters
    ----------
    problem : FlutterProblem
    settings : FlutterSettings
    inputs : tuple of Path
        Files that it was read from.
    """
    # matrices of a hundred rows: threads of BLAS only wait for one another
    with threadpool_limits(1), progress("root loci", 2 * len(problem.variants)) as advance:
        speeds = np.linspace(settings.first_m_per_s, settings.last_m_per_s, settings.n_speeds)
        results = tuple(
            stability_of(variant, problem.rational, problem.density_kg_per_m3, speeds, advance)
            for variant in problem.variants
        )
        checks = problem.checks(0.5 * (settings.first_m_per_s + settings.last_m_per_s))
    return FlutterExperiment(problem, settings, inputs, results, checks)


def stability_of(
    variant: Variant,
    rational: RationalForces,
    density_kg_per_m3: float,
    speeds: FloatArray,
    advance: Callable[[str], None],
) -> Stability:
    """Root locus and p-k of one variant.

    Parameters
    ----------
    variant : Variant
    rational : RationalForces
        Of its coordinates.
    density_kg_per_m3 : float
        Of the air.
    speeds : ndarray
        Ascending.
    advance : callable
        Told both.
    """
    locus = root_locus(variant.matrix_at, speeds, variant.structure.names, rigid=variant.rigid)
    advance(f"{variant.name}, rational functions")
    roots = _p_k(variant, rational.semi_chord_m, density_kg_per_m3, speeds)
    advance(f"{variant.name}, p-k")
    return Stability(variant, locus, roots, rational.semi_chord_m, rational.largest_reduced_frequency)


def _p_k(variant: Variant, semi_chord_m: float, density_kg_per_m3: float, speeds: FloatArray) -> PkRoots:
    # modes are followed from low speeds on, where each has the frequency that it has without flow
    lead = np.geomspace(speeds[0] / 20, speeds[0], 8)[:-1]
    roots = p_k_roots(
        variant.structure,
        variant.forces,
        semi_chord_m=semi_chord_m,
        density_kg_per_m3=density_kg_per_m3,
        speeds=np.concatenate([lead, speeds]),
    )
    keep = slice(lead.size, None)
    return PkRoots(roots.speed_m_per_s[keep], roots.pole_rad_per_s[keep], roots.converged[keep])
