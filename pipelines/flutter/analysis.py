"""Root locus, p-k and flutter points of a wing."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipelines.flutter.model_file import WingModel, read_model
from pipelines.report.progress import progress
from sloshlab.aeroelastic.bending_torsion_beam import WingModes
from sloshlab.aeroelastic.generalised_force_cache import CacheStatus, cached_generalised_forces
from sloshlab.aeroelastic.generalised_forces import generalised_forces, usual_reduced_frequencies
from sloshlab.aeroelastic.modal_structure import ModalStructure, of_modes
from sloshlab.aeroelastic.p_k import Forces, PkRoots, p_k_roots
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aeroelastic.rational_minimum_state import minimum_state_fit
from sloshlab.aeroelastic.rational_roger import roger_fit
from sloshlab.aeroelastic.root_locus import RootLocus, root_locus
from sloshlab.aeroelastic.state_space import system_over_speed
from sloshlab.aeroelastic.strip import strip_table
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
    """

    first_m_per_s: float
    last_m_per_s: float
    n_speeds: int

    def __post_init__(self) -> None:
        if not 0 < self.first_m_per_s < self.last_m_per_s < np.inf:
            raise InputError(
                "--from and --to", got=f"{self.first_m_per_s:g} and {self.last_m_per_s:g}", allowed="0 < from < to"
            )
        if not 2 <= self.n_speeds <= 10_000:
            raise InputError("--speeds", got=f"{self.n_speeds}", allowed="2 … 10000")


@dataclass(frozen=True)
class FlutterExperiment:
    """A wing, what was computed of it, and from what.

    Attributes
    ----------
    model, settings, inputs
        As given.
    modes : WingModes
        Dry.
    reduced_frequency, table : ndarray, shapes (n_k,), (n_k, n, n)
        Generalised forces over q_D.
    rational : RationalForces
        Their fit.
    locus : RootLocus
        By the fit.
    p_k : PkRoots
        By the table.
    cache : CacheStatus or None
        Where the table is from; None for strips.
    """

    model: WingModel
    settings: FlutterSettings
    inputs: tuple[Path, ...]
    modes: WingModes
    reduced_frequency: FloatArray
    table: npt.NDArray[np.complex128]
    rational: RationalForces
    locus: RootLocus
    p_k: PkRoots
    cache: CacheStatus | None = None
    provenance: dict[str, object] = field(default_factory=dict)

    @property
    def semi_chord_m(self) -> float:
        """b of reduced frequencies."""
        return self.rational.semi_chord_m

    @property
    def p_k_flutter_m_per_s(self) -> float:
        """Lowest crossing of the p-k roots, NaN if there is none; linear between speeds."""
        real = self.p_k.pole_rad_per_s.real
        rows, columns = np.nonzero((real[:-1] <= 0) & (real[1:] > 0) & (self.p_k.pole_rad_per_s.imag[1:] > 0))
        if rows.size == 0:
            return float("nan")
        low, high = real[rows[0], columns[0]], real[rows[0] + 1, columns[0]]
        speed = self.p_k.speed_m_per_s
        return float(speed[rows[0]] - low / (high - low) * (speed[rows[0] + 1] - speed[rows[0]]))

    @property
    def flags(self) -> tuple[str, ...]:
        """What must be read before the result."""
        found = list(self.locus.flags)
        for crossing in self.locus.crossings:
            k = crossing.frequency_rad_per_s * self.semi_chord_m / crossing.speed_m_per_s
            if k > self.rational.largest_reduced_frequency:
                found.append(
                    f"flutter at {crossing.speed_m_per_s:.5g} m/s has k = {k:.3g}, beyond"
                    f" {self.rational.largest_reduced_frequency:.3g} of the aerodynamics"
                )
        flutter = self.locus.flutter
        if flutter is not None and np.isfinite(self.p_k_flutter_m_per_s):
            difference = self.p_k_flutter_m_per_s / flutter.speed_m_per_s - 1
            if abs(difference) > _LARGEST_DISAGREEMENT:
                found.append(f"flutter by p-k is {100 * difference:.1f} % off that of the root locus")
        if self.cache is CacheStatus.DAMAGED:
            found.append(f"generalised forces were {self.cache.value}")
        return tuple(found)


