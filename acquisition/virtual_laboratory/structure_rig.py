"""The beam and the guided tank of the rig description, as they truly are.

What the rig tells is what the laboratory believes. Frequencies, damping and masses differ a little from it;
how much is drawn once per laboratory, like the gains of its sensors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank.structures import Mode, Structure
from acquisition.virtual_laboratory.cantilever import Cantilever, fitted_to
from acquisition.virtual_laboratory.sensors import Laboratory
from sloshlab.channel_names import (
    ACCELERATION_BEAM,
    ACCELERATION_ROOT,
    ACCELERATION_TIP,
    DISPLACEMENT_TANK,
    FORCE_INTERFACE,
    numbered,
)
from sloshlab.errors import InputError
from sloshlab.rig import Rig
from sloshlab.rig import Structure as DescribedStructure

FloatArray = NDArray[np.float64]

N_BEAM_ACCELEROMETERS: Final = 3
"""Between root and tip, at equal distances."""
BEAM_CHANNELS: Final = (
    FORCE_INTERFACE,
    ACCELERATION_ROOT,
    *numbered(ACCELERATION_BEAM, N_BEAM_ACCELEROMETERS),
    ACCELERATION_TIP,
    DISPLACEMENT_TANK,
)
SDOF_CHANNELS: Final = (FORCE_INTERFACE, ACCELERATION_TIP, DISPLACEMENT_TANK)
_MASSES_AGREE: Final = 0.01


@dataclass(frozen=True)
class StructureLaboratory:
    """The truth about one laboratory with a structure.

    Attributes
    ----------
    sensors : Laboratory
        Gains, offsets and dry mass.
    frequency_factors, damping_factors : tuple of float
        True over believed, for each mode; within ±2 % and ±20 %.
    """

    sensors: Laboratory
    frequency_factors: tuple[float, ...]
    damping_factors: tuple[float, ...]

    @classmethod
    def drawn(cls, seed: int, rig: Rig) -> StructureLaboratory:
        """Draw a laboratory for a rig."""
        described = described_structure(rig)
        # beside that of the sensors: a structure does not change the gains of a laboratory
        generator = np.random.default_rng([seed, 7302])

        def around_one(spread: float, limit: float, number: int) -> tuple[float, ...]:
            values = 1 + np.clip(spread * generator.standard_normal(number), -limit, limit)
            return tuple(float(value) for value in values)

        n_modes = max(len(described.frequencies_hz), 1)
        return cls(
            Laboratory.drawn(seed, channels_of(described)),
            around_one(0.006, 0.02, n_modes),
            around_one(0.07, 0.2, n_modes),
        )

    def deviations(self) -> dict[str, Any]:
        """In what this laboratory differs from what its rig tells, as JSON can hold it."""
        structure = {"frequency_factors": self.frequency_factors, "damping_factors": self.damping_factors}
        return {**self.sensors.deviations(), **{name: list(factors) for name, factors in structure.items()}}

    @classmethod
    def perfect(cls, rig: Rig) -> StructureLaboratory:
        """Everything is as believed."""
        described = described_structure(rig)
        ones = (1.0,) * max(len(described.frequencies_hz), 1)
        return cls(Laboratory.perfect(channels_of(described)), ones, ones)


def structure_laboratory(rig: Rig, seed: int | None) -> StructureLaboratory:
    """The laboratory of a seed; without one the rig is as told."""
    return StructureLaboratory.perfect(rig) if seed is None else StructureLaboratory.drawn(seed, rig)


@dataclass(frozen=True)
class StructureRig:
    """A structure with its tank and places to measure at.

    Attributes
    ----------
    structure : Structure
        Without the liquid.
    dry_mass_kg : float
        Beyond the force sensor, without the liquid.
    places_m : tuple of float
        Of the accelerometers along the beam, without root and tip.
    shapes : ndarray, shape (n_places, n_modes)
        Mode shapes there.
    length_m : float
        Of the beam; 0 on a guide.
    """

    structure: Structure
    dry_mass_kg: float
    places_m: tuple[float, ...]
    shapes: FloatArray
    length_m: float

    @property
    def is_beam(self) -> bool:
        """False for a tank on a guide."""
        return self.length_m > 0


def described_structure(rig: Rig) -> DescribedStructure:
    """Return the structure of a rig description.

    Raises
    ------
    InputError
        If it has none.
    """
    if rig.structure is None:
        raise InputError("rig: structure", got="nothing", allowed="a table [structure]", remedy="describe it")
    return rig.structure


def channels_of(described: DescribedStructure) -> Sequence[str]:
    """Names of the channels that a kind of structure has."""
    return BEAM_CHANNELS if described.kind == "beam" else SDOF_CHANNELS


def structure_rig(rig: Rig, laboratory: StructureLaboratory) -> StructureRig:
    """Return the true structure of a rig.

    Parameters
    ----------
    rig : Rig
        As believed; modal data of a beam contain the frozen liquid (Table 2.4), the mass on a guide does
        not (Table 2.1).
    laboratory : StructureLaboratory
        In what the truth differs.

    Raises
    ------
    InputError
        If dimensions are missing or contradict the modal data.

    Notes
    -----
    Mode shapes between root and tip and the participation (2.31) are those of an aluminium beam whose tip
    mass gives the first frequency, scaled to the tip values of the rig.
    """
    described = described_structure(rig)
    dry_mass_kg = rig.tank.dry_mass_kg * laboratory.sensors.dry_mass_factor
    if described.kind == "sdof":
        return _on_a_guide(rig, described, laboratory, dry_mass_kg)
    beam = _cantilever(described)
    modes = tuple(
        Mode.of_frequency(
            frequency_hz * laboratory.frequency_factors[n],
            damping_ratio * laboratory.damping_factors[n],
            mass_kg,
            tip,
            tip * beam.participation_kg(n + 1),
        )
        for n, (frequency_hz, damping_ratio, mass_kg, tip) in enumerate(
            zip(
                described.frequencies_hz,
                described.damping_ratios,
                described.modal_masses_kg,
                described.tip_mode_shape,
                strict=True,
            )
        )
    )
    # the modal data of a rig contain the liquid, frozen; the computed one acts by its force
    structure = Structure(modes, included_mass_kg=rig.liquid_mass_kg)
    steps = np.arange(1, N_BEAM_ACCELEROMETERS + 1) / (N_BEAM_ACCELEROMETERS + 1)
    places = tuple(float(x) for x in np.round(steps * beam.length_m, 6))
    shapes = np.stack([tip * beam.shape(n + 1, places) for n, tip in enumerate(structure.shape_at_tank)], axis=1)
    return StructureRig(structure, dry_mass_kg, places, shapes, beam.length_m)


def _on_a_guide(
    rig: Rig, described: DescribedStructure, laboratory: StructureLaboratory, dry_mass_kg: float
) -> StructureRig:
    mass_kg, stiffness = described.mass_kg or 0.0, described.stiffness_n_per_m or 0.0
    # on a guide all that moves is beyond the force cell: two different masses are a mistake in the rig description
    if abs(rig.tank.dry_mass_kg / mass_kg - 1) > _MASSES_AGREE:
        raise InputError(
            "rig: tank.dry_mass_kg",
            got=f"{rig.tank.dry_mass_kg:g}",
            allowed=f"structure.mass_kg = {mass_kg:g}, the same moving mass",
        )
    # what is drawn is the frequency, as that is what a laboratory measures
    true_stiffness = stiffness * laboratory.frequency_factors[0] ** 2
    structure = Structure(
        (Mode(dry_mass_kg, true_stiffness, 0.0, 1.0, dry_mass_kg),),
        coulomb_force_n=(described.coulomb_force_n or 0.0) * laboratory.damping_factors[0],
        guide_damping_kg_per_s=(described.damping_kg_per_s or 0.0) * laboratory.damping_factors[0],
    )
    return StructureRig(structure, dry_mass_kg, (), np.zeros((0, 1)), 0.0)


def _cantilever(described: DescribedStructure) -> Cantilever:
    for name in ("length_m", "width_m", "thickness_m"):
        if getattr(described, name) is None:
            raise InputError(f"rig: structure.{name}", got="nothing", allowed="> 0", remedy="measure the beam")
    return fitted_to(
        described.frequencies_hz[0],
        described.length_m or 0.0,
        described.width_m or 0.0,
        described.thickness_m or 0.0,
    )
