"""The numerical tank of particles at the same points, averaged in the same way."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from acquisition.numerical_tank.forced_motion import HarmonicMotion, moved
from acquisition.numerical_tank.simulation import NumericalTank
from acquisition.numerical_tank.tank import Liquid, TankSetup, filled_tank
from sloshlab import atomic_file
from sloshlab.errors import InputError
from studies.steady_state import MeanOverCycles, mean_over_cycles
from studies.tank_reference.interfoam_readings import waiting_cycles
from studies.tank_reference.planned_cases import VARIED_POINTS, cycles_at
from studies.tank_reference.points import BEAM_POINT, BOX, COMMON_POINTS, FILLING_LEVEL, RISE_CYCLES, DrivenPoint
from studies.tank_scaling.harmonic_runs import cycles_of

KEPT: Final = Path(__file__).with_name("particles.json")
LARGEST_BYTES: Final = 10_000_000
LAYERS: Final = 16
SEEDS: Final = (0, 1)
_LOOKS_PER_CYCLE: Final = 8
_DIGITS: Final = 5


@dataclass(frozen=True)
class ParticleCase:
    """What is computed.

    Attributes
    ----------
    point : DrivenPoint
    n_cycles : int
        In all.
    seed, layers_per_height : int
    speed_of_sound_m_per_s : float
    """

    point: DrivenPoint
    n_cycles: int
    seed: int = 0
    layers_per_height: int = LAYERS
    speed_of_sound_m_per_s: float = Liquid().speed_of_sound_m_per_s

    @property
    def setup(self) -> TankSetup:
        """Box, liquid and numerics."""
        liquid = Liquid(speed_of_sound_m_per_s=self.speed_of_sound_m_per_s)
        return filled_tank(BOX, FILLING_LEVEL, self.layers_per_height, liquid=liquid, seed=self.seed)

    @property
    def inputs_sha256(self) -> str:
        """Hash of everything that determines the run."""
        return hashlib.sha256(f"{self!r} {self.setup!r}".encode()).hexdigest()


@dataclass(frozen=True)
class ParticleResult:
    """What it gave; energies over the shaker's work in the cycles that count.

    Attributes
    ----------
    case : ParticleCase
    inputs_sha256 : str
    w_bar, beta : tuple of float
        Of every cycle.
    packing_share, residual_share : float
        Taken away by the packing correction (negative: given), and unaccounted for.
    height_over_rest : float
        Mean height of the liquid's centre over that at rest.
    """

    case: ParticleCase
    inputs_sha256: str
    w_bar: tuple[float, ...]
    beta: tuple[float, ...]
    packing_share: float
    residual_share: float
    height_over_rest: float


def planned_particle_cases() -> list[ParticleCase]:
    """All points with every seed, and some with a stiffer liquid."""
    points = (*COMMON_POINTS, BEAM_POINT)
    cases = [ParticleCase(point, cycles_at(point), seed) for point in points for seed in SEEDS]
    stiff = 20.0
    return cases + [
        replace(ParticleCase(point, cycles_at(point), seed), speed_of_sound_m_per_s=stiff)
        for point in VARIED_POINTS
        for seed in SEEDS
    ]


def shaken_particles(case: ParticleCase) -> ParticleResult:
    """Compute a case.

    Parameters
    ----------
    case : ParticleCase

    Raises
    ------
    InstabilityError
        If the computation cannot go on.
    """
    setup, point = case.setup, case.point
    tank, period = NumericalTank(setup), 1 / point.frequency_hz
    motion = HarmonicMotion(point.amplitude_m_per_s2, point.frequency_hz, rise_s=RISE_CYCLES * period)
    first = waiting_cycles(case.n_cycles) * period
    forces, heights, before = [], [], None
    for block in moved(tank, motion, case.n_cycles * period, block_s=period / _LOOKS_PER_CYCLE):
        forces.append(block.forces.vertical_n)
        if tank.time_s >= first:
            before = before or tank.account()
            heights.append(float(tank.state().z_m.mean()))
    spent = tank.account() - before if before else tank.account()
    dynamic = np.concatenate(forces) + setup.liquid_mass_kg * setup.gravity_m_per_s2
    w_bar, beta = cycles_of(
        dynamic, setup.step_s, point.omega_rad_per_s, point.amplitude_m_per_s2, setup.liquid_mass_kg
    )
    return ParticleResult(
        case,
        case.inputs_sha256,
        tuple(np.round(w_bar, _DIGITS).tolist()),
        tuple(np.round(beta, _DIGITS).tolist()),
        round(spent.packing_j_per_m / spent.tank_work_j_per_m, _DIGITS),
        round(spent.residual_j_per_m / spent.tank_work_j_per_m, _DIGITS),
        round(float(np.mean(heights)) / (setup.column.height_m / 2), _DIGITS),
    )


def counted(
    results: Mapping[ParticleCase, ParticleResult], case: ParticleCase, name: str
) -> MeanOverCycles | None:
    """Mean of `w_bar` or `beta` of a case over all seeds that were computed; None where none was.

    Parameters
    ----------
    results : mapping
    case : ParticleCase
        Of any seed.
    name : str
    """
    found = [results[same] for seed in SEEDS if (same := replace(case, seed=seed)) in results]
    if not found:
        return None
    of_seeds = [mean_over_cycles(getattr(result, name)[waiting_cycles(case.n_cycles) :]) for result in found]
    values = np.array([mean.value for mean in of_seeds])
    within = math.hypot(*(mean.standard_error for mean in of_seeds)) / len(of_seeds)
    # a weak wave grows to another height from another start: what one run repeats is not all that chance does
    between = float(values.std(ddof=1)) / math.sqrt(values.size) if values.size > 1 else 0.0
    return MeanOverCycles(float(values.mean()), max(within, between))


def write_particles(results: Mapping[ParticleCase, ParticleResult], place: Path) -> None:
    """Write results to a file that is complete or as it was."""
    place.parent.mkdir(parents=True, exist_ok=True)
    content = json.dumps([asdict(result) for result in results.values()], indent=1) + "\n"
    atomic_file.write_bytes(place, content.encode())


def read_particles(place: Path = KEPT) -> dict[ParticleCase, ParticleResult]:
    """Results of a file.

    Parameters
    ----------
    place : Path
        By default that of the repository.

    Raises
    ------
    InputError
        If it cannot be read, or a result was computed from another setup than its case has today.
    """
    try:
        if place.stat().st_size > LARGEST_BYTES:
            raise InputError(f"{place}", got=f"{place.stat().st_size} bytes", allowed=f"≤ {LARGEST_BYTES}")
        results = [_result(entry) for entry in json.loads(place.read_bytes())]
    except InputError:
        raise
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise InputError(f"{place}", got=str(error), allowed="results of make tank-reference") from error
    for result in results:
        if result.inputs_sha256 != result.case.inputs_sha256:
            raise InputError(
                f"{place}, {result.case.point.label}",
                got="a hash of another setup",
                remedy="compute it again: make tank-reference",
            )
    return {result.case: result for result in results}


def _result(entry: Mapping[str, Any]) -> ParticleResult:
    stated, values = dict(entry["case"]), dict(entry)
    values["case"] = ParticleCase(DrivenPoint(**stated.pop("point")), **stated)
    for name in ("w_bar", "beta"):
        values[name] = tuple(values[name])
    return ParticleResult(**values)