def analyse_flutter(path: Path, settings: FlutterSettings, *, cache: Path | None = None) -> FlutterExperiment:
    """Compute root locus and p-k roots of a model file.

    Parameters
    ----------
    path : Path
        The model.
    settings : FlutterSettings
        Speeds.
    cache : Path, optional
        Folder that keeps generalised forces of the doublet lattice.

    Returns
    -------
    FlutterExperiment
    """
    model = read_model(path)
    wing = model.wing
    modes = wing.modes(model.structure.n_modes, n_elements=model.structure.n_elements)
    structure = of_modes(modes.structure.natural_frequency_rad_per_s, damping_ratio=model.structure.damping_ratio)
    k = usual_reduced_frequencies(
        model.aerodynamics.largest_reduced_frequency, model.aerodynamics.n_reduced_frequencies
    )
    forces, table, status = _forces(model, modes, k, cache)
    rational = _fit(model, k, table)
    speeds = np.linspace(settings.first_m_per_s, settings.last_m_per_s, settings.n_speeds)
    density = model.flow.density_kg_per_m3
    locus = root_locus(system_over_speed(structure, rational, density_kg_per_m3=density), speeds, structure.names)
    p_k = _p_k(structure, forces, rational.semi_chord_m, (density, speeds))
    return FlutterExperiment(model, settings, (path,), modes, k, table, rational, locus, p_k, status)


def _forces(
    model: WingModel, modes: WingModes, k: FloatArray, cache: Path | None
) -> tuple[Forces, npt.NDArray[np.complex128], CacheStatus | None]:
    wing, chosen = model.wing, model.aerodynamics
    if chosen.method == "strips":
        forces = strip_table(wing.strips(modes, chosen.n_span), semi_chord_m=wing.semi_chord_m)
        return forces, np.array([forces(float(value)) for value in k]), None
    boxes = wing.boxes(chosen.n_span, chosen.n_chord)
    motion = wing.motion(boxes, modes)
    with progress("doublet lattice", k.size) as advance:
        told = {
            "semi_chord_m": wing.semi_chord_m,
            "mach": model.flow.mach,
            "progress": lambda _done, _all, note: advance(note),
        }
        if cache is None:
            lattice = generalised_forces(boxes, motion, k, **told)  # type: ignore[arg-type]
            return lattice.at, lattice.motion, CacheStatus.MADE
        lattice, status = cached_generalised_forces(cache, boxes, motion, k, **told)  # type: ignore[arg-type]
    return lattice.at, lattice.motion, status


def _fit(model: WingModel, k: FloatArray, table: npt.NDArray[np.complex128]) -> RationalForces:
    fit = roger_fit if model.aerodynamics.rational == "roger" else minimum_state_fit
    return fit(k, table, semi_chord_m=model.wing.semi_chord_m, lags=np.array(model.aerodynamics.lags))


def _p_k(
    structure: ModalStructure, forces: Forces, semi_chord_m: float, flow: tuple[float, FloatArray]
) -> PkRoots:
    density, speeds = flow
    # modes are followed from low speeds on, where each has the frequency that it has without flow
    lead = np.geomspace(speeds[0] / 20, speeds[0], 8)[:-1]
    roots = p_k_roots(
        structure,
        forces,
        semi_chord_m=semi_chord_m,
        density_kg_per_m3=density,
        speeds=np.concatenate([lead, speeds]),
    )
    keep = slice(lead.size, None)
    return PkRoots(roots.speed_m_per_s[keep], roots.pole_rad_per_s[keep], roots.converged[keep])
