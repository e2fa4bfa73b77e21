"""W̄ and β of the half-filled tank on the shaker, computed with liquid and gas.

Run as ``python -m studies.two_phase_verification.shaken --points map --output FILE``; what is in the file already
is not computed again. W̄ and β are those of `studies.numerical_tank_verification.convergence`.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank.forced_motion import HarmonicMotion, moved
from acquisition.numerical_tank.tank import STANDARD_GRAVITY_M_PER_S2, Box
from acquisition.two_phase_box.setup import TwoPhaseBoxSetup
from acquisition.two_phase_tank.energy import TwoPhaseAccount
from acquisition.two_phase_tank.setup import Fluids, TwoPhaseSetup, Walls, filled_two_phase_tank
from acquisition.two_phase_tank.simulation import TwoPhaseTank
from sloshlab.atomic_file import write_bytes
from studies.steady_state import MeanOverCycles, mean_over_cycles

FloatArray = NDArray[np.float64]

TANK: Final = Box(0.1172, 0.0272, 0.078)
RISE_CYCLES: Final = 3


_LATER: Final = ("advancing_angle_deg", "receding_angle_deg", "line_sticks", "filling_level")


@dataclass(frozen=True)
class Shaking:
    """One motion of the tank, and how it is computed.

    Attributes
    ----------
    acceleration_g, frequency_hz : float
    n_cycles : int
        The first half is left out.
    cells_per_height : int
    surface_tension_n_per_m : float
    layer_frequency_hz : float
        Of the boundary layers at the walls before and behind the plane; 0 is without.
    hold : bool
        Whether the walls in the plane hold the fluids.
    seed : int
    gas_density_kg_per_m3 : float
    advancing_angle_deg, receding_angle_deg : float
    line_sticks : bool
        Contact line, as of `Walls`.
    filling_level : float
        Volume of the liquid over that of the box.
    """

    acceleration_g: float
    frequency_hz: float
    n_cycles: int = 40
    cells_per_height: int = 24
    surface_tension_n_per_m: float = Fluids().surface_tension_n_per_m
    layer_frequency_hz: float = 0.0
    hold: bool = True
    seed: int = 0
    gas_density_kg_per_m3: float = Fluids().gas_density_kg_per_m3
    advancing_angle_deg: float = Walls().advancing_angle_deg
    receding_angle_deg: float = Walls().receding_angle_deg
    line_sticks: bool = False
    filling_level: float = 0.5

    @property
    def name(self) -> str:
        """One that no other has."""
        usual = asdict(Shaking(0.0, 0.0))
        # what came after results were kept is told only where it is not as usual, so that they are still found
        told = ((key, value) for key, value in asdict(self).items() if key not in _LATER or value != usual[key])
        return ", ".join(f"{key}={value:g}" for key, value in told)

    @property
    def differs(self) -> str:
        """What is not as usual."""
        usual = Shaking(0.0, 0.0)
        told = {
            "surface_tension_n_per_m": "σ = 0",
            "hold": "walls slip",
            "layer_frequency_hz": "walls before and behind",
            "seed": f"seed {self.seed}",
            "gas_density_kg_per_m3": f"gas of {self.gas_density_kg_per_m3:g} kg/m³",
            "filling_level": f"α = {self.filling_level:g}",
        }
        return ", ".join(text for name, text in told.items() if getattr(self, name) != getattr(usual, name))


@dataclass(frozen=True)
class Shaken:
    """What one run gave over the last half of its cycles.

    Attributes
    ----------
    w_bar, beta : float
        Work of the tank on the fluids per cycle over m_l u₀² Ω², and −Re(Δf̌/ǔ̈)/m_l.
    w_bar_of_cycles, beta_of_cycles : list of float
        Of every cycle that counts.
    w_bar_scatter : float
        Standard deviation of W̄ between cycles.
    w_bar_error, beta_error : float
        Standard errors of the means over cycles, which are correlated.
    account_w_bar : float
        The same work by the account of energy, in the frame of the tank.
    shares : dict
        Terms of the account over the work.
    residual_share : float
        What the account does not explain, over the work.
    volume_change : float
        Of the liquid since the start, over its volume.
    computing_s_per_s : float
        Seconds of one processor for a second of the tank.
    """

    w_bar: float
    beta: float
    w_bar_of_cycles: list[float]
    beta_of_cycles: list[float]
    w_bar_scatter: float
    w_bar_error: float
    beta_error: float
    account_w_bar: float
    shares: dict[str, float]
    residual_share: float
    volume_change: float
    computing_s_per_s: float


def shaken(case: Shaking) -> Shaken:
    """Shake the tank with constant frequency and amplitude.

    Parameters
    ----------
    case : Shaking
    """
    setup = filled_two_phase_tank(
        TANK,
        case.filling_level,
        case.cells_per_height,
        fluids=Fluids(
            surface_tension_n_per_m=case.surface_tension_n_per_m, gas_density_kg_per_m3=case.gas_density_kg_per_m3
        ),
        walls=Walls(
            hold=case.hold,
            layer_frequency_hz=case.layer_frequency_hz,
            advancing_angle_deg=case.advancing_angle_deg,
            receding_angle_deg=case.receding_angle_deg,
            line_sticks=case.line_sticks,
        ),
        seed=case.seed,
    )
    return measured(TwoPhaseTank(setup), case)


def measured(tank: TwoPhaseTank, case: Shaking) -> Shaken:
    """Shake a tank that has been set up as a case asks, and return what it gave.

    Parameters
    ----------
    tank : TwoPhaseTank
        At rest.
    case : Shaking
    """
    setup, period = tank.setup, 1 / case.frequency_hz
    motion = motion_of(case)
    volume, started_s = float(tank.liquid_fraction.sum()), time.process_time()
    n_used = case.n_cycles // 2
    for _ in moved(tank, motion, (case.n_cycles - n_used) * period):
        pass
    before = tank.account()
    cycles = list[tuple[float, float]]()
    for _ in range(n_used):
        blocks = list(moved(tank, motion, period, block_s=period))
        times = np.concatenate([block.time_s for block in blocks])
        force = np.concatenate([block.forces.vertical_n for block in blocks])
        cycles.append(of_a_cycle(setup, case, times, force))
    change = float(tank.liquid_fraction.sum()) / volume - 1
    speed = (time.process_time() - started_s) / tank.time_s
    return told(setup, case, cycles, (tank.account() - before, change, speed))


def motion_of(case: Shaking) -> HarmonicMotion:
    """Return the motion of the tank.

    Parameters
    ----------
    case : Shaking
    """
    amplitude = case.acceleration_g * STANDARD_GRAVITY_M_PER_S2
    return HarmonicMotion(amplitude, case.frequency_hz, rise_s=RISE_CYCLES / case.frequency_hz)


def _unit_j(setup: TwoPhaseSetup | TwoPhaseBoxSetup, case: Shaking) -> float:
    """m_l u₀² Ω²."""
    amplitude = case.acceleration_g * STANDARD_GRAVITY_M_PER_S2
    return setup.liquid_mass_kg * (amplitude / (2 * math.pi * case.frequency_hz)) ** 2


def of_a_cycle(
    setup: TwoPhaseSetup | TwoPhaseBoxSetup, case: Shaking, times_s: FloatArray, force_n: FloatArray
) -> tuple[float, float]:
    """Return W̄ and β of one cycle.

    Parameters
    ----------
    setup : TwoPhaseSetup or TwoPhaseBoxSetup
    case : Shaking
    times_s, force_n : ndarray, shape (n,)
        Middles of the steps of the cycle, and the vertical force of the fluids on the tank.
    """
    omega, amplitude = 2 * math.pi * case.frequency_hz, case.acceleration_g * STANDARD_GRAVITY_M_PER_S2
    force = force_n + setup.fluid_mass_kg * STANDARD_GRAVITY_M_PER_S2
    work_j = -float(np.mean(force * np.sin(omega * times_s))) * amplitude / omega / case.frequency_hz
    excess = force + setup.fluid_mass_kg * amplitude * np.cos(omega * times_s)
    beta = -2 * float(np.mean(excess * np.cos(omega * times_s))) / (setup.liquid_mass_kg * amplitude)
    return work_j / _unit_j(setup, case), beta


def told(
    setup: TwoPhaseSetup | TwoPhaseBoxSetup,
    case: Shaking,
    cycles: Sequence[tuple[float, float]],
    rest: tuple[TwoPhaseAccount, float, float],
) -> Shaken:
    """Return what a run gave.

    Parameters
    ----------
    setup : TwoPhaseSetup or TwoPhaseBoxSetup
    case : Shaking
    cycles : sequence of tuple of float
        W̄ and β of every cycle that counts.
    rest : tuple
        Account of these cycles, change of the liquid's volume over itself, seconds of a processor for a second.
    """
    works, in_phase = [cycle[0] for cycle in cycles], [cycle[1] for cycle in cycles]
    spent, volume_change, computing_s_per_s = rest
    given = spent.tank_work_j_per_m
    w_bar, beta = mean_over_cycles(works), mean_over_cycles(in_phase)
    return Shaken(
        w_bar.value,
        beta.value,
        works,
        in_phase,
        float(np.std(works)),
        w_bar.standard_error,
        beta.standard_error,
        given * setup.box.depth_m / len(works) / _unit_j(setup, case),
        {name.removesuffix("_j_per_m"): value / given for name, value in asdict(spent).items()},
        spent.residual_j_per_m / given,
        volume_change,
        computing_s_per_s,
    )


MAP: Final = (
    Shaking(4.0, 11.4, 30),
    Shaking(0.5, 11.4, 100),
    Shaking(1.0, 11.4, 60),
    Shaking(2.0, 11.4, 36),
    Shaking(6.0, 18.0, 36),
    Shaking(4.0, 8.0, 24),
    Shaking(4.0, 18.0, 36),
    Shaking(2.0, 18.0, 36),
)
COARSE: Final = tuple(replace(case, cells_per_height=16) for case in MAP)
RESOLUTION: Final = tuple(
    Shaking(2.04, 10.7, 30, cells_per_height=cells, seed=seed) for cells in (16, 24, 32, 48) for seed in (0, 1, 2)
)
WEAK_RESOLUTION: Final = (
    *(Shaking(0.5, 11.4, 100, cells_per_height=cells, seed=seed) for cells in (16, 48) for seed in (0, 1, 2)),
    *(Shaking(1.0, 11.4, 60, cells_per_height=cells) for cells in (16, 24, 48)),
)
_WEAK: Final = (Shaking(0.5, 11.4, 100, 16), Shaking(1.0, 11.4, 60, 16))
CAUSES: Final = (
    *(replace(case, layer_frequency_hz=case.frequency_hz / 2) for case in _WEAK),
    *(replace(case, surface_tension_n_per_m=0.0) for case in _WEAK),
    *(replace(case, hold=False) for case in _WEAK),
    *(replace(case, seed=1) for case in _WEAK),
    Shaking(4.0, 11.4, 30, 16, surface_tension_n_per_m=0.0),
    Shaking(4.0, 11.4, 30, 16, hold=False),
    Shaking(4.0, 11.4, 30, 16, seed=1),
    Shaking(4.0, 11.4, 30, 16, gas_density_kg_per_m3=0.12),
)
CAMPAIGN: Final = tuple(
    Shaking(level_g, frequency_hz, 48 if level_g <= 1.0 else 24, 16)
    for level_g in (4.0, 2.0, 1.0, 0.5, 3.0, 6.0, 1.5, 5.0)
    for frequency_hz in (8.0, 9.5, 11.0, 12.5, 14.5, 18.0)
)
BESIDE_BOX: Final = tuple(
    replace(case, seed=seed)
    for case in (Shaking(4.0, 11.4, 24, 12), Shaking(2.04, 10.7, 24, 12), Shaking(0.5, 11.4, 48, 12))
    for seed in (0, 1)
)
"""With the cells of the tank in three dimensions."""
POINTS: Final = {
    "map": MAP,
    "coarse": COARSE,
    "resolution": RESOLUTION,
    "weak_resolution": WEAK_RESOLUTION,
    "causes": CAUSES,
    "campaign": CAMPAIGN,
    "beside_box": BESIDE_BOX,
}
"""What can be computed, by name; the causes change one thing at a time on the coarse grid."""


def rows(results: dict[str, dict[str, Any]], cases: Sequence[Shaking]) -> list[str]:
    """Return a Markdown table of those cases that have been computed.

    Parameters
    ----------
    results : dict
        As in the file.
    cases : sequence of Shaking
    """
    lines = [
        "| motion | cells | with | W̄ | β | advection | viscosity | pressure |"
        " interface | place | height | residual | s/s |"
    ]
    lines.append("|---|---|---|---|---|---|---|---|---|---|---|---|---|")
    for case in cases:
        if (found := results.get(case.name)) is None:
            continue
        shares = found["shares"]
        given = [
            shares.get(name) for name in ("advection", "viscosity", "pressure", "interface", "place", "height")
        ]
        # results that were kept before a term was counted have it in the residual
        given_text = " | ".join("–" if share is None else f"{100 * share:.0f} %" for share in given)
        lines.append(
            f"| {case.acceleration_g:g} g, {case.frequency_hz:g} Hz | {case.cells_per_height} | {case.differs} |"
            f" {MeanOverCycles(found['w_bar'], found.get('w_bar_error', math.nan))} |"
            f" {found['beta']:.3f} | {given_text} | {100 * found['residual_share']:.1f} % |"
            f" {found['computing_s_per_s']:.0f} |".replace("-", "−")
        )
    return lines


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute what is not there yet, and print the table.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(description="W̄ and β of the shaken tank of liquid and gas.")
    parser.add_argument("--points", choices=sorted(POINTS), default="map")
    parser.add_argument("--output", type=Path, required=True, help="JSON file that keeps the results")
    chosen = parser.parse_args(arguments)
    cases = POINTS[chosen.points]
    results = json.loads(chosen.output.read_text()) if chosen.output.exists() else {}
    for number, case in enumerate(cases):
        if case.name not in results:
            sys.stderr.write(f"{number + 1} of {len(cases)}: {case.name}\n")
            results[case.name] = {"case": asdict(case), **asdict(shaken(case))}
            write_bytes(chosen.output, (json.dumps(results, indent=1) + "\n").encode())
    sys.stdout.write("\n".join(rows(results, cases)) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
